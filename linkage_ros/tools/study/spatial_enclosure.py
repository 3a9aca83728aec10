# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The constraints of a spatial linkage, for the reference of `linkage_ros.tools.study.enclosure`.

The unknowns of each link are its place p and the nine entries of its rotation R since the pose, so
a point that the pose has at z is at p + R·z, and all constraints are of second degree at most::

    link       R·Rᵀ = 1
    ball       p1 + R1·z = p2 + R2·z
    rod        |P − Q|² = L²
    hinge      a ball on the axis a; R1·b, R1·c ⟂ R2·a
    slide      R1·b, R1·c ⟂ R2·a, p2 − p1; R1·b ⟂ R2·c
    input      R1·(c·cos φ − b·sin φ) ⟂ R2·b; R1·a · (p2 − p1) = s; |P − Q|² = s²

b and c are across the axis a. A linkage that is over-constrained has more constraints than
unknowns; its lengths are exact in no file, and so are its joints.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations_with_replacement
from typing import Any

from flint import acb, arb
from linkage_ros.kinematics import GROUND, SpaceClosure, SpatialJoint
from linkage_ros.tools.study.exact_constraints import (
    constant_term,
    evaluate_terms,
    ExactConstraints,
    Term,
)

Form = list[tuple[int, Any]]
"""A number: factors by the number of their unknown."""

VectorForm = tuple[Form, Form, Form]


