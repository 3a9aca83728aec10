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


"""All constraints of a linkage in doubles, for rates at places that satisfy them only nearly."""

from __future__ import annotations

from cmath import phase
from collections.abc import Sequence
from typing import Any

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
    """
    What the links' angles and places do, and no dyad.

    Parameters
    ----------
    linkage
        The linkage.

    """

    def __init__(self, linkage: Linkage) -> None:
        self._linkage = linkage
        self._closure = Closure(linkage)
        self._bodies = {name: k for k, name in enumerate(n for n in linkage.links if n != GROUND)}
        self._ground = {name: k for k, name in enumerate(linkage.links[GROUND])}
        self._pins = [complex(*place) for place in linkage.links[GROUND].values()]
        self._slides: dict[str, OnLine] = {}
        self._constraints = self._listed()

    def start(self, inputs: Sequence[float]) -> Any:
        """Return for each link its angle and the place of its first point, as the closure says."""
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
