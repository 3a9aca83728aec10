# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
PRP: a pin at the intersection of two known lines.

The pin travels along a line through E1 in the direction û1 on one link and along a line through E2
in the direction û2 on another. With × for the z component of the cross product and δ the angle
from û1 to û2::

    E1 + s1·û1 = E2 + s2·û2        s1 = (E2 − E1) × û2 / sin δ        s2 = (E2 − E1) × û1 / sin δ

The rates solve the same equations for the difference of the links' velocities at the pin, the
accelerations for the difference of their accelerations, with Coriolis terms. In a frame that turns
about E1 at any rate ω, the links turn at the rates less ω::

    ṡ1·û1 − ṡ2·û2 = Ė2 − Ė1 − ω × (E2 − E1) + (ω2 − ω) × s2·û2 − (ω1 − ω) × s1·û1

The slides are rounded, and 1/sin δ amplifies that. ω is the smaller one of both turns: with ω = 0
a chain whose links turn almost alike lost 5 u·κ; with the larger one, a slow link with a line that
starts far away lost 188 u·κ in its acceleration. Parallel lines do not meet, or coincide: open, or
indeterminate.
"""

from __future__ import annotations

from math import pi
from typing import NamedTuple

from linkage_ros.kinematics.arithmetic import (
    atan2,
    cross_product,
    phase,
    ROUNDING,
    unit_vector,
    where,
)
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import LinkState, Step


class PRPPose(NamedTuple):
    """The dyad at one state of the linkage."""

    status: Status  # Whether the lines cross
    gap: float  # Distance of parallel lines, otherwise 0, in the unit of the lengths
    # s1 and s2, or r1 and r2, in the unit of the lengths.
    first: float
    second: float
    across: complex  # e^{iδ}
    units: tuple[complex, complex] = (0j, 0j)  # û1 and û2 of a `PRPDyad`


class _CrossingLines(Step):
    """Two lines on links of the coordinates ``arms``; at equal ones ``across`` is e^{iδ}."""

    __slots__ = ('_across', 'arms')

    has_transmission_angle = True

    def __init__(self, arms: tuple[int, int], across: complex) -> None:
        self.arms = arms
        self._across = across

    @property
    def span(self) -> _CrossingLines:
        """Return its lines."""
        return self

    @property
    def crosses(self) -> tuple[bool, bool]:
        """Return that neither side is left where the lines are parallel."""
        return False, False

    @property
    def singular_angles(self) -> tuple[float, ...]:
        """Differences of the two coordinates at which the lines are parallel, in [rad]."""
        angle = phase(self._across)
        return angle, angle + pi

    def side_of(self, pose: PRPPose) -> float:
        """Return a number with the sign of the assembly; 0 where it is singular."""
        return pose.across.imag

    def transmission_angle(self, pose: PRPPose) -> float:
        """Return the angle between the two lines, in [0, π/2], in [rad]."""
        return atan2(abs(pose.across.imag), abs(pose.across.real))


class PRPDyad(_CrossingLines):
    """
    A pin on two lines.

    ``starts`` are the indices of E1 and E2 among the pins, and ``arms`` the indices, among the
    coordinates, of the angles of the links that carry the lines. ``units`` are the directions of
    the lines at coordinates of 0.
    """

    __slots__ = ('_starts', '_units')

    def __init__(
        self, starts: tuple[int, int], arms: tuple[int, int], units: tuple[complex, complex]
    ) -> None:
        super().__init__(arms, units[1] * units[0].conjugate())
        self._starts = starts
        self._units = units

    def close(self, solved: LinkState) -> PRPPose:
        """Append both slides."""
        angle, other_angle = (solved.coordinates[k] for k in self.arms)
        start, end = (solved.pins[k] for k in self._starts)
        units = unit_vector(angle) * self._units[0], unit_vector(other_angle) * self._units[1]
        # The angle first: the product of two directions would cancel for parallel lines.
        across = unit_vector(other_angle - angle) * self._across
        between = end - start
        if abs(across.imag) <= ROUNDING:
            gap = abs(cross_product(units[0], between))
            far = gap > ROUNDING * (abs(start) + abs(end))
            status = Status.OPEN if far else Status.INDETERMINATE
            return PRPPose(status, gap if far else 0.0, 0.0, 0.0, across, units)
        first, second = resolve_along_lines(between, units, across.imag, solved)
        return PRPPose(Status.CLOSED, 0.0, first, second, across, units)

    def rates(
        self, pose: PRPPose, solved: LinkState, velocities: LinkState
    ) -> tuple[float, float]:
        """Append the rates of both slides."""
        first, second = pose.units
        turn, other_turn = (velocities.coordinates[k] for k in self.arms)
        start, end = (velocities.pins[k] for k in self._starts)
        begin, finish = (solved.pins[k] for k in self._starts)
        frame = where(abs(turn) < abs(other_turn), turn, other_turn)
        carried = end - start - 1j * frame * (finish - begin)
        carried += 1j * ((other_turn - frame) * pose.second) * second
        carried -= 1j * ((turn - frame) * pose.first) * first
        return resolve_along_lines(carried, pose.units, pose.across.imag, velocities)

    def accelerations(
        self,
        pose: PRPPose,
        rates: tuple[float, float],
        _solved: LinkState,
        velocities: LinkState,
        accelerations: LinkState,
    ) -> None:
        """Append the accelerations of both slides."""
        v, a = velocities.coordinates, accelerations.coordinates
        (i, j), (first, second) = self.arms, pose.units
        slide_rate, other_slide_rate = rates
        start, end = (accelerations.pins[k] for k in self._starts)
        carried = end + _carried_acceleration(pose.second, other_slide_rate, v[j], a[j]) * second
        carried -= start + _carried_acceleration(pose.first, slide_rate, v[i], a[i]) * first
        resolve_along_lines(carried, pose.units, pose.across.imag, accelerations)


def _carried_acceleration(slide: float, rate: float, turn: float, change: float) -> complex:
    """Return the centrifugal, Euler and Coriolis terms of a point on a turning line."""
    return 1j * (change * slide + 2.0 * turn * rate) - turn * turn * slide


def resolve_along_lines(
    between: complex, units: tuple[complex, complex], sine: float, state: LinkState
) -> tuple[float, float]:
    """Resolve a vector along both lines, and append its components."""
    first_unit, second_unit = units
    first, second = (
        cross_product(between, second_unit) / sine,
        cross_product(between, first_unit) / sine,
    )
    state.coordinates.append(first)
    state.coordinates.append(second)
    return first, second


class CrankPRPDyad(_CrossingLines):
    """
    A pin on two lines of links that are pinned together at O.

    The lines pass O at the offsets h1 and h2, to the left, and the dyad's pin lies r1 and r2 ahead
    of the feet of O on them. With δ the angle from û1 to û2 and n̂ = i·û::

        r1·û1 + h1·n̂1 = r2·û2 + h2·n̂2

        r1 = (h1·cos δ − h2)/sin δ        ṙ1 = −δ̇·r2/sin δ
        r2 = (h1 − h2·cos δ)/sin δ        ṙ2 = −δ̇·r1/sin δ

        r̈1 = −δ̈·r2/sin δ + δ̇²·(r1 + r2·cos δ)/sin²δ
        r̈2 = −δ̈·r1/sin δ + δ̇²·(r2 + r1·cos δ)/sin²δ

    The offsets are constants of the linkage. `PRPDyad` takes the difference of two points in the
    frame of the ground, which may be far from the intersection: it lost 8,000 u·κ where the points
    were 1,000 times as far, and 23 u·κ in random linkages.

    ``offsets`` are h1 and h2, in the unit of the lengths. ``size`` is the size of the coordinates
    from which they were computed: it bounds, in units of u, the distance of parallel lines that
    rounding causes. ``arms`` are the indices, among the coordinates, of the angles of the links
    that carry the lines. ``across`` is e^{iδ} if those coordinates are equal.
    """

    __slots__ = ('_offsets', '_size')

    def __init__(
        self, offsets: tuple[float, float], size: float, arms: tuple[int, int], across: complex
    ) -> None:
        super().__init__(arms, across)
        self._offsets = offsets
        self._size = size

    def close(self, solved: LinkState) -> PRPPose:
        """Append r1 and r2."""
        x = solved.coordinates
        (i, j), (h1, h2) = self.arms, self._offsets
        across = unit_vector(x[j] - x[i]) * self._across
        sine, cosine = across.imag, across.real
        if abs(sine) <= ROUNDING:
            gap = abs(h1 * cosine - h2)
            far = gap > ROUNDING * self._size
            status = Status.OPEN if far else Status.INDETERMINATE
            return PRPPose(status, gap if far else 0.0, 0.0, 0.0, across)
        first, second = (h1 * cosine - h2) / sine, (h1 - h2 * cosine) / sine
        x.append(first)
        x.append(second)
        return PRPPose(Status.CLOSED, 0.0, first, second, across)

    def rates(self, pose: PRPPose, _solved: LinkState, velocities: LinkState) -> float:
        """Append their rates; return δ̇/sin δ."""
        v = velocities.coordinates
        i, j = self.arms
        rate_ratio = (v[j] - v[i]) / pose.across.imag
        v.append(-rate_ratio * pose.second)
        v.append(-rate_ratio * pose.first)
        return rate_ratio

    def accelerations(
        self,
        pose: PRPPose,
        rate_ratio: float,
        _solved: LinkState,
        _velocities: LinkState,
        accelerations: LinkState,
    ) -> None:
        """Append their accelerations."""
        a = accelerations.coordinates
        i, j = self.arms
        first, second, cosine = pose.first, pose.second, pose.across.real
        pull, whirl = (a[j] - a[i]) / pose.across.imag, rate_ratio * rate_ratio
        a.append(whirl * (first + second * cosine) - pull * second)
        a.append(whirl * (second + first * cosine) - pull * first)
