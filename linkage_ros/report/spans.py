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
What happened in a run, on lanes of a time line, each of a bounded number of spans.

Things of a kind that follow each other closely are one span, with how many they are. Where there
are more spans than there is room for, the closest ones become one: none is lost from the count.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from operator import attrgetter

from linkage_ros.report.words import short, size_in_json

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
        What the first of them was.

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
        Whether those that say something else are one, too; the first is what is told.
    longest
        Whether, where there is no room for all, the longest spans stay, not all of them as one.
    most
        How many spans there may be.
    window
        From when to when, in [ns]; what lies outside is not told.

    Attributes
    ----------
    count
        How many there were.
    spans
        They, in the order in which they were told.
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
        """Return the spans in the order of their begins: what lasts is told at its end."""
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
