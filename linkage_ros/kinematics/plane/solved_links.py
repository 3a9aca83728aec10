# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The links that are known so far, their places, and the steps that place their points.

Lengths are in the unit of ``scale`` metres: a power of two near the longest length, so that
scaling causes no rounding error. Each point is placed by its own step, and only if it is needed.

Links that ratios turn against links whose whole turns are known have sums as their angles.
"""

from __future__ import annotations

from cmath import phase, rect
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import frexp, hypot, lcm, ldexp, tau

from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics.plane.linkage import (
    GROUND,
    Linkage,
    Point,
    Ratio,
    RevoluteJoint,
    SlideJoint,
)
from linkage_ros.kinematics.plane.topology import (
    find_followed_links,
    GearedLinks,
    Joint,
    Structure,
)
from linkage_ros.kinematics.step import (
    FixedPoint,
    FollowerJoint,
    GearedAngle,
    PointOnLink,
    PointOnRail,
    Step,
    TurnsNear,
)

_MOST_TEETH = 1000
_ROUNDED = 1e-13
"""A ratio of teeth, both at most this number, and its relative error as a decimal number."""

_Row = dict[int, Fraction]


@dataclass(frozen=True, slots=True)
class Angle:
    """
    A link's angle: a coordinate and a constant, in [rad].

    ``unit`` is e^{i·constant}. It is made from lengths where they are known, so that an axis stays
    exact and no angle is rounded at the size of a sum.
    """

    coordinate: int
    constant: float
    unit: complex

    def rotate_by(self, angle: float, unit: complex | None = None) -> Angle:
        """Return the angle of a direction at a constant angle to the link."""
        turned = rect(1.0, angle) if unit is None else unit
        return Angle(self.coordinate, self.constant + angle, self.unit * turned)

    def vector_angle(self, vector: complex) -> Angle:
        """Return the angle of a vector fixed to the link."""
        return self.rotate_by(phase(vector), vector / abs(vector))


@dataclass(frozen=True, slots=True)
class Slide:
    """A slide: ± a coordinate, and a constant, in the unit of the lengths."""

    coordinate: int
    sign: float
    constant: float = 0.0


@dataclass(frozen=True, slots=True)
class Attachment:
    """
    How a link is held: its ``point``, in its own frame, coincides with ``link_point`` of ``link``.

    With a ``slide``, the point lies that far along a line from there, whose ``direction`` is a
    unit vector in the frame of ``link``. ``pin`` is the index of a pin that an iteration placed.
    """

    point: complex
    link: str
    link_point: complex = 0j
    slide: Slide | None = None
    direction: complex = 1 + 0j
    pin: int = -1


@dataclass(frozen=True, slots=True)
class SlideLine:
    """
    The line of a point of one link along a slider, in the frame of the link that it slides on.

    The point lies at start + sign·(slide of the slider)·direction, a unit vector; ``angle`` is the
    angle of the moving link minus the angle of the other.
    """

    start: complex
    direction: complex
    angle: float
    sign: float


@dataclass(frozen=True, slots=True)
class PlanStart:
    """
    What is known before the first step of a linkage.

    Alone it is the ground and the inputs. A planar loop of another linkage has the unit, the
    coordinates and the pins of that, and starts from some of them.
    """

    scale: float  # Metres in the unit of the lengths
    inputs: tuple[int, ...]  # Coordinates of the inputs
    coordinate_count: int
    pin_count: int
    # For each coordinate that is a sum of inputs, the factor of each input: +1, −1 or 0. Such an
    # angle is known with its whole turns; other angles are known only modulo a turn.
    turns_with: dict[int, tuple[float, ...]]

    @classmethod
    def alone(cls, linkage: Linkage, structure: Structure) -> PlanStart:
        """Return the start of a linkage that is not part of another."""
        count = len(linkage.inputs)
        turns = {k: tuple(float(i + 1 == k) for i in range(count)) for k in range(1 + count)}
        scale = _find_scale(structure.links.values())
        return cls(scale, tuple(range(1, 1 + count)), 1 + count, 0, turns)


class SolvedLinks:
    """The known links of a linkage; at first the ground."""

    def __init__(self, linkage: Linkage, structure: Structure, start: PlanStart) -> None:
        self._linkage, self._start = linkage, start
        self.blocks = structure.blocks  # For each slider the link that slides
        self.scale = start.scale
        # Points of every link, in its own frame and in the unit of the lengths.
        self.points = {
            link: {
                name: complex(x / self.scale, y / self.scale) for name, (x, y) in points.items()
            }
            for link, points in structure.links.items()
        }
        # The steps; ``step_groups`` has the group number of each, ``group`` the current number.
        self.steps: list[Step] = []
        self.step_groups: list[int] = []
        # Of the known links and sliders, in terms of the coordinates.
        self.angles = {GROUND: Angle(0, 0.0, 1 + 0j)}
        self.slides: dict[str, Slide] = {}
        self.attachments: dict[
            str, Attachment
        ] = {}  # How each known link except the ground is held
        self.group = 0
        self.coordinate_count = start.coordinate_count
        self.turns_with = start.turns_with
        # The coordinates of the joints that follow others, by number among
        # `Linkage.driven_joints`, and the whole turns of a single input after which they repeat; 0
        # if they never do.
        self._followers: dict[int, int] = {}
        self._turned: set[str] = set()
        """The joints whose whole turns are chosen."""
        self.ratio_turns = 1
        self.pin_count = start.pin_count
        self._pins: dict[tuple[str, complex], int] = {}

    def place_point(self, link: str, point: complex) -> int:
        """Return the index of the pin at a known link's point, and add the steps that place it."""
        index = self._pins.get((link, point))
        if index is not None:
            return index
        if link == GROUND:
            self.add_step(FixedPoint(point))
        else:
            attachment = self.attachments[link]
            if attachment.point == point:
                index = self._place_attachment(attachment)
                self._pins[link, point] = index
                return index
            base = self.place_point(link, attachment.point)
            arm, angle = point - attachment.point, self.angles[link]
            self.add_step(PointOnLink(base, angle.coordinate, angle.unit * arm))
        return self._new_pin(link, point)

    def _place_attachment(self, attachment: Attachment) -> int:
        if attachment.pin >= 0:
            return attachment.pin
        base = self.place_point(attachment.link, attachment.link_point)
        if attachment.slide is None:
            return base
        angle, slide = self.angles[attachment.link], attachment.slide
        unit = angle.unit * (slide.sign * attachment.direction)
        self.add_step(PointOnRail(base, angle.coordinate, slide.coordinate, unit))
        self.pin_count += 1
        return self.pin_count - 1

    def _new_pin(self, link: str, point: complex) -> int:
        self._pins[link, point] = self.pin_count
        self.pin_count += 1
        return self.pin_count - 1

    def add_step(self, step: Step) -> None:
        self.steps.append(step)
        self.step_groups.append(self.group)

    def new_coordinates(self, count: int) -> int:
        self.coordinate_count += count
        return self.coordinate_count - count

    def has_drive(self, index: int) -> bool:
        """Return whether the value of a driven joint is known: an input, or one that follows."""
        count = len(self._linkage.inputs)
        if index < count:
            return True
        of = tuple(self._linkage.ratios.values())[index - count].of
        number = self._number_of(of)
        return (number >= 0 and self.has_drive(number)) or (
            find_followed_links(self._linkage, self.blocks, of) <= {*self.angles}
        )

    def drive_coordinate(self, index: int) -> int:
        """Return the coordinate of a driven joint; add the step of one that follows another."""
        count = len(self._linkage.inputs)
        if index < count:
            return self._start.inputs[index]
        if index not in self._followers:
            name, ratio = tuple(self._linkage.ratios.items())[index - count]
            self._add_follower(name, ratio)
            self._followers[index] = self.new_coordinates(1)
        return self._followers[index]

    def _add_follower(self, name: str, follower: Ratio) -> None:
        slides = isinstance(self._linkage.joints[name], SlideJoint)
        number = self._number_of(follower.of)
        if number >= 0 and self.has_drive(number):
            turning = not self._linkage.driven_joints[number].slider
            first, second, sign, constant = self.drive_coordinate(number), 0, 1.0, 0.0
        else:
            turning = isinstance(self._linkage.joints[follower.of], RevoluteJoint)
            first, second, sign, constant = self.joint_term(self._linkage.joints[follower.of])
        unit = self.scale if slides else 1.0
        ratio = follower.ratio * (1.0 if turning else self.scale) / unit
        step = FollowerJoint(
            name, first, second, sign * constant, sign * ratio, follower.offset / unit
        )
        turns, back = self.turns_with.get(first), self.turns_with.get(second)
        if turns is not None and back is not None:
            # The turns of a sum of inputs are known.
            with_input = tuple(step.ratio * (p - q) for p, q in zip(turns, back, strict=True))
            self.turns_with[self.coordinate_count] = with_input
            self.ratio_turns = lcm(self.ratio_turns, 0 if slides else count_turns(with_input[0]))
        elif turning and (slides or not follower.ratio.is_integer()):
            of = self._linkage.joints[follower.of]
            if follower.of not in self._turned:
                middle = 0.5 * (of.limits.low + of.limits.high) if of.limits.is_bounded else 0.0
                step = replace(step, middle=middle)
        self.add_step(step)

    def turn_joints(self) -> None:
        """Add the steps that turn the newly known joints near to what the linkage says."""
        for name, joint in self._linkage.joints.items():
            if not isinstance(joint, RevoluteJoint) or not joint.near or name in self._turned:
                continue
            if not {joint.parent, joint.child} <= {*self.angles}:
                continue
            self._turned.add(name)
            i, j, _, constant = self.joint_term(joint)
            ends = (i, j, 1.0) if i not in self.turns_with else (j, i, -1.0)
            if ends[0] not in self.turns_with:
                units = (self.scale if driven.slider else 1.0 for driven in self._linkage.inputs)
                factors = (value * unit for value, unit in zip(joint.near[1:], units, strict=True))
                self.add_step(TurnsNear(*ends, constant, (joint.near[0], *factors)))

    def _number_of(self, joint: str) -> int:
        """Return the number of a joint among `Linkage.driven_joints`; -1 if it is not driven."""
        names = [driven.joint for driven in self._linkage.driven_joints]
        return names.index(joint) if joint in names else -1

    def joint_term(self, joint: RevoluteJoint | SlideJoint) -> tuple[int, int, float, float]:
        """Return a known joint as factor·(x[i] − x[j]) + constant, in the unit of the lengths."""
        if isinstance(joint, SlideJoint):
            slide = self.slides[joint.slider]
            return slide.coordinate, 0, slide.sign, slide.constant
        child, parent = self.angles[joint.child], self.angles[joint.parent]
        return child.coordinate, parent.coordinate, 1.0, child.constant - parent.constant

    def attach_to_pin(self, link: str, joint: Joint) -> None:
        """Hold a link by a known pin."""
        self.attachments[link] = Attachment(
            self.points[link][joint.name], joint.to, self.points[joint.to][joint.name]
        )

    def attach_to_slider(
        self, link: str, point: complex, on: str, line: SlideLine, slide: Slide
    ) -> None:
        """Hold a link by a slider that keeps its angle."""
        self.angles[link] = self.angles[on].rotate_by(line.angle)
        self.attachments[link] = Attachment(point, on, line.start, slide, line.direction)

    def point_of(self, slider: str, link: str) -> complex:
        """Return the point of a link in a slider."""
        joint = self._linkage.sliders[slider]
        return self.points[link][joint.through if link == joint.along else joint.point]

    def slider_line(self, name: str, on: str, point: complex) -> SlideLine:
        """Return the line of a point of one link of a slider, in the frame of the other."""
        slider = self._linkage.sliders[name]
        through = self.points[slider.along][slider.through]
        sliding = self.points[self.blocks[name]][slider.point]
        direction = slider.unit
        if on == slider.along:
            start = through + rect(1.0, slider.angle) * (point - sliding)
            return SlideLine(start, direction, slider.angle, 1.0)
        start = sliding + rect(1.0, -slider.angle) * (point - through)
        return SlideLine(start, direction * rect(1.0, -slider.angle), -slider.angle, -1.0)

    def pin_vector(self, link: str, start: str, end: str) -> complex:
        """Return the vector from one pin of a link to another."""
        arm = self.points[link][end] - self.points[link][start]
        if not arm:  # different in the file, but equal at the size of the linkage
            raise DefinitionError(
                f'links.{link}', 'has two pins in one place', 'give them different places'
            )
        return arm

    def carrying_links(self, point: str) -> list[str]:
        """Return the known links that carry a point, the ground first."""
        return [link for link in self.angles if point in self.points[link]]

    def place_pin(self, point: str) -> int:
        link = self.carrying_links(point)[0]
        return self.place_point(link, self.points[link][point])

    def common_pin(self, first: str, second: str, apart: tuple[str, ...]) -> str | None:
        """Return the common pin of two links other than the given points, or None."""
        if first == second:
            return None
        shared = set(self.points[first]) & set(self.points[second]) - set(apart)
        return min(shared, default=None)


