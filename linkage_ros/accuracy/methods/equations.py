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
Methods on the constraint equations: integration of the rates, and extended precision.

Integration: only velocities are solved for, in doubles, at poses that satisfy the constraints only
nearly. From state to state the angles and positions of the links advance in steps of equal length,
by Euler's method or the classical Runge-Kutta method, from an exact start. Nothing closes the
loops again, unless a step of Newton's method follows each step (projection).

Extended precision: Newton's method in mpmath on all constraints, until 30 digits are right. It is
the reference itself with fewer digits, so its error is against one with more.
"""

from __future__ import annotations

from cmath import phase
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from linkage_ros.accuracy.methods import ACCELERATION, Joints, Method, Motion, NOTHING, RATE
from linkage_ros.accuracy.poses import Poses
from linkage_ros.accuracy.reference import Reference, SingularError
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.equations import (
    along,
    Constraint,
    derivative,
    End,
    equations,
    Facing,
    Meeting,
    OnLine,
    Parallel,
)
from linkage_ros.kinematics.linkage import GROUND, Linkage, RevoluteJoint
from linkage_ros.kinematics.step import State
import numpy as np


class VelocityEquations:
    """The constraint equations in the angles and positions of the links, without dyads."""

    def __init__(self, linkage: Linkage) -> None:
        self._linkage = linkage
        self._closure = Closure(linkage)
        self._bodies = {name: k for k, name in enumerate(n for n in linkage.links if n != GROUND)}
        self._ground = {name: k for k, name in enumerate(linkage.links[GROUND])}
        self._pins = [complex(*place) for place in linkage.links[GROUND].values()]
        self._slides: dict[str, OnLine] = {}
        self._constraints = self._listed()

    def start(self, inputs: Sequence[float]) -> Any:
        """Return the angle and the position of the first point of each link, from the closure."""
        position = self._closure.position(*inputs)
        angles, points = self._closure.link_angles(position), self._closure.points(position)
        found = []
        for link in self._bodies:
            place = points[link, next(iter(self._linkage.links[link]))]
            found += [angles[link], place.real, place.imag]
        return np.array(found)

    def rates(self, unknowns: Any, inputs: Sequence[float], swept: Sequence[float]) -> Any:
        """Return the derivatives of the unknowns where the inputs have the rates ``swept``."""
        known, values = State([0.0, *inputs], self._pins), unknowns.tolist()
        still = [0.0] * len(values)
        speeds = State([0.0, *swept], [0j] * len(self._pins))
        _, jacobian = equations(self._constraints, values, known)
        drift = derivative(self._constraints, values, known, speeds, still, None, still)
        return np.linalg.solve(jacobian, np.negative(drift))

    def corrected(self, unknowns: Any, inputs: Sequence[float]) -> Any:
        """Return the unknowns after one step of Newton's method."""
        known = State([0.0, *inputs], self._pins)
        errors, jacobian = equations(self._constraints, unknowns.tolist(), known)
        return unknowns - np.linalg.solve(jacobian, errors)

    def joints(self, unknowns: Any, inputs: Sequence[float]) -> tuple[float, ...]:
        """Return the published joints."""

        def angle(link: str) -> float:
            return float(unknowns[3 * self._bodies[link]]) if link != GROUND else 0.0

        known, values = State([0.0, *inputs], self._pins), unknowns.tolist()
        return tuple(
            angle(joint.child) - angle(joint.parent)
            if isinstance(joint, RevoluteJoint)
            else along(self._slides[joint.slider], known, values).real
            for joint in self._linkage.joints.values()
        )

    def _listed(self) -> tuple[Constraint, ...]:
        found: list[Constraint] = []
        carriers: dict[str, str] = {}
        for link, points in self._linkage.links.items():
            for point in points:
                if point in carriers:
                    found.append(
                        Meeting(self._end(link, point), self._end(carriers[point], point))
                    )
                carriers.setdefault(point, link)
        for name, slider in self._linkage.sliders.items():
            line = OnLine(
                self._end(slider.block or carriers[slider.point], slider.point),
                self._end(slider.along, slider.through),
                self._facing(slider.along, phase(complex(*slider.direction))),
            )
            self._slides[name] = line
            found.append(line)
            if slider.block:
                ends = self._facing(slider.block), self._facing(slider.along)
                found.append(Parallel(*ends, slider.angle))
        for k, joint in enumerate(self._linkage.inputs, 1):
            if joint.slider:
                found.append(self._slides[joint.slider]._replace(slide=k))
            else:
                found.append(
                    Parallel(self._facing(joint.child), self._facing(joint.parent), 0.0, k)
                )
        return tuple(found)

    def _end(self, link: str, point: str) -> End:
        if link == GROUND:
            return End(-1, 0j, self._ground[point])
        points = self._linkage.links[link]
        return End(
            self._bodies[link], complex(*points[point]) - complex(*next(iter(points.values())))
        )

    def _facing(self, link: str, direction: float = 0.0) -> Facing:
        return Facing(self._bodies.get(link, -1), 0, direction)


