# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A linkage as equations: pins coincide, points lie on lines, blocks keep angles, inputs are driven.

The unknowns are the angle and the position of the frame of every moving link. Nothing is
eliminated, and there are no dyads or sides: the equations hold in every assembly. Many states are
evaluated at once, in numpy's longest floats; linear systems are solved in doubles and refined.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from linkage_ros.kinematics import GROUND, Linkage, RevoluteJoint
import numpy as np
import numpy.typing as npt

Real = np.longdouble
"""Mantissa of 64 bits on x86-64, 113 on aarch64; if only 53, the campaign finds less."""

Complex = np.clongdouble
Array = npt.NDArray[Any]

TURN = 2 * np.arctan2(Real(0), Real(-1))

UNIT_ROUNDOFF = 2.0**-53
_REFINEMENTS = 3
_SMALL = 2.0**-6
"""Least size of a term, relative to the linkage: its other terms are larger."""

_STEP = 2.0**-40
_SAMPLES = 5


class _Spot(NamedTuple):
    """A point of a link: the number of the link (−1: the ground), and its place in its frame."""

    link: int
    place: Array


class _Moved(NamedTuple):
    """A point in the frame of the ground, and the vector to it from the origin of its link."""

    place: Array
    arm: Array
    link: int


class Motion(NamedTuple):
    """States of a linkage, in columns."""

    unknowns: Array  # (n, N): angle [rad] and position [m] of each moving link in turn
    # (n, N), their time derivatives.
    rates: Array
    accelerations: Array
    # Three arrays (joints, N): values of the published joints and their derivatives.
    joints: tuple[Array, Array, Array]


