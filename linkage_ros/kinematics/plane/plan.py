# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The steps that solve a linkage, made from its groups."""

from __future__ import annotations

from cmath import phase, rect
from collections.abc import Callable
from dataclasses import replace
from math import inf, lcm
from typing import Any, NamedTuple

from linkage_ros.errors import DefinitionError, list_names, quote
from linkage_ros.kinematics.analysis.grashof import nearly_paired
from linkage_ros.kinematics.arithmetic import cross_product, resolve_along, ROUNDING, UNIT_ROUNDOFF
from linkage_ros.kinematics.plane.diagonals import AnyDiagonal, CrankDiagonal, FreeDiagonal
from linkage_ros.kinematics.plane.dyads.prp import CrankPRPDyad, PRPDyad
from linkage_ros.kinematics.plane.dyads.rpp import RPPDyad
from linkage_ros.kinematics.plane.dyads.rpr import RPRDyad, swivel_diagonal
from linkage_ros.kinematics.plane.dyads.rrp import RRPDyad
from linkage_ros.kinematics.plane.dyads.rrr import (
    crank_diagonal,
    DrivenOffset,
    DrivenRRRDyad,
    DyadSide,
    FoldingRRRDyad,
    InvertedRRRDyad,
    RRRDyad,
)
from linkage_ros.kinematics.plane.dyads.two_sided import TwoSided
from linkage_ros.kinematics.plane.linkage import Input, Linkage
from linkage_ros.kinematics.plane.meant_lengths import (
    four_bar_lengths,
    rail_lengths,
    swivel_lengths,
)
from linkage_ros.kinematics.plane.rail import (
    CrankRail,
    FreeRail,
    NearlyCrossingRail,
    Rail,
    UnsignedRail,
)
from linkage_ros.kinematics.plane.rough_pose import close_in_pose, guess_unknowns
from linkage_ros.kinematics.plane.sides import closing_name, SIDES, telling_part, TwoWays
from linkage_ros.kinematics.plane.solved_links import (
    Angle,
    Attachment,
    count_turns,
    PlanStart,
    Slide,
    SlideLine,
    solve_geared_links,
    SolvedLinks,
)
from linkage_ros.kinematics.plane.topology import (
    assur_groups,
    Driven,
    Dyad,
    GearedLinks,
    Iterated,
    Structure,
)
from linkage_ros.kinematics.step import RelativeAngle

_LEVEL = Angle(0, 0.0, 1 + 0j)
"""The zero direction of angles in the frame of the ground."""


class _Hinge(NamedTuple):
    """The pins A and D of a dyad on two links that are pinned together at O."""

    # OA and OD, in the unit of the lengths.
    a: float
    d: float
    # Coordinates of the two links, and the angle from OD to OA minus their difference.
    arms: tuple[int, int]
    offset: float
    base: Angle  # The zero of the directions that a `CrankDiagonal` gives
    # Whether the link of A is the crank, that is the one of the two that is known later.
    crank_first: bool

    def upright_sign(self, diagonal: CrankDiagonal) -> int:
        """
        Return the sign of a dyad on the side +1 for a crank between 0 and π from the ground.

        A dyad that folds has the sign of the half angle from OD to OA. If OD is the crank and OA
        the ground, that sign is negative there.
        """
        return -1 if diagonal.crosses[0] and not self.crank_first else 1


