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


"""What each method looks like, in all diagrams of a page alike."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import count
from typing import NamedTuple

from linkage_ros.accuracy.results import Results
from linkage_ros.drawing.painting import COLOURS


class Mark(NamedTuple):
    """
    A mark, as both libraries name it.

    Attributes
    ----------
    plotly, matplotlib
        Its names.

    """

    plotly: str
    matplotlib: str


MARKS = (
    Mark('circle', 'o'),
    Mark('square', 's'),
    Mark('triangle-up', '^'),
    Mark('diamond', 'D'),
    Mark('triangle-down', 'v'),
    Mark('cross', 'P'),
    Mark('x', 'X'),
    Mark('star', '*'),
)

DASHES = ('solid', 'dash', 'dot', 'dashdot')
"""As plotly names them; matplotlib's names are another's."""


class Style(NamedTuple):
    """
    What a curve looks like. Seven colours and eight marks make 56 pairs that differ.

    Attributes
    ----------
    colour
        As #rrggbb; black stands for the colour of the text.
    mark
        What marks a point.
    dash
        What its line is like; one of `DASHES`.

    """

    colour: str
    mark: Mark
    dash: str


Styles = dict[str, Style]
"""By a method's name."""


def styles_of(results: Iterable[Results]) -> Styles:
    """
    Return what each method looks like.

    In the order in which the pages tell of them, each takes the first look that no method has
    with which it shares a diagram: so few looks serve many methods, and those are told apart best.
    """
    diagrams = [
        [curve.name for curve in diagram.curves]
        for each in results
        for part in each.parts
        for diagram in part.diagrams
    ]
    numbers: dict[str, int] = {}
    for name in dict.fromkeys(name for names in diagrams for name in names):
        beside = {other for names in diagrams if name in names for other in names}
        taken = {numbers[other] for other in beside if other in numbers}
        numbers[name] = next(number for number in count() if number not in taken)
    return {name: _style(number) for name, number in numbers.items()}


def _style(number: int) -> Style:
    turns = number // len(COLOURS)
    return Style(
        COLOURS[number % len(COLOURS)],
        MARKS[number % len(MARKS)],
        DASHES[turns % len(DASHES)],
    )
