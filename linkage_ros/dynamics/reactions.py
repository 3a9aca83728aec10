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

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import NamedTuple, TYPE_CHECKING

from linkage_ros.dynamics.bodies import PLANE, spring_length
from linkage_ros.dynamics.equation import (
    FrictionJoint,
    joint_friction,
    Mechanics,
    slip_direction,
)
from linkage_ros.dynamics.joint_matrix import JointMatrix
from linkage_ros.errors import DefinitionError, list_names
from linkage_ros.kinematics import (
    Acceleration,
    call,
    GROUND,
    has_result,
    Joint,
    make_vector,
    Position,
    RevoluteJoint,
    Status,
    Velocity,
)
from linkage_ros.kinematics.compiling import Compiled, TracedMotion as CompiledMotion

if TYPE_CHECKING:
    from linkage_ros.dynamics.applied import Loaded
    from linkage_ros.dynamics.load_dependent_friction import FrictionSolver

_SOLVED = (Status.CLOSED, Status.LIMITED)


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
        # The block of a pin in a slot has no mass.
        heavy = {link: linkage.masses[link] for link in moving if link in linkage.masses}
        points = [(link, complex(*body.center)) for link, body in heavy.items()]
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
        centers = [next(at) for _ in heavy]
        self._places = tuple(next(at) for _ in self.joints)
        # For each link its first joint: about a far centre of mass, moments lose digits.
        pivots: dict[str, int] = {}
        for joint, place in zip(self.joints, self._places, strict=True):
            pivots = {joint.link: place, joint.to: place} | pivots
        self._pivots = tuple(pivots[link] for link in moving)
        self._matrix = JointMatrix(closure, {link: pivots[link] for link in moving}, self._places)
        rows = self._matrix.rows
        self._bodies = tuple(
            (body.mass, body.inertia, rows[link], center, closure.angles[link].coordinate)
            for center, (link, body) in zip(centers, heavy.items(), strict=True)
        )
        self._springs = tuple(
            (spring, (next(at), next(at)), tuple(rows.get(link, -1) for link, _ in spring.ends))
            for spring in mechanics.loads.springs
        )
        self._loaded = tuple(at)
        self._load_dependent = tuple(
            joint for joint in mechanics.friction_joints if joint.friction.coefficient
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
        return self._frictions.friction_effort(forces, levers, pull, mobility)

    @cached_property
    def _frictions(self) -> FrictionSolver:
        """Return the solver of the friction that grows with the forces."""
        from linkage_ros.dynamics.load_dependent_friction import (
            FrictionSolver,  # local import: only with it
        )

        unknowns = [self._friction_unknown(rubbing) for rubbing in self._load_dependent]
        return FrictionSolver(unknowns, self._matrix)

    @cached_property
    def _solve_forces(self) -> Callable[..., Sequence[float] | None]:
        return self._matrix.compile_solver()

    @cached_property
    def _solve_displacements(self) -> Callable[..., Sequence[float] | None]:
        return self._matrix.compile_solver(transposed=True)

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
        forces = call(self._frictions.forces_in, *self._matrix.varying_at(x, places), *columns)
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
        lines = self._matrix.lines
        gaps = [0.0] * self._matrix.size
        for index, offset in enumerate(offsets):
            if index in lines:
                across = 1j * lines[index].direction(x)
                gaps[2 * index] = offset.real * across.real + offset.imag * across.imag
            else:
                gaps[2 * index], gaps[2 * index + 1] = offset.real, offset.imag
        moved = call(self._solve_displacements, *self._matrix.varying_at(x, places), *gaps)
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
        for row, pivot, sign in self._matrix.sides[number]:
            lever = (place - places[pivot]) / self._scale
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
        solve = self._frictions.solve_pressed if self._load_dependent else self._solve_forces
        forces = call(solve, *self._matrix.varying_at(x, places), *sides)
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
        sides = [0.0] * self._matrix.size
        for mass, inertia, row, center, turn in self._bodies:
            self._apply_force(sides, row, center, mass * (gravity - pulls[center]), places)
            sides[row + 2] += inertia * a[turn] / scale
        if self._springs:
            velocities = self._follower.velocities(position, velocity, places)
            for spring, (start, end), rows in self._springs:
                length, growth = spring_length(PLANE, places, velocities, (start, end))
                if not length:
                    continue
                force = spring.tension(length, growth) / length * (places[end] - places[start])
                for row, point, pulled in zip(rows, (start, end), (force, -force), strict=True):
                    if row >= 0:
                        self._apply_force(sides, row, point, pulled, places)
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
        at: Loaded,
        load: float,
        position: Position,
        places: list[complex],
    ) -> None:
        """Add a load on a joint or a point to the right sides of its links."""
        from linkage_ros.dynamics.applied import (
            JointCoordinate,  # local import: only with such loads
            LoadedPoint,  # local import: only with such loads
        )

        rows = self._matrix.rows
        if isinstance(at, LoadedPoint):
            row = rows[at.link]
            force = load * at.direction(position)
            self._apply_force(sides, row, self._loaded[at.number], force, places)
            return
        assert isinstance(at, JointCoordinate)
        if at.slider:
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
        for row, _, sign in self._matrix.sides[number]:
            if line is None:
                sides[row + 2] += sign * friction / self._scale
            else:
                force = -sign * friction * line.direction(x)
                self._apply_force(sides, row, self._places[number], force, places)

    def _apply_force(
        self, sides: list[float], row: int, point: int, force: complex, places: Sequence[complex]
    ) -> None:
        """Add a known force at a point of a link to its right sides."""
        lever = places[point] - places[self._pivots[row // 3]]
        sides[row] -= force.real
        sides[row + 1] -= force.imag
        sides[row + 2] -= (lever.real * force.imag - lever.imag * force.real) / self._scale


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
