# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Verified reference: balls that are proved to contain a linkage's joints, rates and accelerations.

It shares only the linkage with the closed form. The unknowns are the position p of
each link's frame and its direction u as a vector, but no angles and no slides. So all constraints
are of second degree at most::

    link       u·u = 1
    pin        p1 + u1 z1 = p2 + u2 z2                  (z times u as complex numbers)
    slider     (p2 + u2 z2 − p1 − u1 t) × u1 d = 0
    block      u1 e^{i·angle} × u2 = 0
    input      u1 e^{iφ} × u2 = 0, or (p2 + u2 z2 − p1 − u1 t) · u1 d = s

In space `linkage_ros.tools.study.spatial_enclosure` has the constraints.

The derivatives of a sum of c·x_i·x_j, with x_0 = 1, come from the product rule; none is derived by
hand. Krawczyk's operator shows that a ball X about m holds exactly one solution: with Y near
J(m)⁻¹, this is so if m − Y·F(m) + (1 − Y·J(X))·(X − m) lies inside X (R. Krawczyk, Computing 4,
1969).
"""

from __future__ import annotations

from cmath import rect
from collections.abc import Sequence
from math import frexp
from typing import Any

from flint import acb, arb, arb_mat, ctx
from linkage_ros.kinematics import Closure, GROUND, PlanarClosure, RevoluteJoint
from linkage_ros.tools.study.exact_constraints import (
    constant_term,
    evaluate_terms,
    ExactConstraints,
    Proof,
    SingularError,
    Term,
)

_PRECISIONS = (512, 1024, 2048)
"""Precisions in bits; the next is tried if one proves nothing."""

_RADIUS = 150
"""Radius of the ball to be verified: 2 to the power of minus this, in the unit of length."""

Form = list[tuple[int, Any]]
"""A position or direction: complex factors by the number of their unknown."""


def prove(
    closure: Closure,
    inputs: Sequence[float],
    rates: Sequence[float] | None = None,
    accelerations: Sequence[float] | None = None,
) -> Proof:
    """
    Return a verified state near the closure's own; without rates, the inputs move at 1.

    A SingularError says that nothing can be proved, at a toggle or a change point, or of a linkage
    with more constraints than unknowns, a ValueError that the linkage does not close.
    """
    rates = [1.0] * len(inputs) if rates is None else rates
    accelerations = [0.0] * len(inputs) if accelerations is None else accelerations
    before = ctx.prec
    try:
        for ctx.prec in _PRECISIONS:
            equations = constraints_of(closure, inputs, rates, accelerations)
            balls = _prove_solution(equations, equations.initial_unknowns(closure, inputs))
            if balls is not None:
                return equations.prove_joints(balls)
    finally:
        ctx.prec = before
    raise SingularError(f'{tuple(inputs)}: nothing is proved')


def solve(closure: Closure, inputs: Sequence[float], bits: int) -> tuple[Any, ...]:
    """Return the joints at a precision in bits, by Newton's method and without a proof."""
    before, ctx.prec = ctx.prec, bits
    try:
        equations = constraints_of(closure, inputs)
        unknowns = _iterate_newton(equations, equations.initial_unknowns(closure, inputs))
        if unknowns is None:
            raise SingularError(f'{tuple(inputs)}: nothing converges')
        return equations.joint_values(unknowns)
    finally:
        ctx.prec = before


def constraints_of(
    closure: Closure,
    inputs: Sequence[float],
    rates: Sequence[float] | None = None,
    accelerations: Sequence[float] | None = None,
) -> ExactConstraints:
    """
    Return the constraints of a linkage at inputs; without rates, these move at 1.

    A SingularError says that they are not as many as unknowns.
    """
    rates = [1.0] * len(inputs) if rates is None else rates
    accelerations = [0.0] * len(inputs) if accelerations is None else accelerations
    driven = [*zip(map(arb, inputs), map(arb, rates), map(arb, accelerations), strict=True)]
    equations: ExactConstraints
    untyped: Any = closure
    if isinstance(closure, PlanarClosure):
        equations = _PlanarConstraints(closure, driven)
    else:
        from linkage_ros.tools.study.spatial_enclosure import (
            SpatialConstraints,  # local import: in space only
        )

        equations = SpatialConstraints(untyped, driven)
    more = len(equations.constraints) - equations.count
    if more:
        reason = f'{abs(more)} constraints {"more" if more > 0 else "less"} than unknowns'
        raise SingularError(f'{reason}: the exact joints do not exist')
    return equations


