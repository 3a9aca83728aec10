# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Links in space that close only together: Newton's method on the joints of a tree.

Each rod is one equation, ½(|C − B|² − L²) = 0, between places on two links. Three rods of length 1
hold a ball: they lead to one place from three others on the link that it is part of. The residual
and its derivatives are written once, for numbers and symbols; rates and accelerations solve the
same matrix. Where the method starts is on a `Grid`: so a state depends on its inputs alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import combinations_with_replacement, islice
from math import hypot, inf, prod
from typing import Any, NamedTuple

from linkage_ros.kinematics.arithmetic import SMALLEST, UndecidedError
from linkage_ros.kinematics.built_once import BuiltProperty, keep_results
from linkage_ros.kinematics.elimination import Elimination
from linkage_ros.kinematics.grid import Grid
from linkage_ros.kinematics.space.joints import LowerPair, SlidePair
from linkage_ros.kinematics.space.steps import missing_length, Rod
from linkage_ros.kinematics.space.vectors import (
    dot,
    minus,
    plus,
    SpaceFrame,
    subtract,
    Vector,
)
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import LinkState, Step
from linkage_ros.kinematics.steps_before import StepsBefore
from linkage_ros.kinematics.straight_line import has_symbols, list_numbers, StraightLine

_LAST_STEP = 2.0**-36
"""Sum of the last changes by Newton's method, in [rad] and lengths: the next is a rounding."""

_SECOND = 8.0
"""How often the next step at most is in the unit of an unknown."""

_HALFWAY, _MOST_STEPS = 2.0**-21, 6
"""Sum of the last changes but one, whose square is a last one; and how many steps are unrolled."""

_LEAST_STEP = 2.0**-20
"""The same of a solution next to a singularity, where the rounding is greater."""

_SINGULAR = 1e-11
"""Least ratio of smallest to largest singular value at which rates exist."""

_TOGGLE = 2.0**-43
"""How far a toggle may be from where the way to its inputs ends, relative to their size."""

_AMID = 1.3
"""Longest that a rod may be between two solutions, relative to its length."""

_SLID = 0.25
"""How far a slide may move between two solutions, in lengths."""

_MOVED = 2.0**-20
"""A gap that shrinks to less, relative to itself, is closed by another assembly."""


class Mover(NamedTuple):
    """A joint of the tree: the frame of its child follows those of the movers before it."""

    joint: LowerPair
    unknown: int  # Number of its value among the unknowns, or −1
    coordinate: int = 0  # If it is known, its index among the coordinates

    def value(self, unknowns: Sequence[float], state: LinkState) -> float:
        """Return its value, or a derivative of it."""
        return unknowns[self.unknown] if self.unknown >= 0 else state.coordinates[self.coordinate]


class RodEnd(NamedTuple):
    """A place on the link that a mover moves; or, if that is −1, beside a known point."""

    mover: int
    pin: int  # Index, among the pins, of the frame of the link, or of the point
    place: Vector

    def locate(self, state: LinkState) -> Vector:
        """Return the place in the frame of the ground."""
        pin = state.pins[self.pin]
        return plus(pin, self.place) if self.mover < 0 else pin.place(self.place)

    def arm(self, state: LinkState) -> Vector:
        """Return the place from the origin of its link."""
        frame: SpaceFrame = state.pins[self.pin]
        return frame.turn(self.place)


class KnotRod(NamedTuple):
    """Two places at a known distance."""

    start: RodEnd
    end: RodEnd
    rod: Rod


class KnotPose(NamedTuple):
    """The links at one state."""

    status: Status
    gap: float
    unknowns: Sequence[float]
    solved: LinkState  # The state that they were appended to


