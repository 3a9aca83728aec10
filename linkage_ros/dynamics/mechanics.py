# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The equation of motion of a linkage, and the efforts of its drives, by virtual work.

With one input q, each centre of mass moves with r' = dr/dq and each link turns with θ' = dθ/dq,
which are the velocities at q̇ = 1; r'' and θ'' are the accelerations at q̇ = 1 and q̈ = 0. So::

    I(q) = Id + Σ (m·|r'|² + J·θ'²)            ½·dI/dq = Σ (m·r'·r'' + J·θ'·θ'')
    V(q) = −Σ m·g·r + Σ ½·k·(ℓ − ℓ0)²          dV/dq = −Σ m·g·r' + Σ k·(ℓ − ℓ0)·ℓ'
    C(q) = Σ c·ψ'² + Σ c·ℓ'²                   F(q) = Σ T·|ψ'|

    I·q̈ + ½·(dI/dq)·q̇² + dV/dq + C·q̇ + F·sign(q̇) = τ

This is Eksergian's equation of motion (R. Eksergian, Dynamical Analysis of Machines, J. Franklin
Institute, 1930–31; B. Paul, Kinematics and Dynamics of Planar Machinery, 1979, ch. 12; for virtual
work also R. L. Norton, Design of Machinery, ch. 10). Id is the inertia of the drive; ψ the angle
in a pin or the slide in a slider, with the viscous coefficient c and the Coulomb moment or force
T; ℓ the length of a spring.

With several inputs there is one such equation for each: its left side is the work of inertia,
loads and friction over the velocities that this input alone would cause at a rate of 1.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from itertools import chain
from typing import NamedTuple, TYPE_CHECKING