class _PlanarConstraints(ExactConstraints):
    """The constraints of a planar linkage."""

    def __init__(self, closure: PlanarClosure, driven: Sequence[tuple[Any, Any, Any]]) -> None:
        self._linkage = linkage = closure.linkage
        moving = [name for name in linkage.links if name != GROUND]
        self._links = {name: 1 + 4 * k for k, name in enumerate(moving)}
        self.count = 4 * len(moving)
        unit = max(abs(complex(*z)) for points in linkage.links.values() for z in points.values())
        self.scale = 2.0 ** frexp(unit)[1]
        self.constraints = []
        for k in self._links.values():
            along = self._direction_form(k, 1)
            self.constraints.append([*_dot_product(along, along), constant_term(-1, 0, 0)])
        carriers: dict[str, str] = {}
        for link, points in linkage.links.items():
            for point in points:
                if point in carriers:
                    self._add_pin(
                        self._point_form(link, point), self._point_form(carriers[point], point)
                    )
                carriers.setdefault(point, link)
        self._slides = {}
        for name, slider in linkage.sliders.items():
            end = self._point_form(slider.block or carriers[slider.point], slider.point)
            between = _subtract_forms(end, self._point_form(slider.along, slider.through))
            line = acb(*slider.direction)
            along = self._link_direction(slider.along, line / abs(line))
            self._slides[name] = _dot_product(along, between)
            self.constraints.append(_cross_product(along, between))
            if slider.block:
                angle = arb(slider.angle)
                turned = self._link_direction(slider.along, acb(angle.cos(), angle.sin()))
                self.constraints.append(
                    _cross_product(turned, self._link_direction(slider.block, acb(1)))
                )
        for joint, (x, v, a) in zip(linkage.inputs, driven, strict=True):
            if joint.slider:
                slide = (-x / self.scale, -v / self.scale, -a / self.scale)
                self.constraints.append([*self._slides[joint.slider], (slide, 0, 0)])
                continue
            unit_vector = acb(x.cos(), x.sin())
            series = (unit_vector, unit_vector * acb(0, v), unit_vector * acb(-v * v, a))
            self.constraints.append(
                _cross_product(
                    self._link_direction(joint.parent, acb(1)),
                    self._link_direction(joint.child, acb(1)),
                    series,
                )
            )

    def initial_unknowns(self, closure: PlanarClosure, inputs: Sequence[float]) -> list[Any]:
        position = closure.position(*inputs)
        if not position.joints:
            raise ValueError(f'{inputs}: the linkage is {position.status.name.lower()}')
        angles, points = closure.link_angles(position), closure.points(position)
        unknowns = [arb(1)]
        for link in self._links:
            name, arm = next(iter(self._linkage.links[link].items()))
            direction = rect(1.0, angles[link])
            place = (points[link, name] - complex(*arm) * direction) / self.scale
            unknowns += [arb(x) for x in (direction.real, direction.imag, place.real, place.imag)]
        return unknowns

    def joint_values(self, *motion: Sequence[Any]) -> tuple[Any, ...]:
        return tuple(
            self._joint_angle(joint, motion)
            if isinstance(joint, RevoluteJoint)
            else evaluate_terms(self._slides[joint.slider], motion) * self.scale
            for joint in self._linkage.joints.values()
        )

    def _joint_angle(self, joint: RevoluteJoint, motion: Sequence[Sequence[Any]]) -> Any:
        """Return an angle; for u on the unit circle its derivatives are u × u' and u × u''."""
        units = []
        for link in (joint.child, joint.parent):
            if link == GROUND:
                units.append([acb(1), acb(0), acb(0)])
            else:
                k = self._links[link]
                units.append([acb(x[k], x[k + 1]) for x in motion])
        child, parent = units
        if len(motion) > 1:
            order = len(motion) - 1
            return _complex_cross(child[0], child[order]) - _complex_cross(
                parent[0], parent[order]
            )
        between = child[0] * _conjugate(parent[0])
        if between.real < 0:
            return (-between).log().imag + arb.pi()
        return between.log().imag

    def _add_pin(self, first: Form, second: Form) -> None:
        between = _subtract_forms(first, second)
        self.constraints.append([constant_term(c.real, 0, k) for k, c in between])
        self.constraints.append([constant_term(c.imag, 0, k) for k, c in between])

    def _point_form(self, link: str, point: str) -> Form:
        z = acb(*self._linkage.links[link][point]) / arb(self.scale)
        if link == GROUND:
            return [(0, z)]
        k = self._links[link]
        return [*self._direction_form(k, z), (k + 2, acb(1)), (k + 3, acb(0, 1))]

    def _link_direction(self, link: str, unit: Any) -> Form:
        return [(0, unit)] if link == GROUND else self._direction_form(self._links[link], unit)

    @staticmethod
    def _direction_form(k: int, z: Any) -> Form:
        return [(k, acb(z)), (k + 1, acb(0, 1) * z)]