Slope = Callable[[Any, float], Any]
"""Takes the unknowns and the part of the step, 0 to 1; returns what they change by in a step."""

ORDERS = {'Euler': 1, 'Runge-Kutta 4': 4}

STEPS = (1, 4, 16, 64)
"""Between two states."""


def integrations(path: Poses, quick: bool) -> Iterator[Method]:
    """Yield the integration methods; their positions hold along a path, from its first state."""
    for name in ORDERS:
        for projected in (False, True):
            for steps in STEPS[:2] if quick else STEPS:
                yield integration(path, name, steps, projected)


def integration(path: Poses, name: str, steps: int, projected: bool) -> Method:
    """Return an integration method with a number of steps between two states."""
    rules = VelocityEquations(path.linkage)
    first = path.inputs[0]
    last, unknowns = first, rules.start(first)
    step = _euler if name == 'Euler' else _runge_kutta

    def position(*inputs: float) -> Joints:
        nonlocal last, unknowns
        if inputs == first:
            last, unknowns = first, rules.start(first)
            return rules.joints(unknowns, inputs)
        begin, span = last, [b - a for a, b in zip(last, inputs, strict=True)]
        part = [s / steps for s in span]
        for k in range(steps):

            def at(done: float, k: int = k) -> list[float]:
                return [a + s * (k + done) / steps for a, s in zip(begin, span, strict=True)]

            def slope(x: Any, done: float, at: Callable[[float], list[float]] = at) -> Any:
                return rules.rates(x, at(done), part)

            try:
                unknowns = step(slope, unknowns)
                if projected:
                    unknowns = rules.corrected(unknowns, at(1.0))
            except np.linalg.LinAlgError:
                return ()
        last = inputs
        return rules.joints(unknowns, inputs)

    named = f'{name}, projected' if projected else name
    return Method(named, f'{steps * (len(path.inputs) - 1)} steps', position, remembers=True)


def _euler(slope: Slope, x: Any) -> Any:
    return x + slope(x, 0.0)


def _runge_kutta(slope: Slope, x: Any) -> Any:
    k1 = slope(x, 0.0)
    k2 = slope(x + 0.5 * k1, 0.5)
    k3 = slope(x + 0.5 * k2, 0.5)
    k4 = slope(x + k3, 1.0)
    return x + (k1 + 2.0 * (k2 + k3) + k4) / 6.0


EXTENDED = 'extended precision'

_DIGITS, _GUARD = 30, 8


def extended(linkage: Linkage) -> Method:
    """Return extended precision as a method; rates and accelerations come with each position."""
    reference = Reference(linkage, _DIGITS, _GUARD)
    driven = len(linkage.inputs)
    rates, accelerations = [RATE] * driven, [ACCELERATION] * driven

    def position(*inputs: float) -> Joints:
        return motion(*inputs)[0]

    def motion(*inputs: float) -> Motion:
        try:
            truth = reference.solve(inputs, rates, accelerations)
        except (SingularError, ValueError):
            return NOTHING
        return truth.joints, truth.rates, truth.accelerations

    return Method(EXTENDED, f'{_DIGITS} digits', position, motion, together=True)
