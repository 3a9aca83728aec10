# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The forces in the joints of a linkage, by the Newton-Euler equations of every link.

For each link that moves, over all forces and moments that act on it::

    Σ F = m·(a − g)        Σ (p − c) × F + Σ M = K·α + ω × K·ω

p is where a force acts and c the centre of mass; in the plane the right side is J·α. The unknowns
are what each joint transmits (`linkage_ros.dynamics.joint_forms`), the effort of each drive and
the force between the wheels of each ratio: one linear system A·f = b (R. L. Norton, Design of
Machinery, ch. 11; E. J. Haug, Computer Aided Kinematics and Dynamics of Mechanical Systems, 1989,
ch. 6). It has as many equations as unknowns, unless the linkage is over-constrained: then some of
the forces are certain, and others are not (`linkage_ros.dynamics.redundancy`).

A ratio is known by the angles of its wheels, not by their radii: so the moment that it transmits
is certain, and what its teeth or belt press on the bearings of the wheels is not.

Friction that grows with the force in its joint changes the forces: see
`linkage_ros.dynamics.load_dependent_friction`.

A column of A is the effect of one unknown on each link (`JointMatrix`). By virtual work, a row of
Aᵀ gives the displacement δ in a joint that small displacements Δ of the links cause: Aᵀ·Δ = δ.
`Reactions.joint_deflections` solves this for Δ with the inputs held: how far play in a joint or
the stretch of a link moves the linkage, to first order.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from functools import cached_property
from itertools import accumulate, chain, islice
from math import sin
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.dynamics.bodies import spring_length
from linkage_ros.dynamics.equation import (
    FrictionJoint,
    joint_friction,
    Mechanics,
    slip_direction,
)
from linkage_ros.dynamics.joint_forms import (
    ACROSS,
    Action,
    ALONG,
    Direction,
    JointForm,
    JointForms,
    LinkTurn,
    NONE,
    planar_bar,
    planar_forms,
    WHOLE,
)
from linkage_ros.dynamics.joint_matrix import Column, JointMatrix
from linkage_ros.errors import DefinitionError, list_names, quote
from linkage_ros.kinematics import (
    Acceleration,
    call,
    dot,
    GROUND,
    has_result,
    minus,
    PlanarClosure,
    Position,
    scale,
    Status,
    Vector,
    Velocity,
    ZERO,
)
from linkage_ros.kinematics.compiling import Compiled, TracedMotion as CompiledMotion

if TYPE_CHECKING:
    from linkage_ros.dynamics.applied import Loaded
    from linkage_ros.dynamics.load_dependent_friction import FrictionSolver, Pressing

_SOLVED = (Status.CLOSED, Status.LIMITED)

_LACKS = {NONE: '{}', ACROSS: '{} along the axis', ALONG: '{} across the axis'}
"""How what is not certain is called, by what is."""

_STATES = 4
"""Number of states, the pose and others near it, in which idle forces are looked for."""


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


class SpatialReaction(NamedTuple):
    """
    The force, in [N], and the moment, in [N·m], as of a `Reaction`, in the frame of the ground.

    In a hinge they count at the point of its axis that the file names, in a slide at the first
    point of its child. Friction is included.
    """

    fx: float
    fy: float
    fz: float
    mx: float
    my: float
    mz: float


JointReaction = Reaction | SpatialReaction


