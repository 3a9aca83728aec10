# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Results of a closure: position, velocity, acceleration; ranges, singular inputs, margins.

The modules that compute them, and `PlanarClosure`, import this one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, fields
from math import tau
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.errors import list_names, quote
from linkage_ros.kinematics.plane.linkage import Limits
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import LinkState, StepPose

if TYPE_CHECKING:
    from linkage_ros.kinematics.closure import Closure


class InputRange(NamedTuple):
    """
    An interval of an input in which every loop closes, in [rad] or [m]; turns not wrapped.

    Attributes
    ----------
    lowest, highest
        The ends.
    turning
        Whether the input is an angle.
    limited
        For each end whether the input cannot go beyond it. A slide may go beyond the end of the
        search, and so may an angle that is limited on one side.
    turns
        Number of whole turns of the input after which the poses repeat: 1 if all links are solved
        by dyads, several if iterated links come back only then, 0 if they never do.
    by
        For each end the joint that is at its limit there; '' at a toggle.

    """

    lowest: float
    highest: float
    turning: bool = True
    limited: tuple[bool, bool] = (True, True)
    turns: int = 1
    by: tuple[str, str] = ('', '')

    @property
    def is_whole(self) -> bool:
        """Whether the input turns fully, without end."""
        width = self.highest - self.lowest
        comes_round = self.turning and self.turns > 0 and self.by == ('', '')
        return comes_round and width >= self.turns * tau

    @property
    def toggles(self) -> tuple[float, ...]:
        """Return the ends at which a toggle lies: those that follow from the links' lengths."""
        if self.is_whole:
            return ()
        ends = zip((self.lowest, self.highest), self.limited, self.by, strict=True)
        return tuple(end for end, limited, by in ends if limited and not by)

    def shift(self, value: float) -> float:
        """Return the whole turns, in [rad], that bring a value nearest the middle of the range."""
        if not (self.turning and self.turns):
            return 0.0
        period = self.turns * tau
        return period * round((0.5 * (self.lowest + self.highest) - value) / period)

    def __str__(self) -> str:
        if self.is_whole:
            return 'every crank angle'
        if self.limited == (False, False) and not self.turning:
            return 'every slide'
        low, high, unit = f'{self.lowest:.6g}', f'{self.highest:.6g}', self.unit
        if self.by != ('', '') and self.limited != (True, True):
            return f'{low} {unit} and more' if self.limited[0] else f'{high} {unit} and less'
        return f'{low} to {high} {unit}'

    def shift_by(self, shift: float) -> InputRange:
        """Return the range moved by a distance, in [rad] or [m]."""
        return self._replace(lowest=self.lowest + shift, highest=self.highest + shift)

    @property
    def unit(self) -> str:
        """Return the unit of the input."""
        return 'rad' if self.turning else 'm'


class SingularInput(NamedTuple):
    """An input at which the linkage is singular."""

    value: float  # In [rad] or [m]
    # ``TOGGLE`` where the linkage ends or turns back, ``CHANGE_POINT`` where it passes, and
    # ``INDETERMINATE`` where its pose is not determined: two pins coincide, or two lines are
    # parallel.
    status: Status


class SingularityMargin(NamedTuple):
    """
    How near a position is to a singularity: the smaller, the nearer.

    Attributes
    ----------
    transmission_angle
        The smallest of all dyads, folded into [0, π/2], in [rad]; π/2 if there is none.
    conditioning
        The smallest singular value of a loop's Jacobian, of rows of length 1: for a dyad of
        transmission angle μ it is √2·sin(μ/2), from 0 at a toggle to 1. For an iterated group it
        is the smallest singular value divided by the largest.
    toggle_distance
        Distance of the input from the nearest singular one, in [rad] or [m]; infinite if there is
        none, or if there are several inputs.
    group
        Number of the group with this conditioning; −1 if there is no dyad and no iterated group.

    """

    transmission_angle: float
    conditioning: float
    toggle_distance: float
    group: int = -1


Near = Mapping[str, tuple[float, ...]]
"""For each former input the line that its whole turns are near, as `RevoluteJoint.near`."""

Plan = Callable[['Position', Mapping[str, float], Mapping[str, Limits]], Any]
"""
Makes a closure with other inputs, in the assembly of a position.

It takes known values of joints with their whole turns, and limits for inputs that have none.
"""


