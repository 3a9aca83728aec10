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

Measuring and presenting know nothing of each other; both know these types.
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
        The quantity, in words: 'error'.
    unit
        In which unit: 'rad'; '' for a number.
    logarithmic
        Whether equal steps are equal factors.
    least
        Of a logarithmic axis, the smallest value worth a place of its own; 0 for any.

    """

    name: str
    unit: str
    logarithmic: bool = True
    least: float = 0.0

    @property
    def title(self) -> str:
        """Return its name with its unit."""
        return f'{self.name} [{self.unit}]' if self.unit else self.name


class Point(NamedTuple):
    """
    A point of a curve.

    Attributes
    ----------
    x, y
        Where it lies: the median.
    x_spread, y_spread
        The quartiles, where it was measured several times.
    setting
        The setting of the method, in words: 'tolerance 1e-6', '256 knots'.

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
        Of the method.
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
    A picture with one message.

    Attributes
    ----------
    key
        Its name as a file, without ending.
    title
        The message, in a sentence.
    x, y
        Its axes.
    curves
        What is drawn; the same name has the same colour and mark in all diagrams.

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
        Its name as a file, without ending.
    title
        What it shows.
    columns
        Names.
    rows
        Numbers as numbers and texts as texts; None for an empty cell.

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
        How it was measured, and what it says, in paragraphs without markup.
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
        What it was measured on, and with which versions: names and values.
    parts
        In their order; a scene without torque has no part on dynamics.

    """

    scene: str
    machine: Sequence[tuple[str, str]]
    parts: Sequence[Part]