def count_turns(ratio: float) -> int:
    """Return the whole turns after which an angle that follows another repeats; 0 if never."""
    near = Fraction(ratio).limit_denominator(_MOST_TEETH)
    return near.denominator if abs(near - Fraction(ratio)) <= _ROUNDED * abs(ratio) else 0


def _find_scale(links: Iterable[Mapping[str, Point]]) -> float:
    """Return the power of two above the longest distance on a link."""
    longest = 0.0
    for points in links:
        places = list(points.values())
        for x, y in places:
            longest = max(longest, hypot(x - places[0][0], y - places[0][1]))
    return ldexp(1.0, frexp(longest)[1]) if longest else 1.0


def solve_geared_links(
    linkage: Linkage,
    group: GearedLinks,
    known: Mapping[str, Angle],
    pose: tuple[Sequence[float], Sequence[float]] | None,
) -> list[GearedAngle]:
    """
    Return the angle of each link of a group.

    Each ratio is an equation Σ a·(angle of the group) = Σ b·x + c with the coordinates x of the
    ``known`` links. ``pose`` has these coordinates, and roughly the angles of the group: they tell
    the tooth. Without a pose the joints follow each other by their values as they are written.
    """
    matrix: list[list[Fraction]] = []
    rights: list[_Row] = []  # Factors of the coordinates; −1 has the constant
    for name in group.ratios:
        ratio = linkage.ratios[name]
        row, right = [Fraction(0)] * len(group.links), {-1: Fraction(ratio.offset)}
        for joint, factor in ((name, Fraction(1)), (ratio.of, -Fraction(ratio.ratio))):
            ends = linkage.joints[joint]
            assert isinstance(ends, RevoluteJoint)
            for link, by in ((ends.child, factor), (ends.parent, -factor)):
                if link in group.links:
                    row[group.links.index(link)] += by
                else:
                    angle = known[link]
                    right[angle.coordinate] = right.get(angle.coordinate, Fraction(0)) - by
                    right[-1] -= by * Fraction(angle.constant)
        if pose is not None and (turns := count_turns(ratio.ratio)):
            # Without the turns of its links, an angle determines the other one modulo a tooth.
            x, angles = pose
            values = [1.0 if k < 0 else x[k] for k in right]
            off = sum(float(a) * value for a, value in zip(row, angles, strict=True)) - sum(
                float(b) * value for b, value in zip(right.values(), values, strict=True)
            )
            right[-1] += round(off * turns / tau) * Fraction(tau) / turns
        matrix.append(row)
        rights.append(right)
    _eliminate(matrix, rights, group)
    return [
        GearedAngle(
            tuple((k, float(b)) for k, b in sorted(right.items()) if k > 0 and b),
            float(right[-1]),
        )
        for right in rights
    ]


def _eliminate(matrix: list[list[Fraction]], rights: list[_Row], group: GearedLinks) -> None:
    """Make the matrix that of unity, by rows."""
    count = len(matrix)
    for k in range(count):
        pivot = next((i for i in range(k, count) if matrix[i][k]), None)
        if pivot is None:
            raise DefinitionError(
                f'ratios.{group.ratios[-1]}',
                f'leaves {group.links[k]!r} free, or locks it',
                'give another ratio, or let another joint follow',
            )
        matrix[k], matrix[pivot] = matrix[pivot], matrix[k]
        rights[k], rights[pivot] = rights[pivot], rights[k]
        scale = matrix[k][k]
        matrix[k] = [value / scale for value in matrix[k]]
        rights[k] = {n: value / scale for n, value in rights[k].items()}
        for i in range(count):
            by = matrix[i][k]
            if i == k or not by:
                continue
            matrix[i] = [a - by * b for a, b in zip(matrix[i], matrix[k], strict=True)]
            for n, value in rights[k].items():
                rights[i][n] = rights[i].get(n, Fraction(0)) - by * value
