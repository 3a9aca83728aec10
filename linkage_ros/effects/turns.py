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
How a published angle runs: on beyond a turn, or wrapped.

The closure knows an angle up to whole turns. `continuous` adds the turns that bring it nearest to
what came last, so it takes steps of less than half a turn. It stands before the sensors, which may
then mix and quantise what they get without a thought of wrapping; `all_wrapped` stands behind.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import pi, remainder, tau

from linkage_ros.effects.stage import Reading, Sensor
from linkage_ros.kinematics.closure import Closure
from linkage_ros.tuples import new

Begin = Callable[[float], float]
"""Returns the turn of an angle that is published first."""


def continuous(turning: Sequence[bool], begins: Mapping[int, Begin] | None = None) -> Sensor:
    """
    Build what lets angles run on without jumps; the first lies in (−π, π].

    Parameters
    ----------
    turning
        For each joint whether it is an angle.
    begins
        For joints that begin elsewhere, by their numbers, where.

    """
    begin = {i: wrapped for i, turns in enumerate(turning) if turns} | dict(begins or {})
    places = tuple(i for i, turns in enumerate(turning) if turns)
    raw: tuple[float, ...] = ()
    """The angles as they came last."""
    added: list[int] = []
    """What is added to them, in turns; nothing where it is 0 for all."""

    def run_on(_now: int, reading: Reading) -> Reading:
        nonlocal raw, added
        joints = reading[1]
        if raw:
            for i in places:
                if not -pi < raw[i] - joints[i] < pi:
                    added = _followed(added, raw, joints, places)
                    break
            raw = joints
            if not added:
                return reading
            now = [v + n * tau if n else v for v, n in zip(joints, added, strict=True)]
        else:
            raw = joints
            now = [begin[i](v) if i in places else v for i, v in enumerate(joints)]
            added = _turns([round((w - v) / tau) for w, v in zip(now, joints, strict=True)])
        stamp, _, rates, accelerations, efforts = reading
        return new(Reading, (stamp, tuple(now), rates, accelerations, efforts))

    return run_on


def beginnings(closure: Closure) -> dict[int, Begin]:
    """
    Return how published angles begin that have limits, by the numbers of the joints.

    One that depends begins nearest to the middle of its limits, and so within them; one that is
    driven begins where it is sent.
    """
    bounds, joints = closure.bounds, list(closure.linkage.joints)
    found: dict[int, Begin] = {
        bound.number: bound.turned for bound in bounds.joints if bound.middle is not None
    }
    for bound in bounds.inputs:
        if bound.name in joints and closure.turning[joints.index(bound.name)]:
            found[joints.index(bound.name)] = float
    return found


def _followed(
    added: list[int], raw: tuple[float, ...], joints: tuple[float, ...], places: Sequence[int]
) -> list[int]:
    """Return the turns that take back the jumps since the last reading too."""
    turns = added or [0] * len(joints)
    for i in places:
        if not -pi < raw[i] - joints[i] < pi:
            turns[i] += round((raw[i] - joints[i]) / tau)
    return _turns(turns)


def _turns(turns: list[int]) -> list[int]:
    return turns if any(turns) else []


def all_wrapped(turning: Sequence[bool]) -> Sensor:
    """
    Build what wraps angles to (−π, π].

    Parameters
    ----------
    turning
        For each joint whether it is an angle.

    """
    turns = tuple(turning)

    def wrap(_now: int, reading: Reading) -> Reading:
        stamp, joints, rates, accelerations, efforts = reading
        now = [wrapped(v) if turn else v for v, turn in zip(joints, turns, strict=True)]
        return new(Reading, (stamp, tuple(now), rates, accelerations, efforts))

    return wrap


def wrapped(angle: float) -> float:
    """Return an angle less its whole turns, in (−π, π] rad."""
    rest = remainder(angle, tau)
    return pi if rest <= -pi else rest