class _JointValues(Mapping[str, float]):
    """A value for each published joint, by its name: ``found['rocker_joint']``."""

    __slots__ = ()

    joints: tuple[float, ...]
    closure: Closure

    def __getitem__(self, joint: str) -> float:
        """
        Return the value of a joint.

        Raises
        ------
        KeyError
            If the linkage publishes no joint of this name.
        ValueError
            If the linkage has no pose.

        """
        names = self.closure.joint_names
        if joint not in names:
            raise KeyError(f'{quote(joint)} is not a published joint; use {list_names(names)}')
        if not self.joints:
            raise ValueError(f'{joint}: {self!r} has no joint values; check its status first')
        return self.joints[names.index(joint)]

    def __reduce__(self) -> tuple[Any, ...]:
        # Also for the pickle protocols that know no slots.
        names = [field.name for field in fields(self)]  # type: ignore[arg-type]
        return type(self), tuple(getattr(self, name) for name in names)

    def __iter__(self) -> Iterator[str]:
        return iter(self.closure.joint_names)

    def __len__(self) -> int:
        return len(self.closure.joint_names)

    def __repr__(self) -> str:
        values = zip(self.closure.joint_names, self.joints, strict=False)
        shown = list_names(f'{name} {value:.6g}' for name, value in values)
        return f'<{self._repr_title}: {shown}>' if shown else f'<{self._repr_title}>'

    @property
    def _repr_title(self) -> str:
        return type(self).__name__


# Not frozen: that takes five times as long, and the tick of a scene with forces makes three.
@dataclass(slots=True, repr=False)
class Position(_JointValues):
    """
    The linkage at one state of its inputs; ``position['rocker_joint']`` is a joint's value.

    Attributes
    ----------
    status
        Whether every loop closes, and whether the position has rates.
    gap
        Distance by which links miss each other where a loop is open, in [m]; else 0.
    joints
        Values of the published joints, in the order of the linkage, in [rad] or [m]; empty where a
        loop is open or indeterminate.
    state
        Coordinates and pins that the steps found.
    poses
        One pose for each step; where a step failed, the last one is its pose.
    closure
        The closure that found the position.

    """

    status: Status
    gap: float
    joints: tuple[float, ...]
    state: LinkState
    poses: list[StepPose]
    closure: Closure = field(compare=False)

    @property
    def inputs(self) -> tuple[float, ...]:
        """Values of the driven joints, in [rad] or [m]."""
        return self.closure.inputs_of(self.state)

    @property
    def points(self) -> dict[str, Any]:
        """
        Every named point in the frame of the ground, as x + iy, or (x, y, z) in space, in [m].

        Raises
        ------
        ValueError
            If the linkage has no pose.

        """
        return self.closure.named_points(self)

    @property
    def _repr_title(self) -> str:
        by = f' by {self.gap:.3g} {self.closure.gap_unit}' if self.gap else ''
        return f'Position {self.status.value}{by}'

    def _repr_svg_(self) -> str | None:
        from linkage_ros import svg  # local import: only a notebook asks for pictures

        return svg(self) if self.joints else None


@dataclass(slots=True, repr=False)
class Velocity(_JointValues):
    """
    The rates of a linkage; ``velocity['rocker_joint']`` is one rate.

    Attributes
    ----------
    joints
        Rates of the published joints, in [rad/s] or [m/s].
    state, rates
        Rates of coordinates and pins, and what each step needs for its accelerations; for rates so
        huge that a square of them would overflow, the velocity at smaller ones.
    closure
        The closure that found them.

    """

    joints: tuple[float, ...]
    state: LinkState
    rates: Any
    closure: Closure = field(compare=False)


@dataclass(slots=True, repr=False)
class Acceleration(_JointValues):
    """
    The accelerations of a linkage; ``acceleration['rocker_joint']`` is one.

    Attributes
    ----------
    joints
        Accelerations of the published joints, in [rad/s²] or [m/s²].
    state
        Accelerations of coordinates and pins.
    closure
        The closure that found them.

    """

    joints: tuple[float, ...]
    state: LinkState
    closure: Closure = field(compare=False)


class PointMotion(NamedTuple):
    """Place, velocity and acceleration of a point in the frame of the ground, in [m]."""

    place: complex
    velocity: complex
    acceleration: complex