class Reactions:
    """
    The forces in the joints of a linkage.

    Friction by a force that is not certain raises DefinitionError.
    """

    def __init__(self, mechanics: Mechanics) -> None:
        closure = mechanics.closure
        self._mechanics, self._model, self._scale = mechanics, mechanics.model, closure.scale
        self._vectors = self._model.vectors
        self._load_dependent = tuple(
            joint for joint in mechanics.friction_joints if joint.friction.coefficient
        )
        self._forms = forms = _forms_of(closure, {joint.joint for joint in self._load_dependent})
        self.joints: tuple[JointForm, ...] = forms.joints
        # If a point has several joints, ``point/link`` with the joint's ``link``; if a slider has
        # the name of a pin, ``slider/link`` with the link that it slides along.
        self.names = _joint_names(forms.joints)
        points = [*dict.fromkeys(joint.point for joint in forms.joints)]
        self._follower = closure.point_tracker(points)
        at = dict(zip(points, self._follower.indices, strict=True))
        self._places = tuple(at[joint.point] for joint in forms.joints)
        units = [joint.actions(number) for number, joint in enumerate(forms.joints)]
        # For each joint its first unknown; then those of the drives.
        *self._first, self._drives = accumulate(map(len, units), initial=0)
        columns: list[Column] = [[(unit, 1.0)] for unit in chain(*units)]
        columns += [[(forms.efforts[name], 1.0)] for name in closure.input_names]
        columns += [self._ratio_column(name) for name in closure.linkage.ratios]
        columns += [[(spin, 1.0)] for spin in forms.spins]
        self._matrix = JointMatrix(forms, self._vectors, self._places, closure.scale, columns)
        self.parts = self._find_certain_parts()
        """What is certain of the force and of the moment in each joint."""
        for rubbing in self._load_dependent:
            if self.parts[rubbing.joint][0] not in (WHOLE, ACROSS):
                name = rubbing.name
                raise DefinitionError(
                    f'effects.friction.joints.{name}.coefficient',
                    f'the force in {quote(name)} is not certain: {self._reason}',
                    'write coulomb instead',
                )

    @property
    def published_joints(self) -> tuple[int, ...]:
        """Return the numbers of the joints of whose force some part is certain."""
        return tuple(number for number, (force, _) in enumerate(self.parts) if force)

    @property
    def uncertain(self) -> str:
        """Return what is not certain, and why, in a line; '' if all is."""
        said: dict[str, list[str]] = {}
        for name, joint, parts in zip(self.names, self.joints, self.parts, strict=True):
            for what, part, units in zip(('force', 'moment'), parts, joint[4:6], strict=True):
                if units and part != WHOLE:
                    said.setdefault(_LACKS[part].format(what), []).append(name)
        lacking = '; '.join(f'{what} in {list_names(names)}' for what, names in said.items())
        return f'{lacking}: {self._reason}' if lacking else ''

    @property
    def _reason(self) -> str:
        if self._matrix.size < len(self._matrix.columns):
            count = len(self._matrix.columns) - self._matrix.size
            return (
                f'the linkage is over-constrained, with {count} unknown '
                f'force{"s" * (count != 1)} more than equations'
            )
        return 'teeth and belts press on the bearings of their wheels by radii that no file says'

    def check_deflections(self, effect: str) -> None:
        """Refuse an effect that moves joints apart, in a linkage that is over-constrained."""
        if self._matrix.size < len(self._matrix.columns):
            raise DefinitionError(
                f'effects.{effect}',
                f'{self._reason}: rigid links neither take up nor pass on a displacement',
                'let a hinge be a ball, or leave it out',
            )

    def solve(
        self,
        position: Position,
        velocity: Velocity,
        acceleration: Acceleration,
        load_values: Sequence[float] = (),
    ) -> tuple[JointReaction, ...] | None:
        """
        Return the reaction in each joint, in the order of `names`: of each what is certain.

        Return None at a toggle and where the linkage does not close. ``load_values`` are as in
        `linkage_ros.dynamics.applied.AppliedForces.given_after`.
        """
        balance = self._solve_balance(position, velocity, acceleration, load_values)
        if balance is None:
            return None
        unknowns, resistances = balance
        matrix, vectors = self._matrix, self._vectors
        reactions: tuple[JointReaction, ...] = ()
        for number, joint in enumerate(self.joints):
            values = islice(unknowns, self._first[number], None)
            force, moment = [0.0] * matrix.force_rows, [0.0] * matrix.moment_rows
            for way in joint.forces:
                _add_along(force, way, next(values), position, vectors.coordinates)
            for way in joint.moments:
                borne = next(values) * self._scale
                _add_along(moment, way, borne, position, vectors.turn_coordinates)
            resisting = resistances[number]
            if joint.slides and joint.axis is not None:
                _subtract_along(force, joint.axis, resisting, position, vectors.coordinates)
            elif joint.axis is not None:
                _subtract_along(moment, joint.axis, resisting, position, vectors.turn_coordinates)
            reactions += (self._certain(number, position, force, moment),)
        return reactions

    def _certain(
        self, number: int, position: Position, force: list[float], moment: list[float]
    ) -> JointReaction:
        """Return what is certain of a force and a moment."""
        parts, axis = self.parts[number], self.joints[number].axis
        if len(force) == 2:
            return Reaction(*force, *moment) if parts[0] else Reaction(0.0, 0.0, 0.0)
        along = ZERO if axis is None or isinstance(axis, int) else axis(position)
        certain = [
            total if part == WHOLE else _certain_of((total[0], total[1], total[2]), part, along)
            for part, total in zip(parts, (force, moment), strict=True)
        ]
        # Adding 0.0 makes 0.0 of −0.0: numbers that are 0 are left out of sums, symbols are not.
        return SpatialReaction(*(component + 0.0 for component in chain(*certain)))

    def force_of(self, reaction: JointReaction) -> Any:
        """Return the force of a reaction as a vector of the model."""
        return self._vectors.from_numbers(reaction[: self._matrix.force_rows])

    def pressing_force(self, number: int, reaction: JointReaction, position: Position) -> Any:
        """Return the force that presses a joint to the side: in a hinge, across its axis."""
        force, axis = self.force_of(reaction), self.joints[number].axis
        if axis is None or isinstance(axis, int) or self.joints[number].slides:
            return force
        return _certain_of(force, ACROSS, axis(position))

    def bar_direction(self, link: str, near: int, far: int) -> Callable[[Position], Any]:
        """Return the direction on a link from one of its joints to another, a unit vector."""
        closure: Any = self._mechanics.closure
        ends = self.joints[near], self.joints[far]
        if isinstance(closure, PlanarClosure):
            return planar_bar(closure, link, *ends)
        from linkage_ros.dynamics.spatial_forms import spatial_bar  # local import: in space only

        return spatial_bar(closure, link, *ends)

    def drive_efforts(
        self,
        position: Position,
        velocity: Velocity,
        acceleration: Acceleration,
        load_values: Sequence[float] = (),
    ) -> tuple[float, ...]:
        """
        Return the effort of each drive; empty where there are no forces.

        It is as in `Mechanics.drive_efforts`, plus the friction that grows with the forces in the
        joints. The parameters are as in `solve`.
        """
        balance = self._solve_balance(position, velocity, acceleration, load_values)
        if balance is None:
            return ()
        unknowns, _ = balance
        a, linkage = acceleration.state.coordinates, self._mechanics.closure.linkage
        inertia = self._mechanics.loads.drive_inertia
        efforts: tuple[float, ...] = ()
        for i, driven in enumerate(linkage.inputs):
            inert, force = inertia * a[1 + i], unknowns[self._drives + i]
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
        `linkage_ros.dynamics.load_dependent_friction.FrictionSolver.improve_sliding`.
        """
        applied = self._mechanics.applied
        given = () if applied is None else applied.given_after(seconds)
        fast = self._compiled_sliding.fast

        def improve_frictions(found: Sequence[float]) -> Sequence[Sequence[float]] | None:
            numbers = (*given, pull, mobility, *found)
            improved: Sequence[Sequence[float]] | None = fast(value, rate, *numbers)
            if improved is None:
                closure = self._mechanics.closure
                position = closure.position(value)
                if position.status not in _SOLVED:
                    return None
                velocity = closure.velocity(position, rate)
                improved = self._improve_sliding(position, velocity, numbers)
            return improved

        return self._frictions.find_sliding(improve_frictions)

    @property
    def pressing(self) -> Pressing:
        """Return how friction grows with the forces in the joints, with several inputs."""
        from linkage_ros.dynamics.load_dependent_friction import (
            Pressing,  # local import: only with it
        )

        dry, inputs = self._mechanics.dry_joints, self._mechanics.closure.input_names
        joints = tuple(k for k, rubbing in enumerate(dry) if rubbing.friction.coefficient)
        solver = self._frictions
        slides = solver.compile_sliding(joints, len(inputs), len(dry))
        return Pressing(joints, len(inputs), solver, self.joint_presses, slides)

    def joint_presses(
        self, values: Sequence[float], rates: Sequence[float], seconds: float
    ) -> Sequence[float]:
        """
        Return the force in each joint whose friction grows with it, x and y, in [N].

        There are those without dry friction at accelerations of 0, then for an acceleration of 1
        of each input, then for a unit of friction along the positive slip of each joint with dry
        friction, and of each with a hard stop; none where there are no forces.
        """
        applied = self._mechanics.applied
        load_values = () if applied is None else applied.given_after(seconds)
        coefficients: Sequence[Sequence[float]] | None = self._compiled_presses.fast(
            *values, *rates, *load_values
        )
        if coefficients is None:
            position = self._mechanics.closure.close_unlimited(*values)
            if position.status not in _SOLVED:
                return ()
            coefficients = self._press_coefficients(position, rates, load_values)
        return coefficients[0] if coefficients else ()

    @cached_property
    def _compiled_presses(self) -> Compiled:
        inputs = len(self._mechanics.closure.input_names)

        def list_outputs(motion: CompiledMotion, *numbers: float) -> Sequence[Sequence[float]]:
            return self._press_coefficients(motion.position, numbers[:inputs], numbers[inputs:])

        applied = self._mechanics.applied
        count = inputs + (0 if applied is None else len(applied.given_after(0.0)))
        return Compiled(
            self._mechanics.closure, 0, list_outputs, within_limits=False, given_count=count
        )

    def _press_coefficients(
        self, position: Position, rates: Sequence[float], load_values: Sequence[float]
    ) -> Sequence[Sequence[float]]:
        mechanics, places = self._mechanics, self._follower.places(position)
        velocity = mechanics.closure.velocity(position, *rates)
        columns, _ = self._sides_by_accelerations(
            position, velocity, places, load_values, dry=False
        )
        actions = [self._motion(rubbing) for rubbing in mechanics.dry_joints]
        actions += [self._forms.efforts[name] for name in mechanics.stopped_joints]
        for action in actions:
            of_a_unit = [0.0] * self._matrix.size
            self._apply_effort(of_a_unit, action, 1.0, position, places)
            columns += of_a_unit
        numbers = self._matrix.varying_at(position, places)
        forces = call(self._frictions.forces_in, *numbers, *columns)
        if not has_result(forces):
            return []
        total = 2 * len(self._load_dependent) * (1 + len(rates) + len(actions))
        return [[forces[i] for i in range(total)]]

    def joint_deflections(
        self, position: Position, offsets: Sequence[Any]
    ) -> tuple[float, ...] | None:
        """
        Return the changes of the published joints, in [rad] or [m], by offsets in the joints.

        This is first order in the offsets: the error falls with their square. Return None at a
        toggle and where the linkage does not close. The inputs of the position, which has no
        offsets, are held.

        An offset belongs to each joint, in the order of `names`: the place of its point on
        ``joint.link`` minus the place of its point on ``joint.to``, in the frame of the ground, in
        [m]. It counts as far as the joint transmits forces: of a slider only across its line.

        Play: a link that is pushed with the force f moves away from the link that pushes it, so
        the offset is −e·f/|f| with the radial play e and the force f of `Reaction`, whichever link
        has the hole. Stretch: if a pin of a link is displaced by the vector u from its nominal
        place, the offset is −u in a joint whose ``link`` it is and +u in one whose ``to`` it is.
        """
        if position.status not in _SOLVED:
            return None
        vectors, places = self._vectors, self._follower.places(position)
        gaps = [0.0] * self._matrix.size
        for first, joint, offset in zip(self._first, self.joints, offsets, strict=True):
            for number, way in enumerate(joint.forces, first):
                gaps[number] = (
                    vectors.coordinates(offset)[way]
                    if isinstance(way, int)
                    else vectors.dot(offset, way(position))
                )
        numbers = self._matrix.varying_at(position, places)
        moved = call(self._solve_displacements, *numbers, *gaps)
        if not has_result(moved):
            return None
        efforts = map(self._forms.efforts.__getitem__, self._mechanics.closure.joint_names)
        return tuple(self._displacement(effort, moved, position, places) for effort in efforts)

    def _displacement(
        self, joint: Action, moved: Sequence[float], position: Position, places: Sequence[Any]
    ) -> float:
        """Return how far displacements of the links move a joint, by a unit of its effort."""
        vectors, matrix, way = self._vectors, self._matrix, joint.direction
        along, slid = None if isinstance(way, int) else way(position), 0.0
        for row, pivot, sign in matrix.sides(joint):
            turned = row + matrix.force_rows
            last = turned + matrix.moment_rows
            turn = vectors.turn_from(moved[turned:last])
            if joint.joint >= 0:
                place = places[self._places[joint.joint]]
                lever = vectors.scale(1.0 / self._scale, vectors.minus(place, places[pivot]))
                moving = vectors.plus(
                    vectors.from_numbers(moved[row:turned]), vectors.carry(turn, lever)
                )
                slid += sign * vectors.dot(moving, along)
            elif isinstance(way, int):
                slid += sign * vectors.turn_coordinates(turn)[way]
            else:
                slid += sign * vectors.turn_dot(turn, along)
        return slid if joint.joint >= 0 else slid / self._scale

    @cached_property
    def _frictions(self) -> FrictionSolver:
        """Return the solver of the friction that grows with the forces."""
        from linkage_ros.dynamics.load_dependent_friction import (
            FrictionSolver,  # local import: only with it
        )

        unknowns = [self._friction_unknown(rubbing) for rubbing in self._load_dependent]
        mechanics = self._mechanics
        sides, count = 2 + len(unknowns), len(mechanics.closure.input_names)
        if count > 1:
            sides = 1 + count + len(mechanics.dry_joints) + len(mechanics.stopped_joints)
        # Several inputs test each step.
        return FrictionSolver(unknowns, self._matrix, sides, 3 if count == 1 else 1)

    @cached_property
    def _solve_forces(self) -> Callable[..., Sequence[float] | None]:
        return self._matrix.compile_solver()

    @cached_property
    def _solve_displacements(self) -> Callable[..., Sequence[float] | None]:
        return self._matrix.compile_solver(transposed=True)

    @cached_property
    def _compiled_sliding(self) -> Compiled:
        def list_outputs(motion: CompiledMotion, *given: float) -> Sequence[Sequence[float]]:
            assert motion.velocity is not None
            return self._improve_sliding(motion.position, motion.velocity, given)

        applied = self._mechanics.applied
        count = 0 if applied is None else len(applied.given_after(0.0))
        count += 2 + len(self._load_dependent)
        return Compiled(
            self._mechanics.closure, 1, list_outputs, within_limits=False, given_count=count
        )

    def _improve_sliding(
        self, position: Position, velocity: Velocity, numbers: Sequence[float]
    ) -> Sequence[Sequence[float]]:
        """
        Return better frictions by the forces at a motion, as `FrictionSolver.improve_sliding`.

        ``numbers`` are those of applied forces, pull and mobility, then the last frictions.
        """
        closure, places = self._mechanics.closure, self._follower.places(position)
        begin = len(numbers) - len(self._load_dependent)
        (*load_values, pull, mobility), frictions = numbers[:begin], numbers[begin:]
        columns, units = self._sides_by_accelerations(position, velocity, places, load_values)
        forces = self._frictions.forces_in(
            *self._matrix.varying_at(position, places), *columns, *units
        )
        if not forces:
            return []
        v = velocity.state.coordinates
        unit = self._scale if closure.linkage.inputs[0].slider else 1.0
        levers = [abs(rubbing.slip_rate(v) / (unit * v[1])) for rubbing in self._load_dependent]
        return self._frictions.improve_sliding(forces, levers, (pull, mobility), frictions)

    def _sides_by_accelerations(
        self,
        position: Position,
        velocity: Velocity,
        places: list[Any],
        load_values: Sequence[float],
        dry: bool = True,
    ) -> tuple[list[float], list[float]]:
        """
        Return right sides at accelerations of 0, and what 1 of each input changes.

        The second list has what `_right_sides` returns of friction after them.
        """
        closure, size = self._mechanics.closure, self._matrix.size
        count = len(closure.input_names)
        still, *moved = [
            self._right_sides(
                position,
                velocity,
                closure.acceleration(position, velocity, *[float(n == k) for n in range(count)]),
                places,
                load_values,
                dry,
            )[0]
            for k in range(-1, count)
        ]
        columns = still[:size]
        for sides in moved:
            columns += [
                first - second for first, second in zip(sides[:size], still[:size], strict=True)
            ]
        return columns, still[size:]

    def _solve_balance(
        self,
        position: Position,
        velocity: Velocity,
        acceleration: Acceleration,
        load_values: Sequence[float] = (),
    ) -> tuple[list[float], list[float]] | None:
        """Return the solution of the system, and the friction in each joint."""
        if position.status not in _SOLVED:
            return None
        places = self._follower.places(position)
        sides, resistances = self._right_sides(
            position, velocity, acceleration, places, load_values
        )
        solve = self._frictions.solve_pressed if self._load_dependent else self._solve_forces
        unknowns = call(solve, *self._matrix.varying_at(position, places), *sides)
        if not has_result(unknowns):
            return None
        v = velocity.state.coordinates
        for i, rubbing in enumerate(self._load_dependent, len(self._matrix.columns)):
            resistances[rubbing.joint] += slip_direction(rubbing, v) * unknowns[i]
        return unknowns, resistances

    def _right_sides(
        self,
        position: Position,
        velocity: Velocity,
        acceleration: Acceleration,
        places: list[Any],
        load_values: Sequence[float],
        dry: bool = True,
    ) -> tuple[list[float], list[float]]:
        """
        Return the right sides of the system, and the friction in each joint.

        After them follow the right sides of a unit of each friction that grows with its force;
        they are left out with all dry friction.
        """
        mechanics, model, vectors = self._mechanics, self._model, self._vectors
        v = velocity.state.coordinates
        sides = [0.0] * self._matrix.size
        at = model.points.places(position)
        pulls = model.points.accelerations(position, velocity, acceleration, at)
        turns = model.turn_rates(position, velocity)
        changes = model.turn_changes(position, velocity, acceleration)
        moments = model.moments_in_ground(
            position,
            [
                vectors.moment(body.gyration, turn, change)
                for body, turn, change in zip(model.bodies, turns, changes, strict=True)
            ],
        )
        for link, body, moment in zip(model.links, model.bodies, moments, strict=True):
            weight = vectors.scale(body.mass, vectors.minus(mechanics.gravity, pulls[body.point]))
            self._apply_force(sides, link, at[body.point], weight, places)
            first = self._matrix.rows[link] + self._matrix.force_rows
            for row, part in enumerate(vectors.turn_coordinates(moment), first):
                sides[row] += part / self._scale
        if mechanics.springs:
            velocities = model.points.velocities(position, velocity, at)
            for spring, (start, end) in mechanics.springs:
                length, growth = spring_length(vectors, at, velocities, (start, end))
                if not length:
                    continue
                along = vectors.minus(at[end], at[start])
                force = vectors.scale(spring.tension(length, growth) / length, along)
                pulled = zip(spring.ends, (start, end), (1.0, -1.0), strict=True)
                for (link, _), point, sign in pulled:
                    if link != GROUND:
                        push = force if sign > 0.0 else vectors.scale(-1.0, force)
                        self._apply_force(sides, link, at[point], push, places)
        if mechanics.applied is not None:
            loaded = mechanics.applied.places(position)
            for on, load in mechanics.applied.acting_loads(position, velocity, load_values):
                self._apply_load(sides, on, load, position, places, loaded)
        resistances = [0.0] * len(self.joints)
        for rubbing in mechanics.friction_joints:
            drag = joint_friction(rubbing, v) if dry else rubbing.viscous_drag(v)
            resistances[rubbing.joint] = drag
            self._apply_effort(sides, self._motion(rubbing), -drag, position, places)
        for rubbing in self._load_dependent if dry else ():
            of_a_unit = [0.0] * self._matrix.size
            direction = -slip_direction(rubbing, v)
            self._apply_effort(of_a_unit, self._motion(rubbing), direction, position, places)
            sides += of_a_unit
        return sides, resistances

    def _motion(self, rubbing: FrictionJoint) -> Action:
        return self.joints[rubbing.joint].motion(rubbing.joint)

    def _friction_unknown(self, rubbing: FrictionJoint) -> tuple[int, bool, float]:
        """Return the first unknown of a joint, whether a second counts, and its factor."""
        friction, joint = rubbing.friction, self.joints[rubbing.joint]
        factor = friction.coefficient * (1.0 if joint.slides else friction.radius)
        return self._first[rubbing.joint], len(joint.forces) > 1, factor

    def _ratio_column(self, name: str) -> Column:
        """Return what a unit between the wheels of a ratio does: together it does no work."""
        efforts, ratio = self._forms.efforts, self._mechanics.closure.linkage.ratios[name]
        factors = {name: 1.0, **{of: -factor for of, factor in ratio.terms.items()}}
        return [
            (efforts[of], factor * (self._scale if efforts[of].joint >= 0 else 1.0))
            for of, factor in factors.items()
        ]

    def _apply_load(
        self,
        sides: list[float],
        on: Loaded,
        load: float,
        position: Position,
        places: list[Any],
        loaded: Sequence[Any],
    ) -> None:
        """Add a load on a joint, a point or a link to the right sides of its links."""
        from linkage_ros.dynamics.applied import (
            JointCoordinate,  # local import: only with such loads
            LoadedPoint,  # local import: only with such loads
        )

        if isinstance(on, LoadedPoint):
            force = self._vectors.scale(load, on.direction(position))
            self._apply_force(sides, on.link, loaded[on.tracked_index], force, places)
        elif isinstance(on, JointCoordinate):
            self._apply_effort(sides, self._forms.efforts[on.name], load, position, places)
        else:
            assert isinstance(on, LinkTurn)
            self._apply_effort(sides, Action(on.link, GROUND, on.axis), load, position, places)

    def _apply_effort(
        self,
        sides: list[float],
        action: Action,
        effort: float,
        position: Position,
        places: list[Any],
    ) -> None:
        """Add an effort to the right sides of its links."""
        vectors, way = self._vectors, action.direction
        turned = None if isinstance(way, int) else way(position)
        for link, sign in ((action.link, 1.0), (action.to, -1.0)):
            if link == GROUND:
                continue
            if action.joint >= 0:
                force = vectors.scale(sign * effort, turned)
                self._apply_force(sides, link, places[self._places[action.joint]], force, places)
                continue
            first = self._matrix.rows[link] + self._matrix.force_rows
            if isinstance(way, int):
                sides[first + way] -= sign * effort / self._scale
                continue
            for row, part in enumerate(vectors.turn_coordinates(turned), first):
                sides[row] -= sign * effort * part / self._scale

    def _apply_force(
        self, sides: list[float], link: str, place: Any, force: Any, places: Sequence[Any]
    ) -> None:
        """Add a known force at a place of a link to its right sides."""
        vectors, row = self._vectors, self._matrix.rows[link]
        lever = vectors.minus(place, places[self._matrix.pivots[link]])
        for at, part in enumerate(vectors.coordinates(force), row):
            sides[at] -= part
        moment = vectors.turn_coordinates(vectors.cross(lever, force))
        for at, part in enumerate(moment, row + self._matrix.force_rows):
            sides[at] -= part / self._scale

    def _find_certain_parts(self) -> list[tuple[str, str]]:
        """Return what is certain of each force and moment; choose the unknowns to solve for."""
        parts = [(WHOLE if joint.forces else NONE, WHOLE) for joint in self.joints]
        matrix = self._matrix
        if matrix.size < len(matrix.columns):
            from linkage_ros.dynamics.redundancy import (
                find_certain,  # local import: it loads numpy
            )

            states = [
                (matrix.rows_at(matrix.varying_at(at, self._follower.places(at))), at)
                for at in self._states()
            ]
            matrix.kept, parts = find_certain(states, self.joints, self._first)
        linkage = self._mechanics.closure.linkage
        following = linkage.ratios.items()
        named = [of for name, ratio in following for of in (name, *ratio.terms)]
        wheels = [self._forms.efforts[of] for of in named]
        for wheel in wheels:
            bearings = [
                number
                for number, joint in enumerate(self.joints)
                if joint.forces and {joint.link, joint.to} == {wheel.link, wheel.to}
            ]
            # Of wheels that no joint joins, any joint between them may bear the other force.
            beside = [] if wheel.joint >= 0 and not bearings else range(len(parts))
            for number in bearings or beside:
                parts[number] = NONE, NONE
        return parts

    def _states(self) -> Iterator[Position]:
        """Yield positions with rates: the pose, and others near it."""
        closure: Any = self._mechanics.closure
        pose = closure.linkage.pose.inputs
        for number in range(_STATES):
            off = 0.1 * number * self._scale
            inputs = [
                value + (off if driven.slider else 0.1 * number) * sin(1.0 + 2.4 * k + number)
                for k, (value, driven) in enumerate(zip(pose, closure.linkage.inputs, strict=True))
            ]
            position = closure.close_unlimited(*inputs)
            if position.status.has_rates:
                yield position


def _forms_of(closure: Any, rubbing: Collection[int]) -> JointForms:
    """Return what the joints transmit; of those that rub by their force, first what rubs."""
    if isinstance(closure, PlanarClosure):
        return planar_forms(closure)
    from linkage_ros.dynamics.spatial_forms import spatial_forms  # local import: in space only

    return spatial_forms(closure, rubbing)


def _add_along(
    total: list[float],
    way: Direction,
    size: float,
    position: Position,
    coordinates: Callable[[Any], Sequence[float]],
) -> None:
    """Add a vector of a size along a direction."""
    if isinstance(way, int):
        total[way] = size
        return
    for at, part in enumerate(coordinates(way(position))):
        added = size * part
        total[at] = added if type(total[at]) is float and total[at] == 0.0 else total[at] + added


def _subtract_along(
    total: list[float],
    way: Direction,
    size: float,
    position: Position,
    coordinates: Callable[[Any], Sequence[float]],
) -> None:
    if isinstance(way, int):
        total[way] = total[way] - size
        return
    for at, part in enumerate(coordinates(way(position))):
        total[at] = total[at] - size * part


def _certain_of(total: Vector, part: str, axis: Vector) -> Vector:
    """Return what is certain of a force or a moment in space."""
    if part == NONE:
        return ZERO
    along = scale(dot(axis, total), axis)
    return along if part == ALONG else minus(total, along)


def _joint_names(joints: Sequence[JointForm]) -> tuple[str, ...]:
    pins = [joint.name for joint in joints if not joint.slides]
    names = []
    for joint in joints:
        if joint.slides:
            names.append(f'{joint.name}/{joint.to}' if joint.name in pins else joint.name)
        else:
            several = pins.count(joint.name) > 1
            names.append(f'{joint.name}/{joint.link}' if several else joint.name)
    return tuple(names)