class Knot:
    """
    Links on a tree of joints, closed by as many rods as there are unknown joints.

    ``known`` is the state of the steps ``before`` in the pose, ``driven`` the number of inputs,
    and ``start`` has the unknowns there.
    """

    def __init__(
        self,
        movers: Sequence[Mover],
        rods: Sequence[KnotRod],
        before: tuple[Step, ...],
        known: LinkState,
        driven: int,
        start: Sequence[float],
    ) -> None:
        self._movers, self._rods, self._start = tuple(movers), tuple(rods), tuple(start)
        end = 1 + driven
        self._before = StepsBefore(before, tuple(known.coordinates[1:end]))
        self._coordinates, self._first = len(known.coordinates), len(known.pins)
        self._chains = [self._moving_chains(rod) for rod in rods]
        pins = [mover.joint.parent for mover in movers]
        pins += [end.pin for rod in rods for end in (rod.start, rod.end)]
        self._pins = set(pins)
        self._traced = keep_results(self._trace)
        self._solution_line = StraightLine(self._straight_solution, self._examples(0))
        self._system_line = StraightLine(self._list_system, self._examples(0, 3))
        self._rates_line = StraightLine(self._straight_rates, self._examples(0, 3, 1))
        self._changes_line = StraightLine(self._straight_changes, self._examples(0, 3, 1, 4, 2))

    @property
    def equation_count(self) -> int:
        """Return the number of equations solved at once."""
        return len(self._rods)

    @BuiltProperty
    def inputs(self) -> tuple[int, ...]:
        """Return the numbers of the inputs that the links depend on."""
        traced = self._traced()
        if traced is None:
            return tuple(range(len(self._before.inputs)))
        known = self._select_needed(traced[0])
        used = {rod.rod.strut for rod in self._rods} | {one.coordinate for one in self._movers}
        numbers = list_numbers([known.pins, *(known.coordinates[k] for k in used)])
        waiting = [number.operation for number in numbers if hasattr(number, 'operation')]
        seen: set[Any] = set()
        while waiting:
            operation = waiting.pop()
            if operation not in seen:
                seen.add(operation)
                waiting += operation.operands()
        names = {operation.name for operation in seen if operation.is_input}
        return tuple(k for k in range(len(self._before.inputs)) if f'q{k}' in names)

    @BuiltProperty
    def grid(self) -> Grid:
        """Return the cells from which the links are solved."""
        return Grid(self, [self._before.inputs[k] for k in self.inputs], self._start)

    @BuiltProperty
    def _step_count(self) -> int:
        """Return how many steps of Newton's method suffice at the corners about the pose."""
        most = 2
        for corner in self.grid.home_corners():
            count, size, (inputs, values) = 0, inf, corner
            known = self._before.known_at(self._inputs_with(inputs))
            while known is not None and size > _HALFWAY and count < _MOST_STEPS:
                found = self._system_line(self._select_needed(known), LinkState([*values], []))
                if found is None:
                    break
                size, count = sum(map(abs, found[: len(values)])), count + 1
                values = [a - b for a, b in zip(values, found, strict=False)]
            most = max(most, count)
        return most

    # A step of the closure

    def close(self, solved: LinkState) -> KnotPose:
        """Append the unknown joints, and the frames of the links."""
        missing = missing_length([rod.rod for rod in self._rods], solved)
        if missing is not None:
            return KnotPose(Status.OPEN, missing, self._start, solved)
        if has_symbols(solved):
            values: Sequence[float] | None = self._straight_solution(solved)
        else:
            values = self._solution_line(self._select_needed(solved))
        if values is None:
            return self._close_slowly(solved)
        return self._append(Status.CLOSED, solved, values)

    def rates(self, pose: KnotPose, solved: LinkState, velocities: LinkState) -> Sequence[float]:
        """Append the rates of the joints, and the motions of the links."""
        unknowns = LinkState([*pose.unknowns], [])
        if has_symbols(solved, velocities):
            rates: Sequence[float] = self._straight_rates(solved, unknowns, velocities)
        else:
            states = self._select_needed(solved), unknowns, self._select_needed(velocities)
            rates = self._rates_line(*states) or []
        moving = self._add_motions(solved, velocities, rates)
        velocities.coordinates.extend(rates)
        velocities.pins.extend(islice(moving.pins, self._first, None))
        return rates

    def accelerations(
        self,
        pose: KnotPose,
        rates: Sequence[float],
        solved: LinkState,
        velocities: LinkState,
        changes: LinkState,
    ) -> None:
        """Append the accelerations of the joints, and the derivatives of the motions."""
        unknowns, speeds = LinkState([*pose.unknowns], []), LinkState([*rates], [])
        if has_symbols(solved, velocities, changes):
            found: Sequence[float] = self._straight_changes(
                solved, unknowns, velocities, speeds, changes
            )
        else:
            known, moving, changing = map(self._select_needed, (solved, velocities, changes))
            found = self._changes_line(known, unknowns, moving, speeds, changing) or []
        changed = self._add_changes(solved, velocities, changes, rates, found)
        changes.coordinates.extend(found)
        changes.pins.extend(islice(changed.pins, self._first, None))

    def conditioning(self, pose: KnotPose) -> float:
        """Return the ratio of the Jacobian's smallest singular value to its largest."""
        return self._conditioning_at(pose.solved, pose.unknowns)

    def _append(self, status: Status, solved: LinkState, unknowns: Sequence[float]) -> KnotPose:
        moved = self._place_links(solved, unknowns)
        solved.coordinates.extend(unknowns)
        solved.pins.extend(islice(moved.pins, self._first, None))
        return KnotPose(status, 0.0, unknowns, solved)

    def _close_slowly(self, solved: LinkState) -> KnotPose:
        """Close the links where no cell is proven: next to a singularity, or beyond it."""
        from linkage_ros.kinematics.descent import descend  # local import: it loads numpy
        import numpy as np  # local import: few states need it

        inputs = [solved.coordinates[1 + k] for k in self.inputs]
        start = self.grid.find_start(inputs)
        if start is not None and (found := self.solve_from(inputs, start)) is not None:
            return self._append(Status.CLOSED, solved, found)
        cell, left = self.grid.reach(inputs)
        if not left:
            status = Status.CLOSED
            if self._conditioning_at(solved, cell.unknowns) <= _SINGULAR:
                status = Status.TOGGLE
            return self._append(status, solved, cell.unknowns)
        sizes = np.array([rod.rod.length(solved) for rod in self._rods])

        def system(unknowns: Any) -> Any:
            errors, rows = self._system(self._place_links(solved, unknowns.tolist()))
            return np.array(errors) / sizes, np.array(rows) / sizes[:, None]

        begin = np.array(cell.unknowns)
        first = float(np.abs(system(begin)[0]).max())
        unknowns, gap = descend(system, begin)
        if left <= _TOGGLE * (1.0 + max(map(abs, inputs))):
            return self._append(Status.TOGGLE, solved, unknowns.tolist())
        return KnotPose(Status.OPEN, gap if gap > _MOVED * first else first, cell.unknowns, solved)

    # Straight lines, for numbers and symbols

    def _straight_solution(self, known: LinkState) -> list[float]:
        """Return the unknowns: steps of Newton's method, and one more with the last slopes."""
        values = self.grid.find_start([known.coordinates[1 + k] for k in self.inputs])
        if values is None:
            raise UndecidedError
        step: Sequence[float] = ()
        for left in reversed(range(1 + self._step_count)):
            errors, rows = self._system(self._place_links(known, values))
            if left:
                eliminated = _eliminate(rows)
            step = eliminated.solve(errors)
            values = [subtract(value, change) for value, change in zip(values, step, strict=True)]
        if not sum(map(abs, step[1:]), abs(step[0])) <= _LAST_STEP:
            raise UndecidedError
        return values

    def _list_system(self, known: LinkState, pose: LinkState) -> list[float]:
        """Return what Newton's method subtracts, and the inverse of the matrix by columns."""
        errors, rows = self._system(self._place_links(known, pose.coordinates))
        eliminated = _eliminate(rows)
        found = eliminated.solve(errors)
        for k in range(len(rows)):
            found += eliminated.solve([float(i == k) for i in range(len(rows))])
        return found

    def _straight_rates(
        self, known: LinkState, pose: LinkState, velocities: LinkState
    ) -> list[float]:
        """Return the rates of the unknowns: (C − B)·(Ċ − Ḃ) = L·L̇ for each rod."""
        state = self._place_links(known, pose.coordinates)
        still = self._add_motions(state, velocities, [0.0] * len(self._rods))
        right = [
            subtract(rod.rod.power(state, velocities), dot(vector, slip))
            for rod, vector, slip in self._slips(state, still)
        ]
        return _eliminate(self._system(state)[1]).solve(right)

    def _straight_changes(
        self,
        known: LinkState,
        pose: LinkState,
        velocities: LinkState,
        speeds: LinkState,
        changes: LinkState,
    ) -> list[float]:
        """Return the accelerations: (C − B)·(C̈ − B̈) + |Ċ − Ḃ|² = L·L̈ + L̇² for each rod."""
        state, rates = self._place_links(known, pose.coordinates), speeds.coordinates
        moving = self._add_motions(state, velocities, rates)
        before = self._add_changes(state, moving, changes, rates, [0.0] * len(self._rods))
        right = []
        for rod, vector, slip in self._slips(state, moving):
            one, other = (
                before.pins[end.pin]
                if end.mover < 0
                else moving.pins[end.pin].acceleration(before.pins[end.pin], end.arm(state))
                for end in (rod.start, rod.end)
            )
            bend = subtract(rod.rod.bend(state, velocities, changes), dot(slip, slip))
            right.append(subtract(bend, dot(vector, minus(other, one))))
        return _eliminate(self._system(state)[1]).solve(right)

    def _place_links(self, known: LinkState, unknowns: Sequence[float]) -> LinkState:
        """Return the state with the frames of the links."""
        first = self._first
        state = LinkState(known.coordinates, known.pins[:first])
        for mover in self._movers:
            value = mover.value(unknowns, known)
            state.pins.append(mover.joint.child_frame(mover.joint.base(state), value))
        return state

    def _add_motions(
        self, state: LinkState, velocities: LinkState, rates: Sequence[float]
    ) -> LinkState:
        """Return the velocities with the motions of the links."""
        first = self._first
        moving = LinkState(velocities.coordinates, velocities.pins[:first])
        for number, mover in enumerate(self._movers, first):
            rate = mover.value(rates, velocities)
            moving.pins.append(mover.joint.motion(state, moving, state.pins[number], rate))
        return moving

    def _add_changes(
        self,
        state: LinkState,
        moving: LinkState,
        changes: LinkState,
        rates: Sequence[float],
        accelerations: Sequence[float],
    ) -> LinkState:
        """Return the accelerations with the derivatives of the motions."""
        first = self._first
        changing = LinkState(changes.coordinates, changes.pins[:first])
        for number, mover in enumerate(self._movers, first):
            given = mover.value(rates, moving), mover.value(accelerations, changes)
            frame = state.pins[number]
            changing.pins.append(mover.joint.change(state, moving, changing, frame, *given))
        return changing

    def _slips(
        self, state: LinkState, moving: LinkState
    ) -> Iterator[tuple[KnotRod, Vector, Vector]]:
        """Yield each rod, its vector, and the velocity of its end relative to its start."""
        for rod in self._rods:
            one, other = (
                moving.pins[end.pin]
                if end.mover < 0
                else moving.pins[end.pin].velocity(end.arm(state))
                for end in (rod.start, rod.end)
            )
            vector = minus(rod.end.locate(state), rod.start.locate(state))
            yield rod, vector, minus(other, one)

    def _system(self, state: LinkState) -> tuple[list[float], list[list[float]]]:
        """Return the residuals, and their derivatives by the unknowns."""
        errors, rows = [], []
        for rod, chains in zip(self._rods, self._chains, strict=True):
            places = rod.start.locate(state), rod.end.locate(state)
            vector, size = minus(places[1], places[0]), rod.rod.length(state)
            errors.append(0.5 * (dot(vector, vector) - size * size))
            row = [0.0] * len(self._rods)
            for sign, place, chain in zip((-1.0, 1.0), places, chains, strict=True):
                for number in chain:
                    joint, unknown, _ = self._movers[number]
                    frame = state.pins[self._first + number]
                    slope = dot(vector, joint.slope(frame.z, minus(place, frame.origin)))
                    if unknown >= 0:
                        row[unknown] = slope if sign > 0.0 else subtract(0.0, slope)
            rows.append(row)
        return errors, rows

    def _moving_chains(self, rod: KnotRod) -> tuple[list[int], list[int]]:
        """Return the movers that move one end of a rod only, for both ends, the last first."""
        chains: list[list[int]] = []
        for end in (rod.start, rod.end):
            chain, number = [], end.mover
            while number >= 0:
                chain.append(number)
                number = max(self._movers[number].joint.parent - self._first, -1)
            chains.append(chain)
        one, other = chains
        return [k for k in one if k not in other], [k for k in other if k not in one]

    def _select_needed(self, state: LinkState) -> LinkState:
        """Return of a state what the links before have, and of their pins what the knot needs."""
        end = self._coordinates
        pins = [pin if k in self._pins else () for k, pin in enumerate(state.pins)]
        first = self._first
        return LinkState(state.coordinates[:end], pins[:first])

    def _trace(self) -> list[LinkState] | None:
        """Return state, rates, accelerations, unknowns and their rates in the pose, as symbols."""
        try:
            traced = self._before.trace()
        except UndecidedError:
            return None
        if traced is None:
            return None
        tape, states = traced
        for name in 'uv':
            given: list[Any] = [tape.add_input(f'{name}{k}', x) for k, x in enumerate(self._start)]
            states.append(LinkState(given, []))
        return states

    def _examples(self, *numbers: int) -> Callable[[], Sequence[LinkState] | None]:
        def examples() -> Sequence[LinkState] | None:
            traced = self._traced()
            return traced and [
                self._select_needed(traced[k]) if k < 3 else traced[k] for k in numbers
            ]

        return examples

    # What the grid asks for

    def _inputs_with(self, inputs: Sequence[float]) -> list[float]:
        """Return all inputs; those on which nothing depends are as in the pose."""
        given = list(self._before.inputs)
        for k, value in zip(self.inputs, inputs, strict=True):
            given[k] = value
        return given

    def proof(self, inputs: Sequence[float], unknowns: Sequence[float]) -> float:
        """
        Return η·ω of Kantorovich's theorem; infinite where there is none.

        The norm is the largest change of an unknown: all in one unit, the largest step; or each in
        its own, its step and some times what the next may be at most. The better one counts.
        """
        known = self._before.known_at(self._inputs_with(inputs))
        if known is None:
            return inf
        found = self._system_line(self._select_needed(known), LinkState([*unknowns], []))
        if found is None:
            return inf
        count = len(self._rods)
        steps = [abs(step) + SMALLEST for step in found[:count]]

        def changes_within(units: Sequence[float]) -> list[float]:
            """Return how much the matrix, and so the step, may change by these changes."""
            totals = [0.0] * count
            # The inverse follows the step, column by column.
            for k in range(count):
                bound = self._bound_bend(k, known, unknowns, units)
                for i in range(count):
                    totals[i] += abs(found[(k + 1) * count + i]) * bound
            return totals

        even = [max(steps)] * count
        fitted = [a + _SECOND * b for a, b in zip(steps, changes_within(steps), strict=True)]
        return min(
            max(a / b for a, b in zip(changes_within(units), units, strict=True))
            for units in (even, fitted)
        )

    def solve_from(
        self, inputs: Sequence[float], unknowns: Sequence[float]
    ) -> Sequence[float] | None:
        """Return the solution that Newton's method leads to, until no step is shorter."""
        known = self._before.known_at(self._inputs_with(inputs))
        if known is None:
            return None
        state, values, last = self._select_needed(known), [*unknowns], inf
        while True:
            found = self._system_line(state, LinkState(values, []))
            size = sum(map(abs, found[: len(values)])) if found else inf
            if found is None or not size < last:
                return values if last <= _LEAST_STEP else None
            values, last = [a - b for a, b in zip(values, found, strict=False)], size

    def forms_at(
        self, inputs: Sequence[float], unknowns: Sequence[float]
    ) -> tuple[list[Sequence[float]], list[Sequence[float]]] | None:
        """Return slopes and bends at a solution, as a cell has them: by rates, accelerations."""
        given, pose = self._inputs_with(inputs), LinkState([*unknowns], [])
        slopes: list[Sequence[float]] = []
        squares: dict[tuple[int, int], list[float]] = {}
        for one, other in combinations_with_replacement(self.inputs, 2):
            rates = [float(k in (one, other)) for k in range(len(given))]
            moving = self._before.changing_at(given, rates)
            if moving is None:
                return None
            known, speeds, changes = map(self._select_needed, moving)
            found = self._rates_line(known, pose, speeds)
            turned = found and self._changes_line(
                known, pose, speeds, LinkState(found, []), changes
            )
            if found is None or turned is None:
                return None
            squares[one, other] = turned
            if one == other:
                slopes.append(found)
        bends: list[Sequence[float]] = []
        for (one, other), both in squares.items():
            if one == other:
                bends.append([0.5 * value for value in both])
            else:
                # Along both inputs at once: twice what is mixed, and what each has alone.
                alone = zip(squares[one, one], squares[other, other], strict=True)
                bends.append(
                    [0.5 * (value - a - b) for value, (a, b) in zip(both, alone, strict=True)]
                )
        return slopes, bends

    @BuiltProperty
    def _axis_cosines(self) -> dict[tuple[int, int], float]:
        """Return the |cosines| between the axes of slides that no hinge turns against another."""
        found: dict[tuple[int, int], float] = {}
        for one, mover in enumerate(self._movers):
            other, axis = one, mover.joint.seat.z
            while other >= 0 and isinstance(self._movers[other].joint, SlidePair):
                joint = self._movers[other].joint
                if other != one:
                    # The axis in the frame of the child of the other.
                    found[one, other] = abs(dot(axis, (0.0, 0.0, 1.0)))
                axis, other = joint.seat.turn(axis), joint.parent - self._first
        return found

    def _bound_bend(
        self, number: int, known: LinkState, unknowns: Sequence[float], units: Sequence[float]
    ) -> float:
        """
        Return a bound of a rod's second derivative, for changes of the unknowns by their units.

        An end is never farther from an axis than the links between reach. It moves by no more for
        a turn, and by 1 for a slide; only what is nearer to the ground turns that.
        """
        start, end, rod = self._rods[number]
        size, total = _AMID * rod.length(known), 0.0
        moves: list[tuple[int, float]] = []
        for at, chain in zip((start, end), self._chains[number], strict=True):
            reach, outer = hypot(*at.place), 0.0
            for k in chain:
                mover = self._movers[k]
                slides = isinstance(mover.joint, SlidePair)
                if mover.unknown >= 0:
                    unit = units[mover.unknown]
                    move = unit if slides else unit * reach
                    # A turn nearer to the ground turns what the others move, and itself.
                    total += 0.0 if slides else size * unit * (2.0 * outer + move)
                    moves.append((k, move))
                    outer += move
                reach += hypot(*mover.joint.seat.origin)
                reach += abs(mover.value(unknowns, known)) + _SLID if slides else 0.0
        aligned = self._axis_cosines
        return total + sum(
            one * other * aligned.get((max(i, k), min(i, k)), 1.0)
            for i, one in moves
            for k, other in moves
        )

    def _conditioning_at(self, known: LinkState, unknowns: Sequence[float]) -> float:
        from linkage_ros.kinematics.descent import (
            reciprocal_condition,  # local import: it loads numpy
        )
        import numpy as np  # local import: few states need it

        return reciprocal_condition(np.array(self._system(self._place_links(known, unknowns))[1]))


def _eliminate(rows: Sequence[Sequence[float]]) -> Elimination:
    """Return a matrix, eliminated; UndecidedError is raised if it is singular."""
    eliminated = Elimination(rows, ())
    divisors = eliminated.divisors
    if divisors and not abs(prod(divisors[1:], start=divisors[0])) > SMALLEST:
        raise UndecidedError
    return eliminated