class SolutionPlan(SolvedLinks):
    """
    Makes the steps of a linkage, Assur group after Assur group.

    ``nominal``, if there is one, determines the assembly and the change points that are passed.
    """

    def __init__(
        self,
        linkage: Linkage,
        structure: Structure,
        start: PlanStart | None = None,
        nominal: SolutionPlan | None = None,
    ) -> None:
        super().__init__(linkage, structure, start or PlanStart.alone(linkage, structure))
        self._structure = structure
        self._assembly = dict(linkage.assembly)
        # The dyads that close in two ways; those of the nominal linkage by name, with its steps.
        self.two_ways: list[TwoWays] = []
        self._settled = 0
        self._nominal: dict[str, TwoSided] = {}
        if linkage.nominal is not None:
            nominal = SolutionPlan(linkage.nominal, assur_groups(linkage.nominal))
        if nominal is not None:
            self._nominal = {
                way.assembly_key: nominal.two_sided_step(way) for way in nominal.two_ways
            }
        self._missing: dict[str, str] = {}
        self._driven = linkage.driven_joints
        for self.group, group in enumerate(structure.groups):
            if isinstance(group, Driven):
                self._add_driven(group)
            elif isinstance(group, Dyad):
                self._add_dyad(group)
            else:
                self._choose_sides()  # these start from the links before them
                if isinstance(group, GearedLinks):
                    self._add_geared(group)
                else:
                    self._add_iteration(group)
            self.turn_joints()
        self._choose_sides()
        for name in self._assembly:
            keys = list_names(repr(way.assembly_key) for way in self.two_ways)
            raise DefinitionError(
                f'assembly.{name}',
                f'{quote(name)} does not close a dyad that has two assemblies',
                f'name {keys}' if keys else 'leave it out',
            )

    def two_sided_step(self, way: TwoWays) -> Any:
        """Return the step of a dyad that closes in two ways, a `TwoSided`."""
        return self.steps[way.step]

    def _choose_sides(self) -> None:
        """Bring the new dyads into the assembly of the file, or refuse it."""
        settled, self._settled = self._settled, len(self.two_ways)
        new = self.two_ways[settled:]
        if self._nominal:
            return
        pose = self._linkage.pose
        crosses = any(way.crosses and way.written for way in new)
        if pose is not None and new and (pose.is_drawn or crosses):
            from linkage_ros.kinematics.plane.drawn_pose import (
                drawn_signs,  # local import: few linkages need it
            )

            for way, sign in drawn_signs(self._linkage, self, new):
                self.steps[way.step] = self.two_sided_step(way).with_sign(sign)
                self._missing.pop(way.assembly_key, None)
        if self._missing:
            verb = 'is' if len(self._missing) == 1 else 'are'
            remedy = f'write {list_names(self._missing.values())}'
            drawn = [
                way for way in self.two_ways if way.crosses and way.assembly_key in self._missing
            ]
            if drawn:
                parts = (telling_part(self.points, way.dyad) for way in drawn)
                points = list_names(f'{point}: [x, y]' for _, point in parts if point)
                remedy = (
                    f'draw it, since its side changes at change points: '
                    f'pose: {{inputs: [...], points: {{{points}}}}}'
                )
            raise DefinitionError(
                'assembly', f'{list_names(map(repr, self._missing))} {verb} missing', remedy
            )

    def _add_driven(self, driven: Driven) -> None:
        joint, index = driven.joint, self.drive_coordinate(driven.index)
        angle = self.angles[joint.to]
        if joint.kind == 'R':
            sign = 1.0 if self._driven[driven.index].child == joint.link else -1.0
            coordinate = index
            if angle.coordinate or sign < 0.0:
                self.add_step(RelativeAngle(angle.coordinate, index, sign))
                coordinate = self.new_coordinates(1)
                before = self.turns_with.get(angle.coordinate)
                with_input = self.turns_with.get(index)
                if before is not None and with_input is not None:
                    self.turns_with[coordinate] = tuple(
                        first + sign * second
                        for first, second in zip(before, with_input, strict=True)
                    )
            self.angles[joint.link] = Angle(coordinate, angle.constant, angle.unit)
            self.attach_to_pin(joint.link, joint)
            return
        point = self.point_of(joint.name, joint.link)
        line = self.slider_line(joint.name, joint.to, point)
        self.attach_to_slider(joint.link, point, joint.to, line, Slide(index, line.sign))
        self.slides[joint.name] = Slide(index, 1.0)

    def _add_dyad(self, dyad: Dyad) -> None:
        if len(dyad.bodies[0]) > 1 or len(dyad.bodies[1]) > 1:
            self._add_driven_rrr(dyad)
            return
        {
            'RRR': self._add_rrr,
            'RRP': self._add_rrp,
            'RPR': self._add_rpr,
            'PRP': self._add_prp,
            'RPP': self._add_rpp,
        }[dyad.kind](dyad)

    def _add_rrr(self, dyad: Dyad) -> None:
        (first_link,), (second_link,) = dyad.bodies
        first, second = dyad.outer
        closing = dyad.inner.name
        first_arm = self.pin_vector(first_link, first.name, closing)
        second_arm = self.pin_vector(second_link, second.name, closing)
        b, c = abs(first_arm), abs(second_arm)
        hinge = self._find_hinge(first.name, second.name)
        if hinge is not None and self._drawn_in_space:
            a, b, c, d = four_bar_lengths(hinge.a, b, c, hinge.d)
            hinge = hinge._replace(a=a, d=d)

        def make_diagonal(
            a: float, d: float, arms: tuple[int, int], angle: float, turns_known: bool
        ) -> CrankDiagonal:
            crosses = self._change_points(dyad, (a, b, c, d))
            return crank_diagonal(a, b, c, d, arms, angle, turns_known, crosses)

        diagonal, base, upright = self._make_diagonal(
            dyad, hinge, (abs(b - c), b + c, 4.0 * b * c), make_diagonal
        )
        kind: type[RRRDyad] = FoldingRRRDyad if FoldingRRRDyad.passes_fold(diagonal) else RRRDyad
        self._add_two_sided(dyad, kind(diagonal, b, c, 1), upright)
        k = self.new_coordinates(2)
        self.angles[first_link] = _link_angle(k, base, first_arm)
        self.angles[second_link] = _link_angle(k + 1, base, second_arm)
        self.attach_to_pin(first_link, first)
        self.attach_to_pin(second_link, second)

    def _add_rpr(self, dyad: Dyad) -> None:
        (rail,), (block,) = dyad.bodies
        first, second = dyad.outer
        name = dyad.inner.name
        start = self.points[rail][first.name]
        line = self.slider_line(name, rail, self.points[block][second.name])
        foot = (line.start - start) * line.direction.conjugate()
        offset = foot.imag
        if abs(offset) <= 4.0 * UNIT_ROUNDOFF * (abs(line.start) + abs(start)):
            offset = 0.0

        def make_diagonal(
            a: float, d: float, arms: tuple[int, int], angle: float, turns_known: bool
        ) -> CrankDiagonal:
            crosses = self._change_points(dyad)
            return swivel_diagonal(a, d, offset, arms, angle, turns_known, crosses)

        hinge = self._find_hinge(first.name, second.name)
        if hinge is not None and self._drawn_in_space:
            a, d, offset = swivel_lengths(hinge.a, hinge.d, offset)
            hinge = hinge._replace(a=a, d=d)
        diagonal, base, upright = self._make_diagonal(
            dyad, hinge, (abs(offset), inf, inf), make_diagonal
        )
        self._add_two_sided(dyad, RPRDyad(diagonal, offset, 1), upright)
        k = self.new_coordinates(2)
        self.angles[rail] = _link_angle(k, base, line.direction)
        self.angles[block] = self.angles[rail].rotate_by(line.angle)
        self.slides[name] = Slide(k + 1, 1.0, -foot.real)
        self.attach_to_pin(rail, first)
        self.attach_to_pin(block, second)

    def _add_rrp(self, dyad: Dyad) -> None:
        (link,), (block,) = dyad.bodies
        first, second = dyad.outer
        closing, name = dyad.inner.name, second.name
        arm = self.pin_vector(link, first.name, closing)
        point = self.points[block][closing]
        line = self.slider_line(name, second.to, point)
        base = self.angles[second.to].vector_angle(line.direction)
        rail = self._make_rail(dyad, first.name, second.to, line, abs(arm))
        self._add_two_sided(dyad, RRPDyad(rail, 1))
        k = self.new_coordinates(2)
        self.angles[link] = _link_angle(k, base, arm)
        self.attach_to_pin(link, first)
        self.attach_to_slider(block, point, second.to, line, Slide(k + 1, 1.0))
        self.slides[name] = Slide(k + 1, line.sign)

    def _add_prp(self, dyad: Dyad) -> None:
        first, second = (outer.to for outer in dyad.outer)
        pivot = self.common_pin(first, second, ())
        if pivot is not None:
            self._add_crank_prp(dyad, pivot)
            return
        starts, arms, units = [], [], []
        k = self.coordinate_count
        for i, ((body,), outer) in enumerate(zip(dyad.bodies, dyad.outer, strict=True)):
            point = self.points[body][dyad.inner.name]
            line = self.slider_line(outer.name, outer.to, point)
            starts.append(self.place_point(outer.to, line.start))
            arms.append(self.angles[outer.to].coordinate)
            units.append(self.angles[outer.to].unit * line.direction)
            self.attach_to_slider(body, point, outer.to, line, Slide(k + i, 1.0))
            self.slides[outer.name] = Slide(k + i, line.sign)
        self.add_step(PRPDyad((starts[0], starts[1]), (arms[0], arms[1]), (units[0], units[1])))
        self.new_coordinates(2)

    def _add_crank_prp(self, dyad: Dyad, pivot: str) -> None:
        offsets, angles, size = [], [], 0.0
        k = self.coordinate_count
        for i, ((body,), outer) in enumerate(zip(dyad.bodies, dyad.outer, strict=True)):
            point, center = self.points[body][dyad.inner.name], self.points[outer.to][pivot]
            line = self.slider_line(outer.name, outer.to, point)
            way, offset = resolve_along(line.start - center, line.direction)
            offsets.append(offset)
            angles.append(self.angles[outer.to].vector_angle(line.direction))
            size += abs(line.start - center)
            foot = replace(line, start=center + 1j * offset * line.direction)
            self.attach_to_slider(body, point, outer.to, foot, Slide(k + i, 1.0))
            self.slides[outer.name] = Slide(k + i, line.sign, -line.sign * way)
        first, second = angles
        arms = first.coordinate, second.coordinate
        across = second.unit * first.unit.conjugate()
        self.add_step(CrankPRPDyad((offsets[0], offsets[1]), size, arms, across))
        self.new_coordinates(2)

    def _add_rpp(self, dyad: Dyad) -> None:
        (link,), (carrier,) = dyad.bodies
        first, second = dyad.outer
        point = self.point_of(second.name, carrier)
        outer = self.slider_line(second.name, second.to, point)
        inner = self.slider_line(dyad.inner.name, carrier, self.points[link][first.name])
        turn = rect(1.0, outer.angle)
        direction = turn * inner.direction
        if abs((direction * outer.direction.conjugate()).imag) <= ROUNDING:
            raise DefinitionError(
                f'sliders.{dyad.inner.name}.direction',
                f'is parallel to the direction of {second.name!r}',
                'give the two sliders different directions',
            )
        constant = (inner.start - point) * turn
        level = SlideLine(outer.start, 1 + 0j, 0.0, 1.0)
        rail = self._make_rail(dyad, first.name, second.to, level, inf)
        offsets = (
            cross_product(constant, outer.direction),
            cross_product(inner.start - point, inner.direction),
        )
        self.add_step(RPPDyad(rail, direction, outer.direction, offsets))
        k = self.new_coordinates(2)
        self.attach_to_slider(carrier, point, second.to, outer, Slide(k + 1, 1.0))
        self.slides[second.name] = Slide(k + 1, outer.sign)
        self.slides[dyad.inner.name] = Slide(k, inner.sign)
        self.angles[link] = self.angles[carrier].rotate_by(inner.angle)
        self.attach_to_pin(link, first)

    def _add_driven_rrr(self, dyad: Dyad) -> None:
        if self._add_inverted_rrr(dyad):
            return
        closing = dyad.inner.name
        first, second = dyad.outer
        sides = [
            DyadSide(
                self.points[outer.link][outer.name],
                self.points[end][closing],
                self._link_transforms(end, outer.link),
            )
            for outer, end in zip(dyad.outer, (dyad.inner.link, dyad.inner.to), strict=True)
        ]
        ends = self.place_pin(first.name), self.place_pin(second.name)
        self._add_two_sided(dyad, DrivenRRRDyad(ends, (sides[0], sides[1]), 1))
        k = self.new_coordinates(2)
        for i, outer in enumerate(dyad.outer):
            self.angles[outer.link] = Angle(k + i, 0.0, 1 + 0j)
            self.attach_to_pin(outer.link, outer)

    def _add_inverted_rrr(self, dyad: Dyad) -> bool:
        """Add a dyad whose outer pins lie on one link, and one of whose sides an input bends."""
        ends = [*zip(dyad.outer, (dyad.inner.link, dyad.inner.to), (1, -1), strict=True)]
        bent = [end for end in ends if end[0].link != end[1]]
        if len(bent) != 1 or dyad.outer[0].to != dyad.outer[1].to:
            return False
        ((first, end, order),) = bent
        ((second, carrier, _),) = (end for end in ends if end[0].link == end[1])
        transform, *more = self._link_transforms(end, first.link)
        if more or transform.turn < 0:
            return False
        closing = dyad.inner.name
        # From P to A and to B, from B to D, and from A to D on the link that carries both.
        to_first = self.points[first.link][first.name] - transform.origin
        to_closing = self.points[end][closing] - transform.inner
        to_second = self.pin_vector(carrier, closing, second.name)
        between = self.pin_vector(first.to, first.name, second.name)
        a, b, c, d = map(abs, (to_closing, to_second, between, to_first))
        if not (a and d):
            return False
        if self._drawn_in_space:
            a, b, c, d = four_bar_lengths(a, b, c, d)
        offset = transform.sign * phase(to_closing * to_first.conjugate())
        crosses = self._change_points(dyad, (a, b, c, d))
        diagonal = crank_diagonal(a, b, c, d, (transform.turn, 0), offset, True, crosses)
        kind: type[RRRDyad] = FoldingRRRDyad if FoldingRRRDyad.passes_fold(diagonal) else RRRDyad
        base = self.angles[first.to].vector_angle(between)
        flip = order * int(transform.sign)
        step = InvertedRRRDyad(
            kind(diagonal, b, c, 1), base.coordinate, transform.turn, transform.sign, flip
        )
        self._add_two_sided(dyad, step)
        k = self.new_coordinates(2)
        self.angles[first.link] = _link_angle(k, base, to_first)
        self.angles[carrier] = _link_angle(k + 1, base, to_second)
        self.attach_to_pin(first.link, first)
        self.attach_to_pin(carrier, second)
        return True

    def _add_geared(self, group: GearedLinks) -> None:
        waiting = list(self._structure.joints_of(group))
        held = {*self.angles}
        while waiting:
            joint = next(joint for joint in waiting if held & {joint.link, joint.to})
            waiting.remove(joint)
            if joint.link in held:
                joint = replace(joint, link=joint.to, to=joint.link)
            held.add(joint.link)
            self.attach_to_pin(joint.link, joint)
        pose = self._pose_of_geared(group)
        for link, step in zip(
            group.links, solve_geared_links(self._linkage, group, self.angles, pose), strict=True
        ):
            self.add_step(step)
            coordinate = self.new_coordinates(1)
            turned = [(factor, self.turns_with[k]) for k, factor in step.factors]
            by_input = zip(*([f * turn for turn in turns] for f, turns in turned), strict=True)
            with_input = tuple(map(sum, by_input)) or self.turns_with[0]
            self.turns_with[coordinate] = with_input
            self.ratio_turns = lcm(self.ratio_turns, count_turns(with_input[0]))
            self.angles[link] = Angle(coordinate, 0.0, 1 + 0j)

    def _pose_of_geared(self, group: GearedLinks) -> tuple[list[float], list[float]] | None:
        """Return the coordinates in the pose, and the angles of a group, if it draws its links."""
        pose = self._linkage.pose
        named = {*pose.points, *pose.angles} if pose else set()
        if not any(named & {link, *self.points[link]} for link in group.links):
            return None
        known = [*self.angles]
        pins = {
            point: self.place_pin(point)
            for link in group.links
            for point in self.points[link]
            if any(point in self.points[link] for link in known)
        }
        state = close_in_pose(self._linkage, self.scale, self.steps)
        places = {name: state.pins[index] for name, index in pins.items()}
        start = guess_unknowns(self._linkage, group.links, self, places, state)
        return state.coordinates, start[0::3]

    def _add_iteration(self, group: Iterated) -> None:
        from linkage_ros.kinematics.iterated.group_equations import (
            make_iterated_step,  # local import: it loads numpy
        )

        joints = self._structure.joints_of(group)
        step, slides = make_iterated_step(self._linkage, group, joints, self)
        self.add_step(step)
        k = self.new_coordinates(len(group.links) + len(slides))
        for i, link in enumerate(group.links):
            self.angles[link] = Angle(k + i, 0.0, 1 + 0j)
            point = next(iter(self.points[link].values()))
            self.attachments[link] = Attachment(point, link, pin=self.pin_count + i)
        self.pin_count += len(group.links)
        for i, name in enumerate(slides):
            self.slides[name] = Slide(k + len(group.links) + i, 1.0)

    def _link_transforms(self, start: str, end: str) -> tuple[DrivenOffset, ...]:
        """Return the transformations from one link of a body to another, by its driven joints."""
        ways: dict[str, tuple[DrivenOffset, ...]] = {start: ()}
        while end not in ways:
            for i, driven in enumerate(self._driven):
                for first, second in self._joined_links(i) if self.has_drive(i) else ():
                    if first in ways and second not in ways:
                        ways[second] = (
                            *ways[first],
                            self._link_transform(self.drive_coordinate(i), driven, first, second),
                        )
        return ways[end]

    def _joined_links(self, index: int) -> tuple[tuple[str, str], tuple[str, str]]:
        driven = self._driven[index]
        first, second = driven.parent, driven.child
        if driven.slider:
            first, second = self._linkage.sliders[driven.slider].along, self.blocks[driven.slider]
        return (first, second), (second, first)

    def _link_transform(self, index: int, driven: Input, inner: str, outer: str) -> DrivenOffset:
        if driven.slider:
            point = self.point_of(driven.slider, inner)
            line = self.slider_line(driven.slider, outer, point)
            self.slides[driven.slider] = Slide(index, 1.0)
            return DrivenOffset(
                line.start, point, line.angle, -1, index, line.sign, line.direction
            )
        (pin,) = set(self.points[inner]) & set(self.points[outer])
        sign = 1.0 if driven.child == inner else -1.0
        return DrivenOffset(
            self.points[outer][pin], self.points[inner][pin], 0.0, index, -1, sign, 0j
        )

    def _make_diagonal(
        self,
        dyad: Dyad,
        hinge: _Hinge | None,
        limits: tuple[float, float, float],
        make_diagonal: Callable[..., CrankDiagonal],
    ) -> tuple[AnyDiagonal, Angle, int]:
        """Return the diagonal of a dyad, the zero of its directions, and its upright sign."""
        if hinge is None:
            first, second = (outer.name for outer in dyad.outer)
            ends = self.place_pin(first), self.place_pin(second)
            return FreeDiagonal(ends, limits), _LEVEL, 1
        turns_known = self._driven_only(hinge.arms)
        diagonal = make_diagonal(hinge.a, hinge.d, hinge.arms, hinge.offset, turns_known)
        return diagonal, hinge.base, hinge.upright_sign(diagonal)

    def _change_points(
        self, dyad: Dyad, lengths: tuple[float, float, float, float] | None = None
    ) -> tuple[bool, bool] | None:
        """
        Return the change points of a dyad on a crank; None if its own lengths determine them.

        Else the nominal linkage determines them, or the parallelogram, kite or rhombus that a
        four-bar of such lengths nearly is.
        """
        if self._nominal:
            return self._nominal[closing_name(dyad)].crosses
        nearly = nearly_paired(*lengths) if lengths else None
        return nearly.crosses if nearly else None

    @property
    def _drawn_in_space(self) -> bool:
        """Return whether lengths are of places in space, which are rounded."""
        return self._linkage.corrections is not None

    def _find_hinge(self, first: str, second: str) -> _Hinge | None:
        """Return the links with a common pin O that carry two pins, or None."""
        known = list(self.angles)
        for second_link in self.carrying_links(second):
            for first_link in self.carrying_links(first):
                pivot = self.common_pin(first_link, second_link, (first, second))
                if pivot:
                    a, d = (
                        self.pin_vector(first_link, pivot, first),
                        self.pin_vector(second_link, pivot, second),
                    )
                    angle, base = (
                        self.angles[first_link].vector_angle(a),
                        self.angles[second_link].vector_angle(d),
                    )
                    offset = phase(angle.unit * base.unit.conjugate())
                    arms = angle.coordinate, base.coordinate
                    later = known.index(first_link) > known.index(second_link)
                    return _Hinge(abs(a), abs(d), arms, offset, base, later)
        return None

    def _make_rail(self, dyad: Dyad, pin: str, on: str, line: SlideLine, length: float) -> Rail:
        """Return a line on a known link as the rail of a known pin."""
        base = self.angles[on].vector_angle(line.direction)
        for link in self.carrying_links(pin):
            pivot = self.common_pin(link, on, (pin,))
            if pivot:
                angle = self.angles[link]
                arm = self.pin_vector(link, pivot, pin) * angle.unit * base.unit.conjugate()
                place = (self.points[on][pivot] - line.start) * line.direction.conjugate()
                if length < inf and self._drawn_in_space:
                    length, height = rail_lengths(abs(arm), length, place.imag)
                    place = complex(place.real, height)
                arms = angle.coordinate, base.coordinate
                rail = CrankRail(arm, place, length, arms)
                # As for a parallelogram: both roots change their sign with a whole turn.
                turns_matter = len(rail.singular_angles) < 2
                crosses = self._change_points(dyad) if dyad.kind == 'RRP' else None
                if crosses is not None and crosses != rail.crosses:
                    turns_matter = not all(crosses)
                    rail = NearlyCrossingRail(arm, place, length, arms, crosses)
                if turns_matter and not self._driven_only(arms):
                    return UnsignedRail(arm, place, length, arms)
                return rail
        ends = self.place_point(on, line.start), self.place_pin(pin)
        return FreeRail(ends, length, base.coordinate, base.unit)

    def _driven_only(self, arms: tuple[int, int]) -> bool:
        """Return whether two coordinates are sums of inputs, so that their turns are known."""
        return set(arms) <= set(self.turns_with)

    def _add_two_sided(self, dyad: Dyad, step: Any, upright: int = 1) -> None:
        """
        Add the step of a dyad that closes in two ways, on the side that the file writes.

        ``upright`` is the sign of its diagonal or rail on the side +1.
        """
        name, sides = closing_name(dyad), SIDES[dyad.kind]
        crosses = any(step.crosses)
        first, second = (outer.name for outer in dyad.outer)
        meaning = {
            'RRR': f'the side of {first}→{second}',
            'RPR': f'where {second} lies from {first}',
            'RRP': f'where {dyad.inner.name} lies from {first}',
        }[dyad.kind]
        choices = ' or '.join(sides)
        side = self._assembly.pop(name, None)
        if side is None:
            self._missing[name] = f'{name}: {choices} ({meaning})'
        elif side not in sides:
            raise DefinitionError(
                f'assembly.{name}', f'{quote(side)} is not a side', f'write {choices} ({meaning})'
            )
        written = sides[side] if side else 0
        sign = self._nominal[name].sign if self._nominal else (written or 1) * upright
        self.two_ways.append(TwoWays(dyad, len(self.steps), written, crosses, upright))
        self.add_step(step.with_sign(sign))


def _link_angle(coordinate: int, base: Angle, vector: complex) -> Angle:
    """Return the angle of a link, given the coordinate of its vector, measured from a base."""
    unit = base.unit * (vector / abs(vector)).conjugate()
    return Angle(coordinate, base.constant - phase(vector), unit)
