# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The equation of motion of a linkage, and the efforts of its drives, by virtual work.

A body takes part by the velocity c of its centre of mass and its turn s, with a constant matrix K
(`linkage_ros.dynamics.bodies`): so plane and space differ in no formula. With one input q, a body
moves with c and s at q̇ = 1, and with c' and s' at q̇ = 1 and q̈ = 0. So::

    I(q) = Id + Σ (m·c·c + s·K·s)              ½·dI/dq = Σ (m·c·c' + s·K·s')
    V(q) = −Σ m·g·r + Σ ½·k·(ℓ − ℓ0)²          dV/dq = −Σ m·g·c + Σ k·(ℓ − ℓ0)·ℓ'
    C(q) = Σ c·ψ'² + Σ c·ℓ'²                   F(q) = Σ T·|ψ'|

    I·q̈ + ½·(dI/dq)·q̇² + dV/dq + C·q̇ + F·sign(q̇) = τ

This is Eksergian's equation of motion (R. Eksergian, Dynamical Analysis of Machines, J. Franklin
Institute, 1930–31; B. Paul, Kinematics and Dynamics of Planar Machinery, 1979, ch. 12; for virtual
work also R. L. Norton, Design of Machinery, ch. 10). Id is the inertia of the drive; ψ the angle
in a pin or the slide in a slider, with the viscous coefficient c and the Coulomb moment or force
T; ℓ the length of a spring.

With several inputs there is one such equation for each: its left side is the work of inertia,
loads and friction over the velocities that this input alone would cause at a rate of 1. In space
the moment of inertia forces is K·ṡ + s × K·s, whose second part works on nothing if s is the only
one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from itertools import chain, islice
from operator import mul
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.dynamics.bodies import BodyModel, planar_bodies, spring_length
from linkage_ros.dynamics.dry_friction import DryFriction, JointStop, settle_forces, Slip
from linkage_ros.dynamics.integrators import check_step, EXACT
from linkage_ros.dynamics.loads import (
    check_loads,
    check_masses,
    Friction,
    JointFriction,
    Loads,
)
from linkage_ros.kinematics import (
    Acceleration,
    all_finite,
    call,
    copysign,
    Limits,
    PlanarClosure,
    Position,
    Velocity,
    where,
)
from linkage_ros.kinematics.compiling import Compiled, TracedMotion as CompiledMotion

if TYPE_CHECKING:
    from linkage_ros.dynamics.applied import AppliedForces
    from linkage_ros.dynamics.laws import Law, LawTerm, Stribeck

_ROUNDING = 1e-9
"""Slips below this fraction of the rates that they come from count as zero."""


class Terms(NamedTuple):
    """The equation of motion at one value of its input, in SI units."""

    inertia: float  # I, in [kg·m²], or in [kg] if the input slides; the units of the others follow
    half_slope: float  # ½·dI/dq
    potential_slope: float  # dV/dq
    viscous: float  # C; the force on q is −C·q̇
    coulomb: float  # F; the force on q is −F·sign(q̇), and up to F in either direction at q̇ = 0
    # T·ψ' of each joint with Coulomb friction, so that F is the sum of their absolute values; 0 if
    # ψ' is 0 within rounding. Empty without such friction.
    slips: tuple[float, ...] = ()
    # For each law of an applied force (`linkage_ros.dynamics.laws`): the force on q is the sum of
    # λ·f(x, ẋ, t). Empty without laws.
    laws: tuple[LawTerm, ...] = ()
    breakaway: float = 0.0  # What friction holds at q̇ = 0 in addition to F


class InputLawTerm(NamedTuple):
    """A load by a law, at values and rates of several inputs."""

    levers: tuple[float, ...]  # λ of the load for each input
    value: float  # x of the law, in [rad] or [m]
    rate: float  # ẋ