class Equations:
    """
    The equations of a linkage.

    To ``vary`` its numbers, a function returns the factors of one number, a state each.
    """

    def __init__(self, linkage: Linkage, vary: Any = None) -> None:
        self.linkage = linkage
        self._vary = vary
        self.links = [link for link in linkage.links if link != GROUND]
        self._number = {link: i for i, link in enumerate(self.links)} | {GROUND: -1}
        self._spots = {
            (link, name): self._spot(link, place)
            for link, points in linkage.links.items()
            for name, place in points.items()
        }
        self._lines = {name: self._line(s.direction) for name, s in linkage.sliders.items()}
        self._angles = {
            name: self._varied(slider.angle) for name, slider in linkage.sliders.items()
        }
        self.count = 3 * len(self.links)
        self.size = max(
            abs(part) for points in linkage.links.values() for p in points.values() for part in p
        )

    def _varied(self, value: float) -> Array:
        exact = np.array([value], Real)
        return exact if self._vary is None else exact * self._vary()

    def _spot(self, link: str, place: Sequence[float]) -> _Spot:
        x, y = map(self._varied, place)
        return _Spot(self._number[link], x + Complex(1j) * y)

    def _line(self, direction: Sequence[float]) -> Array:
        x, y = map(self._varied, direction)
        length = np.sqrt(x * x + y * y)
        return np.asarray(x / length + Complex(1j) * (y / length))

    def unknowns(self, poses: dict[str, tuple[Array, Array, Array]]) -> Array:
        """Return the unknowns, from the angle and position of each link."""
        return np.array([part for link in self.links for part in poses[link]], Real)

    def residuals(self, unknowns: Array, inputs: Array) -> tuple[Array, Array, Array]:
        """
        Return the residuals of the equations, their Jacobian, and the moduli of their terms.

        At unknowns (n, N) and inputs (inputs, N), in [rad] or [m], these are (n, N), (N, n, n) and
        sums (n, N).
        """
        count = unknowns.shape[1]
        rows: list[Array] = []
        sizes: list[Any] = []
        jacobian = np.zeros((count, self.count, self.count), Real)
        turned = self._turned(unknowns)
        for kind, parts in self._each():
            row = len(rows)
            if kind == 'pin':
                one, other = (self._moved(unknowns, turned, spot) for spot in parts)
                for part in (np.real, np.imag):
                    rows.append(part(one.place) - part(other.place))
                    sizes.append(
                        sum(
                            np.abs(moved.arm.real)
                            + np.abs(moved.arm.imag)
                            + np.abs(part(moved.place))
                            for moved in (one, other)
                        )
                    )
                for sign, moved in ((1, one), (-1, other)):
                    self._add_place(jacobian, row, moved, sign)
            elif kind in ('on line', 'slide'):
                value, size, gradient = self._on_line(unknowns, turned, parts[0], kind)
                if kind == 'slide':
                    value, size = value - inputs[parts[1]], size + np.abs(inputs[parts[1]])
                rows.append(value)
                sizes.append(size)
                jacobian[:, row, :] += gradient.T
            else:
                value, size = self._turn(unknowns, jacobian[:, row], parts)
                if kind == 'turn':
                    value, size = value - inputs[parts[3]], size + np.abs(inputs[parts[3]])
                rows.append(value - TURN * np.round(value / TURN))
                sizes.append(size)
        shape = (self.count, count)
        residuals = np.empty(shape, Real)
        terms = np.empty(shape, Real)
        for i, (row_, size) in enumerate(zip(rows, sizes, strict=True)):
            residuals[i], terms[i] = row_, np.maximum(size, _SMALL * self.size)
        return residuals, jacobian, terms

    def _each(self) -> Any:
        """Yield the equations by kind; a pin has two equations."""
        carriers: dict[str, list[str]] = {}
        for link, points in self.linkage.links.items():
            for point in points:
                carriers.setdefault(point, []).append(link)
        for point, (first, *others) in carriers.items():
            for link in others:
                yield 'pin', (self._spots[link, point], self._spots[first, point])
        for name, slider in self.linkage.sliders.items():
            yield 'on line', (name,)
            if slider.block:
                yield (
                    'block',
                    (self._number[slider.block], self._number[slider.along], self._angles[name]),
                )
        for i, given in enumerate(self.linkage.inputs):
            if given.slider:
                yield 'slide', (given.slider, i)
            else:
                ends = self._number[given.child], self._number[given.parent]
                yield 'turn', (*ends, np.zeros(1, Real), i)

    def _turned(self, unknowns: Array) -> Array:
        angles = unknowns[0::3]
        return np.asarray(np.cos(angles) + Complex(1j) * np.sin(angles))

    def _moved(self, unknowns: Array, turned: Array, spot: _Spot) -> _Moved:
        i, place = spot
        if i < 0:
            return _Moved(place, place, i)
        arm = turned[i] * place
        return _Moved(_place(unknowns, i) + arm, arm, i)

    @staticmethod
    def _add_place(jacobian: Array, row: int, moved: _Moved, sign: int) -> None:
        """Add the derivatives of the coordinates of a point."""
        if moved.link >= 0:
            k = 3 * moved.link
            jacobian[:, row, k] -= sign * moved.arm.imag
            jacobian[:, row + 1, k] += sign * moved.arm.real
            jacobian[:, row, k + 1] += sign
            jacobian[:, row + 1, k + 2] += sign

    def _slider(
        self, unknowns: Array, turned: Array, name: str, kind: str
    ) -> tuple[_Moved, _Moved, int, Array]:
        """Return point and start of a line, the link that carries it, and what is counted."""
        slider = self.linkage.sliders[name]
        carrier = slider.block or next(
            link for link, points in self.linkage.links.items() if slider.point in points
        )
        tip = self._moved(unknowns, turned, self._spots[carrier, slider.point])
        foot = self._moved(unknowns, turned, self._spots[slider.along, slider.through])
        along, unit = self._number[slider.along], self._lines[name]
        if along >= 0:
            unit = turned[along] * unit
        # The distance from the line is counted along its normal.
        return tip, foot, along, Complex(1j) * unit if kind == 'on line' else unit

    def _on_line(
        self, unknowns: Array, turned: Array, name: str, kind: str
    ) -> tuple[Array, Array, Array]:
        """Return the distance of a slider's point from its line, or along it, and the gradient."""
        tip, foot, along, unit = self._slider(unknowns, turned, name, kind)
        seen = unit.conj() * (tip.place - foot.place)
        value = seen.real
        size = sum(
            np.abs(part(moved.place)) + np.abs(part(moved.arm))
            for moved in (tip, foot)
            for part in (np.real, np.imag)
        ) * np.ones_like(value)
        gradient = np.zeros((self.count, unknowns.shape[1]), Real)
        for sign, moved in ((1, tip), (-1, foot)):
            if moved.link >= 0:
                k = 3 * moved.link
                gradient[k] -= sign * (unit.conj() * moved.arm).imag
                gradient[k + 1] += sign * unit.real
                gradient[k + 2] += sign * unit.imag
        if along >= 0:
            gradient[3 * along] += seen.imag
        return value, size, gradient

    def _turn(self, unknowns: Array, jacobian: Array, parts: Any) -> tuple[Array, Array]:
        """Return the angle of one link minus that of another and a constant."""
        one, other, angle = parts[:3]
        value = -angle * np.ones(unknowns.shape[1], Real)
        size = np.abs(angle) + np.pi * np.ones(unknowns.shape[1], Real)
        for sign, i in ((1, one), (-1, other)):
            if i >= 0:
                value = value + sign * unknowns[3 * i]
                jacobian[:, 3 * i] += sign
        return value, size

    def bend(self, unknowns: Array, rates: Array) -> Array:
        """Return the second time derivatives (n, N) of the equations for accelerations of 0."""
        turned = self._turned(unknowns)
        rows: list[Array] = []
        for kind, parts in self._each():
            if kind == 'pin':
                one, other = (self._moved(unknowns, turned, spot) for spot in parts)
                pull = _pull(one, rates) - _pull(other, rates)
                rows += [pull.real, pull.imag]
            elif kind in ('on line', 'slide'):
                rows.append(self._line_bend(unknowns, rates, turned, parts[0], kind))
            else:
                rows.append(np.zeros(unknowns.shape[1], Real))
        bend = np.empty((self.count, unknowns.shape[1]), Real)
        for i, row in enumerate(rows):
            bend[i] = row
        return bend

    def _line_bend(
        self, unknowns: Array, rates: Array, turned: Array, name: str, kind: str
    ) -> Array:
        tip, foot, along, unit = self._slider(unknowns, turned, name, kind)
        turn: Any = rates[3 * along] if along >= 0 else 0.0
        pull, speed, between = (
            unit.conj() * (one - other)
            for one, other in (
                (_pull(tip, rates), _pull(foot, rates)),
                (_velocity(tip, rates), _velocity(foot, rates)),
                (tip.place, foot.place),
            )
        )
        return np.asarray(pull.real + 2 * turn * speed.imag - turn * turn * between.real)

    def joints(
        self, unknowns: Array, rates: Array | None = None, accelerations: Array | None = None
    ) -> tuple[Array, Array, Array]:
        """Return the published joints with their first and second derivatives, (joints, N)."""
        count = unknowns.shape[1]
        still = np.zeros_like(unknowns)
        rates = still if rates is None else rates
        accelerations = still if accelerations is None else accelerations
        turned = self._turned(unknowns)
        found = [np.zeros((len(self.linkage.joints), count), Real) for _ in range(3)]
        for j, joint in enumerate(self.linkage.joints.values()):
            if isinstance(joint, RevoluteJoint):
                for sign, link in ((1, joint.child), (-1, joint.parent)):
                    if link != GROUND:
                        k = 3 * self._number[link]
                        for order, values in enumerate((unknowns, rates, accelerations)):
                            found[order][j] += sign * values[k]
                continue
            value, _, gradient = self._on_line(unknowns, turned, joint.slider, 'slide')
            found[0][j] = value
            found[1][j] = (gradient * rates).sum(0)
            found[2][j] = (gradient * accelerations).sum(0) + self._line_bend(
                unknowns, rates, turned, joint.slider, 'slide'
            )
        return found[0], found[1], found[2]

    def correct(
        self, unknowns: Array, inputs: Array, shift: Array | None = None, steps: int = 8
    ) -> tuple[Array, Array]:
        """
        Correct states by Newton's method; return the solutions, and which have converged.

        Unknowns (n, N) and inputs (inputs, N) have the residuals ``shift``, (n, N), at the end; 0
        if not given.
        """
        found = np.array(unknowns, Real)
        good = np.zeros(found.shape[1], bool)
        for step in range(steps + 1):
            residuals, jacobian, sizes = self.residuals(found, inputs)
            if shift is not None:
                residuals = residuals - shift
            ratio = (np.abs(residuals) / np.maximum(sizes, 1e-300)).max(0)
            good = ratio < 64 * np.finfo(Real).eps
            if step == steps or good.all():
                break
            found = found + solve(jacobian, -residuals)
        return found, good

    def motion(
        self,
        unknowns: Array,
        inputs: Array,
        rates: Array,
        accelerations: Array,
        noise: Array | float = 0.0,
    ) -> Motion:
        """
        Return the rates and accelerations of solutions, from those of the inputs.

        ``noise``, (n, N), is the error of each equation relative to the size of its terms.
        """
        _, jacobian, _ = self.residuals(unknowns, inputs)
        drive = np.zeros_like(unknowns)
        driven = slice(-len(inputs), None)
        drive[driven] = rates
        v = solve(jacobian, drive)
        v = v + solve(jacobian, noise * _terms(jacobian, v))
        pull = np.zeros_like(unknowns)
        pull[driven] = accelerations
        bend = self.bend(unknowns, v)
        a = solve(jacobian, pull - bend)
        a = a + solve(jacobian, noise * (_terms(jacobian, a) + np.abs(bend)))
        return Motion(unknowns, v, a, self.joints(unknowns, v, a))


