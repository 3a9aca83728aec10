# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The forces in the pins and sliders of a linkage, by the Newton-Euler equations of every link.

For each link that moves, over all forces and moments that act on it::

    Σ F = m·(a − g)        Σ (p − c) × F + Σ M = J·α

p is where a force acts and c the centre of mass. The unknowns are the force in each pin, the force
across and the moment in each slider, and the effort of each drive: as many as equations, one
linear system A·f = b (R. L. Norton, Design of Machinery, ch. 11; E. J. Haug, Computer Aided
Kinematics and Dynamics of Mechanical Systems, 1989, ch. 6).

Friction that grows with the force in its joint changes the forces: see
`linkage_ros.dynamics.load_dependent_friction`.

A column of A is the effect of one unknown on each link (`JointMatrix`). By virtual work, a row of
Aᵀ gives the displacement δ in a joint that small displacements Δ of the links cause: Aᵀ·Δ = δ.
`Reactions.joint_deflections` solves this for Δ with the inputs held: how far play in a pin or the
stretch of a link moves the linkage, to first order.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, partial
from math import isfinite
from typing import NamedTuple, TYPE_CHECKING

from linkage_ros.dynamics.mechanics import (
    FrictionJoint,
    joint_friction,
    Mechanics,
    slip_direction,
    spring_length,
)
from linkage_ros.errors import DefinitionError, list_names
from linkage_ros.kinematics import (
    Acceleration,
    call,
    Closure,
    GROUND,
    has_result,
    Joint,
    make_vector,
    Position,
    RevoluteJoint,
    Status,
    unit_vector,
    Velocity,
)
from linkage_ros.kinematics.compiling import Compiled, TracedMotion as CompiledMotion
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from linkage_ros.dynamics.applied import JointCoordinate, LoadedPoint

Array = NDArray[np.float64]

_SOLVED = (Status.CLOSED, Status.LIMITED)


class PinSide(NamedTuple):
    """A link of a joint: its first row, the index of its centre among the places, its sign."""

    row: int
    center: int
    sign: float


class ForceLine(NamedTuple):
    """
    The line of a slider.

    ``unit``, turned by a coordinate of the closure, is its direction in the frame of the ground.
    """

    coordinate: int
    unit: complex

    def direction(self, coordinates: Sequence[float]) -> complex:
        """Return the direction in the frame of the ground, a unit vector."""
        return unit_vector(coordinates[self.coordinate]) * self.unit


