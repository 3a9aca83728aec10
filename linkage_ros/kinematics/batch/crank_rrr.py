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
RRR over arrays, on two links that are pinned together: a four-bar, a million states at once.

As `RRRDyad` over a `CrankDiagonal`, of whose roots this takes products of two, and of squares and
products the halves; p and q as there, doubled. With X = s² − lower², Y = upper² − s², D = b² − c²
and M, N the diagonal's brackets::

    K = σ·√(X·Y)        r = q/K

    ω3 = r·(D − s²) − p        α3 = E·(D − s²) + q·(d² − a²)/s² − 2qr·D
    ω4 = r·(D + s²) − p        α4 = E·(D + s²) + q·(d² − a²)/s² − 2qr·D
    E  = (M·far²/X − N·near²/Y)/(4s²·K)

An array costs as much to pass over as the arithmetic in the pass. Hence blocks that stay in the
cache, ``out=`` throughout, one tangent of φ/4 in place of a sine and a cosine, and masks only in
blocks where a state is not closed.
"""

from __future__ import annotations

from math import sqrt
from operator import attrgetter
from typing import NamedTuple, TypeAlias

from linkage_ros.kinematics.batch.arrays import (
    Array,
    Block,
    CLOSED,
    Codes,
    INDETERMINATE,
    OPEN,
    sine_cosine,
    TOGGLE,
)
from linkage_ros.kinematics.crank_diagonal import CrankDiagonal
from linkage_ros.kinematics.dyads.rrr import RRRDyad
from linkage_ros.kinematics.rounding import ROUNDING, SMALLEST
import numpy as np

Pair: TypeAlias = tuple[Array, Array]


class Scratch(NamedTuple):
    """
    What a block is worked out in, named by what it holds first.

    Attributes
    ----------
    near, far, s, x, y, cross
        ½·near², ½·far², ½·s², ½·X, ½·Y, ½·K.
    plus, minus
        ½·(D + s²), ½·(D − s²).
    turn
        −dir(AD), from OD.
    p, q, r
        2p, 2q, 4r.
    first, second
        2ω3 and 2ω4, against OD and at a rate of φ of 1.

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


ROWS = len(Scratch._fields)
"""Rows of scratch that a block needs."""


