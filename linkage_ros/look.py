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
What a linkage comes to at a tick, put together of the stages that are called for.

Each of the functions below makes a function of the time. What is not called for leaves no trace in
it: no stage, and no question whether there is one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from operator import add
from typing import Any, NamedTuple

from linkage_ros.drives.drive import CrankState
from linkage_ros.effects.stage import Begin, DriveStage, Motion, Reading, Sensor, Stage
from linkage_ros.effects.turns import all_wrapped, beginnings, continuous
from linkage_ros.kinematics.closure import Closure, Position
from linkage_ros.kinematics.status import Status
from linkage_ros.tuples import new


class Look(NamedTuple):
    """
    What a linkage comes to at a tick.

    Attributes
    ----------
    crank
        The crank; nothing where there is none.
    position
        The loop; nothing where there is no crank.
    motion
        What the mechanism does; nothing where the loop has no pose, or no stage asks.
    reading
        What is published of it; nothing where nothing is.

    """

    crank: CrankState | None
    position: Position | None
    motion: Motion | None
    reading: Reading | None


_NO_CRANK = Look(None, None, None, None)


def sensing(sensors: Sequence[Sensor], closure: Closure, wrapped: bool) -> Sensor:
    """Put sensors together: what makes angles run on before them, what wraps them behind."""
    turning = closure.turning
    if wrapped and not sensors:
        return all_wrapped(turning)
    run_on = continuous(turning, beginnings(closure))
    return _chain([run_on, *sensors, *([all_wrapped(turning)] if wrapped else [])])


def delayed(sensors: Sequence[Sensor], delay: Any) -> Sensor:
    """Put a delay behind sensors, which is told their silence too."""
    sense = _chain(sensors)

    def late(now: int, reading: Reading) -> Reading | None:
        arrived: Reading | None = delay(now, sense(now, reading))
        return arrived

    return late


def _chain(sensors: Sequence[Sensor]) -> Sensor:
    """Let each sensor read what the one before it has read, as long as there is something."""
    if len(sensors) == 1:
        return sensors[0]

    def chain(now: int, reading: Reading) -> Reading | None:
        found: Reading | None = reading
        for sensor in sensors:
            if found is None:
                break
            found = sensor(now, found)
        return found

    return chain


def silent_beyond(close: Callable[..., Position], closure: Closure) -> Callable[..., Position]:
    """Return what closes the loops, and has no joints to publish where one is beyond limits."""
    exceeded = closure.bounds.exceeded

    def within(*inputs: float) -> Position:
        position = close(*inputs)
        if position[2] and exceeded(inputs, position[2]) is not None:
            return position._replace(status=Status.LIMITED, joints=())
        return position

    return within


def plain_look(
    state: Callable[[int], CrankState | None],
    close: Callable[..., Position],
    sense: Sensor,
) -> Callable[[int], Look]:
    """Put a tick together that asks for positions and for nothing that moves or pushes."""

    def look(now: int) -> Look:
        crank = state(now)
        if crank is None:
            return _NO_CRANK
        position = close(*crank[0])
        joints = position[2]
        if not joints:
            return new(Look, (crank, position, None, None))
        reading = sense(now, new(Reading, (now, joints, (), (), ())))
        return new(Look, (crank, position, None, reading))

    return look


def full_look(
    state: Callable[[int], CrankState | None],
    drive_stages: Sequence[DriveStage],
    close: Callable[..., Position],
    mechanism: Sequence[Callable[[Position], Position]],
    begin: Begin,
    stages: Sequence[Stage],
    observe: Callable[[int, Motion], Reading],
    sense: Sensor,
) -> Callable[[int], Look]:
    """Put a tick together."""

    def look(now: int) -> Look:
        crank = state(now)
        if crank is None:
            return _NO_CRANK
        for between in drive_stages:
            crank = between(crank)
        position = close(*crank[0])
        for harm in mechanism:
            position = harm(position)
        if not position[2]:
            return new(Look, (crank, position, None, None))
        motion = begin(crank, position)
        for stage in stages:
            motion = stage(motion)
        reading = sense(now, observe(now, motion))
        return new(Look, (crank, position, motion, reading))

    return look


def at_rest(crank: CrankState, position: Position) -> Motion:
    """Return the motion of which only the pose is asked for."""
    return new(Motion, (crank, position, None, None, (), (), ()))


def observer(named: set[str], joints: int) -> Callable[[int, Motion], Reading]:
    """Return what makes the reading of an ideal sensor: what is named, and no more."""
    if any('.' in name for name in named):
        # What is not of this package may let the mechanism yield.
        return _Observer(named, joints).observe
    if named.isdisjoint(_OBSERVED):
        return _positions
    if named & _OBSERVED == {'velocity'}:
        return _positions_and_rates
    return _Observer(named, joints).observe


_OBSERVED = {'velocity', 'acceleration', 'effort', 'compliance', 'clearance'}


def _positions(now: int, motion: Motion) -> Reading:
    return new(Reading, (now, motion[1][2], (), (), ()))


def _positions_and_rates(now: int, motion: Motion) -> Reading:
    velocity = motion[2]
    return new(Reading, (now, motion[1][2], velocity[0] if velocity else (), (), ()))


class _Observer:
    """Reads off a motion what is published of it."""

    def __init__(self, named: set[str], joints: int) -> None:
        self._joints = joints
        self._rates = _rates if 'velocity' in named else _nothing
        self._accelerations = _accelerations if 'acceleration' in named else _nothing
        self._efforts = self._drive_efforts if 'effort' in named else _nothing

    def observe(self, now: int, motion: Motion) -> Reading:
        joints, shift = motion[1][2], motion[6]
        if shift:
            joints = tuple(map(add, joints, shift))
        rates, accelerations = self._rates(motion), self._accelerations(motion)
        return new(Reading, (now, joints, rates, accelerations, self._efforts(motion)))

    def _drive_efforts(self, motion: Motion) -> tuple[float, ...]:
        """Return the efforts of the inputs, which are published first; 0 for the others."""
        efforts = motion[4]
        return (*efforts, *(0.0,) * (self._joints - len(efforts))) if efforts else ()


def _rates(motion: Motion) -> tuple[float, ...]:
    velocity = motion[2]
    return velocity[0] if velocity else ()


def _accelerations(motion: Motion) -> tuple[float, ...]:
    acceleration = motion[3]
    return acceleration[0] if acceleration else ()


def _nothing(_motion: Motion) -> tuple[float, ...]:
    return ()
