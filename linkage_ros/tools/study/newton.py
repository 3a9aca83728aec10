# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Newton's method on the constraint equations of a linkage, in the angles and places of its links.

It shares no formula with the dyads.
"""

from __future__ import annotations

from cmath import phase
from collections.abc import Callable, Sequence
from typing import Any

from linkage_ros.kinematics import (
    BodyDirection,
    CoincidentPoints,
    Constraint,
    End,
    evaluate_constraints,
    GROUND,
    Linkage,
    LinkState,
    OnLine,
    Parallel,
    PlanarClosure,
    RevoluteJoint,
)
import numpy as np

_MOST = 50
"""Most iterations; more mean no convergence."""

_BEHIND = 0.01
"""How far behind a state its iteration starts, in [rad] or parts of the size."""


class ConstraintEquations:
    """The constraint equations in the angles and positions of the links, without dyads."""

    def __init__(self, linkage: Linkage) -> None:
        self._linkage = linkage
        self._closure = PlanarClosure(linkage)
        self._bodies = {name: k for k, name in enumerate(n for n in linkage.links if n != GROUND)}
        self._ground = {name: k for k, name in enumerate(linkage.links[GROUND])}
        self._pins = [complex(*place) for place in linkage.links[GROUND].values()]
        self._slides: dict[str, OnLine] = {}
        self._constraints = self._list_constraints()

    def start_behind(self, inputs: Sequence[float], apart: float) -> Any:
        """Return the unknowns of the closure at inputs that differ, on the side that closes."""
        position = None
        for side in (-apart, apart, 0.0):
            units = [self._closure.scale if i.slider else 1.0 for i in self._linkage.inputs]
            near = [x + side * unit for x, unit in zip(inputs, units, strict=True)]
            position = self._closure.position(*near)
            if position.joints:
                break
        assert position is not None, 'there are three'
        angles, points = self._closure.link_angles(position), self._closure.points(position)
        found = []
        for link in self._bodies:
            place = points[link, next(iter(self._linkage.links[link]))]
            found += [angles[link], place.real, place.imag]
        return np.array(found)

    def newton_step(self, unknowns: Any, inputs: Sequence[float]) -> Any:
        """Return the unknowns after one step of Newton's method."""
        known = LinkState([0.0, *inputs], self._pins)
        errors, jacobian = evaluate_constraints(self._constraints, unknowns.tolist(), known)
        return unknowns - np.linalg.solve(jacobian, errors)

    def joint_values(self, unknowns: Any) -> tuple[float, ...]:
        """Return the published joints."""

        def link_angle(link: str) -> float:
            return float(unknowns[3 * self._bodies[link]]) if link != GROUND else 0.0

        known, values = LinkState([0.0], self._pins), unknowns.tolist()
        return tuple(
            link_angle(joint.child) - link_angle(joint.parent)
            if isinstance(joint, RevoluteJoint)
            else self._slides[joint.slider].place(values, known).real
            for joint in self._linkage.joints.values()
        )

    def _list_constraints(self) -> tuple[Constraint, ...]:
        found: list[Constraint] = []
        carriers: dict[str, str] = {}
        for link, points in self._linkage.links.items():
            for point in points:
                if point in carriers:
                    found.append(
                        CoincidentPoints(
                            self._link_end(link, point), self._link_end(carriers[point], point)
                        )
                    )
                carriers.setdefault(point, link)
        for name, slider in self._linkage.sliders.items():
            line = OnLine(
                self._link_end(slider.block or carriers[slider.point], slider.point),
                self._link_end(slider.along, slider.through),
                self._link_facing(slider.along, phase(complex(*slider.direction))),
            )
            self._slides[name] = line
            found.append(line)
            if slider.block:
                ends = self._link_facing(slider.block), self._link_facing(slider.along)
                found.append(Parallel(*ends, slider.angle))
        for k, joint in enumerate(self._linkage.inputs, 1):
            if joint.slider:
                found.append(self._slides[joint.slider]._replace(slide=k))
            else:
                found.append(
                    Parallel(
                        self._link_facing(joint.child), self._link_facing(joint.parent), 0.0, k
                    )
                )
        return tuple(found)

    def _link_end(self, link: str, point: str) -> End:
        if link == GROUND:
            return End(-1, 0j, self._ground[point])
        points = self._linkage.links[link]
        return End(
            self._bodies[link], complex(*points[point]) - complex(*next(iter(points.values())))
        )

    def _link_facing(self, link: str, direction: float = 0.0) -> BodyDirection:
        return BodyDirection(self._bodies.get(link, -1), 0, direction)


def solve_by_newton(linkage: Linkage, tolerance: float) -> Callable[..., Sequence[Any]]:
    """
    Return Newton's method from a state a little behind, as from the last tick.

    It ends at a last correction of at most the tolerance, in [rad] and [m]. The starts are kept,
    so a second call with the same inputs only iterates.
    """
    rules = ConstraintEquations(linkage)
    starts: dict[tuple[float, ...], Any] = {}

    def position(*inputs: float) -> Sequence[Any]:
        if inputs not in starts:
            starts[inputs] = rules.start_behind(inputs, _BEHIND)
        unknowns = starts[inputs]
        for _ in range(_MOST):
            try:
                corrected = rules.newton_step(unknowns, inputs)
            except np.linalg.LinAlgError:
                return ()
            change, unknowns = float(np.abs(corrected - unknowns).max()), corrected
            if change <= tolerance:
                return rules.joint_values(unknowns)
        return ()

    return position