class JointMatrix:
    """
    The square matrix of what a unit of each joint's force and drive's effort does to each link.

    Three rows for each link that moves: both components of force and the moment about its centre.
    Two columns for each joint: the components of force of a pin, or the force of a slider across
    its line and its moment. One column for each drive. A force f at p is (f, (p − c) × f) on one
    link and the opposite on the other. Moments are divided by the closure's scale, so that all
    entries are of one size.

    The transposed matrix gives what small displacements of the links open in each joint, since a
    joint's force does no work: a row is the displacement between the points of the two links.

    ``centers`` has, for each link that moves, the index of the reference point of its moments
    among the places given to `matrix_at`; ``places`` has the index of the place of each joint of
    the structure; of a slider, of its point.
    """

    def __init__(
        self, closure: Closure, centers: Mapping[str, int], places: Sequence[int]
    ) -> None:
        linkage, joints = closure.linkage, closure.structure.joints
        # For each link that moves its first row.
        self.rows = {link: 3 * i for i, link in enumerate(centers)}
        self.size = 3 * len(centers)
        self._scale = closure.scale
        self._centers = centers
        # For each joint its links that move, ``joint.link`` with the sign +1 first.
        self.sides = tuple(self._joint_sides(joint.link, joint.to) for joint in joints)
        self.lines: dict[int, ForceLine] = {}  # For each slider, by the number of its joint
        self._matrix = np.zeros((self.size, self.size))
        where: list[int] = []
        self._pins = self._plan_pins(joints, places, where)
        for number, joint in enumerate(joints):
            if joint.kind == 'P':
                along = closure.angles[joint.to]
                direction = complex(*linkage.sliders[joint.name].direction)
                unit = along.unit * direction / abs(direction)
                self.lines[number] = ForceLine(along.coordinate, unit)
        sliders = {joint.name: n for n, joint in enumerate(joints) if joint.kind == 'P'}
        self._thrusts = [
            self._plan_thrust(number, 1j, 2 * number, places[number], where)
            for number in sliders.values()
        ]
        for column, given in enumerate(linkage.inputs, 2 * len(joints)):
            if given.slider:
                number = sliders[given.slider]
                self._thrusts.append(
                    self._plan_thrust(number, 1 + 0j, column, places[number], where)
                )
            else:
                self._fill_moment(self._joint_sides(given.child, given.parent), column)
        self._fill = partial(_fill_matrix, self._matrix, np.array(where, dtype=np.intp))

    def matrix_at(self, coordinates: Sequence[float], places: Sequence[complex]) -> Array:
        """Return the matrix at coordinates and places, in the ground frame in [m]."""
        values: list[float] = []
        for place, center, factor in self._pins:
            lever = places[place] - places[center]
            values += (-factor * lever.imag, factor * lever.real)
        for line, turn, place, sides in self._thrusts:
            force = turn * line.direction(coordinates)
            for _, center, sign in sides:
                lever = (places[place] - places[center]) / self._scale
                moment = lever.real * force.imag - lever.imag * force.real
                values += (sign * force.real, sign * force.imag, sign * moment)
        matrix: Array = call(self._fill, *values)
        return matrix

    def _plan_pins(
        self, joints: Sequence[Joint], places: Sequence[int], where: list[int]
    ) -> list[tuple[int, int, float]]:
        """Fill in the constant entries of the pins; return places, centres and factors."""
        pins = []
        for index, (joint, sides) in enumerate(zip(joints, self.sides, strict=True)):
            column = 2 * index
            if joint.kind == 'P':
                self._fill_moment(sides, column + 1)
                continue
            for row, center, sign in sides:
                self._matrix[row, column] = self._matrix[row + 1, column + 1] = sign
                where += (
                    self._entry_index(row + 2, column),
                    self._entry_index(row + 2, column + 1),
                )
                pins.append((places[index], center, sign / self._scale))
        return pins

    def _plan_thrust(
        self, number: int, turn: complex, column: int, place: int, where: list[int]
    ) -> tuple[ForceLine, complex, int, tuple[PinSide, ...]]:
        """Plan a force on a slider: along its line, turned by a constant factor."""
        sides = self.sides[number]
        for row, _, _ in sides:
            where += (self._entry_index(row + i, column) for i in range(3))
        return self.lines[number], turn, place, sides

    def _fill_moment(self, sides: tuple[PinSide, ...], column: int) -> None:
        for row, _, sign in sides:
            self._matrix[row + 2, column] = sign

    def _joint_sides(self, link: str, to: str) -> tuple[PinSide, ...]:
        return tuple(
            PinSide(self.rows[name], self._centers[name], sign)
            for name, sign in ((link, 1.0), (to, -1.0))
            if name != GROUND
        )

    def _entry_index(self, row: int, column: int) -> int:
        return row * self.size + column


def _fill_matrix(constant: Array, where: NDArray[np.intp], *values: float) -> Array:
    """Return the matrix with values at the given entries, counted along its rows."""
    matrix = constant.copy()  # ticks and diagnostics ask for forces from different threads
    matrix.reshape(-1)[where] = values
    return matrix


class Reaction(NamedTuple):
    """
    The force and moment of ``joint.to`` on ``joint.link``; the opposite acts on ``joint.to``.

    The effort of a drive is not part of it: that acts beside the joint that it drives.
    """

    # Force in the frame of the ground, in [N]. In a pin: at the pin. In a slider: at its point,
    # across the line, with friction along it.
    fx: float
    fy: float
    # Moment about that point, counter-clockwise, in [N·m]. In a pin: friction only. In a slider:
    # the moment that keeps the block from turning.
    moment: float