class CrankRRRArrays:
    """
    Two links pinned together, on two links that are.

    Parameters
    ----------
    dyad
        The same for one state; its diagonal is a `CrankDiagonal`.

    """

    __slots__ = (
        '_arms',
        '_assembly',
        '_constants',
        '_diagonal',
        '_lost',
        '_pair',
        '_span',
        '_tolerance',
    )

    def __init__(self, dyad: RRRDyad) -> None:
        diagonal = dyad.diagonal
        assert isinstance(diagonal, CrankDiagonal)
        (more, less), sign, difference = attrgetter('_sums', '_sign', '_difference')(dyad)
        *_, short_pair, whole = attrgetter('_constants')(diagonal)
        fold, stretch = diagonal.brackets
        a, d = diagonal.sides
        self._arms = diagonal.arms
        self._assembly = sign
        self._diagonal = diagonal
        # Beside a long crank and ground, Y = whole − near² is what cancels less.
        self._pair = 0.5 * whole if short_pair else 0.0
        self._constants = (
            a, d, diagonal.root / sqrt(2.0),
            0.5 * fold, 0.5 * stretch, 0.5 * more, 0.5 * less, 0.5 * difference,
        )  # fmt: skip
        self._span = 0.5 * diagonal.limits[2]
        self._lost = OPEN if diagonal.limits[0] else INDETERMINATE
        # A state whose X·Y is above this is further inside its limits than any rounding goes.
        sizes = [2.0 * a * d + 0.5 * abs(bracket) for bracket in (fold, stretch)]
        self._tolerance = 8.0 * ROUNDING * sizes[0] * sizes[1]

    @staticmethod
    def fits(dyad: RRRDyad) -> bool:
        """Return whether it solves a dyad: one without a change point."""
        return isinstance(dyad.diagonal, CrankDiagonal) and all(dyad.diagonal.brackets)

    def solve(self, block: Block) -> None:
        """Append the directions of both links, and what is asked for of their motion."""
        i, j, _ = self._arms
        x = block.known[0]
        # Of links that never turn there is one number for all states.
        phi = np.atleast_1d(x[i] - x[j] if j else x[i])
        count = len(phi)
        w = Scratch(*block.scratch[:, :count])
        self._triangle(phi, w)
        if w.cross.min() > self._tolerance:
            np.sqrt(w.cross, out=w.cross)
            if self._assembly < 0.0:
                np.negative(w.cross, out=w.cross)
        else:
            block.note(self._judge(w))
        out = _room(block, 0, x)
        self._angles(out, w)
        self._append(x, out)
        if block.speeds is None:
            return
        self._rates(w)
        v = block.speeds[0]
        swing = v[i] - v[j] if j else v[i]
        out = _room(block, 1, v)
        for one, into in zip((w.first, w.second), out, strict=True):
            np.multiply(one, 0.5 * swing, out=into)
        self._append(v, out)
        if block.changes is None:
            return
        a = block.changes[0]
        pull = a[i] - a[j] if j else a[i]
        out = _room(block, 2, a)
        self._accelerations(swing, pull, out, w)
        self._append(a, out)

    def _append(self, values: list[Array], out: Pair) -> None:
        """Append what is measured from OD."""
        _, j, _ = self._arms
        for one in out:
            if j:
                np.add(one, values[j], out=one)
            values.append(one)

    def _triangle(self, phi: Array, w: Scratch) -> None:
        """Find the squares, and ¼·K² as cross."""
        _, _, root, fold, stretch, more, less, _ = self._constants
        near, far = w.x, w.y
        sine_cosine(phi, near, far, w.p, 0.5)
        np.multiply(near, 2.0 * root, out=near)
        np.multiply(far, root, out=far)
        if self._arms[2]:
            self._turn(w)
        np.multiply(near, far, out=w.q)
        np.multiply(near, near, out=w.near)
        np.multiply(far, far, out=w.far)

        np.add(w.near, 0.5 * float(self._diagonal.least), out=w.s)
        np.add(w.near, more, out=w.plus)
        np.subtract(less, w.near, out=w.minus)
        np.add(w.near, fold, out=w.x)
        if self._pair:
            np.subtract(self._pair, w.near, out=w.y)
        else:
            np.add(w.far, stretch, out=w.y)
        smaller = w.x < w.y
        np.subtract(self._span, w.x, out=w.y, where=smaller)
        np.subtract(self._span, w.y, out=w.x, where=~smaller)
        np.multiply(w.x, w.y, out=w.cross)

    def _turn(self, w: Scratch) -> None:
        """Turn the roots of near² and far² by half the offset of φ."""
        sine, cosine = self._diagonal.half_turn
        np.multiply(w.x, sine, out=w.p)
        np.multiply(w.y, sine, out=w.q)
        np.multiply(w.x, cosine, out=w.x)
        np.multiply(w.y, cosine, out=w.y)
        np.add(w.x, w.q, out=w.x)
        np.subtract(w.y, w.p, out=w.y)

    def _judge(self, w: Scratch) -> Codes:
        """
        Find ½·K and the status of each state, where not all are far inside their limits.

        The criteria are those of the scalar dyad.
        """
        _, _, _, fold, stretch, *_ = self._constants
        codes: Codes = np.full(len(w.s), CLOSED, np.uint8)
        direct = w.near + fold, self._pair - w.near if self._pair else w.far + stretch
        np.multiply(np.sqrt(np.maximum(w.x, 0.0)), np.sqrt(np.maximum(w.y, 0.0)), out=w.cross)
        np.multiply(w.cross, self._assembly, out=w.cross)
        upper = (self._pair, w.near) if self._pair else (stretch, w.far)
        for total, constant, part in ((direct[0], fold, w.near), (direct[1], *upper)):
            rounding = ROUNDING * (abs(constant) + part)
            codes[total < -rounding] = OPEN
            w.cross[np.abs(total) <= rounding] = 0.0
        w.cross[np.abs(w.cross) < SMALLEST] = 0.0
        codes[(w.cross == 0.0) & (codes == CLOSED)] = TOGGLE
        codes[w.s < 0.5 * SMALLEST] = self._lost
        return codes

    def _angles(self, out: Pair, w: Scratch) -> None:
        """Write θ3 and θ4."""
        a, d, *_ = self._constants
        np.add(w.near, d * (d - a), out=w.turn)
        np.arctan2(w.q, w.turn, out=w.turn)
        for one, side in zip(out, (w.plus, w.minus), strict=True):
            np.arctan2(w.cross, side, out=one)
            np.subtract(one, w.turn, out=one)

    def _rates(self, w: Scratch) -> None:
        """Find p, q, r and twice the rates at a rate of φ of 1."""
        np.subtract(self._diagonal.along, w.near, out=w.p)
        np.divide(w.p, w.s, out=w.p)
        np.divide(w.q, w.s, out=w.q)
        np.divide(w.q, w.cross, out=w.r)
        for product, side in ((w.first, w.minus), (w.second, w.plus)):
            np.multiply(w.r, side, out=product)
            np.subtract(product, w.p, out=product)

    def _accelerations(
        self, rate: Array | float, acceleration: Array | float, out: Pair, w: Scratch
    ) -> None:
        """Write α3 and α4; what the scratch held is used up."""
        a, d, _, fold, stretch, _, _, difference = self._constants
        np.multiply(w.far, 0.5 * fold, out=w.far)
        np.divide(w.far, w.x, out=w.far)
        np.multiply(w.near, 0.5 * stretch, out=w.near)
        np.divide(w.near, w.y, out=w.near)
        np.subtract(w.far, w.near, out=w.far)
        np.divide(w.far, w.s, out=w.far)
        np.divide(w.far, w.cross, out=w.far)

        np.multiply(w.r, difference, out=w.r)
        np.divide(0.5 * (d - a) * (d + a), w.s, out=w.p)
        np.subtract(w.p, w.r, out=w.p)
        np.multiply(w.p, w.q, out=w.p)
        square = 0.5 * rate * rate
        for one, side, into in ((w.first, w.minus, out[0]), (w.second, w.plus, out[1])):
            np.multiply(side, w.far, out=side)
            np.add(side, w.p, out=side)
            np.multiply(side, square, out=into)
            if isinstance(acceleration, np.ndarray) or acceleration:
                np.multiply(one, 0.5 * acceleration, out=one)
                np.add(into, one, out=into)


def _room(block: Block, derivative: int, values: list[Array]) -> Pair:
    """Return where two coordinates go, or derivatives of them, that are appended to values."""
    first = len(values)
    return block.room(derivative, first), block.room(derivative, first + 1)
