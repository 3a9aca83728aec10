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
Links that no dyad covers (class III and higher), by Newton's method on their constraints.

The unknowns are the angle of each link and the place of one point of it. A pin makes two points
meet, a slider keeps an angle and a point on a line, a driven joint fixes an angle or a slide: as
many equations as unknowns, with the Jacobian written out. Velocities and accelerations solve the
same matrix for the constraints' own derivatives.

The assembly is the one that the given pose leads to by continuity. Of a single input it is a
`Branch`, which is followed once, so that a state depends on its input alone, and not on where the
linkage was before: it starts from the branch's own curve, and what Newton's method finds farther
from there than the curve allows is no answer. Of several inputs the straight line from the pose's
inputs is followed anew for each state, with the same proof that no other assembly is met.
"""

from __future__ import annotations

from cmath import phase
from collections.abc import Sequence
from math import hypot, inf, isnan, nan
from operator import add, sub
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics.arithmetic import called, is_found
from linkage_ros.kinematics.branch import Branch, Continuation, Start
from linkage_ros.kinematics.compiling.python import straight
from linkage_ros.kinematics.equations import (
    along,
    Array,
    Constraint,
    derivative,
    End,
    equations,
    Facing,
    line_motion,
    Meeting,
    OnLine,
    Parallel,
)
from linkage_ros.kinematics.initial_guess import initial_guess, InitialGuess
from linkage_ros.kinematics.linkage import Linkage
from linkage_ros.kinematics.rounding import UNIT_ROUNDOFF
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import State, Step
from linkage_ros.kinematics.topology import Joint
import numpy as np

if TYPE_CHECKING:
    from linkage_ros.kinematics.known_links import KnownLinks


_ACCEPTED = 256.0 * UNIT_ROUNDOFF
"""Of the size of the coordinates: what a constraint may be off by at a solution."""

_SINGULAR = 1e-11
"""Of several inputs: smallest singular value of the Jacobian, of the largest, that has rates."""

_AROUND = 64.0
"""In [rad] or lengths: what a search for a solution does not go beyond."""

_MOVED = 1e-6
"""In lengths: by less than that links are not said to miss each other."""


class IteratedPose(NamedTuple):
    """
    The links at one state.

    Attributes
    ----------
    status, gap
        Whether they close; where not, what a constraint is off by at best.
    unknowns
        For each body its angle and the place of its point.
    jacobian
        Of the constraints by the unknowns.

    """

    status: Status
    gap: float
    unknowns: list[float]
    jacobian: Array


class Iteration:
    """
    A group of links that is solved by iteration.

    Parameters
    ----------
    constraints
        As many equations as there are unknowns.
    slides
        The sliders whose slides are appended to the coordinates.
    start
        The pose to continue from.
    before
        The steps before this one.
    sliding
        For each input whether it is a slide.
    far
        Length that no slide needs to exceed for a link to be stretched.

    """

    __slots__ = ('_before', '_branch', '_constraints', '_far', '_inputs', '_slides', '_sliding',
                 '_solution', '_start', '_straight')  # fmt: skip

    def __init__(
        self,
        constraints: tuple[Constraint, ...],
        slides: tuple[OnLine, ...],
        start: InitialGuess,
        before: tuple[Step, ...],
        sliding: tuple[bool, ...],
        far: float,
    ) -> None:
        self._constraints = constraints
        self._slides = slides
        self._before = before
        self._inputs = start.inputs
        self._sliding = sliding
        self._far = far
        self._start = np.array(
            [
                value
                for angle, place in zip(start.angles, start.places, strict=True)
                for value in (angle, place.real, place.imag)
            ]
        )
        self._branch: Branch | None = None
        self._solution: Array | None = None
        self._straight: _StraightSystem | None = None

    @property
    def equation_count(self) -> int:
        """How many equations are solved at once."""
        return len(self._start)

    @property
    def inputs(self) -> tuple[float, ...]:
        """Return the inputs of the pose, as coordinates."""
        return self._inputs

    def close(self, known: State) -> IteratedPose:
        """Append the angles of the bodies, the slides, and the places of the bodies."""
        solved = called(self._closed_at, len(known.coordinates), *known.coordinates, *known.pins)
        if not is_found(solved):
            return self._not_closed(known)
        n, bodies = self.equation_count, self.equation_count // 3
        unknowns = [solved[i] for i in range(n)]
        self._place(known, unknowns, [solved[n + i] for i in range(bodies)])
        return IteratedPose(Status.CLOSED, 0.0, unknowns, solved[n + bodies])

    def _closed_at(self, count: int, *numbers: Any) -> tuple[Any, ...] | None:
        """
        Return a closed solution: unknowns, angles with their turns, and the Jacobian.

        Parameters
        ----------
        count
            How many of the numbers are coordinates.
        *numbers
            The coordinates and the pins that are known before.

        """
        known = State(list(numbers[:count]), list(numbers[count:]))
        inputs = self._inputs_of(known)
        start = self._start_at(inputs)
        if start is None or start.ends:
            return None
        found = self._correct(known, start.unknowns, start.farthest)
        if found is None:
            return None
        unknowns, jacobian = found
        if len(inputs) > 1 and _conditioning(jacobian) <= _SINGULAR:
            return None
        return (*unknowns.tolist(), *(unknowns + start.turned)[0::3].tolist(), jacobian)

    def _not_closed(self, known: State) -> IteratedPose:
        """Return the pose at a toggle, or what of it there is where links are open."""
        inputs = self._inputs_of(known)
        start = self._start_at(inputs)
        if start is None:
            return self._open(known, inputs)
        if start.ends:
            # Where the Jacobian is singular, what Newton's method finds is no nearer.
            unknowns, jacobian = start.unknowns, self._system(known, start.unknowns)[1]
        else:
            found = self._correct(known, start.unknowns, start.farthest)
            if found is None:
                return self._open(known, inputs)
            unknowns, jacobian = found
        values = unknowns.tolist()
        self._place(known, values, (unknowns + start.turned)[0::3].tolist())
        return IteratedPose(Status.TOGGLE, 0.0, values, jacobian)

    def _inputs_of(self, known: State) -> list[float]:
        end = 1 + len(self._inputs)
        return known.coordinates[1:end]

    def branch(self) -> Branch | None:
        """
        Return the branch of a single input, followed when it is first asked for.

        There is none where the pose leads to no solution.
        """
        if self._branch is None:
            solution = self.solution()
            if solution is None:
                return None
            self._branch = Branch(
                Continuation(self._constraints, self._known, self._moving),
                solution,
                self._inputs[0],
                self._known,
                turning=not self._sliding[0],
                far=self._far,
            )
        return self._branch

    def solution(self) -> Array | None:
        """Return the unknowns at the pose's inputs, nothing where the pose leads to none."""
        if self._solution is None:
            known = self._known_at(self._inputs)
            found = self._correct(known, self._start, inf) if known is not None else None
            self._solution = found[0] if found is not None else None
        return self._solution

    def rates(self, pose: IteratedPose, known: State, speeds: State) -> list[float]:
        """Append the rates of what `close` has appended."""
        still = [0.0] * len(pose.unknowns)
        drift = derivative(self._constraints, pose.unknowns, known, speeds, still, None, still)
        rates = _solved(pose, drift)
        self._append(speeds, rates)
        for slide in self._slides:
            _, rate, _ = line_motion(slide, pose.unknowns, known, speeds, rates, None, still)
            speeds.coordinates.append(rate.real)
        return rates

    def accelerations(
        self, pose: IteratedPose, rates: list[float], known: State, speeds: State, changes: State
    ) -> None:
        """Append the accelerations of what `close` has appended."""
        still = [0.0] * len(rates)
        drift = derivative(self._constraints, pose.unknowns, known, speeds, rates, changes, still)
        solved = _solved(pose, drift)
        self._append(changes, solved)
        for slide in self._slides:
            _, _, change = line_motion(slide, pose.unknowns, known, speeds, rates, changes, solved)
            changes.coordinates.append(change.real)

    def conditioning(self, pose: IteratedPose) -> float:
        """Return the smallest singular value of the constraints' Jacobian, of the largest."""
        return _conditioning(pose.jacobian)

    def solution_from(self, angles: Array) -> Array | None:
        """
        Return the solution at the pose's inputs that a start with these angles leads to.

        The bodies start where they miss their constraints least, which are linear in the places.
        """
        known = self._known_at(self._inputs)
        if known is None:
            return None
        start = np.zeros_like(self._start)
        start[0::3] = angles
        errors, jacobian = self._system(known, start)
        places = np.arange(len(start)) % 3 > 0
        start[places] = np.linalg.lstsq(jacobian[:, places], -errors, rcond=None)[0]
        found = self._correct(known, start, _AROUND)
        return None if found is None else found[0]

    def solution_at(self, x: float) -> Array | None:
        """Return the unknowns at a value of the single input, nothing where the branch is not."""
        start, known = self._start_at((x,)), self._known(x)
        if start is None or known is None:
            return None
        found = self._correct(known, start.unknowns, start.farthest)
        return None if found is None else found[0]

    def _place(self, known: State, unknowns: list[float], angles: list[float]) -> None:
        """Append a solution, with the angles as the turns before have left them."""
        known.coordinates.extend(angles)
        known.pins.extend(_places(unknowns))
        for slide in self._slides:
            known.coordinates.append(along(slide, known, unknowns).real)

    def _append(self, state: State, values: list[float]) -> None:
        state.coordinates.extend(values[0::3])
        state.pins.extend(_places(values))

    def _system(self, known: State, unknowns: Array) -> tuple[Array, Array]:
        """Return what the constraints are off by, and their derivatives by the unknowns."""
        errors, jacobian = self._listed_system(known, unknowns.tolist())
        return np.array(errors), jacobian

    def _listed_system(
        self, known: State, unknowns: Sequence[float]
    ) -> tuple[tuple[float, ...], Array]:
        numbers = [*known.coordinates, *known.pins, *unknowns]
        if self._straight is None:
            self._straight = _StraightSystem(
                self._constraints, numbers, len(known.coordinates), len(unknowns)
            )
        return self._straight.at(numbers)

    def _known_at(self, inputs: Sequence[float]) -> State | None:
        """Return what is known before this step, at any inputs."""
        known = State([0.0, *inputs], [])
        for step in self._before:
            if not step.close(known).status.has_pose:
                return None
        return known

    def _moving_at(
        self, inputs: Sequence[float], rates: Sequence[float]
    ) -> tuple[State, State] | None:
        """Return what is known before this step, and its rates; nothing where it has none."""
        known, speeds = State([0.0, *inputs], []), State([0.0, *rates], [])
        for step in self._before:
            pose = step.close(known)
            if not pose.status.has_rates:
                return None
            step.rates(pose, known, speeds)
        return known, speeds

    def _known(self, x: float) -> State | None:
        return self._known_at((x,))

    def _moving(self, x: float) -> tuple[State, State] | None:
        return self._moving_at((x,), (1.0,))

    def _start_at(self, inputs: Sequence[float]) -> Start | None:
        """Return where to start; nothing where the assembly does not lead."""
        if len(inputs) > 1:
            return self._along_a_line(inputs)
        branch = self.branch()
        return None if branch is None else branch.start(inputs[0])

    def _along_a_line(self, inputs: Sequence[float]) -> Start | None:
        """Return the start at several inputs, on the straight line from those of the pose."""
        solution = self.solution()
        if solution is None:
            return None
        ways = [value - begin for value, begin in zip(inputs, self._inputs, strict=True)]
        length = hypot(*ways)
        still = np.zeros_like(solution)
        if not length:
            return Start(solution, inf, still, False)
        rates = [way / length for way in ways]

        def place(x: float) -> list[float]:
            return [begin + x * rate for begin, rate in zip(self._inputs, rates, strict=True)]

        continuation = Continuation(
            self._constraints,
            lambda x: self._known_at(place(x)),
            lambda x: self._moving_at(place(x), rates),
        )
        node = continuation.first(solution, 0.0)
        if node is None:
            return None
        cell = None
        for cell in continuation.cells(node, 1.0, length):
            if cell.folds:
                return None
        if cell is None or cell.end.place[-1] < length:
            return None
        size = float(np.abs(cell.end.place - cell.begin.place).max())
        return Start(cell.end.place[:-1], 0.2 * size, still, False)

    def _correct(self, known: State, start: Array, farthest: float) -> tuple[Array, Array] | None:
        """Return the solution within a distance of a start, and its Jacobian."""
        # In lists: of so few numbers an array's own overhead is greater than the arithmetic.
        begin = start.tolist()
        unknowns, last = begin, inf
        size = 1.0 + _greatest(begin)
        for _ in range(30):
            errors, jacobian = self._listed_system(known, unknowns)
            try:
                step = np.linalg.solve(jacobian, np.negative(errors)).tolist()
            except np.linalg.LinAlgError:
                return None
            length = _greatest(step)
            if length >= last or length <= 4.0 * UNIT_ROUNDOFF * size:
                good = _greatest(errors) <= _ACCEPTED * size
                return (np.array(unknowns), jacobian) if good else None
            unknowns, last = list(map(add, unknowns, step)), length
            if not _greatest(list(map(sub, unknowns, begin))) <= farthest:
                return None
        return None

    def _open(self, known: State, inputs: Sequence[float]) -> IteratedPose:
        """
        Return how near the links come, downhill from where their assembly ends.

        Where they would close, but in another assembly or after another number of turns, what they
        miss each other by is told as they lie at that end.
        """
        end = self._branch.nearest_end(inputs[0]) if self._branch is not None else None
        unknowns = self._start if end is None else end
        errors, jacobian = self._system(known, unknowns)
        first = float(np.abs(errors).max())
        for _ in range(20):
            step = np.linalg.lstsq(jacobian, -errors, rcond=1e-6)[0]
            step *= min(1.0, 0.1 / max(float(np.abs(step).max()), 1e-300))
            trial, slope = self._system(known, unknowns + step)
            if np.abs(trial).max() >= np.abs(errors).max():
                break
            unknowns, errors, jacobian = unknowns + step, trial, slope
        gap = float(np.abs(errors).max())
        return IteratedPose(
            Status.OPEN, gap if gap > _MOVED else first, unknowns.tolist(), jacobian
        )


