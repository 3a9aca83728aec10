# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The place of a pin in the frame of a line (rail) along which another pin travels.

The line passes E in the direction û on a known link; the frame of the rail has its origin at E and
û for its x axis. If the pin A lies on a link that is pinned, at O, to the link that carries the
rail, its place follows from the angle between the two links (`CrankRail`); otherwise it is
computed from the coordinates (`FreeRail`).
"""

from __future__ import annotations

from cmath import rect
import math
from math import fsum, inf, pi
from typing import NamedTuple, Protocol

from linkage_ros.kinematics.arithmetic import (
    copysign,
    exact_sum,
    make_vector,
    passes_zero,
    phase,
    Root,
    root_of,
    signed_root,
    unit_vector,
    where,
)
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import LinkState, Span


class PinOnRail(NamedTuple):
    """The pin A in the frame of the rail."""

    place: complex  # (x + i·y), in the unit of the lengths
    # √(b − y) and √(b + y): the distance of a link of length b, from A to the line, from its
    # limits. Signed at a change point; infinite if there is no such link.
    below: float
    above: float
    gap: float  # Length by which A is too far from the line; otherwise 0
    base: float  # Coordinate of the link that carries the rail, in [rad]
    arm: complex  # From O to A in the frame of a `CrankRail`, otherwise 0
    # dy/dψ/(below·above) of a `CrankRail` with a change point, otherwise 0: at the change point
    # dy/dψ and the product are 0, but this is not.
    lean: float
    # Status of the link as far as the rail decides it, except whether it stands across the line.
    status: Status


class Rail(Span, Protocol):
    """The interface of a rail to a dyad."""

    def pin_at(self, solved: LinkState, /) -> PinOnRail:
        """Return the pin in the frame of the rail."""

    def rates(
        self, pin_on_rail: PinOnRail, solved: LinkState, velocities: LinkState, /
    ) -> tuple[complex, float]:
        """Return the pin's velocity in that frame, and the rate of the frame, in [rad/s]."""

    def accelerations(
        self,
        pin_on_rail: PinOnRail,
        rates: tuple[complex, float],
        solved: LinkState,
        velocities: LinkState,
        accelerations: LinkState,
        /,
    ) -> tuple[complex, float]:
        """Return the accelerations of the pin in that frame, and of the frame, in [rad/s²]."""

    def unsigned_link_rate(
        self, pin_on_rail: PinOnRail, rise: float, velocities: LinkState, /
    ) -> float:
        """Return ẏ/(below·above); ``rise`` is ẏ."""

    def unsigned_link_acceleration(
        self,
        pin_on_rail: PinOnRail,
        pin_acceleration: complex,
        link_rate: float,
        velocities: LinkState,
        accelerations: LinkState,
        /,
    ) -> float:
        """Return (ÿ + y·λ̇²)/(below·above) for a link at the rate λ̇."""