class SpatialConstraints(ExactConstraints):
    """The constraints of a spatial linkage."""

    def __init__(self, closure: SpaceClosure, driven: Sequence[tuple[Any, Any, Any]]) -> None:
        self._linkage = linkage = closure.linkage
        self._scale = arb(closure.scale)
        carried = [(point, link) for link, points in linkage.links.items() for point in points]
        carriers: dict[str, list[str]] = {point: [] for point, _ in carried}
        for point, link in carried:
            carriers[point].append(link)
        joints = linkage.pair_joints
        ends = {end for joint in joints.values() for end in (joint.parent, joint.child)}
        rods: dict[str, list[str]] = {}
        for link, points in linkage.links.items():
            shared = [point for point in points if len(carriers[point]) > 1]
            if link not in (*ends, GROUND) and len(shared) == 2:
                rods[link] = shared
        moving = [name for name in linkage.link_names if name != GROUND and name not in rods]
        self._links = {name: 1 + 12 * k for k, name in enumerate(moving)}
        self.count = 12 * len(moving)
        self._carriers = {
            point: [link for link in carriers[point] if link not in rods] for point in carriers
        }
        self._across = {name: _across_axis(joint) for name, joint in joints.items()}
        self.constraints = [*self._link_constraints()]
        on_axes = {(point, *pair) for point, *pair in linkage.shared_points(on_axes=True)}
        for point, links in self._carriers.items():
            first, *others = links
            for other in others:
                if not {(point, first, other), (point, other, first)} & on_axes:
                    self._add_ball(self._point_form(point, first), self._point_form(point, other))
        for shared in rods.values():
            between = self._span_form(*shared)
            length = self._square_distance(*shared)
            self.constraints.append([*_dot(between, between), constant_term(-length, 0, 0)])
        for name in joints:
            self._add_pair(name)
        for name, (x, v, a) in zip(linkage.driven, driven, strict=True):
            self._add_input(name, x, v, a)
        for name in closure.held:
            self._add_input(name, arb(linkage.pair_joints[name].value), arb(0), arb(0))

    def _link_constraints(self) -> Iterator[list[Term]]:
        for link in self._links:
            rows = enumerate(self._rows(link))
            for (i, first), (j, second) in combinations_with_replacement(rows, 2):
                products = [constant_term(1, *pair) for pair in zip(first, second, strict=True)]
                yield [*products, constant_term(-int(i == j), 0, 0)]

    def initial_unknowns(self, closure: SpaceClosure, inputs: Sequence[float]) -> list[Any]:
        position = closure.position(*inputs)
        if not position.joints:
            raise ValueError(f'{tuple(inputs)}: the linkage is {position.status.name.lower()}')
        drawn = closure.frames(closure.close_unlimited(*closure.linkage.pose.inputs))
        frames, unknowns = closure.frames(position), [arb(1)]
        for link in self._links:
            place, (x, y, z, w) = frames[link]
            rows = (
                (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)),
                (2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)),
                (2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)),
            )
            at = drawn[link][0]
            unknowns += [
                (arb(now) - sum(r * c for r, c in zip(row, at, strict=True))) / self._scale
                for now, row in zip(place, rows, strict=True)
            ]
            unknowns += [arb(entry) for row in rows for entry in row]
        return unknowns

    def joint_values(self, *motion: Sequence[Any]) -> tuple[Any, ...]:
        linkage = self._linkage
        return tuple(
            arb(linkage.held[name] if len(motion) == 1 else 0)
            if name in linkage.held
            else self._strut_length(name, motion)
            if name in linkage.struts
            else self._pair_value(name, motion)
            for name in linkage.published
        )

    def _strut_length(self, name: str, motion: Sequence[Sequence[Any]]) -> Any:
        between = self._span_form(*self._linkage.struts[name])
        ends = range(1, 1 + len(motion))
        square, *more = (evaluate_terms(_dot(between, between), motion[:end]) for end in ends)
        length = square.sqrt()
        if not more:
            return length * self._scale
        rate = more[0] / (2 * length)
        if len(more) == 1:
            return rate * self._scale
        return (more[1] / 2 - rate * rate) / length * self._scale

    def _pair_value(self, name: str, motion: Sequence[Sequence[Any]]) -> Any:
        """Return a value; of an angle its derivatives are c·s' − s·c' and c·s'' − s·c''."""
        joint, (a, b, c) = self._linkage.pair_joints[name], self._across[name]
        pose = arb(joint.value if len(motion) == 1 else 0)
        if name in self._linkage.slides:
            along = _dot(self._direction_form(joint.parent, a), self._offset(joint))
            return evaluate_terms(along, motion) * self._scale + pose
        turned = self._direction_form(joint.child, b)
        parts = [
            [
                evaluate_terms(_dot(self._direction_form(joint.parent, way), turned), motion[:end])
                for way in (b, c)
            ]
            for end in (1, len(motion))
        ]
        (cosine, sine), (cosine_rate, sine_rate) = parts
        if len(motion) > 1:
            return cosine * sine_rate - sine * cosine_rate
        return arb.atan2(sine, cosine) + pose

    # Constraints

    def _add_ball(self, first: VectorForm, second: VectorForm) -> None:
        for row in _difference(first, second):
            self.constraints.append([constant_term(c, 0, k) for k, c in row])

    def _add_pair(self, name: str) -> None:
        joint, (a, b, c) = self._linkage.pair_joints[name], self._across[name]
        across = [self._direction_form(joint.parent, way) for way in (b, c)]
        axis = self._direction_form(joint.child, a)
        self.constraints += [_dot(way, axis) for way in across]
        if name in self._linkage.hinges:
            ends = joint.parent, joint.child
            self._add_ball(*(self._place_form(end, joint.at) for end in ends))
            return
        self.constraints.append(_dot(across[0], self._direction_form(joint.child, c)))
        self.constraints += [_dot(way, self._offset(joint)) for way in across]

    def _add_input(self, name: str, x: Any, v: Any, a: Any) -> None:
        """Add the constraint of a joint at a value with its rate and acceleration."""
        linkage = self._linkage
        if name in linkage.struts:
            between, size = self._span_form(*linkage.struts[name]), self._scale * self._scale
            constant = (-x * x / size, -2 * x * v / size, -2 * (v * v + x * a) / size)
            self.constraints.append([*_dot(between, between), (constant, 0, 0)])
            return
        joint, (along, b, c) = linkage.pair_joints[name], self._across[name]
        moved = x - arb(joint.value)
        if name in linkage.slides:
            constant = tuple(-part / self._scale for part in (moved, v, a))
            slid = _dot(self._direction_form(joint.parent, along), self._offset(joint))
            self.constraints.append([*slid, (constant, 0, 0)])
            return
        unit = acb(moved.cos(), moved.sin())
        turns = (unit, unit * acb(0, v), unit * acb(-v * v, a))
        turned = self._direction_form(joint.child, b)
        terms: list[Term] = []
        for way, parts in ((c, [t.real for t in turns]), (b, [-t.imag for t in turns])):
            for (factor, *_), i, j in _dot(self._direction_form(joint.parent, way), turned):
                terms.append((tuple(factor * part for part in parts), i, j))
        self.constraints.append(terms)

    # Forms

    def _rows(self, link: str) -> list[list[int]]:
        first = self._links[link] + 3
        return [[first + 3 * i + j for j in range(3)] for i in range(3)]

    def _direction_form(self, link: str, way: Sequence[Any]) -> VectorForm:
        if link == GROUND:
            x, y, z = ([(0, part)] for part in way)
        else:
            x, y, z = ([*zip(row, way, strict=True)] for row in self._rows(link))
        return x, y, z

    def _place_form(self, link: str, at: Sequence[float]) -> VectorForm:
        x, y, z = self._direction_form(link, [arb(part) / self._scale for part in at])
        if link == GROUND:
            return x, y, z
        first = self._links[link]
        return [*x, (first, arb(1))], [*y, (first + 1, arb(1))], [*z, (first + 2, arb(1))]

    def _point_form(self, point: str, link: str = '') -> VectorForm:
        return self._place_form(link or self._carriers[point][0], self._linkage.points[point])

    def _span_form(self, start: str, end: str) -> VectorForm:
        return _difference(self._point_form(start), self._point_form(end))

    def _square_distance(self, start: str, end: str) -> Any:
        """Return the square of the distance of two points in the pose."""
        points = self._linkage.points
        pairs = zip(points[start], points[end], strict=True)
        return sum(((arb(a) - arb(b)) ** 2 for a, b in pairs), arb(0)) / self._scale**2

    def _offset(self, joint: SpatialJoint) -> VectorForm:
        origin = (0.0, 0.0, 0.0)
        return _difference(*(self._place_form(end, origin) for end in (joint.child, joint.parent)))


def _across_axis(joint: SpatialJoint) -> tuple[tuple[Any, ...], ...]:
    """Return the direction of an axis, and two directions across it, right-handed."""
    a = _unit([arb(part) for part in joint.axis])
    least = min(range(3), key=lambda k: abs(joint.axis[k]))
    b = _unit(_cross(a, [arb(int(k == least)) for k in range(3)]))
    return a, b, _cross(a, b)


def _unit(vector: Sequence[Any]) -> tuple[Any, ...]:
    length = sum((part * part for part in vector), arb(0)).sqrt()
    return tuple(part / length for part in vector)


def _cross(first: Sequence[Any], second: Sequence[Any]) -> tuple[Any, ...]:
    (a, b, c), (d, e, f) = first, second
    return b * f - c * e, c * d - a * f, a * e - b * d


def _dot(first: VectorForm, second: VectorForm) -> list[Term]:
    return [
        constant_term(c * d, i, j)
        for a, b in zip(first, second, strict=True)
        for i, c in a
        for j, d in b
    ]


def _difference(first: VectorForm, second: VectorForm) -> VectorForm:
    x, y, z = ([*a, *((k, -c) for k, c in b)] for a, b in zip(first, second, strict=True))
    return x, y, z
