# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The limits of a linkage's joints, and the states beyond them.

An input is compared as it is given, an angle with all its turns. A published angle is compared
after whole turns that bring it nearest to the middle of its limits, since the pose is the same.
"""

from __future__ import annotations

from cmath import rect
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import wraps
from math import inf, pi, remainder, tau
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.kinematics.arithmetic import ROUNDING, UNIT_ROUNDOFF
from linkage_ros.kinematics.plane.linkage import GROUND, Limits, Linkage, RevoluteJoint
from linkage_ros.kinematics.status import Status

if TYPE_CHECKING:
    from linkage_ros.kinematics.batch import Array, Mask
    from linkage_ros.kinematics.plane.topology import Structure
    from linkage_ros.kinematics.results import InputRange, Position

_UNDISTURBED = (Status.CLOSED, Status.CHANGE_POINT)
"""A state of these becomes limited beyond the limits; a toggle stays one, without rates."""

_ROUNDINGS = 4.0
"""Roundings by which a value may be beyond: the sum of two decimal numbers is still within."""


class Bound(NamedTuple):
    """The limits of one joint, ready for comparisons."""

    name: str  # Of the joint
    number: int  # Its number among the inputs, or among the published joints
    # In [rad] or [m], widened by rounding.
    low: float
    high: float
    # Middle of the limits of a published angle, in [rad]; None if whole turns count.
    middle: float | None

    def is_beyond(self, value: float) -> bool:
        """Return whether a value of the joint is beyond the limits."""
        if self.low <= value <= self.high:
            return False
        if self.middle is None:
            return True
        return not self.low <= self.turn_to_middle(value) <= self.high

    def turn_to_middle(self, value: float) -> float:
        """Return a value plus the whole turns with which it is compared."""
        if self.middle is None:
            return value
        return value - tau * round((value - self.middle) / tau)

    def limit_margin(self, value: float) -> float:
        """Return the distance of a value from the limits, negative beyond them; continuous."""
        if self.middle is None:
            return min(value - self.low, self.high - value)
        return self.high - self.middle - abs(remainder(value - self.middle, tau))


class Bounds:
    """The limits of a linkage's driven joints, and of its published ones."""

    def __init__(self, linkage: Any) -> None:
        limits = {name: of for name, of in linkage.limits.items() if of.is_bounded}
        inputs = [driven.joint for driven in linkage.inputs]
        self.inputs = tuple(
            _make_bound(name, index, limits[name])
            for index, name in enumerate(inputs)
            if name in limits
        )
        self.joints = tuple(
            _make_bound(name, index, limits[name], turning=isinstance(joint, RevoluteJoint))
            for index, (name, joint) in enumerate(linkage.joints.items())
            if name in limits and name not in inputs
        )

    def __bool__(self) -> bool:
        """Whether there are any."""
        return bool(self.inputs or self.joints)

    def first_exceeded(self, inputs: Sequence[float], joints: Sequence[float]) -> Bound | None:
        """Return the first limits that a state is beyond, or None."""
        for bound in self.inputs:
            if bound.is_beyond(inputs[bound.number]):
                return bound
        for bound in self.joints:
            if bound.is_beyond(joints[bound.number]):
                return bound
        return None

    def are_beyond(self, inputs: Sequence[Array], joints: Array) -> Mask:
        """Return which of many states are beyond; inputs (N,) each, and joints (joints, N)."""
        import numpy as np  # local import: the batch alone needs it

        beyond = np.zeros(joints.shape[1], bool)
        for bound in self.inputs:
            value = inputs[bound.number]
            beyond |= ~((bound.low <= value) & (value <= bound.high))
        for bound in self.joints:
            value = joints[bound.number]
            within = (bound.low <= value) & (value <= bound.high)
            if bound.middle is not None:
                value = value - tau * np.rint((value - bound.middle) / tau)
                within |= (bound.low <= value) & (value <= bound.high)
            beyond |= ~within
        return beyond


def limit_status(position: Callable[..., Position], bounds: Bounds) -> Callable[..., Position]:
    """Return a function that closes the loops, with the status limited beyond the limits."""
    exceeded = bounds.first_exceeded

    @wraps(position)
    def close_limited(*inputs: float) -> Position:
        closed = position(*inputs)
        if closed.status in _UNDISTURBED and exceeded(closed.inputs, closed.joints) is not None:
            return replace(closed, status=Status.LIMITED)
        return closed

    return close_limited


def _make_bound(name: str, number: int, limits: Limits, *, turning: bool = False) -> Bound:
    low, high = limits.low, limits.high
    slack = _ROUNDINGS * UNIT_ROUNDOFF * max(abs(end) for end in (low, high) if abs(end) < inf)
    if not turning:
        return Bound(name, number, low - slack, high + slack, None)
    slack += _ROUNDINGS * UNIT_ROUNDOFF * pi
    return Bound(name, number, low - slack, high + slack, 0.5 * (low + high))


# Cylinders: driven slides whose length has a mirror image below zero.
#
# A rod slides in a tube, and each has one pin, on the line. The slide is the distance of the pins.
# With the tube turned by π, the negative distance holds the same pins, and nothing else moves. So
# every pose has a second one that no machine has.


def zero_length(linkage: Linkage, structure: Structure) -> float | None:
    """Return the first input, in [m], at which the pins of a cylinder meet; or None."""
    name = linkage.inputs[0].slider
    if not name:
        return None
    slider = linkage.sliders[name]
    tube, rod = slider.along, structure.blocks[name]
    turned = {link for driven in linkage.inputs for link in (driven.parent, driven.child)}
    if GROUND in (tube, rod) or not turned.isdisjoint((tube, rod)):
        return None
    places = []
    for link in (tube, rod):
        joints = [joint for joint in structure.joints if link in (joint.link, joint.to)]
        pins = {joint.name for joint in joints if joint.kind == 'R'}
        if len(pins) != 1 or sum(joint.kind == 'P' for joint in joints) != 1:
            return None
        places.append(complex(*structure.links[link][pins.pop()]))
    at_tube, at_rod = places
    through = complex(*structure.links[tube][slider.through])
    along = slider.unit
    arm = at_rod - complex(*structure.links[rod][slider.point])
    angle = slider.angle if slider.block else 0.0
    # From pin to pin where the slide is 0, along the line and across it.
    between = (through - at_tube + rect(1.0, angle) * arm) * along.conjugate()
    size = abs(through) + abs(at_tube) + abs(arm)
    return -between.real if abs(between.imag) <= ROUNDING * size else None


def without_mirrored(
    linkage: Linkage, structure: Structure, ranges: tuple[InputRange, ...]
) -> tuple[InputRange, ...]:
    """
    Return the ranges of the first input; for a cylinder only the ranges of positive length.

    The ranges of negative length are returned if its pose or its limits lie there, or if there
    are no others.
    """
    zero = zero_length(linkage, structure)
    if zero is None:
        return ranges
    positive = tuple(
        part._replace(lowest=max(part.lowest, zero)) for part in ranges if part.highest > zero
    )
    negative = tuple(
        part._replace(highest=min(part.highest, zero)) for part in ranges if part.lowest < zero
    )
    pose, limits = linkage.pose, linkage.inputs[0].limits
    if limits.high <= zero or (pose and pose.inputs[0] < zero):
        return negative or positive
    return positive or negative