class CrankRail:
    """
    A rail on a link to which the link of pin A is pinned at O.

    With a = OA at the angle ψ to the rail, O at (f, e) in the frame of the rail, and a link of
    length b from A to the line, the link stands across the line if b ∓ y = 0. There the form with
    the smaller terms is used, with η = π/4 − ψ/2::

        b − y = (b − e − a) + 2a·sin²η        b + y = (b + e − a) + 2a·cos²η

    The brackets are constants of the linkage. If one is zero, the root has the sign of its sine or
    cosine, and passes the change point with it; so does dy/dψ = a·cos ψ = 2a·sin η·cos η.

    ``arm`` is OA in the frame of the rail, if the difference of the two coordinates is 0;
    ``pivot`` is O in that frame. ``link`` is b, infinite if A has no link to the line. ``arms``
    are the indices, among the coordinates, of the angles of the link of A and of the rail's link.
    """

    __slots__ = (
        '_above', '_arm', '_below', '_changes_over', '_half_turn', '_length', '_link', '_pivot',
        '_products', '_root_length', 'arms',
    )  # fmt: skip

    _at_change_point = Status.CHANGE_POINT

    def __init__(self, arm: complex, pivot: complex, link: float, arms: tuple[int, int]) -> None:
        a = abs(arm)
        below, above = (
            (inf, inf)
            if link == inf
            else (exact_sum(link, side, -a) for side in (-pivot.imag, pivot.imag))
        )
        self._length, self._pivot = a, pivot
        self._below, self._above = below, above
        self._root_length = math.sqrt(2.0 * a)
        self._changes_over = not (below and above)
        # For `unsigned_link_acceleration`: these sums would cancel for a short crank and a long
        # link.
        self._products = (
            (0.0, 0.0)
            if link == inf
            else (below * fsum((a, link, -pivot.imag)), above * fsum((a, link, pivot.imag)))
        )
        self._arm = arm
        self._half_turn = rect(1.0, 0.25 * pi - 0.5 * phase(arm))
        self._link = link
        self.arms = arms

    @property
    def crosses(self) -> tuple[bool, bool]:
        """Whether the link changes its side where it stands across the line, on either side."""
        return self._below == 0.0, self._above == 0.0

    @property
    def singular_angles(self) -> tuple[float, ...]:
        """Differences of the two coordinates at which all links lie across the line, in [rad]."""
        across = ((self._below, 0.5 * pi), (self._above, -0.5 * pi))
        return tuple(psi - phase(self._arm) for bracket, psi in across if bracket == 0.0)

    def pin_at(self, solved: LinkState) -> PinOnRail:
        first, second = self.arms
        base = solved.coordinates[second]
        swing = solved.coordinates[first] - base
        arm = unit_vector(swing) * self._arm
        place = self._pivot + arm
        if self._link == inf:
            return PinOnRail(place, inf, inf, 0.0, base, arm, 0.0, Status.CLOSED)
        eta = unit_vector(-0.5 * swing) * self._half_turn
        sine, cosine = eta.imag, eta.real
        part, other_part = self._root_length * sine, self._root_length * cosine
        square, other_square = (2.0 * self._length * side * side for side in (sine, cosine))
        below, above = self._limit_root(self._below, part, square, -place.imag), Root(0.0)
        if below.status is not Status.OPEN:
            above = self._limit_root(self._above, other_part, other_square, place.imag)
        if Status.OPEN in (below.status, above.status):
            gap = below.missing + above.missing
            return PinOnRail(place, 0.0, 0.0, gap, base, arm, 0.0, Status.OPEN)
        lean, status = 0.0, Status.CLOSED
        if self._changes_over:
            # ẏ and the root are 0 together: computed in two forms, the zeros would not cancel.
            arm = make_vector(2.0 * self._length * sine * cosine, arm.imag)
            lean = 1.0
            if self._above:
                lean = 0.0 if above.status is Status.TOGGLE else other_part / above.root
            elif self._below:
                lean = 0.0 if below.status is Status.TOGGLE else part / below.root
            if (not self._below and passes_zero(sine, 0.5 * swing)) or (
                not self._above and passes_zero(cosine, 0.5 * swing)
            ):
                status = self._at_change_point
        return PinOnRail(place, below.root, above.root, 0.0, base, arm, lean, status)

    def _limit_root(self, bracket: float, part: float, square: float, side: float) -> Root:
        """Return the root of the link's length minus the distance it has to reach."""
        if bracket == 0.0:
            return signed_root(bracket, part, square)
        size = self._link + abs(side)
        # The square has more rounding errors than the side: if as great, it is not better.
        shorter = 4.0 * (abs(bracket) + square) < size
        return root_of(
            where(shorter, bracket + square, self._link + side),
            where(shorter, abs(bracket) + square, size),
        )

    def rates(
        self, pin_on_rail: PinOnRail, _solved: LinkState, velocities: LinkState
    ) -> tuple[complex, float]:
        first, second = self.arms
        turn, arm = velocities.coordinates[second], pin_on_rail.arm
        swing = velocities.coordinates[first] - turn
        return 1j * (swing * arm.real) - swing * arm.imag, turn

    def accelerations(
        self,
        pin_on_rail: PinOnRail,
        _rates: tuple[complex, float],
        _solved: LinkState,
        velocities: LinkState,
        accelerations: LinkState,
    ) -> tuple[complex, float]:
        first, second = self.arms
        swing = velocities.coordinates[first] - velocities.coordinates[second]
        change = accelerations.coordinates[second]
        swing_change = accelerations.coordinates[first] - change
        return (1j * swing_change - swing * swing) * pin_on_rail.arm, change

    def unsigned_link_rate(
        self, pin_on_rail: PinOnRail, rise: float, velocities: LinkState
    ) -> float:
        if not self._changes_over:
            return rise / (pin_on_rail.below * pin_on_rail.above)
        first, second = self.arms
        return (velocities.coordinates[first] - velocities.coordinates[second]) * pin_on_rail.lean

    def unsigned_link_acceleration(
        self,
        pin_on_rail: PinOnRail,
        _pin_acceleration: complex,
        link_rate: float,
        velocities: LinkState,
        accelerations: LinkState,
    ) -> float:
        """
        Return (ÿ + y·λ̇²)/(below·above).

        Its two terms cancel at a change point. Their part with ψ̇² is also::

            (e·(b − y)² − y·(b − e − a)·(a + b − e))/w²
              = (e·(b + y)² − y·(b + e − a)·(a + b + e))/w²

        where the brackets b ∓ e − a are constants of the linkage. The form with the smaller terms
        is used; with a change point, the form whose bracket is 0, the only one that does not
        cancel.
        """
        first, second = self.arms
        swing = velocities.coordinates[first] - velocities.coordinates[second]
        change = accelerations.coordinates[first] - accelerations.coordinates[second]
        e, y, below, above = (
            self._pivot.imag,
            pin_on_rail.place.imag,
            pin_on_rail.below,
            pin_on_rail.above,
        )
        if self._changes_over:
            bent = 0.0
            if self._below:
                bent = e * above / below**3
            elif self._above:
                bent = e * below / above**3
            return change * pin_on_rail.lean + swing * swing * bent
        left_of_line = y > 0.0
        term = e * where(left_of_line, below, above) ** 4
        other_term = y * where(left_of_line, *self._products)
        part, other_part = -swing * swing * pin_on_rail.arm.imag, y * link_rate * link_rate
        along = below * above
        square = (swing / along) ** 2
        rest = where(
            (abs(term) + abs(other_term)) * square < abs(part) + abs(other_part),
            (term - other_term) * square,
            part + other_part,
        )
        return (change * pin_on_rail.arm.real + rest) / along


