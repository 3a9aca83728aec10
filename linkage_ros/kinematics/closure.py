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
The loop closure of a linkage: from the crank's angle to the published joints.

Position first; what a scene calls for beyond it starts from the position and repeats nothing.
"""

from __future__ import annotations

from math import cos, hypot, sin
from typing import Any, NamedTuple

from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics.assembly import find_loop, Loop
from linkage_ros.kinematics.dyads.rpr import RPRPose
from linkage_ros.kinematics.dyads.rrr import RRRDyad, RRRPose
from linkage_ros.kinematics.linkage import Linkage, RevoluteJoint, SlideJoint
from linkage_ros.kinematics.mobility import crank_ranges, CrankRange
from linkage_ros.kinematics.status import Status
from linkage_ros.tuples import new

_CLOSED, _TOGGLE = Status.CLOSED, Status.TOGGLE


class Position(NamedTuple):
    """
    The linkage at one crank angle.

    Attributes
    ----------
    status
        Whether the loop closes.
    gap
        What the links miss each other by where it is open, else 0, in [m].
    joints
        Values of the published joints, in the order of the linkage, in [rad] or [m]; empty where
        the loop is open or indeterminate.
    phi
        Direction of the crank in the frame of the loop, in [rad].
    pose
        The dyad's own coordinates.

    """

    status: Status
    gap: float
    joints: tuple[float, ...]
    phi: float
    pose: RRRPose | RPRPose


class Closure:
    """
    A linkage, ready to be solved.

    Parameters
    ----------
    linkage
        What to solve.

    Raises
    ------
    DefinitionError
        Where no dyad closes the linkage, or where it closes at no crank angle.

    """

    __slots__ = ('_crank_offset', '_dyad', '_terms', 'crank_ranges', 'loop', 'turning')

    loop: Loop
    turning: tuple[bool, ...]
    """For each published joint: whether it turns (an angle) or slides (a length)."""
    crank_ranges: tuple[CrankRange, ...]
    """Where the loop closes."""

    def __init__(self, linkage: Linkage) -> None:
        self.loop = find_loop(linkage)
        self.crank_ranges = crank_ranges(self.loop)
        if not self.crank_ranges:
            sides = ', '.join(f'{side * self.loop.scale:g}' for side in self.loop.dyad.sides)
            raise DefinitionError(
                'links',
                f'the loop of {sides} m closes at no crank angle',
                'the longest link must be shorter than the other three together',
            )
        self.turning = tuple(isinstance(j, RevoluteJoint) for j in linkage.joints.values())
        self._dyad = self.loop.dyad
        self._crank_offset = self.loop.crank_offset
        self._terms = tuple(
            tuple(self._joint(name, joint)) for name, joint in linkage.joints.items()
        )

    def position(self, crank_angle: float) -> Position:
        """
        Close the loop at a crank angle.

        Parameters
        ----------
        crank_angle
            Angle of the input joint, in [rad], finite.

        """
        phi = crank_angle + self._crank_offset
        pose = self._dyad.close(phi)
        status, gap, first, second, *_ = pose
        if status is not _CLOSED and status is not _TOGGLE:
            return Position(status, gap * self.loop.scale, (), phi, pose)
        joints: tuple[float, ...] = ()
        for t, u, v, w in self._terms:
            joints += (t * crank_angle + u * first + v * second + w,)
        return new(Position, (status, 0.0, joints, phi, pose))

    def rates(self, position: Position, crank_rate: float) -> tuple[float, ...]:
        """
        Return the rates of the published joints, in [rad/s] or [m/s].

        Parameters
        ----------
        position
            A closed position; a rate at a toggle does not exist.
        crank_rate
            Rate of the input joint, in [rad/s].

        """
        # The pose came out of this very dyad: the pair matches, which no annotation can say.
        pose: Any = position.pose
        first, second = self._dyad.rates(pose, crank_rate)
        rates: tuple[float, ...] = ()
        for t, u, v, _ in self._terms:
            rates += (t * crank_rate + u * first + v * second,)
        return rates

    def residual(self, position: Position) -> float:
        """
        Return what is left open by a closed position, in [m].

        The loop is walked from the crank's pivot along crank, dyad and ground, with the angles
        alone.
        """
        _, _, first, second, *_ = position.pose
        x, y = cos(position.phi), sin(position.phi)
        if isinstance(self._dyad, RRRDyad):
            a, b, c, d = self._dyad.sides
            x = a * x + b * cos(first) - c * cos(second) - d
            y = a * y + b * sin(first) - c * sin(second)
        else:
            a, d, offset = self._dyad.sides
            x = a * x + second * cos(first) - offset * sin(first) - d
            y = a * y + second * sin(first) + offset * cos(first)
        return hypot(x, y) * self.loop.scale

    def _joint(self, name: str, joint: RevoluteJoint | SlideJoint) -> list[float]:
        """Return a published joint as a sum over crank angle and dyad coordinates."""
        if isinstance(joint, SlideJoint):
            if joint.slider not in self.loop.slides:
                raise DefinitionError(
                    f'joints.{name}.slider',
                    f'{joint.slider!r} is not a slider',
                    f'name one of {", ".join(self.loop.slides) or "(this linkage has none)"}',
                )
            return list(self.loop.slides[joint.slider])
        for end in ('parent', 'child'):
            if getattr(joint, end) not in self.loop.angles:
                raise DefinitionError(
                    f'joints.{name}.{end}',
                    f'{getattr(joint, end)!r} is not a link',
                    f'name one of {", ".join(self.loop.angles)}',
                )
        child, parent = self.loop.angles[joint.child], self.loop.angles[joint.parent]
        return [c - p for c, p in zip(child, parent, strict=True)]