from linkage_ros.dynamics.loads import (
    check_loads,
    check_masses,
    Friction,
    JointFriction,
    Loads,
)
from linkage_ros.dynamics.longest_step import check_step, EXACT
from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics import (
    Acceleration,
    all_finite,
    call,
    Closure,
    copysign,
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


class FrictionJoint(NamedTuple):
    """
    A joint with friction.

    Its rate is factor·(v[one] − v[other]) of the closure's coordinates, in [rad/s] or [m/s];
    ``joint`` is its index among the joints of the structure. ``law`` is the law of the friction
    that falls with the rate, if it has any.
    """

    joint: int
    friction: JointFriction
    one: int
    other: int
    factor: float
    law: Stribeck | None

    def slip_rate(self, v: Sequence[float]) -> float:
        """Return the rate for the rates of the closure's coordinates."""
        return self.factor * (v[self.one] - v[self.other])


class Mechanics:
    """
    A linkage with masses, and the forces that act on it.

    Without loads and friction there are none. A link that moves without a mass, and a load on a
    part that does not exist, raise DefinitionError.
    """

    def __init__(
        self, closure: Closure, loads: Loads | None = None, friction: Friction | None = None
    ) -> None:
        self.closure = closure
        self.loads = loads or Loads()
        self.friction = friction or Friction()
        linkage = closure.linkage
        check_masses(linkage, self.loads)
        check_loads(linkage, self.loads, self.friction)
        if self.friction.holds and len(linkage.inputs) > 1:
            raise DefinitionError(
                'effects.friction.holds',
                f'the linkage has {len(linkage.inputs)} inputs, and friction could hold either',
                'leave it out',
            )
        heavy = {link: linkage.masses[link] for link in linkage.links if link in linkage.masses}
        heavy = {link: body for link, body in heavy.items() if body.mass or body.inertia}
        points = [(link, complex(*body.center)) for link, body in heavy.items()]
        for spring in self.loads.springs:
            for link, name in spring.ends:
                points.append((link, complex(*linkage.links[link][name])))
        self._follower = closure.point_tracker(points)
        at = iter(self._follower.indices)
        self._bodies = tuple(
            (body.mass, body.inertia, next(at), closure.angles[link].coordinate)
            for link, body in heavy.items()
        )
        self._springs = tuple(
            (spring.stiffness, spring.free_length, spring.damping, next(at), next(at))
            for spring in self.loads.springs
        )
        self._gravity = complex(*self.loads.gravity)
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
        sticks = any(rubbing.friction.breakaway_excess for rubbing in self.friction_joints)
        self._has_no_laws = not sticks and self.applied is None
        """Whether the equation has neither laws nor an excess of friction at rest."""
        self._units = tuple(closure.scale if given.slider else 1.0 for given in linkage.inputs)

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
        places = self._follower.places(position)
        velocities = self._follower.velocities(position, velocity, places)
        accelerations = self._follower.accelerations(position, velocity, acceleration, places)
        v, a = velocity.state.coordinates, acceleration.state.coordinates
        inertia, half_slope, momentum = self.loads.drive_inertia, 0.0, 0j
        for mass, gyration, point, turn in self._bodies:
            speed, pull, spin = velocities[point], accelerations[point], v[turn]
            moved = mass * speed
            momentum += moved
            inertia += moved.real * speed.real + moved.imag * speed.imag + gyration * spin * spin
            half_slope += moved.real * pull.real + moved.imag * pull.imag
            half_slope += gyration * spin * a[turn]
        gravity = self._gravity
        slope = -(gravity.real * momentum.real + gravity.imag * momentum.imag)
        viscous = coulomb = 0.0
        slips: tuple[float, ...] = ()
        for stiffness, free_length, damping, start, end in self._springs:
            length, growth = spring_length(places, velocities, start, end)
            slope += stiffness * (length - free_length) * growth
            viscous += damping * growth * growth
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
        places = self._follower.places(position)
        moment = 0j
        for mass, _, point, _ in self._bodies:
            moment += mass * places[point]
        energy = -(self._gravity.real * moment.real + self._gravity.imag * moment.imag)
        for stiffness, free_length, _, start, end in self._springs:
            stretch = abs(places[end] - places[start]) - free_length
            energy += 0.5 * stiffness * stretch * stretch
        return energy if self.applied is None else energy + self.applied.potential_energy(position)

    def kinetic_energy(self, position: Position, velocity: Velocity) -> float:
        """Return the kinetic energy, with the drive's inertia, in [J]."""
        places = self._follower.places(position)
        velocities = self._follower.velocities(position, velocity, places)
        v = velocity.state.coordinates
        twice = 0.0
        for mass, gyration, point, turn in self._bodies:
            speed = velocities[point]
            twice += mass * (speed.real * speed.real + speed.imag * speed.imag)
            twice += gyration * v[turn] * v[turn]
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
        given: Sequence[float] = (),
    ) -> tuple[float, ...]:
        """
        Return the effort of each drive for a motion, against inertia, loads and friction.

        Each is a moment in [N·m], or a force in [N] if the input slides, positive if it drives the
        input forward; Coulomb friction is 0 in a joint at rest. The position is closed and not a
        toggle. ``given`` is as in `linkage_ros.dynamics.applied.AppliedForces.given_after`.
        """
        follower, count = self._follower, len(self._units)
        places = follower.places(position)
        velocities = follower.velocities(position, velocity, places)
        accelerations = follower.accelerations(position, velocity, acceleration, places)
        v, a = velocity.state.coordinates, acceleration.state.coordinates
        pulls = [
            spring.tension(*spring_length(places, velocities, start, end))
            for spring, (_, _, _, start, end) in zip(
                self.loads.springs, self._springs, strict=True
            )
        ]
        drags = [joint_friction(rubbing, v) for rubbing in self.friction_joints]
        efforts: tuple[float, ...] = ()
        for i, unit in enumerate(self._units):
            alone = [0.0] * count
            alone[i] = 1.0
            virtual = self.closure.velocity(position, *alone)
            w = virtual.state.coordinates
            moved = follower.velocities(position, virtual, places)
            effort = self.loads.drive_inertia * a[1 + i] * unit
            for mass, gyration, point, turn in self._bodies:
                force, way = mass * (accelerations[point] - self._gravity), moved[point]
                effort += force.real * way.real + force.imag * way.imag
                effort += gyration * a[turn] * w[turn]
            for pull, (_, _, _, start, end) in zip(pulls, self._springs, strict=True):
                effort += pull * spring_length(places, moved, start, end)[1]
            for drag, rubbing in zip(drags, self.friction_joints, strict=True):
                effort += drag * rubbing.slip_rate(w)
            if self.applied is not None:
                effort -= self.applied.virtual_work(position, velocity, virtual, given)
            if self.friction.holds:
                held = sum(
                    (rubbing.friction.coulomb + rubbing.friction.breakaway_excess)
                    * abs(rubbing.slip_rate(w))
                    for rubbing in self.friction_joints
                )
                rest = copysign(where(abs(effort) > held, abs(effort) - held, 0.0), effort)
                effort = where(abs(v[1]) <= 0.0, rest, effort)
            efforts += (effort,)
        return efforts

    def check_curves(self, places: Sequence[Terms], method: str, step: float) -> None:
        """
        Refuse friction that falls with the rate faster than a step follows, in [s].

        ``places`` are the equation of motion at places of the range. The error has the key of the
        steepest curve; its remedy is the longest step that follows it.
        """
        worst, blamed = 0.0, None
        for terms in places:
            first = len(terms.laws) - len(self.stribeck_joints)
            pairs = zip(self.stribeck_joints, terms.laws[first:], strict=True)
            falls = {
                r: r.law.steepest_slope * at.factor**2 / terms.inertia for r, at in pairs if r.law
            }
            if sum(falls.values()) > worst:
                worst, blamed = sum(falls.values()), max(falls, key=falls.__getitem__)
        if blamed is not None:
            joint = self.closure.structure.joints[blamed.joint].name
            check_step(
                f'effects.friction.joints.{joint}.stribeck',
                worst,
                method,
                step,
                'the curve is too steep',
                'write 0: breakaway then acts at rest only',
                EXACT,
            )

    def _find_friction_joints(self) -> Iterator[FrictionJoint]:
        closure = self.closure
        for index, joint in enumerate(closure.structure.joints):
            friction = self.friction.joints.get(joint.name)
            if friction is None:
                continue
            one, other = closure.angles[joint.link].coordinate, closure.angles[joint.to].coordinate
            factor = 1.0
            if joint.kind == 'P':
                slide = closure.slides[joint.name]
                one, other, factor = slide.coordinate, 0, slide.sign * closure.scale
            law = None
            if friction.breakaway_excess and friction.stribeck:
                from linkage_ros.dynamics.laws import Stribeck  # local import: only with it

                law = Stribeck(friction.breakaway_excess, friction.stribeck)
            yield FrictionJoint(index, friction, one, other, factor, law)


def _make_applied(closure: Closure, loads: Loads) -> AppliedForces | None:
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


def _is_at_rest(v: list[float], one: int, other: int) -> bool:
    """Return whether the difference of two rates is 0 within rounding."""
    rates = abs(v[one]) + abs(v[other]) + abs(v[1])
    return abs(v[one] - v[other]) <= _ROUNDING * rates


def spring_length(
    places: list[complex], velocities: list[complex], start: int, end: int
) -> tuple[float, float]:
    """Return the length of a spring and its rate; both 0 if its ends coincide."""
    along, apart = places[end] - places[start], velocities[end] - velocities[start]
    length = abs(along)
    if not length:
        return 0.0, 0.0
    return length, (along.real * apart.real + along.imag * apart.imag) / length