class UnsignedRail(CrankRail):
    """A `CrankRail` whose angle is known only modulo a turn; see `UnsignedDiagonal`."""

    __slots__ = ()

    _at_change_point = Status.TOGGLE

    @property
    def crosses(self) -> tuple[bool, bool]:
        return False, False

    def pin_at(self, solved: LinkState) -> PinOnRail:
        signed = super().pin_at(solved)
        lean = where((signed.below < 0.0) != (signed.above < 0.0), -signed.lean, signed.lean)
        return signed._replace(below=abs(signed.below), above=abs(signed.above), lean=lean)


class NearlyCrossingRail(CrankRail):
    """
    A `CrankRail` whose lengths nearly make a change point; see `NearlyCrossingDiagonal`.

    ``crosses``: whether the link without deviations changes its side across the line, on either
    side.
    """

    __slots__ = ('_crosses',)

    def __init__(
        self,
        arm: complex,
        pivot: complex,
        link: float,
        arms: tuple[int, int],
        crosses: tuple[bool, bool],
    ) -> None:
        super().__init__(arm, pivot, link, arms)
        self._crosses = crosses

    @property
    def crosses(self) -> tuple[bool, bool]:
        return self._crosses

    def pin_at(self, solved: LinkState) -> PinOnRail:
        pin = super().pin_at(solved)
        first, second = self.arms
        swing = solved.coordinates[first] - solved.coordinates[second]
        eta = unit_vector(-0.5 * swing) * self._half_turn
        below, above, lean = pin.below, pin.above, pin.lean
        if self._crosses[0]:
            below = copysign(below, eta.imag)
        if self._crosses[1]:
            above = copysign(above, eta.real)
        if all(self._crosses):
            lean = abs(lean)
        return pin._replace(below=below, above=above, lean=lean)