def condition_numbers(
    linkage: Linkage, motion: Motion, inputs: Array, rates: Array, accelerations: Array, seed: int
) -> tuple[Array, Array, Array]:
    """
    Return the condition numbers of the joints and their derivatives, (joints, N) each.

    All numbers of the linkage, the inputs and the terms of every equation are varied by the same
    relative amount with random signs, several times. The result is the greatest relative change
    plus the value itself. Varying the terms of the equations stands for the rounding of results
    that one dyad passes to the next.
    """
    random = np.random.default_rng(seed)
    count = inputs.shape[1]

    def vary() -> Array:
        return np.repeat(1 + _STEP * random.choice((-1.0, 1.0), _SAMPLES), count).astype(Real)

    varied = Equations(linkage, vary)
    noise = _STEP * random.choice((-1.0, 1.0), (varied.count, _SAMPLES * count)).astype(Real)
    wide = [np.tile(values, (1, _SAMPLES)) for values in (inputs, rates, accelerations)]
    wide = [values * (1 + _STEP * random.choice((-1.0, 1.0), values.shape)) for values in wide]
    start = np.tile(motion.unknowns, (1, _SAMPLES))
    _, _, sizes = varied.residuals(start, wide[0])
    moved, _ = varied.correct(start, wide[0], noise * sizes, 3)
    changed = varied.motion(moved, wide[0], wide[1], wide[2], noise).joints
    found = []
    for base, other in zip(motion.joints, changed, strict=True):
        change = np.abs(other.reshape(len(base), _SAMPLES, count) - base[:, None, :]).max(1)
        found.append(change / _STEP + np.abs(base))
    return found[0], found[1], found[2]