class Reactions:
    """
    The forces in the joints of a linkage.

    Joints that follow others by ratios raise DefinitionError.
    """

    def __init__(self, mechanics: Mechanics) -> None:
        closure = mechanics.closure
        linkage, structure = closure.linkage, closure.structure
        if linkage.ratios:
            raise DefinitionError(
                'effects',
                f'forces in pins are not known with ratios ({list_names(linkage.ratios)}): the '
                'force '
                'between teeth, on a belt or a rack, is not computed',
                'leave out pin forces, clearance, compliance, and friction by coefficient',
            )
        self._mechanics = mechanics
        self._scale = closure.scale
        self.joints = structure.joints
        # If a pin has several joints, ``pin/link`` with the joint's ``link``; if a slider has the
        # name of a pin, ``slider/link`` with the link that it slides along.
        self.names = _joint_names(self.joints)

        moving = [link for link in structure.links if link != GROUND]
        points, weights = [], []
        for link in moving:
            # The block of a pin in a slot has no mass, and one point.
            mass = linkage.masses.get(link)
            center = mass.center if mass else next(iter(structure.links[link].values()))
            weights.append((mass.mass, mass.inertia) if mass else (0.0, 0.0))
            points.append((link, complex(*center)))
        for joint in self.joints:
            name = linkage.sliders[joint.name].point if joint.kind == 'P' else joint.name
            points.append((joint.link, complex(*structure.links[joint.link][name])))
        for spring in mechanics.loads.springs:
            points += [(link, complex(*linkage.links[link][name])) for link, name in spring.ends]
        if mechanics.applied is not None:
            points += mechanics.applied.points
        self._sliders = {joint.name: n for n, joint in enumerate(self.joints) if joint.kind == 'P'}

        self._follower = closure.point_tracker(points)
        at = iter(self._follower.indices)
        centers = {link: next(at) for link in moving}
        self._places = tuple(next(at) for _ in self.joints)
        self._bodies = tuple(
            (mass, inertia, centers[link], closure.angles[link].coordinate)
            for link, (mass, inertia) in zip(moving, weights, strict=True)
        )
        self._matrix = JointMatrix(closure, centers, self._places)
        rows = self._matrix.rows
        self._springs = tuple(
            (spring, (next(at), next(at)), tuple(rows.get(link, -1) for link, _ in spring.ends))
            for spring in mechanics.loads.springs
        )
        self._loaded = tuple(at)
        self._load_dependent = tuple(
            joint for joint in mechanics.friction_joints if joint.friction.coefficient
        )
        self._solve_system: Callable[..., list[float] | None] = _solve_linear
        if self._load_dependent:
            from linkage_ros.dynamics import (
                load_dependent_friction,  # local import: only with it
            )

            unknowns = [self._friction_unknown(rubbing) for rubbing in self._load_dependent]
            self._solve_system = partial(load_dependent_friction.solve_pressed, unknowns)
            self._forces_in = partial(load_dependent_friction.forces_in, unknowns)
            self._solve_friction_effort = partial(
                load_dependent_friction.friction_effort, unknowns
            )
        self._published = tuple(
            (rows.get(joint.child, -1), rows.get(joint.parent, -1))
            if isinstance(joint, RevoluteJoint)
            else self._sliders[joint.slider]
            for joint in linkage.joints.values()
        )

    def solve(
        self,
        position: Position,
        velocity: Velocity,
        acceleration: Acceleration,
        given: Sequence[float] = (),
    ) -> tuple[Reaction, ...] | None:
        """
        Return the reaction in each joint, in the order of `names`.

        Return None at a toggle and where the linkage does not close. ``given`` is as in
        `linkage_ros.dynamics.applied.AppliedForces.given_after`.
        """
        balance = self._solve_balance(position, velocity, acceleration, given)
        if balance is None:
            return None
        forces, resistances = balance
        x, lines = position.state.coordinates, self._matrix.lines
        reactions: tuple[Reaction, ...] = ()
        for index in range(len(self.joints)):
            one, other = forces[2 * index], forces[2 * index + 1]
            resisting = resistances[index]
            if index in lines:
                force = make_vector(-resisting, one) * lines[index].direction(x)
                reaction = Reaction(force.real, force.imag, other * self._scale)
            else:
                reaction = Reaction(one, other, 0.0 - resisting)
            reactions += (reaction,)
        return reactions

    def drive_efforts(
        self,
        position: Position,
        velocity: Velocity,
        acceleration: Acceleration,
        given: Sequence[float] = (),
    ) -> tuple[float, ...]:
        """
        Return the effort of each drive; empty where there are no forces.

        It is as in `Mechanics.drive_efforts`, plus the friction that grows with the forces in the
        joints. The parameters are as in `solve`.
        """
        balance = self._solve_balance(position, velocity, acceleration, given)
        if balance is None:
            return ()
        forces, _ = balance
        a, linkage = acceleration.state.coordinates, self._mechanics.closure.linkage
        inertia, first = self._mechanics.loads.drive_inertia, 2 * len(self.joints)
        efforts: tuple[float, ...] = ()
        for i, driven in enumerate(linkage.inputs):
            inert, force = inertia * a[1 + i], forces[first + i]
            if driven.slider:
                efforts += (force + inert * self._scale,)
            else:
                efforts += (force * self._scale + inert,)
        return efforts

    def friction_effort(
        self, value: float, rate: float, seconds: float, pull: float, mobility: float
    ) -> float | None:
        """
        Return the effort at the only input by the friction that grows with the joint forces.

        The result is in [N·m] or [N]; None where the linkage jams, or has no forces. ``value`` and
        ``rate`` of the input are in [rad] or [m] and per second; the rate is not 0. ``seconds`` is
        the time since the first tick, ``pull`` and ``mobility`` are as in
        `linkage_ros.dynamics.load_dependent_friction.solve_frictions`.
        """
        closure, applied = self._mechanics.closure, self._mechanics.applied
        given = () if applied is None else applied.given_after(seconds)
        found: Sequence[Sequence[float]] | None = self._compiled_motion.fast(value, rate, *given)
        if found is None:
            position = closure.position(value)
            if position.status not in _SOLVED:
                return None
            found = self._force_coefficients(position, closure.velocity(position, rate), given)
        if not found:
            return None
        forces, levers = found
        return self._solve_friction_effort(forces, levers, pull, mobility)

    @cached_property
    def _compiled_motion(self) -> Compiled:
        def list_outputs(motion: CompiledMotion, *given: float) -> Sequence[Sequence[float]]:
            assert motion.velocity is not None
            return self._force_coefficients(motion.position, motion.velocity, given)

        applied = self._mechanics.applied
        count = 0 if applied is None else len(applied.given_after(0.0))
        return Compiled(
            self._mechanics.closure, 1, list_outputs, within_limits=False, given_count=count
        )

    def _force_coefficients(
        self, position: Position, velocity: Velocity, given: Sequence[float]
    ) -> Sequence[Sequence[float]]:
        """Return the coefficients of the forces that cause friction, and the levers of joints."""
        closure, size = self._mechanics.closure, self._matrix.size
        x, places = position.state.coordinates, self._follower.places(position)
        still, pulled = (closure.acceleration(position, velocity, pull) for pull in (0.0, 1.0))
        sides, _ = self._right_sides(position, velocity, still, places, given)
        more, _ = self._right_sides(position, velocity, pulled, places, given)
        by_pull = [one - other for one, other in zip(more[:size], sides[:size], strict=True)]
        columns = [*sides[:size], *by_pull, *sides[size:]]
        forces = call(self._forces_in, self._matrix.matrix_at(x, places), *columns)
        if not has_result(forces):
            return []
        v = velocity.state.coordinates
        unit = self._scale if closure.linkage.inputs[0].slider else 1.0
        levers = [abs(rubbing.slip_rate(v) / (unit * v[1])) for rubbing in self._load_dependent]
        count = 2 * len(self._load_dependent) * (len(self._load_dependent) + 2)
        return [[forces[i] for i in range(count)], levers]

    def joint_deflections(
        self, position: Position, offsets: Sequence[complex]
    ) -> tuple[float, ...] | None:
        """
        Return the changes of the published joints, in [rad] or [m], by offsets in the joints.

        This is first order in the offsets: the error falls with their square. Return None at a
        toggle and where the linkage does not close. The inputs of the position, which has no
        offsets, are held.

        An offset belongs to each joint, in the order of `names`: the place of its point on
        ``joint.link`` minus the place of its point on ``joint.to``, in the frame of the ground, in
        [m]. Of a slider only the component across its line counts.

        Play: a link that is pushed with the force f moves away from the link that pushes it, so
        the offset is −e·f/|f| with the radial play e and the force f of `Reaction`, whichever link
        has the hole. Stretch: if a pin of a link is displaced by the vector u from its nominal
        place, the offset is −u in a joint whose ``link`` it is and +u in one whose ``to`` it is.
        """
        if position.status not in _SOLVED:
            return None
        places, x = self._follower.places(position), position.state.coordinates
        matrix, lines = self._matrix.matrix_at(x, places), self._matrix.lines
        gaps = [0.0] * self._matrix.size
        for index, offset in enumerate(offsets):
            if index in lines:
                across = 1j * lines[index].direction(x)
                gaps[2 * index] = offset.real * across.real + offset.imag * across.imag
            else:
                gaps[2 * index], gaps[2 * index + 1] = offset.real, offset.imag
        moved = call(_solve_transposed, matrix, *gaps)
        if not has_result(moved):
            return None
        shifts: tuple[float, ...] = ()
        for published in self._published:
            if isinstance(published, int):
                shifts += (self._slide_displacement(published, moved, x, places),)
            else:
                child, parent = (moved[row + 2] if row >= 0 else 0.0 for row in published)
                shifts += ((child - parent) / self._scale,)
        return shifts

    def _slide_displacement(
        self, number: int, moved: list[float], x: Sequence[float], places: list[complex]
    ) -> float:
        """Return how far displacements of the links move a point along its slider."""
        along = self._matrix.lines[number].direction(x)
        place, slid = places[self._places[number]], 0.0
        for row, center, sign in self._matrix.sides[number]:
            lever = (place - places[center]) / self._scale
            way = make_vector(moved[row], moved[row + 1]) + 1j * moved[row + 2] * lever
            slid += sign * (way.real * along.real + way.imag * along.imag)
        return slid

    def _solve_balance(
        self,
        position: Position,
        velocity: Velocity,
        acceleration: Acceleration,
        given: Sequence[float] = (),
    ) -> tuple[list[float], list[float]] | None:
        """Return the solution of the system, and the friction in each joint."""
        if position.status not in _SOLVED:
            return None
        x, places = position.state.coordinates, self._follower.places(position)
        sides, resistances = self._right_sides(position, velocity, acceleration, places, given)
        forces = call(self._solve_system, self._matrix.matrix_at(x, places), *sides)
        if not has_result(forces):
            return None
        v = velocity.state.coordinates
        for i, rubbing in enumerate(self._load_dependent):
            resistances[rubbing.joint] += (
                slip_direction(rubbing, v) * forces[self._matrix.size + i]
            )
        return forces, resistances

    def _right_sides(
        self,
        position: Position,
        velocity: Velocity,
        acceleration: Acceleration,
        places: list[complex],
        given: Sequence[float],
    ) -> tuple[list[float], list[float]]:
        """
        Return the right sides of the system, and the friction in each joint.

        After them follow the right sides of a unit of each friction that grows with its force.
        """
        loads, scale = self._mechanics.loads, self._scale
        gravity = complex(*loads.gravity)
        pulls = self._follower.accelerations(position, velocity, acceleration, places)
        x, v, a = (part.state.coordinates for part in (position, velocity, acceleration))
        sides: list[float] = []
        for mass, inertia, center, turn in self._bodies:
            pull = mass * (pulls[center] - gravity)
            sides += (pull.real, pull.imag, inertia * a[turn] / scale)
        if self._springs:
            velocities = self._follower.velocities(position, velocity, places)
            for spring, (start, end), rows in self._springs:
                length, growth = spring_length(places, velocities, start, end)
                if not length:
                    continue
                force = spring.tension(length, growth) / length * (places[end] - places[start])
                for row, point, pulled in zip(rows, (start, end), (force, -force), strict=True):
                    if row >= 0:
                        lever = places[point] - places[self._bodies[row // 3][2]]
                        self._apply_force(sides, row, lever, pulled)
        if self._mechanics.applied is not None:
            for at, load in self._mechanics.applied.acting_loads(position, velocity, given):
                self._apply_load(sides, at, load, position, places)
        resistances = [0.0] * len(self.joints)
        for rubbing in self._mechanics.friction_joints:
            number = rubbing.joint
            resistances[number] = joint_friction(rubbing, v)
            self._add_friction(sides, number, resistances[number], x, places)
        for rubbing in self._load_dependent:
            of_a_unit = [0.0] * self._matrix.size
            self._add_friction(of_a_unit, rubbing.joint, slip_direction(rubbing, v), x, places)
            sides += of_a_unit
        return sides, resistances

    def _friction_unknown(self, joint: FrictionJoint) -> tuple[int, bool, float]:
        """Return the first unknown of a joint, whether it is a pin, and its friction by force."""
        friction, pin = joint.friction, joint.joint not in self._matrix.lines
        return 2 * joint.joint, pin, friction.coefficient * (friction.radius if pin else 1.0)

    def _apply_load(
        self,
        sides: list[float],
        at: JointCoordinate | LoadedPoint,
        load: float,
        position: Position,
        places: list[complex],
    ) -> None:
        """Add a load on a joint or a point to the right sides of its links."""
        from linkage_ros.dynamics.applied import LoadedPoint  # local import: only with such loads

        rows = self._matrix.rows
        if isinstance(at, LoadedPoint):
            row = rows[at.link]
            lever = places[self._loaded[at.number]] - places[self._bodies[row // 3][2]]
            self._apply_force(sides, row, lever, load * at.direction(position))
        elif at.slider:
            number = self._sliders[at.slider]
            self._add_friction(sides, number, -load, position.state.coordinates, places)
        else:
            for link, moment in ((at.child, load), (at.parent, -load)):
                if link != GROUND:
                    sides[rows[link] + 2] -= moment / self._scale

    def _add_friction(
        self,
        sides: list[float],
        number: int,
        friction: float,
        x: Sequence[float],
        places: list[complex],
    ) -> None:
        """Add the friction in a joint to the right sides of its links."""
        line = self._matrix.lines.get(number)
        for row, center, sign in self._matrix.sides[number]:
            if line is None:
                sides[row + 2] += sign * friction / self._scale
            else:
                lever = places[self._places[number]] - places[center]
                self._apply_force(sides, row, lever, -sign * friction * line.direction(x))

    def _apply_force(self, sides: list[float], row: int, lever: complex, force: complex) -> None:
        """Add a known force on a link to its right sides."""
        sides[row] -= force.real
        sides[row + 1] -= force.imag
        sides[row + 2] -= (lever.real * force.imag - lever.imag * force.real) / self._scale


def _solve_linear(matrix: Array, *sides: float) -> list[float] | None:
    """Return the solution of a linear system, or None if it is singular."""
    try:
        solution: list[float] = np.linalg.solve(matrix, sides).tolist()
    except np.linalg.LinAlgError:
        return None
    return solution if all(map(isfinite, solution)) else None


def _solve_transposed(matrix: Array, *sides: float) -> list[float] | None:
    """Return the solution of the system with the transposed matrix."""
    return _solve_linear(matrix.T, *sides)


def _joint_names(joints: Sequence[Joint]) -> tuple[str, ...]:
    pins = [joint.name for joint in joints if joint.kind == 'R']
    names = []
    for joint in joints:
        if joint.kind == 'P':
            names.append(f'{joint.name}/{joint.to}' if joint.name in pins else joint.name)
        else:
            several = pins.count(joint.name) > 1
            names.append(f'{joint.name}/{joint.link}' if several else joint.name)
    return tuple(names)