def _iterate_newton(equations: ExactConstraints, start: list[Any]) -> list[Any] | None:
    """Return the unknowns to the present precision, or None where their matrix is singular."""
    x, enough = start, max(2.0 ** (-2 * _RADIUS), 2.0 ** (8 - ctx.prec))
    try:
        for _ in range(12):
            step = equations.compute_jacobian(x).solve(
                arb_mat([[v] for v in equations.compute_residuals([x])])
            )
            x = [arb(1), *((a - b).mid() for a, b in zip(x[1:], step.entries(), strict=True))]
            if max(float(abs(entry).mid()) for entry in step.entries()) < enough:
                break
    except ZeroDivisionError:
        return None
    return x


def _prove_solution(equations: ExactConstraints, start: list[Any]) -> list[Any] | None:
    """Return balls that hold exactly one solution, or None."""
    x = _iterate_newton(equations, start)
    if x is None:
        return None
    try:
        inverse = equations.compute_jacobian(x).inv().mid()
    except ZeroDivisionError:
        return None
    radius = arb(0, arb(2) ** -_RADIUS)
    ball = [arb(1), *(component + radius for component in x[1:])]
    constant = inverse * arb_mat([[v] for v in equations.compute_residuals([x])])
    identity = arb_mat(
        equations.count,
        equations.count,
        [int(i == j) for i in range(equations.count) for j in range(equations.count)],
    )
    spread = (identity - inverse * equations.compute_jacobian(ball)) * arb_mat(
        [[radius]] * equations.count
    )
    image = [
        middle - c + s
        for middle, c, s in zip(x[1:], constant.entries(), spread.entries(), strict=True)
    ]
    if all(b.contains_interior(k) for b, k in zip(ball[1:], image, strict=True)):
        return [arb(1), *image]
    return None


def _dot_product(first: Form, second: Form) -> list[Term]:
    return [constant_term((_conjugate(c) * d).real, i, j) for i, c in first for j, d in second]


def _cross_product(first: Form, second: Form, turn: Sequence[Any] = ()) -> list[Term]:
    """Return one × other, with the first rotated by the series of a unit vector."""
    if not turn:
        return [constant_term((_conjugate(c) * d).imag, i, j) for i, c in first for j, d in second]
    return [
        (tuple((_conjugate(c * t) * d).imag for t in turn), i, j)
        for i, c in first
        for j, d in second
    ]


def _subtract_forms(first: Form, second: Form) -> Form:
    return [*first, *((k, -c) for k, c in second)]


def _complex_cross(first: Any, second: Any) -> Any:
    return (_conjugate(first) * second).imag


def _conjugate(number: Any) -> Any:
    return acb(number.real, -number.imag)