def _terms(jacobian: Array, values: Array) -> Array:
    """Return the sums of the absolute terms of a matrix product, (n, N)."""
    return (np.abs(jacobian) @ np.abs(values.T)[:, :, None])[:, :, 0].T


def _place(values: Array, link: int) -> Array:
    """Return the position of a link's origin, or its rate."""
    return np.asarray(values[3 * link + 1] + Complex(1j) * values[3 * link + 2])


def _velocity(moved: _Moved, rates: Array) -> Any:
    if moved.link < 0:
        return 0.0
    return _place(rates, moved.link) + Complex(1j) * rates[3 * moved.link] * moved.arm


def _pull(moved: _Moved, rates: Array) -> Any:
    """Return the centripetal acceleration of a point."""
    return -(rates[3 * moved.link] ** 2) * moved.arm if moved.link >= 0 else Complex(0.0)


def solve(jacobian: Array, right: Array) -> Array:
    """Solve (N, n, n) systems for (n, N) right sides, with refinement; infinite if singular."""
    scale = np.maximum(np.abs(jacobian).max(2), 1e-300)
    scaled = jacobian / scale[:, :, None]
    matrix = scaled.astype(float)
    rest = (right / scale.T).T[:, :, None]
    with np.errstate(all='ignore'):
        try:
            inverse = np.linalg.inv(matrix)
        except np.linalg.LinAlgError:
            inverse = np.stack([_inverse(one) for one in matrix])
        found = np.zeros_like(rest)
        for _ in range(_REFINEMENTS):
            error = rest - scaled @ found
            found = found + (inverse @ error.astype(float))
    return np.asarray(found[:, :, 0].T)


def _inverse(matrix: Array) -> Array:
    try:
        return np.linalg.inv(matrix)
    except np.linalg.LinAlgError:
        return np.full_like(matrix, np.inf)