class InputTerms(NamedTuple):
    """The equation of motion M·q̈ + h = τ + Σ λ·f at values and rates of several inputs."""

    matrix: tuple[float, ...]  # M, the rows of its lower triangle
    mobility: tuple[tuple[float, ...], ...]  # The rows of its inverse
    bias: tuple[float, ...]  # h: of inertia, weight, springs and dampers, and constant loads
    laws: tuple[InputLawTerm, ...] = ()  # One for each law of an applied force
    slips: tuple[Slip, ...] = ()  # One for each joint with dry friction
    limited: tuple[Slip, ...] = ()  # One for each joint with a hard stop that is no input
    # By the time, the forces of `linkage_ros.dynamics.reactions.Reactions.joint_presses`.
    presses: Callable[[float], Sequence[float]] | None = None

    def inertia(self, row: int, column: int) -> float:
        """Return an element of M."""
        row, column = max(row, column), min(row, column)
        return self.matrix[row * (row + 1) // 2 + column]

    @property
    def total_inertia(self) -> float:
        """Return the sum of the diagonal of M."""
        return sum(self.inertia(n, n) for n in range(len(self.bias)))


class FrictionJoint(NamedTuple):
    """
    A joint with friction.

    Its rate is factor·(v[one] − v[other]) of the closure's coordinates, in [rad/s] or [m/s];
    ``joint`` is its index among the joints of the structure, in space among hinges, slides and
    struts. ``law`` is the law of the friction
    that falls with the rate, if it has any.
    """

    name: str
    joint: int
    friction: JointFriction
    one: int
    other: int
    factor: float
    law: Stribeck | None

    def slip_rate(self, v: Sequence[float]) -> float:
        """Return the rate for the rates of the closure's coordinates."""
        return self.factor * (v[self.one] - v[self.other])

    def viscous_drag(self, v: Sequence[float]) -> float:
        """Return its viscous friction for the rates of the closure's coordinates."""
        return self.friction.viscous * self.slip_rate(v)


class Mechanics:
    """
    A linkage with masses, and the forces that act on it.

    Without loads and friction there are none. A link that moves without a mass, and a load on a
    part that does not exist, raise DefinitionError.
    """

    def __init__(
        self, closure: PlanarClosure, loads: Loads | None = None, friction: Friction | None = None
    ) -> None:
        self.closure = closure
        self.loads = loads or Loads()
        self.friction = friction or Friction()
        linkage = closure.linkage
        check_masses(linkage, self.loads)
        check_loads(linkage, self.loads, self.friction)
        self.model = model = _bodies_of(closure, self.loads)
        """The bodies, and the ends of the springs."""
        self._points, self._bodies = model.points, model.bodies
        gravity = self.loads.gravity
        self.gravity = model.vectors.from_numbers(gravity) if any(gravity) else model.vectors.zero
        """The acceleration of gravity, as a vector of the model."""
        self.springs = tuple(zip(self.loads.springs, model.springs, strict=True))
        """The springs, each with its ends among the points of the model."""
        self.friction_joints = tuple(self._find_friction_joints())
        """The joints that have friction."""
        self.applied = _make_applied(closure, self.loads)
        """Loads on joints and points; None if there are none."""
        self.laws: tuple[Law, ...] = (
            *(self.applied.laws if self.applied else ()),
            *(rubbing.law for rubbing in self.friction_joints if rubbing.law),
        )
        """Laws of the forces, in the order of ``Terms.laws``."""
        self.stribeck_joints = tuple(rubbing for rubbing in self.friction_joints if rubbing.law)
        """The joints whose friction falls with the rate; their laws are the last ones."""
        self.dry_joints = tuple(joint for joint in self.friction_joints if joint.friction.is_dry)
        """The joints with dry friction."""
        self.stopped_joints = _find_stopped(closure, self.loads)
        """Of several inputs, the other joints with hard stops, by name, with their limits."""
        sticks = any(rubbing.friction.breakaway_excess for rubbing in self.friction_joints)
        self._has_no_laws = not sticks and self.applied is None
        """Whether the equation has neither laws nor an excess of friction at rest."""
        self._units = tuple(closure.scale if driven.slider else 1.0 for driven in linkage.inputs)

    def motion_terms(self, position: Position) -> Terms | None:
        """
        Return the equation of motion of a linkage with one input.

        Return None if no rates exist, as at a toggle, if the linkage does not close, and so near a
        toggle that the terms overflow.
        """
        if not position.status.has_rates:
            return None
        velocity = self.closure.velocity(position, 1.0)
        acceleration = self.closure.acceleration(position, velocity, 0.0)
        points, vectors = self._points, self.model.vectors
        places = points.places(position)
        velocities = points.velocities(position, velocity, places)
        accelerations = points.accelerations(position, velocity, acceleration, places)
        turns = self.model.turn_rates(position, velocity)
        changes = self.model.turn_changes(position, velocity, acceleration)
        v = velocity.state.coordinates
        inertia, half_slope, momentum = self.loads.drive_inertia, 0.0, vectors.zero
        for (mass, gyration, point), turn, change in zip(
            self._bodies, turns, changes, strict=True
        ):
            speed, pull = velocities[point], accelerations[point]
            moved, whirled = vectors.scale(mass, speed), vectors.momentum(gyration, turn)
            momentum = vectors.plus(momentum, moved)
            inertia += vectors.dot(moved, speed) + vectors.turn_dot(whirled, turn)
            half_slope += vectors.dot(moved, pull)
            half_slope += vectors.turn_dot(whirled, change)
        slope = -vectors.dot(self.gravity, momentum)
        viscous = coulomb = 0.0
        slips: tuple[float, ...] = ()
        for spring, ends in self.springs:
            length, growth = spring_length(vectors, places, velocities, ends)
            slope += spring.stiffness * (length - spring.free_length) * growth
            viscous += spring.damping * growth * growth
        for rubbing in self.friction_joints:
            slip, limit = rubbing.slip_rate(v), rubbing.friction.coulomb
            viscous += rubbing.friction.viscous * slip * slip
            coulomb += limit * abs(slip)
            if limit:
                slips += (where(_is_at_rest(v, rubbing.one, rubbing.other), 0.0, limit * slip),)
        if not all_finite((inertia, half_slope)):
            return None
        if self._has_no_laws:
            return Terms(inertia, half_slope, slope, viscous, coulomb, slips)
        from linkage_ros.dynamics.laws import LawTerm  # local import: only with laws

        laws: tuple[LawTerm, ...] = ()
        if self.applied is not None:
            pull, drag, laws = self.applied.one_input(position, velocity)
            slope, viscous = slope + pull, viscous + drag
        breakaway = 0.0
        for rubbing in self.friction_joints:
            slip = rubbing.slip_rate(v)
            breakaway += rubbing.friction.breakaway_excess * abs(slip)
            if rubbing.law:
                slip = where(_is_at_rest(v, rubbing.one, rubbing.other), 0.0, slip)
                laws += (LawTerm(slip, 0.0, slip),)
        return Terms(inertia, half_slope, slope, viscous, coulomb, slips, laws, breakaway)

    @cached_property
    def motion_equation(self) -> Callable[[float], Terms | None]:
        """
        Return the equation of motion of a linkage with one input, as a function of the input.

        Its results equal `motion_terms` at the position to the last bit; it is straight-line code.
        """
        compiled = Compiled(self.closure, 0, self._wanted_terms, within_limits=False)
        fast, position, terms = compiled.fast, self.closure.position, self.motion_terms

        def equation(value: float) -> Terms | None:
            values = fast(value)
            if values is None:
                return terms(position(value))
            (inertia, half_slope, potential_slope, viscous, coulomb), slips = values
            return Terms(inertia, half_slope, potential_slope, viscous, coulomb, slips)

        if self._has_no_laws:
            return equation
        from linkage_ros.dynamics.laws import LawTerm  # local import: only with laws

        def equation_with_laws(value: float) -> Terms | None:
            values = fast(value)
            if values is None:
                return terms(position(value))
            (inertia, half_slope, potential_slope, viscous, coulomb), slips, laws, more = values
            return Terms(
                inertia,
                half_slope,
                potential_slope,
                viscous,
                coulomb,
                slips,
                tuple(map(LawTerm, *[iter(laws)] * 3)),
                *more,
            )

        return equation_with_laws

    def input_terms(self, position: Position, rates: Sequence[float]) -> InputTerms | None:
        """
        Return the equation of motion of a linkage with several inputs, at their rates.

        Return None as `motion_terms` does. Of dry friction it has the slips alone.
        """
        if not position.status.has_rates:
            return None
        closure, points, vectors = self.closure, self._points, self.model.vectors
        count = len(self._units)
        places = points.places(position)
        alone = [closure.velocity(position, *_unit_rates(count, i)) for i in range(count)]
        moved = [points.velocities(position, way, places) for way in alone]
        turned = [self.model.turn_rates(position, way) for way in alone]
        velocity = closure.velocity(position, *rates)
        still = closure.acceleration(position, velocity, *[0.0] * count)
        velocities = points.velocities(position, velocity, places)
        accelerations = points.accelerations(position, velocity, still, places)
        turns = self.model.turn_rates(position, velocity)
        changes = self.model.turn_changes(position, velocity, still)
        forces = self._inertia_forces(accelerations, turns, changes)
        v = velocity.state.coordinates
        matrix: tuple[float, ...] = ()
        bias: tuple[float, ...] = ()
        for i, way in enumerate(alone):
            matrix += self._inertia_row(moved[: i + 1], turned[: i + 1])
            needed = 0.0
            for body, (force, moment), turn in zip(self._bodies, forces, turned[i], strict=True):
                needed += vectors.dot(force, moved[i][body.point])
                needed += vectors.turn_dot(moment, turn)
            for spring, ends in self.springs:
                pull = spring.tension(*spring_length(vectors, places, velocities, ends))
                needed += pull * spring_length(vectors, places, moved[i], ends)[1]
            w = way.state.coordinates
            for rubbing in self.friction_joints:
                needed += rubbing.friction.viscous * rubbing.slip_rate(v) * rubbing.slip_rate(w)
            bias += (needed,)
        elements = iter(matrix)
        rows = [[*islice(elements, i + 1)] for i in range(count)]
        columns = [solve_positive(rows, _unit_rates(count, i)) for i in range(count)]
        mobility = tuple(tuple(column) for column in columns if column)
        if len(mobility) < count or not all_finite((*chain(*mobility), *bias)):
            return None
        laws: tuple[InputLawTerm, ...] = ()
        if self.applied is not None:
            more, law_values = self.applied.several_inputs(position, velocity, alone)
            bias = tuple(first + second for first, second in zip(bias, more, strict=True))
            laws = tuple(InputLawTerm(*law) for law in law_values)
        if not (self.dry_joints or self.stopped_joints):
            return InputTerms(matrix, mobility, bias, laws)
        return InputTerms(
            matrix, mobility, bias, laws, *self._find_slips(position, velocity, still, alone)
        )

    def _inertia_row(
        self, moved: Sequence[Sequence[Any]], turned: Sequence[Sequence[Any]]
    ) -> tuple[float, ...]:
        """Return M between the last of some inputs and each of them, by rates of 1 of each."""
        vectors = self.model.vectors
        row: tuple[float, ...] = ()
        for speeds, turns in zip(moved, turned, strict=True):
            inertia = self.loads.drive_inertia if len(row) == len(moved) - 1 else 0.0
            for (mass, gyration, point), first, second in zip(
                self._bodies, turned[-1], turns, strict=True
            ):
                carried = vectors.scale(mass, moved[-1][point])
                inertia += vectors.dot(carried, speeds[point])
                inertia += vectors.turn_dot(vectors.momentum(gyration, first), second)
            row += (inertia,)
        return row

    def _find_slips(
        self,
        position: Position,
        velocity: Velocity,
        still: Acceleration,
        alone: Sequence[Velocity],
    ) -> tuple[tuple[Slip, ...], tuple[Slip, ...]]:
        """Return the slips of joints with dry friction, and the motion of those with stops."""
        from linkage_ros.dynamics.applied import joint_coordinate  # local import: only here

        limited: tuple[Slip, ...] = ()
        ways = [way.state.coordinates for way in alone]
        v, a = velocity.state.coordinates, still.state.coordinates
        slips = tuple(
            Slip(tuple(map(joint.slip_rate, ways)), joint.slip_rate(v), joint.slip_rate(a))
            for joint in self.dry_joints
        )
        for name in self.stopped_joints:
            joint = joint_coordinate(self.closure, name)
            levers = tuple(joint.lever(way, position, ()) for way in alone)
            rate, curved = (joint.lever(of, position, ()) for of in (velocity, still))
            limited += (Slip(levers, rate, curved, joint.value(position)),)
        return slips, limited

    @cached_property
    def input_equation(
        self,
    ) -> Callable[[Sequence[float], Sequence[float]], InputTerms | None]:
        """
        Return the equation of motion of a linkage with several inputs, of values and rates.

        Its results equal `input_terms` at the position to the last bit; it is straight-line code.
        """
        count = len(self._units)

        def list_terms(motion: CompiledMotion, *rates: float) -> Sequence[Sequence[float]]:
            terms = self.input_terms(motion.position, rates)
            if terms is None:
                return []
            others = (
                [*chain.from_iterable((*at.levers, *at[1:]) for at in part)]
                for part in (terms.laws, terms.slips, terms.limited)
            )
            return [terms.matrix, *terms.mobility, terms.bias, *others]

        compiled = Compiled(self.closure, 0, list_terms, within_limits=False, given_count=count)
        fast, close, terms_at = compiled.fast, self.closure.close_unlimited, self.input_terms

        def equation(values: Sequence[float], rates: Sequence[float]) -> InputTerms | None:
            terms = fast(*values, *rates)
            if terms is None:
                return terms_at(close(*values), rates)
            matrix, *mobility, bias, numbers, rubbing, stopped = terms
            laws = tuple([InputLawTerm(*at) for at in take_parts(numbers, 2)])
            if not (rubbing or stopped):
                return InputTerms(matrix, tuple(mobility), bias, laws)
            slips, limited = (
                tuple([Slip(*at) for at in take_parts(part, 3)]) for part in (rubbing, stopped)
            )
            return InputTerms(matrix, tuple(mobility), bias, laws, slips, limited)

        def take_parts(numbers: Sequence[float], more: int) -> Iterator[tuple[Any, ...]]:
            left = iter(numbers)
            for _ in range(len(numbers) // (count + more)):
                yield tuple(islice(left, count)), *islice(left, more)

        return equation

    def _inertia_forces(
        self, accelerations: list[Any], turns: list[Any], changes: list[Any]
    ) -> list[tuple[Any, Any]]:
        """Return the force and the moment that each body needs, against its weight too."""
        vectors = self.model.vectors
        return [
            (
                vectors.scale(mass, vectors.minus(accelerations[point], self.gravity)),
                vectors.moment(gyration, turn, change),
            )
            for (mass, gyration, point), turn, change in zip(
                self._bodies, turns, changes, strict=True
            )
        ]

    def _wanted_terms(self, motion: CompiledMotion) -> Sequence[Sequence[float]]:
        terms = self.motion_terms(motion.position)
        if terms is None:
            return []
        linear = (
            terms.inertia,
            terms.half_slope,
            terms.potential_slope,
            terms.viscous,
            terms.coulomb,
        )
        if self._has_no_laws:
            return [linear, terms.slips]
        return [linear, terms.slips, [*chain.from_iterable(terms.laws)], [terms.breakaway]]

    def potential_energy(self, position: Position) -> float:
        """Return V at a closed position, in [J]; weight has potential 0 at the origin's height."""
        vectors, places = self.model.vectors, self._points.places(position)
        moment = vectors.zero
        for mass, _, point in self._bodies:
            moment = vectors.plus(moment, vectors.scale(mass, places[point]))
        energy = -vectors.dot(self.gravity, moment)
        for spring, (start, end) in self.springs:
            length = vectors.length(vectors.minus(places[end], places[start]))
            stretch = length - spring.free_length
            energy += 0.5 * spring.stiffness * stretch * stretch
        return energy if self.applied is None else energy + self.applied.potential_energy(position)

    def kinetic_energy(self, position: Position, velocity: Velocity) -> float:
        """Return the kinetic energy, with the drive's inertia, in [J]."""
        vectors, places = self.model.vectors, self._points.places(position)
        velocities = self._points.velocities(position, velocity, places)
        turns = self.model.turn_rates(position, velocity)
        v, twice = velocity.state.coordinates, 0.0
        for (mass, gyration, point), turn in zip(self._bodies, turns, strict=True):
            speed = velocities[point]
            twice += mass * vectors.dot(speed, speed)
            twice += vectors.turn_dot(vectors.momentum(gyration, turn), turn)
        for i, unit in enumerate(self._units, 1):
            twice += self.loads.drive_inertia * (unit * v[i]) ** 2
        return 0.5 * twice

    def total_energy(self, position: Position, *rates: float) -> float:
        """
        Return the sum of kinetic and potential energy, in [J].

        The position is closed and not a toggle; the rates are in [rad/s] or [m/s].
        """
        velocity = self.closure.velocity(position, *rates)
        return self.kinetic_energy(position, velocity) + self.potential_energy(position)

    def drive_efforts(
        self,
        position: Position,
        velocity: Velocity,
        acceleration: Acceleration,
        load_values: Sequence[float] = (),
    ) -> tuple[float, ...]:
        """
        Return the effort of each drive for a motion, against inertia, loads and friction.

        Each is a moment in [N·m], or a force in [N] if the input slides, positive if it drives the
        input forward; Coulomb friction is 0 in a joint at rest. The position is closed and not a
        toggle. ``load_values`` are as in `linkage_ros.dynamics.applied.AppliedForces.given_after`.
        """
        points, vectors, count = self._points, self.model.vectors, len(self._units)
        places = points.places(position)
        velocities = points.velocities(position, velocity, places)
        accelerations = points.accelerations(position, velocity, acceleration, places)
        turns = self.model.turn_rates(position, velocity)
        changes = self.model.turn_changes(position, velocity, acceleration)
        v, a = velocity.state.coordinates, acceleration.state.coordinates
        pulls = [
            spring.tension(*spring_length(vectors, places, velocities, ends))
            for spring, ends in self.springs
        ]
        drags = [joint_friction(rubbing, v) for rubbing in self.friction_joints]
        forces = self._inertia_forces(accelerations, turns, changes)
        efforts: tuple[float, ...] = ()
        moved_by: list[Any] = []
        turned_by: list[Any] = []
        matrix: tuple[float, ...] = ()
        levers: tuple[float, ...] = ()
        for i, unit in enumerate(self._units):
            virtual = self.closure.velocity(position, *_unit_rates(count, i))
            w = virtual.state.coordinates
            moved = points.velocities(position, virtual, places)
            turned = self.model.turn_rates(position, virtual)
            effort = self.loads.drive_inertia * a[1 + i] * unit
            for body, (force, moment), way in zip(self._bodies, forces, turned, strict=True):
                effort += vectors.dot(force, moved[body.point])
                effort += vectors.turn_dot(moment, way)
            for pull, (_, ends) in zip(pulls, self.springs, strict=True):
                effort += pull * spring_length(vectors, places, moved, ends)[1]
            for drag, rubbing in zip(drags, self.friction_joints, strict=True):
                effort += drag * rubbing.slip_rate(w)
            if self.applied is not None:
                effort -= self.applied.virtual_work(position, velocity, virtual, load_values)
            if self.friction.holds and count > 1:
                moved_by.append(moved)
                turned_by.append(turned)
                matrix += self._inertia_row(moved_by, turned_by)
                levers += tuple(rubbing.slip_rate(w) for rubbing in self.dry_joints)
            elif self.friction.holds:
                held = sum(
                    rubbing.friction.holding * abs(rubbing.slip_rate(w))
                    for rubbing in self.friction_joints
                )
                rest = copysign(where(abs(effort) > held, abs(effort) - held, 0.0), effort)
                effort = where(abs(v[1]) <= 0.0, rest, effort)
            efforts += (effort,)
        if not (self.friction.holds and count > 1):
            return efforts
        limits = [
            where(_is_at_rest(v, joint.one, joint.other), joint.friction.holding, 0.0)
            for joint in self.dry_joints
        ]
        rest = call(self._efforts_beside_friction, *efforts, *matrix, *levers, *limits)
        return tuple(rest[i] for i in range(count))

    def _efforts_beside_friction(self, *numbers: float) -> list[float]:
        """
        Return what is left of efforts where friction carries what it can, of several inputs.

        Friction carries what it would hold if the drives let go: what is left is what would then
        accelerate the linkage. The numbers are efforts, the inertia, the slips of dry joints at a
        rate of 1 of each input, and what these joints hold.
        """
        count, parts = len(self._units), iter(numbers)
        efforts = [*islice(parts, count)]
        rows = [[*islice(parts, i + 1)] for i in range(count)]
        by_input = [[*islice(parts, len(self.dry_joints))] for _ in range(count)]
        levers, limits = [*zip(*by_input, strict=True)], [*parts]
        moved = [solve_positive(rows, lever) for lever in levers]
        free = solve_positive(rows, efforts)
        if free is None:
            return efforts
        borne, _ = settle_forces(
            [[sum(map(mul, lever, way or ())) for way in moved] for lever in levers],
            [-sum(map(mul, lever, free)) for lever in levers],
            [(-limit, limit) for limit in limits],
        )
        for lever, part in zip(levers, borne, strict=True):
            efforts = [effort - of * part for effort, of in zip(efforts, lever, strict=True)]
        return efforts

    @property
    def dry_frictions(self) -> tuple[DryFriction, ...]:
        """Return the dry friction of `dry_joints`, as a linkage of several inputs takes it."""
        rubbing = [joint.friction for joint in self.dry_joints]
        return tuple(DryFriction(f.coulomb, f.breakaway_excess, f.stribeck) for f in rubbing)

    @property
    def joint_stops(self) -> tuple[JointStop, ...]:
        """Return the hard stops of `stopped_joints`, as a linkage of several inputs takes them."""
        joints, stops = self.closure.linkage.joints, self.stopped_joints
        return tuple(
            JointStop(
                limits.low,
                limits.high,
                0.5 * (limits.low + limits.high) if joints[name].unit == 'rad' else None,
            )
            for name, limits in stops.items()
        )

    def check_curves(self, places: Sequence[Terms], method: str, step: float) -> None:
        """
        Refuse friction that falls with the rate faster than a step follows, in [s].

        ``places`` are the equation of motion at places of the range. The error has the key of the
        steepest curve; its remedy is the longest step that follows it.
        """
        first = -len(self.stribeck_joints)
        self._check_falls(
            [
                {
                    joint: joint.law.steepest_slope * at.factor**2 / terms.inertia
                    for joint, at in zip(self.stribeck_joints, terms.laws[first:], strict=True)
                    if joint.law
                }
                for terms in places
                if self.stribeck_joints
            ],
            method,
            step,
        )

    def check_curves_at(self, terms: InputTerms, method: str, step: float) -> None:
        """Refuse as `check_curves` does, at one state of a linkage with several inputs."""
        falls = {}
        for joint, slip in zip(self.dry_joints, terms.slips, strict=True):
            if joint.law:
                moved = [sum(map(mul, row, slip.levers)) for row in terms.mobility]
                falls[joint] = joint.law.steepest_slope * sum(map(mul, slip.levers, moved))
        self._check_falls([falls], method, step)

    def _check_falls(
        self, places: Sequence[Mapping[FrictionJoint, float]], method: str, step: float
    ) -> None:
        """Refuse curves by how fast they let rates fall, in [1/s], at some places."""
        falls = max(places, key=lambda at: sum(at.values()), default={})
        if sum(falls.values()) > 0.0:
            blamed = max(falls, key=falls.__getitem__)
            check_step(
                f'effects.friction.joints.{blamed.name}.stribeck',
                sum(falls.values()),
                method,
                step,
                'the curve is too steep',
                'write 0: breakaway then acts at rest only',
                EXACT,
            )

    def _find_rubbing_joints(self) -> Iterator[tuple[str, int, JointFriction, int, int, float]]:
        """Yield joints with friction: name, number, and its rate as factor·(v[one] − v[other])."""
        closure: Any = self.closure
        joints = self.friction.joints
        if not isinstance(closure, PlanarClosure):
            places = [*closure.linkage.pair_joints, *closure.linkage.struts]
            for name, friction in joints.items():
                slides = name not in closure.linkage.hinges
                coordinate = closure.joint_coordinates[name]
                yield (
                    name,
                    places.index(name),
                    friction,
                    coordinate,
                    0,
                    closure.scale if slides else 1.0,
                )
            return
        for index, joint in enumerate(closure.structure.joints if joints else ()):
            if joint.name not in joints:
                continue
            first, second = (
                closure.angles[joint.link].coordinate,
                closure.angles[joint.to].coordinate,
            )
            factor = 1.0
            if joint.kind == 'P':
                slide = closure.slides[joint.name]
                first, second, factor = slide.coordinate, 0, slide.sign * closure.scale
            yield joint.name, index, joints[joint.name], first, second, factor

    def _find_friction_joints(self) -> Iterator[FrictionJoint]:
        for name, index, friction, first, second, factor in self._find_rubbing_joints():
            law = None
            if friction.breakaway_excess and friction.stribeck:
                from linkage_ros.dynamics.laws import Stribeck  # local import: only with it

                law = Stribeck(friction.breakaway_excess, friction.stribeck)
            yield FrictionJoint(name, index, friction, first, second, factor, law)


def solve_positive(rows: Sequence[Sequence[float]], right: Sequence[float]) -> list[float] | None:
    """
    Return x of M·x = right; None if M is not positive.

    M is symmetric, given by the rows of its lower triangle, and is taken apart into L·D·Lᵀ
    (Cholesky without roots: G. H. Golub, C. F. Van Loan, Matrix Computations, ch. 4).
    """
    lower: list[list[float]] = []
    pivots: list[float] = []
    x = [*right]
    for i, row in enumerate(rows):
        scaled = [*row]  # L·D of the row, then L
        for j in range(i):
            for k in range(j):
                scaled[j] = scaled[j] - scaled[k] * lower[j][k]
        pivot = row[i]
        for j in range(i):
            factor = scaled[j] / pivots[j]
            pivot, x[i] = pivot - factor * scaled[j], x[i] - factor * x[j]
            scaled[j] = factor
        if not pivot > 0.0:
            return None
        lower.append(scaled)
        pivots.append(pivot)
    for i in range(len(x) - 1, -1, -1):
        x[i] = x[i] / pivots[i]
        for k in range(i + 1, len(x)):
            x[i] = x[i] - lower[k][i] * x[k]
    return x


def _unit_rates(count: int, number: int) -> list[float]:
    """Return the rates of inputs of which one has a rate of 1."""
    return [float(i == number) for i in range(count)]


def _bodies_of(closure: Any, loads: Loads) -> BodyModel:
    """Return the bodies of a linkage in plane or space."""
    if isinstance(closure, PlanarClosure):
        return planar_bodies(closure, loads)
    from linkage_ros.dynamics.spatial_bodies import spatial_bodies  # local import: in space only

    return spatial_bodies(closure, loads)


def _find_stopped(closure: PlanarClosure, loads: Loads) -> dict[str, Limits]:
    """Return the limits of joints with hard stops that are not inputs, of several inputs."""
    inputs = [driven.joint for driven in closure.linkage.inputs]
    yielding = (*inputs, *loads.applied.stops)
    limits = closure.linkage.limits.items() if len(inputs) > 1 else ()
    return {name: bounds for name, bounds in limits if bounds.is_bounded and name not in yielding}


def _make_applied(closure: PlanarClosure, loads: Loads) -> AppliedForces | None:
    """Return the loads on joints and points, or None without importing their model."""
    if not loads.applied:
        return None
    from linkage_ros.dynamics.applied import AppliedForces  # local import: only with such loads

    return AppliedForces(closure, loads.applied)


def joint_friction(joint: FrictionJoint, v: list[float]) -> float:
    """
    Return the friction of a joint against its motion, in [N·m] or [N], with the rate's sign.

    Coulomb friction is 0 in a joint at rest, within rounding.
    """
    slip, coulomb = joint.slip_rate(v), joint.friction.coulomb
    stands = _is_at_rest(v, joint.one, joint.other)
    dry = where(stands, 0.0, copysign(coulomb, slip)) if coulomb else 0.0
    if joint.law:
        dry -= where(stands, 0.0, call(joint.law.force_at, slip)[0])
    return joint.friction.viscous * slip + dry


def slip_direction(joint: FrictionJoint, v: list[float]) -> float:
    """Return the direction of a joint's rate: 1, -1, or 0 at rest, within rounding."""
    return where(_is_at_rest(v, joint.one, joint.other), 0.0, copysign(1.0, joint.slip_rate(v)))


def _is_at_rest(v: list[float], first: int, second: int) -> bool:
    """Return whether the difference of two rates is 0 within rounding."""
    rates = abs(v[first]) + abs(v[second]) + abs(v[1])
    return abs(v[first] - v[second]) <= _ROUNDING * rates
