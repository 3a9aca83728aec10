# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The equations of a group of links that no dyad covers, as straight lines.

All functions take numbers or symbols and make no decision, so each is recorded on a tape as it
stands. A pin gives the place of a link from its angle: the places follow from the angles, one link
after the other, and only the equations that close loops are left to be solved. The derivatives by
the places are the constants 1 and −1, which the elimination takes first.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from operator import add
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.errors import DefinitionError, list_names
from linkage_ros.kinematics.arithmetic import (
    make_vector,
    unit_vector,
)
from linkage_ros.kinematics.iterated.bend_bounds import ArmSums, list_bounds
from linkage_ros.kinematics.iterated.elimination import subtract
from linkage_ros.kinematics.iterated.equations import (
    bound_jacobian_change,
    CoincidentPoints,
    Constraint,
    Constraints,
    differentiate_constraints,
    End,
    evaluate_constraints,
    is_meshed,
    OnLine,
)
from linkage_ros.kinematics.iterated.grid import grid_inputs
from linkage_ros.kinematics.iterated.group import Equations, GroupMotion
from linkage_ros.kinematics.iterated.iterated_step import IteratedStep
from linkage_ros.kinematics.iterated.steps_before import StepsBefore
from linkage_ros.kinematics.plane.linkage import Linkage
from linkage_ros.kinematics.plane.rough_pose import close_in_pose, guess_unknowns
from linkage_ros.kinematics.plane.topology import Iterated, Joint
from linkage_ros.kinematics.step import LinkState

if TYPE_CHECKING:
    from linkage_ros.kinematics.plane.solved_links import SolvedLinks


class _PlacedBody(NamedTuple):
    """A body that a pin places: the row of the pin's equations, and its two ends."""

    row: int
    end: End
    other: End


