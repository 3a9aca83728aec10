# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Texts of a page: titles of lanes and plots, notes, durations."""

from __future__ import annotations

import json
from typing import Any

LONGEST_NAME = 80
"""Maximum length of names from outside: topics and joints of bags, keys of diagnostics."""

EVENT_TRACKS = {
    'fault': ('fault injected', 'from its begin to its end, as its topic and the diagnostics say'),
    'open': ('loop open', 'a good sample at which the loop does not close; nothing is published'),
    'told_open': ('no pose, by diagnostics', 'as the diagnostics count, once a period'),
    'toggle': ('at a toggle', 'joint states without rates'),
    'told_toggle': ('at a toggle, by diagnostics', 'as the diagnostics count, once a period'),
    'told_limited': ('beyond limits, by diagnostics', 'as the diagnostics count, once a period'),
    'silent': ('gap in joint states', 'more than five periods, and 2 ms, without one'),
    'withheld': ('withheld', 'ticks without a joint state after which something is remembered'),
    'rejected': ('samples rejected', 'as the scene refuses them, once more'),
    'stale': ('no samples', 'no good one for longer than max_age'),
    'lost': ('ticks lost', 'as the diagnostics count, once a period'),
    'dropped': ('messages dropped', 'by the recorder, as the diagnostics count, once a period'),
    'reset': ('reset', 'all was forgotten before the tick that follows'),
    'jump': ('clock jumped back', 'the time of this page goes on from there'),
    'health': ('warnings, errors', 'of the diagnostics, by the period that they cover'),
}
"""Title and description of each lane, in the order of the page."""

QUANTITIES = {
    ('position', 'rad'): ('positions_rad', 'Angles'),
    ('position', 'm'): ('positions_m', 'Slides'),
    ('position', 'rad or m'): ('positions', 'Positions'),
    ('rate', 'rad/s'): ('rates_rad', 'Rates of angles'),
    ('rate', 'm/s'): ('rates_m', 'Rates of slides'),
    ('rate', 'rad/s or m/s'): ('rates', 'Rates'),
    ('effort', 'N·m'): ('efforts_rad', 'Torques'),
    ('effort', 'N'): ('efforts_m', 'Forces'),
    ('effort', 'N·m or N'): ('efforts', 'Efforts'),
    ('force', 'N'): ('pin_forces', 'Forces in pins and sliders'),
    ('moment', 'N·m'): ('pin_moments', 'Moments in pins and sliders'),
    ('load', 'N'): ('loads', 'Forces on links'),
    ('moment of a load', 'N·m'): ('load_moments', 'Moments on links'),
    ('lateness', 'ms'): ('lateness', 'How late ticks were'),
    ('age', 'ms'): ('age', 'How old the input was at a tick'),
}
"""Key and title of each quantity's plot, by unit, in the order of the page."""

LATENESS_NOTE = (
    'Worked out from the times of the ticks: a tick is due a whole number of periods after the '
    'most punctual ones within 0.25 s. What all ticks nearby have in common is not in it; the '
    'node’s own measure, on its steady clock, is among what the diagnostics said last.'
)
FORCE_NOTE = 'The magnitude of each force; the bag holds its x and y.'
AGE_NOTE = 'The time of the tick less the stamp of the newest good sample.'
POSE_NOTE = (
    'The links stand where the recorded joints put them, as they do in RViz; nothing is solved '
    'again. Where a sensor is wrong or late against another, links come apart at a pin that they '
    'share. Where no joint state was recorded there is no pose.'
)
SPACE_NOTE = (
    'The loops are closed at the recorded inputs. Drag the picture to look at it from elsewhere, '
    'or press arrow keys once it has the focus; a double click takes you back.'
)
CLOSED_NOTE = (
    'The published joints do not determine where every link stands ({why}); the loops are closed '
    'at the recorded inputs.'
)


def shorten_text(text: str, most: int = LONGEST_NAME) -> str:
    """Return a text of at most ``most`` characters."""
    return text if len(text) <= most else f'{text[: most - 1]}…'


def size_in_json(value: Any) -> int:
    """
    Return an upper bound of a value's size among a page's data, in [bytes].

    A ValueError is raised if it contains a number that is not finite.
    """
    # Escaping all characters beyond ASCII gives the longest text; a page also escapes <.
    text = json.dumps(value, allow_nan=False)
    return len(text) + 5 * text.count('<')


def seconds_text(time: int) -> str:
    """Return a run time, in [ns], as seconds."""
    return f'{time / 1e9:.6f}'.rstrip('0').rstrip('.')


def duration_text(seconds: float) -> str:
    """Return a duration in a suitable unit."""
    for factor, unit in ((1.0, 's'), (1e3, 'ms'), (1e6, 'µs')):
        if abs(seconds) * factor >= 1.0:
            return f'{seconds * factor:.4g} {unit}'
    return f'{seconds * 1e9:.0f} ns'
