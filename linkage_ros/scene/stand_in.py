# Copyright 2026 The linkage_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.


"""
The scene that a linkage file stands for where a scene is expected: the linkage, moving.

It begins where the linkage starts (see `usual_inputs`). A single input turns at a constant rate,
or swings through its range as a sine; several come from a topic. What is generated is the text of
a scene file, read as any other.
"""

from __future__ import annotations

from math import asin

from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.linkage import Linkage
from linkage_ros.kinematics.ranges import describe, InputRange
from linkage_ros.kinematics.survey import usual_inputs, Way
from linkage_ros.scene.linkage_text import number_text

_PART = 0.96
"""Of its range that an input swings through: at the ends of many lies a toggle, without rates."""

_PERIOD = 4.0
"""Of the swing, in [s]."""

_SAME = 1e-9
"""What a start may lie beyond the end of a range and count as it, in [rad] or of a length."""


def scene_text_for(linkage: Linkage, file: str) -> str:
    """
    Return the text of the scene that a linkage stands for.

    Parameters
    ----------
    linkage
        The linkage.
    file
        Name of its file, as the scene is to give it.

    Raises
    ------
    DefinitionError
        Where its pose says that it starts where no loop closes.

    """
    return (
        '# What a linkage file alone stands for where a scene is expected.\n'
        f'linkage: {file}\n'
        'rate: 1000\n'
        f'drive: {_drive(Closure(linkage))}\n'
        'effects: {velocity: {}}\n'
    )


def _drive(closure: Closure) -> str:
    if len(closure.linkage.inputs) > 1:
        return '{topic: {}}'
    start, interval = _start(closure)
    if interval.whole:
        return f'{{constant_rate: {{rate: 1, start: {number_text(start)}}}}}'
    left_out = 0.5 * (1.0 - _PART) * (interval.highest - interval.lowest)
    low, high = (
        end if by else end + inwards
        for end, inwards, by in zip(interval[:2], (left_out, -left_out), interval.by, strict=True)
    )
    # A start that lies in what is left out at an end is where the swing turns back.
    low, high = min(low, start), max(high, start)
    mean, amplitude = 0.5 * (low + high), 0.5 * (high - low)
    sine = min(max((start - mean) / amplitude, -1.0), 1.0) if amplitude else 0.0
    said = {
        'amplitude': amplitude,
        'frequency': 1.0 / _PERIOD,
        'mean': mean,
        'phase': asin(sine),
    }
    return f'{{sine: {{{", ".join(f"{key}: {number_text(of)}" for key, of in said.items())}}}}}'


def _start(closure: Closure) -> tuple[float, InputRange]:
    """Return where the single input starts, and the range in which that lies."""
    way, pose = Way(closure), closure.linkage.pose
    if pose is None or pose.points:
        (start,) = usual_inputs(closure)
        # Of a range as narrow as the rounding of its values the usual one may lie beside it.
        interval = way.range_about(start) or way.widest_range
        assert interval is not None, 'reading the file has proved that it closes somewhere'
        return start, interval
    (start,) = pose.inputs
    near = _SAME * (1.0 if way.turning else closure.scale)
    for value in (start, start - near, start + near):
        interval = way.range_about(value)
        if interval is not None:
            if not interval.whole:
                start = min(max(start, interval.lowest), interval.highest)
            return start, interval
    raise DefinitionError(
        'pose.inputs',
        f'no loop closes at {start:g} {"rad" if way.turning else "m"}',
        f'start within {describe(way.ranges)}',
    )
