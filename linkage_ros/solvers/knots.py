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
The closed form at knots of the inputs: where to start from, and in which assembly.

Knots lie 256 to a turn of an input, or to the unit of length. A state takes the nearest. One
counts only if the loops close there and at its neighbours, in the same assembly; so that no change
point lies between a state and its knot. They are worked out as they are asked for, and depend on
nothing else; so what starts from them depends on the inputs alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import tau
from typing import NamedTuple

from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.status import Status

_PER_TURN = 256
_MOST = 2**16
"""Knots that are kept; beyond it they are worked out again."""


class Knot(NamedTuple):
    """
    The closed form at a knot.

    Attributes
    ----------
    inputs
        As coordinates.
    coordinates
        All of them.
    slopes
        For each input the derivatives of all coordinates.
    signs
        For each dyad its assembly: +1 or −1.

    """

    inputs: tuple[float, ...]
    coordinates: list[float]
    slopes: tuple[list[float], ...]
    signs: tuple[float, ...]


class Knots:
    """
    Knots of a linkage.

    Parameters
    ----------
    closed
        The linkage in closed form.
    orientations
        Returns for given coordinates of a closed position how each dyad is oriented: a sign.
    repeats
        Whether everything is the same again after two turns of an input.

    """

    def __init__(
        self,
        closed: Closure,
        orientations: Callable[[list[float]], tuple[float, ...]],
        repeats: bool,
    ) -> None:
        self._closed = closed
        self._orientations = orientations
        self._spacing = [
            (1.0 if given.slider else tau) / _PER_TURN for given in closed.linkage.inputs
        ]
        self._period = [
            2 * _PER_TURN if repeats and not given.slider else 0 for given in closed.linkage.inputs
        ]
        self._units = [closed.scale if given.slider else 1.0 for given in closed.linkage.inputs]
        self._knots: dict[tuple[int, ...], Knot | None] = {}
        self._signs: dict[tuple[int, ...], tuple[float, ...] | None] = {}

    def near(self, inputs: Sequence[float]) -> tuple[Knot | None, list[float]]:
        """Return the knot nearest to some inputs, given as coordinates, and how far these are."""
        numbers, offsets = [], []
        for value, spacing, period in zip(inputs, self._spacing, self._period, strict=True):
            number = round(value / spacing)
            offsets.append(value - number * spacing)
            numbers.append(number % period if period else number)
        key = tuple(numbers)
        try:
            return self._knots[key], offsets
        except KeyError:
            return self._new(key), offsets

    def _new(self, key: tuple[int, ...]) -> Knot | None:
        if len(self._knots) >= _MOST:
            self._knots.clear()
            self._signs.clear()
        self._knots[key] = knot = self._knot(key)
        return knot

    def _knot(self, key: tuple[int, ...]) -> Knot | None:
        signs = self._signs_at(key)
        around = [
            tuple(number + step * (k == i) for k, number in enumerate(key))
            for i in range(len(key))
            for step in (-1, 1)
        ]
        if signs is None or any(self._signs_at(other) != signs for other in around):
            return None
        given = self._given(key)
        closed = self._closed
        position = closed.position(*given)
        slopes = []
        for i in range(len(key)):
            rates = [self._units[i] if k == i else 0.0 for k in range(len(key))]
            slopes.append(closed.velocity(position, *rates).state.coordinates)
        coordinates, count = position.state.coordinates, len(key)
        return Knot(tuple(coordinates[1:][:count]), coordinates, tuple(slopes), signs)

    def _signs_at(self, key: tuple[int, ...]) -> tuple[float, ...] | None:
        """Return the assembly of each dyad, or nothing where a loop is not closed."""
        if key not in self._signs:
            position = self._closed.position(*self._given(key))
            closed = position.status in (Status.CLOSED, Status.LIMITED)
            self._signs[key] = self._orientations(position.state.coordinates) if closed else None
        return self._signs[key]

    def _given(self, key: tuple[int, ...]) -> list[float]:
        return [
            number * spacing * unit
            for number, spacing, unit in zip(key, self._spacing, self._units, strict=True)
        ]
