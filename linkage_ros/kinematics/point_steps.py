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

"""Steps that place a point of a link at a known angle, or compute the angle of a driven link."""

from __future__ import annotations

from linkage_ros.kinematics.arithmetic import facing
from linkage_ros.kinematics.step import PLACED, Pose, State


class FixedPoint:
    """
    A point of the ground.

    Parameters
    ----------
    place
        In the frame of the ground.

    """

    __slots__ = ('_place',)

    def __init__(self, place: complex) -> None:
        self._place = place

    def close(self, known: State) -> Pose:
        """Append the point."""
        known.pins.append(self._place)
        return PLACED

    def rates(self, _pose: Pose, _known: State, speeds: State) -> None:
        """Append a velocity of zero."""
        speeds.pins.append(0j)

    def accelerations(
        self, _pose: Pose, _rates: None, _known: State, _speeds: State, changes: State
    ) -> None:
        """Append an acceleration of zero."""
        changes.pins.append(0j)


class PointOnLink:
    """
    A point at a constant distance from a pin of the same link.

    Parameters
    ----------
    pin
        Index of that pin.
    arm
        Index, among the coordinates, of the angle of the link.
    vector
        Vector from the pin to the point at a coordinate of 0.

    """

    __slots__ = ('_arm', '_pin', '_vector')

    def __init__(self, pin: int, arm: int, vector: complex) -> None:
        self._pin = pin
        self._arm = arm
        self._vector = vector

    def close(self, known: State) -> Pose:
        """Append the point."""
        arm = facing(known.coordinates[self._arm]) * self._vector
        known.pins.append(known.pins[self._pin] + arm)
        return PLACED

    def rates(self, _pose: Pose, known: State, speeds: State) -> complex:
        """Append its velocity; return the vector from the pin."""
        # Not the difference of the two places, which has few digits far from the origin.
        arm = facing(known.coordinates[self._arm]) * self._vector
        turn = speeds.coordinates[self._arm]
        speeds.pins.append(speeds.pins[self._pin] + 1j * turn * arm)
        return arm

    def accelerations(
        self, _pose: Pose, arm: complex, _known: State, speeds: State, changes: State
    ) -> None:
        """Append its acceleration."""
        turn, change = speeds.coordinates[self._arm], changes.coordinates[self._arm]
        changes.pins.append(changes.pins[self._pin] + (1j * change - turn * turn) * arm)


class PointOnRail:
    """
    A point that travels along a line of a link.

    Parameters
    ----------
    pin
        Index of the pin that the line starts from.
    arm
        Index, among the coordinates, of the angle of the link that carries the line.
    slide
        Index, among the coordinates, of the slide along the line.
    unit
        Direction in which the point travels with the slide, at a link coordinate of 0.

    """

    __slots__ = ('_arm', '_pin', '_slide', '_unit')

    def __init__(self, pin: int, arm: int, slide: int, unit: complex) -> None:
        self._pin = pin
        self._arm = arm
        self._slide = slide
        self._unit = unit

    def close(self, known: State) -> Pose:
        """Append the point."""
        unit = facing(known.coordinates[self._arm]) * self._unit
        slide = known.coordinates[self._slide]
        known.pins.append(known.pins[self._pin] + slide * unit)
        return PLACED

    def rates(self, _pose: Pose, known: State, speeds: State) -> None:
        """Append its velocity."""
        x, v = known.coordinates, speeds.coordinates
        unit = facing(x[self._arm]) * self._unit
        moved = v[self._slide] + 1j * (v[self._arm] * x[self._slide])
        speeds.pins.append(speeds.pins[self._pin] + moved * unit)

    def accelerations(
        self, _pose: Pose, _rates: None, known: State, speeds: State, changes: State
    ) -> None:
        """Append its acceleration."""
        x, v, a = known.coordinates, speeds.coordinates, changes.coordinates
        unit = facing(x[self._arm]) * self._unit
        slide, turn = x[self._slide], v[self._arm]
        across = a[self._arm] * slide + 2.0 * turn * v[self._slide]
        moved = a[self._slide] - turn * turn * slide + 1j * across
        changes.pins.append(changes.pins[self._pin] + moved * unit)


class RelativeAngle:
    """
    The angle of a link that a driven joint turns against another.

    Parameters
    ----------
    arm, turn
        Indices, among the coordinates, of the other link's angle and of the joint.
    sign
        +1 if the joint adds to that angle, −1 if it is subtracted.

    """

    __slots__ = ('_arm', '_sign', '_turn')

    def __init__(self, arm: int, turn: int, sign: float) -> None:
        self._arm = arm
        self._turn = turn
        self._sign = sign

    def close(self, known: State) -> Pose:
        """Append the angle."""
        self._append(known)
        return PLACED

    def rates(self, _pose: Pose, _known: State, speeds: State) -> None:
        """Append its rate."""
        self._append(speeds)

    def accelerations(
        self, _pose: Pose, _rates: None, _known: State, _speeds: State, changes: State
    ) -> None:
        """Append its acceleration."""
        self._append(changes)

    def _append(self, state: State) -> None:
        values = state.coordinates
        values.append(values[self._arm] + self._sign * values[self._turn])