class _StraightSystem:
    """
    The constraints and their derivatives as a straight line.

    Most derivatives are constants, such as 0 and 1: only the others are worked out.

    Parameters
    ----------
    constraints
        The constraints.
    numbers
        Coordinates, pins and unknowns, one after the other, for which they can be worked out.
    coordinates, unknowns
        How many there are of each.

    """

    def __init__(
        self,
        constraints: Sequence[Constraint],
        numbers: Sequence[complex],
        coordinates: int,
        unknowns: int,
    ) -> None:
        def listed(*values: Any) -> list[float]:
            state = State(list(values[:coordinates]), list(values[coordinates:-unknowns]))
            errors, rows = equations(constraints, values[-unknowns:], state)
            return [*errors, *(slope for row in rows for slope in row)]

        self._line = straight(listed, numbers)
        self._count = unknowns
        self._constants = np.array(self._line.results[unknowns:])
        self._places = np.array([place - unknowns for place in self._line.places[unknowns:]])

    def at(self, numbers: Sequence[complex]) -> tuple[tuple[float, ...], Array]:
        """Return what the constraints are off by, each of which varies, and the Jacobian."""
        n = self._count
        found = self._line.varying(*numbers)
        jacobian = self._constants.copy()
        jacobian[self._places] = found[n:]
        return found[:n], jacobian.reshape(n, n)


