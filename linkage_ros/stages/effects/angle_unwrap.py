# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Unwrap published angles beyond a turn, or wrap them.

The closure gives an angle up to whole turns. `Continuous` adds the turns that bring it nearest to
the last one, so an angle must move less than half a turn per tick. It comes before the sensors,
which may then mix and quantise angles without regard to wrapping; `wrap_all` comes after them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import pi, tau
from operator import add

from linkage_ros.kinematics import Closure, wrap_angle
from linkage_ros.stages.effects.stage import Sensor, SensorReading

_NO_TURN = -0.0
"""Changes no number when added; 0.0 would turn −0.0 into 0.0."""

Begin = Callable[[float], float]
"""Returns the turns of an angle that is published first."""


class Continuous:
    """Unwraps angles; the first value lies in (−π, π], unless ``begins`` has one."""

    __slots__ = ('_begin', '_turns', 'added', 'places', 'raw')

    def __init__(self, turning: Sequence[bool], begins: Mapping[int, Begin] | None = None) -> None:
        self.places = tuple(
            i for i, turns in enumerate(turning) if turns
        )  # Joints that are angles
        self._begin = dict.fromkeys(self.places, wrap_angle) | dict(begins or {})
        self._turns = [0] * len(turning)
        self.raw: tuple[float, ...] = ()  # Last joint values before unwrapping
        self.added = (_NO_TURN,) * len(turning)  # Whole turns, in [rad]

    def __call__(self, _now: int, reading: SensorReading) -> SensorReading:
        """Return the reading with unwrapped angles."""
        joints, raw = reading.joints, self.raw
        self.raw = joints
        if raw:
            if not all(-pi < raw[i] - joints[i] < pi for i in self.places):
                self._add_turns({i: raw[i] for i in self.places}, joints)
            return reading._replace(joints=tuple(map(add, joints, self.added)))
        first = {i: begin(joints[i]) for i, begin in self._begin.items()}
        self._add_turns(first, joints)
        # Keep the first values exactly: adding turns may round.
        began = tuple(first.get(i, value) for i, value in enumerate(joints))
        return reading._replace(joints=began)

    def _add_turns(self, last: Mapping[int, float], joints: Sequence[float]) -> None:
        """Add the turns that bring the joints nearest to their last values."""
        for i, value in last.items():
            if not -pi < value - joints[i] < pi:
                self._turns[i] += round((value - joints[i]) / tau)
        self.added = tuple(n * tau if n else _NO_TURN for n in self._turns)


def first_values(closure: Closure) -> dict[int, Begin]:
    """
    Return the first values of published angles with limits, by joint index.

    A dependent angle begins nearest to the middle of its limits, and so within them; a driven one
    begins at its input.
    """
    bounds, joints = closure.bounds, list(closure.linkage.joints)
    begins: dict[int, Begin] = {
        bound.number: bound.turn_to_middle for bound in bounds.joints if bound.middle is not None
    }
    for bound in bounds.inputs:
        if bound.name in joints and closure.turning[joints.index(bound.name)]:
            begins[joints.index(bound.name)] = float
    return begins


def wrap_all(turning: Sequence[bool]) -> Sensor:
    """Build a stage that wraps the joints that are angles to (−π, π]."""
    turns = tuple(turning)

    def wrap(_now: int, reading: SensorReading) -> SensorReading:
        now = [wrap_angle(v) if turn else v for v, turn in zip(reading.joints, turns, strict=True)]
        return reading._replace(joints=tuple(now))

    return wrap