class FreeRail:
    """
    A rail and a pin, computed from their coordinates.

    ``ends`` are the indices of E and A among the pins. ``link`` is b, the length of a link from A
    to the line, infinite if there is none. ``arm`` is the index, among the coordinates, of the
    angle of the link that carries the rail, and ``unit`` the direction of the line at a coordinate
    of 0.
    """

    __slots__ = ('_arm', '_back', '_ends', '_link')

    arms, crosses, singular_angles = (), (False, False), ()

    def __init__(self, ends: tuple[int, int], link: float, arm: int, unit: complex) -> None:
        self._ends = ends
        self._link = link
        self._arm = arm
        self._back = unit.conjugate()

    def pin_at(self, solved: LinkState) -> PinOnRail:
        base = solved.coordinates[self._arm]
        start, end = (solved.pins[i] for i in self._ends)
        place = (end - start) * (unit_vector(-base) * self._back)
        link = self._link
        if link == inf:
            return PinOnRail(place, inf, inf, 0.0, base, 0j, 0.0, Status.CLOSED)
        size = abs(start) + abs(end) + link
        below, above = root_of(link - place.imag, size), Root(0.0)
        if below.status is not Status.OPEN:
            above = root_of(link + place.imag, size)
        gap = below.missing + above.missing
        is_open = Status.OPEN in (below.status, above.status)
        status = Status.OPEN if is_open else Status.CLOSED
        return PinOnRail(place, below.root, above.root, gap, base, 0j, 0.0, status)

    def rates(
        self, pin_on_rail: PinOnRail, _solved: LinkState, velocities: LinkState
    ) -> tuple[complex, float]:
        start, end = (velocities.pins[i] for i in self._ends)
        turn = velocities.coordinates[self._arm]
        back = unit_vector(-pin_on_rail.base) * self._back
        return (end - start) * back - 1j * turn * pin_on_rail.place, turn

    def accelerations(
        self,
        pin_on_rail: PinOnRail,
        rates: tuple[complex, float],
        _solved: LinkState,
        _velocities: LinkState,
        accelerations: LinkState,
    ) -> tuple[complex, float]:
        start, end = (accelerations.pins[i] for i in self._ends)
        velocity, turn = rates
        change = accelerations.coordinates[self._arm]
        back = unit_vector(-pin_on_rail.base) * self._back
        # Coriolis, Euler and centrifugal terms of a frame that turns.
        apparent = 2j * turn * velocity + (1j * change - turn * turn) * pin_on_rail.place
        return (end - start) * back - apparent, change

    def unsigned_link_rate(
        self, pin_on_rail: PinOnRail, rise: float, _velocities: LinkState
    ) -> float:
        return rise / (pin_on_rail.below * pin_on_rail.above)

    def unsigned_link_acceleration(
        self,
        pin_on_rail: PinOnRail,
        pin_acceleration: complex,
        link_rate: float,
        _velocities: LinkState,
        _accelerations: LinkState,
    ) -> float:
        across = pin_acceleration.imag + pin_on_rail.place.imag * link_rate * link_rate
        return across / (pin_on_rail.below * pin_on_rail.above)
