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
The crank-driven RRR dyad over arrays of crank directions: a four-bar, a million states at once.

Where the scalar dyad (`dyads.rrr`) takes the roots of what the triangle's sides fail to cancel,
this takes products of two of them. φ enters by its half angle, the lengths by constants that
cancel once and for all::

    near² = 4ad·sin²(φ/2)        s² = near² + (d − a)²
    far²  = 4ad·cos²(φ/2)        D  = b² − c²
    X = s² − (b − c)² = near² + M        M = (d − a)² − (b − c)²
    Y = (b + c)² − s² = far² + N         N = (b + c)² − (a + d)²
    K = σ·√(X·Y)                         twice AB × DB

    θ3 = dir(AD) + atan2(K, D + s²)      cot(σ·β)  = (D + s²)/K
    θ4 = dir(AD) + atan2(K, D − s²)      cot(σ·γ') = (D − s²)/K

At a crank rate of 1, with p and q as in `diagonal` and r = q/K::

    ω3 = r·(D − s²) − p        α3 = E·(D − s²) + q·(1 + 2p − 2r·D)
    ω4 = r·(D + s²) − p        α4 = E·(D + s²) + q·(1 + 2p − 2r·D)
    E  = ad/(s²·K)·(cos²(φ/2)·M/X − sin²(φ/2)·N/Y)

E is ṙ + 2qr. Differentiated term by term, ln r = ln q − ½·ln X − ½·ln Y has poles at φ = 0 and π
that cancel; here they are cancelled in writing, so that none has to be in numbers. At a change
point M or N is 0, and its whole term with it: accelerations keep their digits there, too.

An array costs as much to pass over as the arithmetic in the pass. Hence blocks that stay in the
cache, ``out=`` throughout, one tangent of φ/4 in place of a sine and a cosine, and masks only in
blocks where a state is not closed. All squares and products above are kept halved, p and q
doubled: that saves passes.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import frexp, fsum, inf, ldexp, nan, sqrt, tan
from typing import NamedTuple, TypeAlias

from linkage_ros.kinematics.diagonal import margin, SMALLEST, UNIT_ROUNDOFF
from linkage_ros.kinematics.status import Status
import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Codes: TypeAlias = NDArray[np.uint8]
Rows: TypeAlias = Sequence[Array] | NDArray[np.float64]

BLOCK = 8192
"""States of a block."""

CODES = {status: code for code, status in enumerate(Status)}
"""How an array says a status: closed is 0."""

_CLOSED, _TOGGLE = CODES[Status.CLOSED], CODES[Status.TOGGLE]
_OPEN, _INDETERMINATE = CODES[Status.OPEN], CODES[Status.INDETERMINATE]

_ROUNDING = 16.0 * UNIT_ROUNDOFF
"""What is smaller, as a part of its two terms, is a toggle: as for the scalar dyad."""


def _tangent_is_close() -> bool:
    """
    Return whether numpy's tangent is right to its last digit, here.

    Of the vectorised ones some are 3 ulp off; sine and cosine, which take longer, never are.
    """
    angles = np.linspace(-1.5, 1.5, 1000)
    return all(
        abs(found - exact) <= 2.5 * UNIT_ROUNDOFF * abs(exact)
        for found, exact in zip(np.tan(angles).tolist(), map(tan, angles.tolist()), strict=True)
    )


_BY_TANGENT = _tangent_is_close()


class Scratch(NamedTuple):
    """
    What a block is worked out in, named by what it holds first.

    Attributes
    ----------
    near, far, s, x, y, cross
        ½·near², ½·far², ½·s², ½·X, ½·Y, ½·K. At a change point x or y is the signed root.
    plus, minus
        ½·(D + s²), ½·(D − s²).
    turn
        −dir(AD).
    p, q, r
        2p, 2q, 4r.
    first, second
        2ω3 and 2ω4 at a crank rate of 1.

    """

    near: Array
    far: Array
    s: Array
    x: Array
    y: Array
    cross: Array
    plus: Array
    minus: Array
    turn: Array
    p: Array
    q: Array
    r: Array
    first: Array
    second: Array

    @classmethod
    def of(cls, states: int) -> Scratch:
        """Make it for so many states."""
        return cls(*np.empty((len(cls._fields), states)))


class RRRBatch:
    """
    The dyad of a four-bar, for arrays.

    Parameters
    ----------
    a, b, c, d
        Lengths of crank, coupler, rocker and ground, in one unit.
    sign
        The assembly: +1 where B lies left of A→D, −1 where it lies right of it. In a change-point
        linkage: for 0 < φ < π.
    margins
        |d − a| − |b − c| and b + c − a − d, 0 where they are meant to be 0; if None, they are what
        `margin` makes of the lengths.

    """

    __slots__ = (
        '_assembly', '_fold', '_lengths', '_pair', '_squares', '_stretch', '_tolerance', 'margins',
    )  # fmt: skip

    def __init__(
        self,
        a: float,
        b: float,
        c: float,
        d: float,
        sign: int,
        margins: tuple[float, float] | None = None,
    ) -> None:
        if margins is None:
            margins = (margin(max(a, d), -min(a, d), -max(b, c), min(b, c)), margin(b, c, -a, -d))
        self.margins = margins
        # Angles and their rates have no unit: scaled by a power of two, nothing overflows.
        exponent = -frexp(max(a, b, c, d))[1]
        a, b, c, d, fold, stretch = (ldexp(x, exponent) for x in (a, b, c, d, *margins))
        self._assembly = float(sign)
        self._lengths = (a, b, c, d)
        self._fold = fold
        self._stretch = stretch
        # Beside a long crank and ground, Y = (b + c)² − (d − a)² − near² is what cancels less.
        self._pair = fsum((b, c, -max(a, d), min(a, d))) if a + d > 2.0 * (b + c) else 0.0
        fold_square = 0.5 * fold * (abs(d - a) + abs(b - c))
        stretch_square = 0.5 * stretch * fsum((a, b, c, d))
        pair_square = 0.5 * self._pair * (b + c + abs(d - a))
        self._squares = (fold_square, stretch_square, pair_square)
        # A state whose X·Y is above this is further inside its limits than any rounding goes.
        sizes = [2.0 * a * d + abs(square) for square in (fold_square, stretch_square)]
        self._tolerance = 8.0 * _ROUNDING * sizes[0] * sizes[1] if fold and stretch else inf

    def solve(
        self,
        phi: Array,
        rate: float | Array = 1.0,
        acceleration: float | Array = 0.0,
        out_position: Rows | None = None,
        out_velocity: Rows | None = None,
        out_acceleration: Rows | None = None,
    ) -> Codes:
        """
        Solve all states, block by block, and return the status of each, as `CODES` has it.

        Parameters
        ----------
        phi
            Directions of the crank in the frame of the loop, in [rad]. One that is not a finite
            number is indeterminate.
        rate, acceleration
            The crank's, in [rad/s] and [rad/s²]: one for all states, or one for each.
        out_position, out_velocity, out_acceleration
            Where θ3 and θ4 go, their rates and their accelerations: two rows each, of as many
            states as ``phi`` has. What is None is not worked out. NaN stands where there is
            nothing: in all of a state that is open or indeterminate, and in the rate and the
            acceleration of one at a toggle.

        """
        count = phi.shape[0]
        status = np.empty(count, np.uint8)
        scratch = Scratch.of(min(count, BLOCK))
        outs = (out_position, out_velocity, out_acceleration)
        with np.errstate(all='ignore'):
            for start in range(0, count, BLOCK):
                part = slice(start, start + BLOCK)
                position, velocity, accelerations = (
                    None if out is None else (out[0][part], out[1][part]) for out in outs
                )
                self.block(
                    phi[part],
                    rate[part] if isinstance(rate, np.ndarray) else rate,
                    acceleration[part] if isinstance(acceleration, np.ndarray) else acceleration,
                    position,
                    velocity,
                    accelerations,
                    status[part],
                    scratch,
                )
        return status

    def block(
        self,
        phi: Array,
        rate: float | Array,
        acceleration: float | Array,
        out_position: Rows | None,
        out_velocity: Rows | None,
        out_acceleration: Rows | None,
        status: Codes,
        scratch: Scratch,
    ) -> None:
        """
        Solve the states of one block, as `solve` does; the caller has numpy's warnings off.

        Parameters
        ----------
        phi, rate, acceleration, out_position, out_velocity, out_acceleration
            As for `solve`.
        status
            Where the status goes.
        scratch
            For as many states or more.

        """
        w = scratch
        if phi.shape[0] < w.s.shape[0]:
            w = Scratch(*(row[: phi.shape[0]] for row in w))
        self._triangle(phi, w)
        if w.cross.min() > self._tolerance:
            np.sqrt(w.cross, out=w.cross)
            if self._assembly < 0.0:
                np.negative(w.cross, out=w.cross)
            status.fill(_CLOSED)
            closed = True
        else:
            closed = self._judge(phi, status, w)

        if out_position is not None:
            self._angles(out_position, w)
        if out_velocity is not None or out_acceleration is not None:
            self._rates(w)
        if out_velocity is not None:
            for one, out in zip((w.first, w.second), out_velocity, strict=True):
                np.multiply(one, 0.5 * rate, out=out)
        if out_acceleration is not None:
            self._accelerations(rate, acceleration, out_acceleration, w)

        if not closed:
            for outs, last in (
                (out_position, _TOGGLE), (out_velocity, _CLOSED), (out_acceleration, _CLOSED)
            ):  # fmt: skip
                for out in outs or ():
                    np.copyto(out, nan, where=status > last)

    def _triangle(self, phi: Array, w: Scratch) -> None:
        """Find the squares, and ¼·K² as cross."""
        a, b, c, d = self._lengths
        fold_square, stretch_square, pair_square = self._squares
        sine, cosine = w.near, w.far
        _half_angle(phi, sine, cosine, w.p)
        if not self._stretch:
            # A change point at half a turn, where the tangent leaves no digits of the cosine.
            np.multiply(phi, 0.5, out=cosine)
            np.cos(cosine, out=cosine)
            np.multiply(cosine, sqrt(2.0 * a * d), out=w.y)
        np.multiply(sine, cosine, out=w.q)
        np.multiply(w.q, 4.0 * a * d, out=w.q)
        if not self._fold:
            np.multiply(sine, sqrt(8.0 * a * d), out=w.x)
        np.multiply(sine, sine, out=w.near)
        np.multiply(w.near, 8.0 * a * d, out=w.near)
        np.multiply(cosine, cosine, out=w.far)
        np.multiply(w.far, 2.0 * a * d, out=w.far)

        np.add(w.near, 0.5 * (d - a) * (d - a), out=w.s)
        np.add(w.s, 0.5 * (b - c) * (b + c), out=w.plus)
        np.subtract(0.5 * (b - c) * (b + c), w.s, out=w.minus)
        if self._fold:
            np.add(w.near, fold_square, out=w.x)
        if self._pair:
            np.subtract(pair_square, w.near, out=w.y)
        elif self._stretch:
            np.add(w.far, stretch_square, out=w.y)
        np.multiply(w.x, w.y, out=w.cross)

    def _judge(self, phi: Array, status: Codes, w: Scratch) -> bool:
        """
        Find ½·K and the status of each state, where not all are far inside their limits.

        The criteria are those of the scalar dyad. Return whether all are closed.
        """
        a, _, _, d = self._lengths
        s = np.sqrt(2.0 * w.s)
        status.fill(_CLOSED)
        root_x, root_y = self._roots(w)
        np.multiply(root_x, root_y, out=w.cross)
        np.multiply(w.cross, self._assembly, out=w.cross)
        reaches = []
        if self._fold:
            reaches.append((self._fold, 2.0 * w.near / (s + abs(d - a))))
        if self._pair:
            reaches.append((self._pair, -2.0 * w.near / (s + abs(d - a))))
        elif self._stretch:
            reaches.append((self._stretch, 2.0 * w.far / (s + (a + d))))
        for constant, part in reaches:
            total, rounding = constant + part, _ROUNDING * (abs(constant) + np.abs(part))
            status[total < -rounding] = _OPEN
            # Times 0, since its sign says the side.
            w.cross[np.abs(total) <= rounding] *= 0.0
        w.cross[np.abs(w.cross) < SMALLEST] *= 0.0
        status[(w.cross == 0.0) & (status == _CLOSED)] = _TOGGLE
        status[w.s < SMALLEST] = _OPEN if self._fold < 0.0 else _INDETERMINATE
        status[~np.isfinite(phi)] = _INDETERMINATE
        return not status.any()

    def _roots(self, w: Scratch) -> tuple[Array, Array]:
        """Return √(½·X) and √(½·Y), signed at a change point; 0 where open."""
        root_x = np.sqrt(np.maximum(w.x, 0.0)) if self._fold else w.x
        root_y = np.sqrt(np.maximum(w.y, 0.0)) if self._stretch else w.y
        return root_x, root_y

    def _angles(self, out: Rows, w: Scratch) -> None:
        """Write θ3 and θ4."""
        a, b, c, d = self._lengths
        first, second = out
        np.add(w.near, d * (d - a), out=w.turn)
        np.arctan2(w.q, w.turn, out=w.turn)
        if self._fold and self._stretch:
            np.arctan2(w.cross, w.plus, out=first)
            np.arctan2(w.cross, w.minus, out=second)
        else:
            # By half angles, as the scalar dyad: they go on steadily through a change point.
            s = np.sqrt(2.0 * w.s)
            root_x, root_y = self._roots(w)
            wide, perimeter = s + abs(b - c), s + (b + c)
            if b >= c:
                np.arctan2(root_x * root_y, 0.5 * perimeter * wide, out=first)
                np.arctan2(perimeter * root_x, wide * root_y, out=second)
            else:
                np.arctan2(wide * root_y, perimeter * root_x, out=first)
                np.arctan2(0.5 * perimeter * wide, root_x * root_y, out=second)
            np.multiply(first, 2.0 * self._assembly, out=first)
            np.multiply(second, 2.0 * self._assembly, out=second)
        np.subtract(first, w.turn, out=first)
        np.subtract(second, w.turn, out=second)

    def _rates(self, w: Scratch) -> None:
        """Find p, q, r and twice the rates at a crank rate of 1."""
        a, _, _, d = self._lengths
        np.subtract(a * (d - a), w.near, out=w.p)
        np.divide(w.p, w.s, out=w.p)
        np.divide(w.q, w.s, out=w.q)
        np.divide(w.q, w.cross, out=w.r)
        np.multiply(w.r, w.minus, out=w.first)
        np.subtract(w.first, w.p, out=w.first)
        np.multiply(w.r, w.plus, out=w.second)
        np.subtract(w.second, w.p, out=w.second)

    def _accelerations(
        self, rate: float | Array, acceleration: float | Array, out: Rows, w: Scratch
    ) -> None:
        """Write α3 and α4; what the scratch held is used up."""
        _, b, c, _ = self._lengths
        fold_square, stretch_square, _ = self._squares
        if self._fold:
            np.multiply(w.far, 0.5 * fold_square, out=w.far)
            np.divide(w.far, w.x, out=w.far)
        else:
            w.far.fill(0.0)
        if self._stretch:
            np.multiply(w.near, 0.5 * stretch_square, out=w.near)
            np.divide(w.near, w.y, out=w.near)
            np.subtract(w.far, w.near, out=w.far)
        np.divide(w.far, w.s, out=w.far)
        np.divide(w.far, w.cross, out=w.far)

        np.multiply(w.r, 0.5 * (b - c) * (b + c), out=w.r)
        np.subtract(w.p, w.r, out=w.p)
        np.add(w.p, 1.0, out=w.p)
        np.multiply(w.p, w.q, out=w.p)
        for product, one, into in ((w.minus, w.first, out[0]), (w.plus, w.second, out[1])):
            np.multiply(product, w.far, out=product)
            np.add(product, w.p, out=product)
            np.multiply(product, 0.5 * rate * rate, out=into)
            if isinstance(acceleration, np.ndarray) or acceleration:
                np.multiply(one, 0.5 * acceleration, out=one)
                np.add(into, one, out=into)


def _half_angle(phi: Array, sine: Array, cosine: Array, spare: Array) -> None:
    """Write ½·sin(φ/2) and cos(φ/2)."""
    if _BY_TANGENT:
        # With t = tan(φ/4): t/(1 + t²) and (1 − t²)/(1 + t²).
        np.multiply(phi, 0.25, out=spare)
        np.tan(spare, out=spare)
        np.multiply(spare, spare, out=cosine)
        np.add(cosine, 1.0, out=sine)
        np.subtract(1.0, cosine, out=cosine)
        np.divide(cosine, sine, out=cosine)
        np.divide(spare, sine, out=sine)
    else:
        np.multiply(phi, 0.5, out=spare)
        np.cos(spare, out=cosine)
        np.sin(spare, out=sine)
        np.multiply(sine, 0.5, out=sine)
