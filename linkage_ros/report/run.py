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
The contents of a report: the curves, the linkages, and events as spans on lanes.

Events of one kind that follow each other closely are one span, with their number. Where there are
more spans than a lane may have, the closest ones become one: none is lost from the count.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from operator import attrgetter
from typing import NamedTuple

from linkage_ros.bag.contents import Contents
from linkage_ros.kinematics.closure import Closure
from linkage_ros.report.decimation import Histogram, Intervals, Numbers, Times
from linkage_ros.report.labels import short, size_in_json
import numpy as np

MOST_SPANS = 1000
MOST_TEXT = 60_000
"""How much the texts of a lane may take on a page, in [bytes]."""

APART = -1
"""How near are those that stay apart even where one begins as the other ends, in [ns]."""

_LONGEST_TEXT = 120
_MORE = ', and others'


@dataclass(slots=True)
class Span:
    """
    Things that happened one after the other.

    Attributes
    ----------
    begin, end
        In [ns]; the same for an instant.
    count
        How many.
    text
        Description of the first of them.

    """

    begin: int
    end: int
    count: int
    text: str


class Lane:
    """
    A kind of things that happen.

    Parameters
    ----------
    near
        How far apart two may be, in [ns], and be one span.
    alike
        Whether events with different texts join, too; the first text stays.
    longest
        Whether, where there is no room for all, the longest spans stay, not all of them as one.
    most
        How many spans there may be.
    window
        Begin and end, in [ns]; events outside are left out.

    Attributes
    ----------
    count
        How many there were.
    spans
        The spans, in the order in which they were added.
    near
        As it has become.

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
        self.near = near
        self._alike, self._longest, self._most = alike, longest, most
        self._since, self._until = window
        self.count = 0
        self.spans: list[Span] = []
        self._text = 0

    @property
    def in_order(self) -> list[Span]:
        """Return the spans in the order of their begins; a span is added at its end."""
        return sorted(self.spans, key=attrgetter('begin'))

    def add(self, begin: int, end: int, text: str = '', count: int = 1) -> None:
        """Add what happened from then to then, in [ns]."""
        if end < self._since or begin > self._until:
            return
        begin, end = max(begin, self._since), min(end, self._until)
        text = short(text, _LONGEST_TEXT)
        self.count += count
        if self.spans and self._joins(self.spans[-1], begin, text):
            _join(self.spans[-1], end, count)
            return
        self.spans.append(Span(begin, end, count, text))
        self._text += size_in_json(text)
        while len(self.spans) > self._most or self._text > MOST_TEXT:
            self.spans = self._half()
            self._text = sum(size_in_json(span.text) for span in self.spans)

    def _joins(self, last: Span, begin: int, text: str) -> bool:
        # What says something else is something else, unless there is no room for it.
        same = self._alike or text == last.text or last.text.endswith(_MORE)
        return same and last.begin <= begin and begin - last.end <= self.near

    def _half(self) -> list[Span]:
        """Return half of the spans, or fewer."""
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
                _join(last, span.end, span.count)
            else:
                kept.append(span)
        return kept


def _join(last: Span, end: int, count: int) -> None:
    last.end = max(last.end, end)
    last.count += count


_SILENCE_FACTOR = 5
"""How many times as far apart as is usual is silence."""

_SHORTEST_SILENCE = 2_000_000
"""In [ns]: no eye sees less."""

_MESSAGES_FOR_A_USUAL = 8


class Silences:
    """
    Looks for silences, block by block.

    Parameters
    ----------
    lane
        Where they are put.
    period
        In which messages are due, in [ns]; 0 where none is known.
    limit
        From which on there is silence, in [ns]; 0 for what is longer than usual.

    """

    def __init__(self, lane: Lane, period: int, limit: int = 0) -> None:
        self._lane, self._period, self.limit = lane, period, limit
        self._usual = 0
        self._last: int | None = None

    def add(self, times: Times) -> None:
        """Take messages, in the time of the run in [ns]."""
        if not len(times):
            return
        # The time of a run begins at 0, whether or not something is published then.
        apart = np.diff(times, prepend=self._last or 0)
        # What goes before the first message says nothing of how far they are apart.
        between = apart if self._last is not None else apart[1:]
        least = 1 if not (self._usual or self._period) else _MESSAGES_FOR_A_USUAL
        if len(between) >= least:
            self._usual = int(np.median(between))
        for i in np.flatnonzero(apart > self._longest):
            self._lane.add(int(times[i] - apart[i]), int(times[i]))
        self._last = int(times[-1])

    def end(self, time: int) -> None:
        """Take the end of the run."""
        last = 0 if self._last is None else self._last
        if self._last is None or time - last > self._longest:
            self._lane.add(last, time)

    @property
    def _longest(self) -> int:
        return self.limit or max(
            _SILENCE_FACTOR * self._period, _SILENCE_FACTOR * self._usual, _SHORTEST_SILENCE
        )


class Window(NamedTuple):
    """The part of a run that is shown, in the time of the run, in [ns]."""

    since: int = 0
    until: int = 2**63 - 1


class Column(NamedTuple):
    """
    What a curve tells.

    Attributes
    ----------
    name
        Of the joint, as messages have it.
    quantity
        position, rate, effort, lateness or age.
    unit
        Of its values.

    """

    name: str
    quantity: str
    unit: str


class Curves(NamedTuple):
    """
    Curves that share their times.

    Attributes
    ----------
    title
        What they are of: a topic.
    columns
        What each tells.
    rows
        How many rows there were.
    intervals
        The curves.

    """

    title: str
    columns: Sequence[Column]
    rows: int
    intervals: Intervals


class LinkageRun(NamedTuple):
    """
    A linkage of a scene, and what was recorded of it.

    Attributes
    ----------
    name
        Its name; '' where it is the only one.
    prefix
        What its joints have before their own names.
    closure
        As it is solved.
    inputs, joints
        Names of the driven joints, and of the published ones, in messages.
    input_units
        Of the driven joints.
    silent
        When nothing was published of it.

    """

    name: str
    prefix: str
    closure: Closure
    inputs: tuple[str, ...]
    joints: tuple[str, ...]
    input_units: tuple[str, ...]
    silent: Lane


class Frames(NamedTuple):
    """
    Instants of a run at which all joints are told, for the moving picture.

    Attributes
    ----------
    step
        Of how many joint states there is one.
    times
        In the time of the run, in [ns].
    values
        By the names in messages the values of joints, in [rad] or [m]; NaN where there is none.

    """

    step: int
    times: Times
    values: Mapping[str, Numbers]


@dataclass(frozen=True, slots=True)
class Run:
    """
    The contents of a bag, as a run.

    Attributes
    ----------
    begin
        The log time at which its time begins, in [ns]; None without messages.
    end
        The time of the run at its end, in [ns].
    window
        The part of it that is shown.
    contents
        Counts of all messages, and what is damaged.
    curves
        Joints, cranks, lateness and age over time.
    frames
        For the moving picture; None without a scene.
    linkages
        Of the scene; none where there is none.
    lanes
        The events, by kind.
    lateness, age
        Their histogram; None where they are unknown.
    rejected
        How many samples were rejected, by reason.
    left_out
        How many messages, or joints of messages, could not be read, by topic and reason.
    said
        The values of the last diagnostics, by task and key.

    """

    begin: int | None
    end: int
    window: Window
    contents: Contents
    curves: Sequence[Curves]
    frames: Frames | None = None
    linkages: Sequence[LinkageRun] = ()
    lanes: Mapping[str, Lane] = field(default_factory=dict)
    lateness: Histogram | None = None
    age: Histogram | None = None
    rejected: Mapping[str, int] = field(default_factory=dict)
    left_out: Mapping[tuple[str, str], int] = field(default_factory=dict)
    said: Mapping[tuple[str, str], str] = field(default_factory=dict)