def _greatest(values: Sequence[float]) -> float:
    """Return the greatest size; NaN where one is."""
    return nan if isnan(sum(values)) else max(map(abs, values))


def _places(values: Sequence[float]) -> list[complex]:
    return [x + 1j * y for x, y in zip(values[1::3], values[2::3], strict=True)]


def _conditioning(jacobian: Array) -> float:
    values = np.linalg.svd(jacobian, compute_uv=False)
    return float(values[-1] / values[0])


def _solved(pose: IteratedPose, drift: Sequence[float]) -> list[float]:
    """Return the derivatives of the unknowns that make up for the constraints' own."""
    found = called(_solve, pose.jacobian, *drift)
    return [found[i] for i in range(len(drift))]


def _solve(jacobian: Array, *drift: float) -> list[float]:
    found: list[float] = np.linalg.solve(jacobian, np.negative(drift)).tolist()
    return found


# The joints of links that no dyad covers, as constraints of an `Iteration`.


class Constraints:
    """
    What holds a group of links.

    Parameters
    ----------
    linkage
        The linkage.
    joints
        Those of the group.
    links
        The links of the group.
    planner
        Knows and places what comes before the group.

    Attributes
    ----------
    slides
        The sliders of the group, by name.

    """

    def __init__(
        self,
        linkage: Linkage,
        joints: Sequence[Joint],
        links: Sequence[str],
        planner: KnownLinks,
    ) -> None:
        self._linkage = linkage
        self._planner = planner
        self._links = links
        self._bodies = {link: i for i, link in enumerate(links)}
        self._constraints: list[Constraint] = []
        self._known_pins: dict[str, int] = {}
        self.slides: dict[str, OnLine] = {}
        for joint in joints:
            self._add_joint(joint)
        self._add_drives()

    def iteration(self, before: tuple[Step, ...]) -> Iteration:
        """Return the step that solves the group, given those before it."""
        planner = self._planner

        def place_known(
            inputs: Sequence[float],
        ) -> tuple[dict[str, complex], dict[str, float]]:
            known = State([0.0, *inputs], [])
            for step in before:
                if not step.close(known).status.has_pose:
                    raise DefinitionError(
                        'pose.inputs',
                        'what comes before the iterated links does not close there',
                        'give inputs that the linkage can have',
                    )
            x, pins = known
            return (
                {name: pins[i] for name, i in self._known_pins.items()},
                {link: x[a.coordinate] + a.constant for link, a in planner.angles.items()},
            )

        start = initial_guess(
            self._linkage, self._links, planner.blocks, planner.points, planner.scale, place_known
        )
        sliding = tuple(bool(given.slider) for given in self._linkage.inputs)
        far = sum(
            max(abs(one - other) for one in points.values() for other in points.values())
            for points in planner.points.values()
        )
        return Iteration(
            tuple(self._constraints), tuple(self.slides.values()), start, before, sliding, far
        )

    def _add_joint(self, joint: Joint) -> None:
        if joint.kind == 'R':
            self._constraints.append(
                Meeting(self._end(joint.link, joint.name), self._end(joint.to, joint.name))
            )
            return
        slider = self._linkage.sliders[joint.name]
        block, rail = self._facing(joint.link, 0.0), self._facing(joint.to, 0.0)
        self._constraints.append(Parallel(block, rail, slider.angle))
        self.slides[joint.name] = OnLine(
            self._end(joint.link, slider.point),
            self._end(joint.to, slider.through),
            self._facing(joint.to, phase(complex(*slider.direction))),
        )
        self._constraints.append(self.slides[joint.name])

    def _add_drives(self) -> None:
        for i, given in enumerate(self._linkage.inputs, 1):
            if given.slider in self.slides:
                self._constraints.append(self.slides[given.slider]._replace(slide=i))
            elif given.child in self._bodies or given.parent in self._bodies:
                child, parent = (self._facing(end, 0.0) for end in (given.child, given.parent))
                self._constraints.append(Parallel(child, parent, 0.0, i))

    def _end(self, link: str, name: str) -> End:
        points = self._planner.points[link]
        if link in self._bodies:
            return End(self._bodies[link], points[name] - next(iter(points.values())))
        self._known_pins[name] = self._planner.place(link, points[name])
        return End(-1, 0j, self._known_pins[name])

    def _facing(self, link: str, direction: float) -> Facing:
        if link in self._bodies:
            return Facing(self._bodies[link], 0, direction)
        angle = self._planner.angles[link].plus(direction)
        return Facing(-1, angle.coordinate, angle.constant)
