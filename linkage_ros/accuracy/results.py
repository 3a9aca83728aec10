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
The results of measurements as data: parts, diagrams and tables.

The modules that measure and those that present share only these types.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from linkage_ros.measuring import Spread


class Axis(NamedTuple):
    """
    An axis of a diagram.

    Attributes
    ----------
    name
        The quantity, for example 'error'.
    unit
        Its unit, for example 'rad'; '' for a number.
    logarithmic
        Whether the axis is logarithmic.
    least
        For a logarithmic axis, the smallest value drawn at its own position; 0 for any.

    """

    name: str
    unit: str
    logarithmic: bool = True
    least: float = 0.0

    @property
    def title(self) -> str:
        """Return the name with the unit."""
        return f'{self.name} [{self.unit}]' if self.unit else self.name


class Point(NamedTuple):
    """
    A point of a curve.

    Attributes
    ----------
    x, y
        Coordinates: medians.
    x_spread, y_spread
        The quartiles, if it was measured several times.
    setting
        The setting of the method: 'tolerance 1e-6', '256 knots'.

    """

    x: float
    y: float
    x_spread: Spread | None = None
    y_spread: Spread | None = None
    setting: str = ''


class Curve(NamedTuple):
    """
    The results of a method, over its settings.

    Attributes
    ----------
    name
        Name of the method.
    points
        In the order of the settings.
    joined
        Whether a line joins the points.

    """

    name: str
    points: Sequence[Point]
    joined: bool = True


class Diagram(NamedTuple):
    """
    A diagram with one message.

    Attributes
    ----------
    key
        File name without suffix.
    title
        The message, in a sentence.
    x, y
        Its axes.
    curves
        The curves; the same name has the same colour and mark in all diagrams.

    """

    key: str
    title: str
    x: Axis
    y: Axis
    curves: Sequence[Curve]


class Table(NamedTuple):
    """
    A table; each column's name has its unit: 'time [µs]'.

    Attributes
    ----------
    key
        File name without suffix.
    title
        Its heading.
    columns
        Headings.
    rows
        Numbers or texts; None for an empty cell.

    """

    key: str
    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[float | int | str | Spread | None]]


class Part(NamedTuple):
    """
    A part of the page.

    Attributes
    ----------
    key
        'solving', 'ticking', 'effects', 'dynamics' or 'recording'.
    title
        The question that it answers.
    text
        The method of measurement and the conclusions, in paragraphs without markup.
    diagrams, tables
        The results.
    advice
        The cheapest method for some accuracies, a sentence each, derived from the data.

    """

    key: str
    title: str
    text: Sequence[str]
    diagrams: Sequence[Diagram] = ()
    tables: Sequence[Table] = ()
    advice: Sequence[str] = ()


class Results(NamedTuple):
    """
    All measurements of a scene.

    Attributes
    ----------
    scene
        Its name.
    machine
        Machine and versions: names and values.
    parts
        The parts in order; a scene without torque has no part on dynamics.

    """

    scene: str
    machine: Sequence[tuple[str, str]]
    parts: Sequence[Part]
