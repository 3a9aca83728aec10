# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The contents of a report: the curves, the linkages, and events as spans on lanes.

Events of one kind that are close together form one span, with their number. If a lane would have
too many spans, the closest ones are merged: the count stays complete.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from operator import attrgetter
from typing import NamedTuple

from linkage_ros.bag import Contents
from linkage_ros.kinematics import Closure
from linkage_ros.tools.view.report.decimation import Histogram, Intervals, Numbers, Times
from linkage_ros.tools.view.report.labels import shorten_text, size_in_json
import numpy as np

MOST_SPANS = 1000
MOST_TEXT = 60_000
"""Size limit of the texts of a lane on a page, in [bytes]."""

APART = -1
"""Value of ``near`` for events that never join, even if one begins when the other ends."""

_LONGEST_TEXT = 120
_MORE = ', and others'

_SILENCE_FACTOR = 5
"""A gap of this many usual periods is a silence."""

_SHORTEST_SILENCE = 2_000_000
"""Shortest silence that is shown, in [ns]: the eye sees no shorter one."""

_MESSAGES_FOR_A_USUAL = 8


@dataclass(slots=True)
class EventSpan:
    """Consecutive events between two run times in [ns], and the description of the first one."""

    begin: int
    end: int
    count: int
    text: str


class EventTrack:
    """
    Events of one kind, within a window, in [ns]; events outside are ignored.

    Events closer than ``near``, in [ns], form one span. With ``alike``, events with different
    texts join, too; the first text is kept. Of more than ``most`` spans the ``longest`` are kept,
    or spans are merged.
    """

    def __init__(
        self,
        near: int = 0,
        *,
        alike: bool = False,
        longest: bool = False,
        most: int = MOST_SPANS,
        window: tuple[int, int] = (0, 2**63 - 1),
    ) -> None:
        self.near = near  # The current value; it grows as spans are merged
        self._alike, self._longest, self._most = alike, longest, most
        self._since, self._until = window
        self.count = 0  # Number of events
        self.spans: list[EventSpan] = []  # The spans, in the order in which they were added
        self._text = 0

    @property
    def in_order(self) -> list[EventSpan]:
        """Return the spans in the order of their begins; a span is added when it ends."""
        return sorted(self.spans, key=attrgetter('begin'))

    def add(self, begin: int, end: int, text: str = '', count: int = 1) -> None:
        """Add an event with begin and end, in [ns]."""
        if end < self._since or begin > self._until:
            return
        begin, end = max(begin, self._since), min(end, self._until)
        text = shorten_text(text, _LONGEST_TEXT)
        self.count += count
        if self.spans and self._can_join(self.spans[-1], begin, text):
            _extend_span(self.spans[-1], end, count)
            return
        self.spans.append(EventSpan(begin, end, count, text))
        self._text += size_in_json(text)
        while len(self.spans) > self._most or self._text > MOST_TEXT:
            self.spans = self._halve_spans()
            self._text = sum(size_in_json(span.text) for span in self.spans)

    def _can_join(self, last: EventSpan, begin: int, text: str) -> bool:
        # Events with different texts stay apart, unless there are too many spans.
        same = self._alike or text == last.text or last.text.endswith(_MORE)
        return same and last.begin <= begin and begin - last.end <= self.near

    def _halve_spans(self) -> list[EventSpan]:
        """Return at most half of the spans."""
        spans = self.in_order
        half = len(spans) // 2
        if self._longest:
            by_length = sorted(spans, key=lambda span: span.begin - span.end)
            return sorted(by_length[:half], key=attrgetter('begin'))
        apart = sorted(after.begin - before.end for before, after in pairwise(spans))
        self.near = max(2 * self.near, apart[len(apart) // 2], 1)
        kept = spans[:1]
        for span in spans[1:]:
            last = kept[-1]
            if span.begin - last.end <= self.near:
                if span.text != last.text and not last.text.endswith(_MORE):
                    last.text += _MORE
                _extend_span(last, span.end, span.count)
            else:
                kept.append(span)
        return kept


def _extend_span(last: EventSpan, end: int, count: int) -> None:
    last.end = max(last.end, end)
    last.count += count


class Silences:
    """
    Finds silences, block by block, and adds them to a track.

    ``period`` is the period of the messages, in [ns], or 0 if unknown; ``limit`` is the shortest
    silence, in [ns], or 0 for a multiple of the usual period.
    """

    def __init__(self, track: EventTrack, period: int, limit: int = 0) -> None:
        self._lane, self._period, self.limit = track, period, limit
        self._usual = 0
        self._last: int | None = None

    def add(self, times: Times) -> None:
        """Add messages at run times in [ns]."""
        if not len(times):
            return
        # A run begins at 0, whether or not a message is published then.
        apart = np.diff(times, prepend=self._last or 0)
        # The gap before the first message does not count for the usual period.
        between = apart if self._last is not None else apart[1:]
        least = 1 if not (self._usual or self._period) else _MESSAGES_FOR_A_USUAL
        if len(between) >= least:
            self._usual = int(np.median(between))
        for i in np.flatnonzero(apart > self._longest):
            self._lane.add(int(times[i] - apart[i]), int(times[i]))
        self._last = int(times[-1])

    def end_run(self, time: int) -> None:
        """Add the end of the run."""
        last = 0 if self._last is None else self._last
        if self._last is None or time - last > self._longest:
            self._lane.add(last, time)

    @property
    def _longest(self) -> int:
        return self.limit or max(
            _SILENCE_FACTOR * self._period, _SILENCE_FACTOR * self._usual, _SHORTEST_SILENCE
        )


class Window(NamedTuple):
    """The part of a run to show, in run time, in [ns]."""

    since: int = 0
    until: int = 2**63 - 1


class CurveColumn(NamedTuple):
    """
    A column of a group of curves.

    The name is the joint's in messages, the quantity position, rate, effort, lateness or age.
    """

    name: str
    quantity: str
    unit: str


class Curves(NamedTuple):
    """Curves of a topic with common times, and their number of rows."""

    title: str
    columns: Sequence[CurveColumn]
    rows: int
    intervals: Intervals


class LinkageRun(NamedTuple):
    """
    A linkage of a scene, as recorded; its name is '' if it is the only one.

    Inputs and joints have their names in messages. In the silent spans nothing of it was
    published.
    """

    name: str
    prefix: str
    closure: Closure
    inputs: tuple[str, ...]
    joints: tuple[str, ...]
    input_units: tuple[str, ...]
    silent: EventTrack


class Frames(NamedTuple):
    """Instants of a run at which all joints are known, for the animation."""

    step: int  # One in this many joint states is kept
    times: Times  # Run times, in [ns]
    # Joint values by name in messages, in [rad] or [m]; NaN if missing.
    values: Mapping[str, Numbers]


@dataclass(frozen=True, slots=True)
class ReportedRun:
    """The contents of a bag, as a run."""

    begin: int | None  # Log time at run time 0, in [ns]; None without messages
    end: int  # Run time at the end, in [ns]
    window: Window  # The part of the run to show
    contents: Contents  # Counts of all messages, and the damage
    curves: Sequence[Curves]  # Joints, cranks, lateness and age over time
    frames: Frames | None = None  # Frames of the animation; None without a scene
    linkages: Sequence[LinkageRun] = ()  # Linkages of the scene; empty without a scene
    event_tracks: Mapping[str, EventTrack] = field(default_factory=dict)  # The events, by kind
    # Histograms; None if unknown.
    lateness: Histogram | None = None
    age: Histogram | None = None
    # Number of rejected samples, by reason.
    rejected: Mapping[str, int] = field(default_factory=dict)
    # Number of messages, or joints of messages, that were not decoded, by topic and reason.
    left_out: Mapping[tuple[str, str], int] = field(default_factory=dict)
    # The values of the last diagnostics, by task and key.
    last_values: Mapping[tuple[str, str], str] = field(default_factory=dict)