class GroupEquations(Equations):
    """
    As many equations as unknowns: for each of ``bodies`` links its angle and its place.

    ``free`` has the indices of the unknowns that no pin gives, ``slides`` are appended to them.
    """

    def __init__(
        self, constraints: Sequence[Constraint], slides: Iterable[OnLine], bodies: int
    ) -> None:
        self._constraints, self._slides = constraints, tuple(slides)
        self.angles = [not k % 3 for k in range(3 * bodies)]
        self._placed = _place_bodies(constraints, bodies)
        by_pins = {placed.end.body for placed in self._placed}
        self.free = tuple(k for k in range(3 * bodies) if not k % 3 or k // 3 not in by_pins)
        self._sums = ArmSums(
            {placed.end.body: (placed.end, placed.other) for placed in self._placed}
        )
        # The last first: its place is in no other of the equations that remain.
        self.unit_pivots = [
            (placed.row + axis, 3 * placed.end.body + 1 + axis)
            for placed in reversed(self._placed)
            for axis in (0, 1)
        ]
        rows = [
            constraint
            for constraint in constraints
            for _ in range(1 + isinstance(constraint, CoincidentPoints))
        ]
        rows_of_pins = {row for row, _ in self.unit_pivots}
        self.closing = [row for row in range(len(rows)) if row not in rows_of_pins]
        self._closing_constraints = [rows[row] for row in self.closing]

    def complete(self, values: Sequence[Any], solved: LinkState) -> list[Any]:
        unknowns: list[Any] = [0.0] * len(self.angles)
        for k, value in zip(self.free, values, strict=True):
            unknowns[k] = value
        for _, end, carrier in self._placed:
            k = 3 * end.body
            place = subtract(carrier.place_and_arm(unknowns, solved)[0], end.rotated_arm(unknowns))
            unknowns[k + 1], unknowns[k + 2] = place.real, place.imag
        return unknowns

    def bound_bends(self, number: int, known: LinkState, values: Sequence[Any]) -> list[Any]:
        unknowns = self.complete(values, known)
        bounds = self._sums.bound_bends(self._closing_constraints[number], unknowns, known)
        return list_bounds(bounds, self.free)

    def evaluate(
        self, known: LinkState, unknowns: Sequence[Any]
    ) -> tuple[list[Any], list[list[Any]]]:
        return evaluate_constraints(self._constraints, unknowns, known)

    def drift(self, motion: GroupMotion) -> list[Any]:
        return differentiate_constraints(self._constraints, motion)

    def bound_changes(
        self, known: LinkState, unknowns: Sequence[float]
    ) -> Callable[[Sequence[float]], list[list[float]]]:
        return partial(bound_jacobian_change, self._constraints, unknowns, known)

    def is_meshed(self, off: Sequence[float], part: float) -> bool:
        return is_meshed(self._constraints, off, part)

    # The links: the angles of the bodies and the slides, and the places of the bodies

    def place(self, known: LinkState, unknowns: Sequence[Any], gained: Sequence[Any]) -> LinkState:
        angles = map(add, unknowns[0::3], gained[0::3])
        slides = (slide.place(unknowns, known).real for slide in self._slides)
        return LinkState([*angles, *slides], _body_places(unknowns))

    def move(self, motion: GroupMotion) -> LinkState:
        values, _ = motion.highest
        slides = (slide.measured_change(motion) for slide in self._slides)
        return LinkState([*values[0::3], *slides], _body_places(values))

    def list_places(self, _known: LinkState, unknowns: Sequence[float]) -> list[complex]:
        return [*map(unit_vector, unknowns[0::3]), *_body_places(unknowns)]


def _body_places(values: Sequence[Any]) -> list[Any]:
    return list(map(make_vector, values[1::3], values[2::3]))


def _place_bodies(constraints: Sequence[Constraint], bodies: int) -> list[_PlacedBody]:
    """Return the bodies that pins place, each after the one that its pin is on."""
    pins = []
    row = 0
    for constraint in constraints:
        if isinstance(constraint, CoincidentPoints):
            first, second = constraint
            pins += [_PlacedBody(row, first, second), _PlacedBody(row, second, first)]
        row += 2 if isinstance(constraint, CoincidentPoints) else 1
    placed = []
    unknown = list(range(bodies))
    while unknown:
        pin = next(
            (p for p in pins if p.end.body in unknown and p.other.body not in unknown), None
        )
        if pin is not None:
            placed.append(pin)
        # Where nothing places a body, its own place is free, and others may follow from it.
        unknown.remove(unknown[0] if pin is None else pin.end.body)
    return placed


def make_iterated_step(
    linkage: Linkage, group: Iterated, joints: Sequence[Joint], planner: SolvedLinks
) -> tuple[IteratedStep, list[str]]:
    """
    Return the step that solves a group of links, and the sliders that it appends.

    A DefinitionError says that there is no pose, or that it has too few points of a link.
    """
    if linkage.pose is None:
        raise DefinitionError(
            'pose',
            f'is missing: no dyad covers {list_names(group.links)}, they are solved by iteration',
            'give inputs, and where points of these links lie then: '
            'pose: {inputs: [...], points: {...}}',
        )
    equations = Constraints(linkage, joints, group.links, planner, group.ratios)
    solved = close_in_pose(linkage, planner.scale, planner.steps)
    last = 1 + len(linkage.inputs)
    inputs = tuple(solved.coordinates[1:last])
    pins = {name: solved.pins[i] for name, i in equations.known_pins.items()}
    start = guess_unknowns(linkage, group.links, planner, pins, solved)
    far = sum(
        max(abs(first - second) for first in points.values() for second in points.values())
        for points in planner.points.values()
    )
    step = IteratedStep(
        GroupEquations(equations.constraints, equations.slides.values(), len(group.links)),
        StepsBefore(tuple(planner.steps), inputs),
        (len(solved.coordinates), len(solved.pins)),
        start,
        grid_inputs(linkage.inputs, inputs, planner.scale),
        far,
        # With ratios, turns of the first input alone are counted.
        0 if linkage.ratios and len(inputs) > 1 else equations.turns,
    )
    return step, [*equations.slides]
