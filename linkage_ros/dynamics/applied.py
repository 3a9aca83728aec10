# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Loads that are applied to joints, points and links, and their work over the motion of a linkage.

A joint effort acts on the joint's child, and the opposite on its parent; a force on a slide acts
along its line. By virtual work, a load f adds f·λ to the force on an input, with the lever λ: the
rate of its joint, or the velocity of its point along its direction, at a rate of the input of 1.
A wrench is several such loads: the components of a force on a point, and of a torque, whose lever
is the rate of its link.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import chain, pairwise
from math import hypot, sqrt, tau
from typing import Any, NamedTuple, Protocol, TYPE_CHECKING

from linkage_ros.dynamics.bodies import PLANE, Vectors
from linkage_ros.dynamics.integrators import check_step, EXACT
from linkage_ros.dynamics.joint_forms import LinkTurn
from linkage_ros.dynamics.laws import Contact, Law, LawTerm, TorqueTable
from linkage_ros.dynamics.loads import (
    AppliedLoads,
    check_vector,
    JointLoad,
    JointSpring,
    PointLoad,
    SoftStop,
)
from linkage_ros.errors import DefinitionError, did_you_mean, list_names, quote
from linkage_ros.kinematics import (
    Acceleration,
    call,
    GROUND,
    PlanarClosure,
    Position,
    remainder,
    RevoluteJoint,
    unit_vector,
    Velocity,
)

if TYPE_CHECKING:
    from linkage_ros.dynamics.wrenches import Component, HeldWrench

_SAMPLES = 90
"""Intervals of the range over which the stiffest place is looked for."""


class JointCoordinate(NamedTuple):
    """A joint, driven or published."""

    name: str
    # Its number among the driven joints, or among the published ones.
    number: int
    driven: bool
    is_revolute: bool  # Whether it is an angle
    # Its rate is factor·(v[one] − v[other]) of the closure's coordinates.
    one: int
    other: int
    factor: float

    def value(self, position: Position) -> float:
        """Return its value, in [rad] or [m]; of a driven joint with all its turns."""
        return (position.inputs if self.driven else position.joints)[self.number]

    def lever(
        self, velocity: Velocity | Acceleration, _position: Position, _moved: Sequence[Any]
    ) -> float:
        """Return its rate, in [rad/s] or [m/s]; or what of its acceleration rates do not give."""
        v = velocity.state.coordinates
        return self.factor * (v[self.one] - v[self.other])

    def reference_angle(self, low: float, high: float) -> float | None:
        """Return the angle nearest to which it is compared, if whole turns do not count."""
        return 0.5 * (low + high) if self.is_revolute and high - low <= tau + 1e-9 else None


def joint_coordinate(closure: PlanarClosure, name: str) -> JointCoordinate:
    """Return a driven or published joint of a linkage by its name."""
    linkage = closure.linkage
    for index, driven in enumerate(linkage.inputs):
        if driven.joint == name:
            unit = closure.scale if driven.slider else 1.0
            return JointCoordinate(name, index, True, not driven.slider, 1 + index, 0, unit)
    joint, place = linkage.joints[name], list(linkage.joints).index(name)
    turns = isinstance(joint, RevoluteJoint)
    return JointCoordinate(name, place, False, turns, *closure.rate_term(place))


class LoadedPoint(NamedTuple):
    """A point of a link under a force."""

    # Its link, and its number among the loaded points.
    link: str
    number: int
    tracked_index: int  # Its index among the tracked points
    direction: Callable[[Position], Any]  # Of the force, a unit vector in the frame of the ground
    dot: Callable[[Any, Any], float]  # The scalar product

    def lever(self, _velocity: Velocity, position: Position, moved: Sequence[Any]) -> float:
        """Return the velocity of the point along the direction, in [m/s]."""
        return self.dot(moved[self.tracked_index], self.direction(position))


class LoadedParts(Protocol):
    """What loads act on, by kind of linkage: `PlanarParts` or `SpatialParts`."""

    vectors: Vectors
    wrench_numbers: tuple[int, ...]
    """Which of the six numbers of a wrench move the linkage: first those of the force."""

    def place(self, link: str, point: str) -> Any:
        """Return the place of a point for `point_tracker`; of the link's frame for ''."""

    def direction(self, link: str, vector: Any, frame: str) -> Callable[[Position], Any]:
        """Return a vector that stays in the frame 'ground', or turns with the 'link'."""

    def axes(self, link: str, frame: str) -> list[Callable[[Position], Any]]:
        """Return the axes of a frame."""

    def turns(self, link: str, frame: str) -> Sequence[Loaded]:
        """Return the turn of a link about each axis that it may have."""


class PlanarParts:
    """What loads act on in the plane."""

    vectors = PLANE
    wrench_numbers: tuple[int, ...] = (0, 1, 5)

    def __init__(self, closure: PlanarClosure) -> None:
        self._closure = closure

    def place(self, link: str, point: str) -> complex:
        return complex(*self._closure.linkage.links[link][point]) if point else 0j

    def direction(self, link: str, vector: complex, frame: str) -> Callable[[Position], complex]:
        if frame == 'ground':
            return lambda _: vector
        angle = self._closure.angles[link]
        turned, coordinate = vector * angle.unit, angle.coordinate
        return lambda position: unit_vector(position.state.coordinates[coordinate]) * turned

    def axes(self, link: str, frame: str) -> list[Callable[[Position], complex]]:
        return [self.direction(link, axis, frame) for axis in (1 + 0j, 1j)]

    def turns(self, link: str, _frame: str) -> Sequence[Loaded]:
        coordinate = self._closure.angles[link].coordinate
        return [LinkTurn(link, lambda velocity, _: velocity.state.coordinates[coordinate], 0)]


def _parts_of(closure: Any, applied: AppliedLoads) -> LoadedParts:
    if isinstance(closure, PlanarClosure):
        return PlanarParts(closure)
    from linkage_ros.dynamics.spatial_bodies import SpatialParts  # local import: in space only

    return SpatialParts(closure, applied)


class Loaded(Protocol):
    """What a load acts on: a joint, a point, or a turn of a link."""

    def lever(self, velocity: Velocity, position: Position, moved: Sequence[Any], /) -> float:
        """Return its rate along the load; ``moved`` are the velocities of the loaded points."""


class _Lawful(NamedTuple):
    applied_to: Loaded
    depends_on: JointCoordinate
    law: Law


class AppliedForces:
    """
    The loads of a linkage on joints and points.

    A wrong table, stop, direction or point raises DefinitionError with the key
    ``loads.KIND.NAME``.
    """

    def __init__(self, closure: PlanarClosure, applied: AppliedLoads) -> None:
        linkage = closure.linkage
        self._closure, self._given = closure, applied
        self.begin = -1  # Time of the first pose, in [ns]; negative before it
        _check_loads(closure, applied)
        parts = _parts_of(closure, applied)
        places = [name.rpartition('.') for name in applied.forces]
        # The loaded points, as `point_tracker` takes them.
        self.points = [(link, parts.place(link, name)) for link, _, name in places]
        for link, wrench in applied.wrenches.items():
            self.points.append((link, parts.place(link, wrench.point)))
        self._tracker = closure.point_tracker(self.points)
        self._springs = tuple(
            (joint_coordinate(closure, name), spring)
            for name, spring in applied.joint_springs.items()
        )
        self._constant: list[tuple[Loaded, float]] = []
        self._lawful: list[_Lawful] = []
        laws: list[Law] = []

        def add_law(at: Loaded, of: JointCoordinate, law: Law) -> None:
            laws.append(law)
            self._lawful.append(_Lawful(at, of, law))

        self._stops: dict[str, tuple[JointCoordinate, Contact]] = {}
        for name, stop in applied.stops.items():
            joint = joint_coordinate(closure, name)
            limits = linkage.limits[name]
            middle = None if joint.driven else joint.reference_angle(limits.low, limits.high)
            contact = Contact(limits.low, limits.high, stop.stiffness, stop.damping, middle)
            self._stops[name] = joint, contact
            add_law(joint, joint, contact)
        loaded: list[tuple[Loaded, JointCoordinate, JointLoad | PointLoad]]
        loaded = []
        for name, effort in applied.efforts.items():
            joint = joint_coordinate(closure, name)
            loaded.append((joint, joint, effort))
        first = joint_coordinate(closure, linkage.inputs[0].joint)
        # Behind them follow the points of the wrenches.
        pairs = zip(places, applied.forces.values(), self._tracker.indices, strict=False)
        for count, ((link, _, _), force, index) in enumerate(pairs):
            unit = parts.vectors.from_numbers(
                [part / hypot(*force.direction) for part in force.direction]
            )
            way = parts.direction(link, unit, force.frame)
            at = LoadedPoint(link, count, index, way, parts.vectors.dot)
            loaded.append((at, first, force))
        for part, of, load in loaded:
            if load.constant:
                self._constant.append((part, load.constant))
            for over in ('time', 'position', 'rate'):
                table = getattr(load, f'over_{over}')
                if table:
                    middle = (
                        of.reference_angle(table[0][0], table[-1][0])
                        if over == 'position'
                        else None
                    )
                    add_law(part, of, TorqueTable(over, table, middle))
        self.wrenches: dict[str, HeldWrench] = {}
        self._components: list[tuple[Loaded, Component]] = []
        if applied.wrenches:
            self._hold_wrenches(applied, len(places), parts)
        self.laws = (*laws, *(component for _, component in self._components))

    def _hold_wrenches(self, applied: AppliedLoads, count: int, parts: LoadedParts) -> None:
        """Let a wrench act on each link that has one; ``count`` points precede theirs."""
        from linkage_ros.dynamics.wrenches import Component, HeldWrench  # local import: few scenes

        for number, (link, wrench) in enumerate(applied.wrenches.items(), count):
            self.wrenches[link] = held = HeldWrench(wrench.max_age, parts.wrench_numbers)
            place, dot = self._tracker.indices[number], parts.vectors.dot
            along: list[Loaded] = [
                LoadedPoint(link, number, place, axis, dot)
                for axis in parts.axes(link, wrench.frame)
            ]
            along += parts.turns(link, wrench.frame)
            for component, at in enumerate(along):
                self._components.append((at, Component(held, component)))

    def check_step(
        self,
        inertia: Callable[[float], float],
        between: tuple[float, float],
        method: str,
        step: float,
    ) -> None:
        """
        Refuse a spring or a stop that is too stiff for a step of the integration, in [s].

        ``inertia`` is the inertia of the equation of motion as a function of the only input, 0
        where there is none; ``between`` is the range of the input, in [rad] or [m]. The error has
        the key of the stiffest load; its remedy is the longest step that carries it.
        """
        yielding = self._yielding
        worst, blamed = 0.0, ''
        for inert, touched in self._sample_range(inertia, between):
            stiffness = sum(yielding[key].stiffness * lever**2 for key, lever in touched.items())
            damping = sum(yielding[key].damping * lever**2 for key, lever in touched.items())
            fastest = _fastest_eigenvalue(stiffness / inert, damping / inert)
            if fastest > worst:
                worst = fastest
                blamed = max(touched, key=lambda key: yielding[key].stiffness * touched[key] ** 2)
        _check_stiffness(blamed, worst, method, step)

    def check_step_at(
        self,
        values: Sequence[float],
        mobility: Sequence[Sequence[float]],
        method: str,
        step: float,
    ) -> None:
        """
        Refuse as `check_step` does, at one state of a linkage with several inputs.

        ``mobility`` is the inverse of the matrix of inertia at these ``values`` of the inputs.
        """
        import numpy as np  # local import: only with several inputs

        closure, count = self._closure, len(values)
        position = closure.close_unlimited(*values)
        alone = [
            closure.velocity(position, *(float(i == j) for j in range(count)))
            for i in range(count)
        ]
        moved_by = np.array(mobility)
        stiffness, damping = np.zeros((count, count)), np.zeros((count, count))
        worst, blamed = 0.0, ''
        joints = [joint for joint, _ in self._springs] + [j for j, _ in self._stops.values()]
        for (key, spring), joint in zip(self._yielding.items(), joints, strict=True):
            levers = np.array([joint.lever(way, position, ()) for way in alone])
            stiffness += spring.stiffness * np.outer(levers, levers)
            damping += spring.damping * np.outer(levers, levers)
            own = spring.stiffness * float(levers @ moved_by @ levers)
            if own > worst:
                worst, blamed = own, key
        fastest = [
            float(np.linalg.eigvals(moved_by @ of).real.max()) for of in (stiffness, damping)
        ]
        _check_stiffness(blamed, _fastest_eigenvalue(*fastest), method, step)

    @property
    def _yielding(self) -> dict[str, JointSpring | SoftStop]:
        """Return the springs and stops of joints by their keys."""
        springs, stops = self._given.joint_springs, self._given.stops
        return {
            **{f'joint_springs.{name}': spring for name, spring in springs.items()},
            **{f'stops.{name}': stop for name, stop in stops.items()},
        }

    def _sample_range(
        self, inertia: Callable[[float], float], between: tuple[float, float]
    ) -> Iterator[tuple[float, dict[str, float]]]:
        """Yield inertia, and the lever of each spring and of each touched stop, over the range."""
        low, high = between
        before: dict[str, float] = {}
        for index in range(_SAMPLES + 1):
            value = low + (high - low) * index / _SAMPLES
            inert, position = inertia(value), self._closure.position(value)
            if not (inert > 0.0 and position.status.has_rates):
                continue
            velocity = self._closure.velocity(position, 1.0)
            levers, depths = {}, {}
            for name, (joint, _) in zip(self._given.joint_springs, self._springs, strict=True):
                levers[f'joint_springs.{name}'] = joint.lever(velocity, position, ())
            for name, (joint, contact) in self._stops.items():
                at = joint.value(position)
                depths[name] = max(contact.depth(side, at) for side in (-1, 1))
                if max(depths[name], before.get(name, 0.0)) > 0.0:
                    levers[f'stops.{name}'] = joint.lever(velocity, position, ())
            before = depths
            yield inert, levers

    def one_input(
        self, position: Position, velocity: Velocity
    ) -> tuple[float, float, tuple[LawTerm, ...]]:
        """
        Return what the loads add to the equation of motion of a linkage with one input.

        The position is closed, and the velocity has a rate of 1. The result is slope, viscous and
        a term for each law: without the laws, the force on the input is −slope − viscous·q̇.
        """
        moved = self._point_velocities(position, velocity)
        slope = viscous = 0.0
        for joint, spring in self._springs:
            lever = joint.lever(velocity, position, moved)
            slope += spring.stiffness * _spring_stretch(joint, spring, position) * lever
            viscous += spring.damping * lever * lever
        for at, force in self._constant:
            slope -= force * at.lever(velocity, position, moved)
        terms: tuple[LawTerm, ...] = ()
        for at, of, _ in self._lawful:
            lever, factor = (of.lever(velocity, position, moved) for of in (at, of))
            terms += (LawTerm(lever, of.value(position), factor),)
        for at, _ in self._components:
            terms += (LawTerm(at.lever(velocity, position, moved), 0.0, 0.0),)
        return slope, viscous, terms

    def several_inputs(
        self, position: Position, velocity: Velocity, alone: Sequence[Velocity]
    ) -> tuple[list[float], list[tuple[tuple[float, ...], float, float]]]:
        """
        Return what the loads add to the equation of motion of a linkage with several inputs.

        ``alone`` are the velocities at a rate of 1 of each input. The result is what the loads
        without laws need on each input, and for each law its levers, its value and its rate.
        """
        moved = [self._point_velocities(position, way) for way in alone]

        def levers_of(at: Loaded) -> tuple[float, ...]:
            ways = zip(alone, moved, strict=True)
            return tuple(at.lever(way, position, points) for way, points in ways)

        needed = [0.0] * len(alone)
        for joint, spring in self._springs:
            rate = joint.lever(velocity, position, ())
            pull = spring.stiffness * _spring_stretch(joint, spring, position)
            pull += spring.damping * rate
            needed = [
                effort + pull * lever
                for effort, lever in zip(needed, levers_of(joint), strict=True)
            ]
        for at, force in self._constant:
            needed = [
                effort - force * lever for effort, lever in zip(needed, levers_of(at), strict=True)
            ]
        laws = [
            (levers_of(at), of.value(position), of.lever(velocity, position, ()))
            for at, of, _ in self._lawful
        ]
        laws += [(levers_of(at), 0.0, 0.0) for at, _ in self._components]
        return needed, laws

    def potential_energy(self, position: Position) -> float:
        """Return the energy of the springs at joints, in [J]."""
        energy = 0.0
        for joint, spring in self._springs:
            energy += 0.5 * spring.stiffness * _spring_stretch(joint, spring, position) ** 2
        return energy

    @property
    def given_count(self) -> int:
        """Return how many numbers `given_at` has; 0 if no load is given from outside."""
        timed = self.wrenches or self._given.changes_with_time
        return 1 + len(self._components) if timed else 0

    def given_at(self, now: int) -> tuple[float, ...]:
        """Return what gives the loads at a time, in [ns]; the first call begins their time."""
        if self.begin < 0:
            self.begin = now
        for held in self.wrenches.values():
            held.expire(now)
        return self.given_after((now - self.begin) * 1e-9)

    def given_after(self, seconds: float) -> tuple[float, ...]:
        """Return a time since the first pose, in [s], and the numbers of the wrenches now."""
        return (seconds, *chain.from_iterable(held.wrench for held in self.wrenches.values()))

    def acting_loads(
        self, position: Position, velocity: Velocity, load_values: Sequence[float]
    ) -> Iterator[tuple[Loaded, float]]:
        """
        Yield each load, where it acts and how strong, in [N·m] or [N].

        ``load_values`` begin as `given_after`; empty for the begin, and the wrenches now.
        """
        seconds, *numbers = load_values[: self.given_count] or self.given_after(0.0)
        for joint, spring in self._springs:
            rate = joint.lever(velocity, position, ())
            stretch = _spring_stretch(joint, spring, position)
            yield joint, -spring.stiffness * stretch - spring.damping * rate
        yield from self._constant
        for at, of, law in self._lawful:
            rate = of.lever(velocity, position, ())
            yield at, call(_law_force, law, of.value(position), rate, seconds)[0]
        yield from zip([at for at, _ in self._components], numbers, strict=True)

    def virtual_work(
        self,
        position: Position,
        velocity: Velocity,
        virtual: Velocity,
        load_values: Sequence[float],
    ) -> float:
        """Return the work of the loads over a virtual velocity; arguments as in `acting_loads`."""
        moved, work = self._point_velocities(position, virtual), 0.0
        for at, force in self.acting_loads(position, velocity, load_values):
            work += force * at.lever(virtual, position, moved)
        return work

    def places(self, position: Position) -> list[Any]:
        """Return the places of the loaded points, by `LoadedPoint.tracked_index`."""
        return self._tracker.places(position) if self._tracker.indices else []

    def _point_velocities(self, position: Position, velocity: Velocity) -> list[Any]:
        """Return the velocities of the loaded points."""
        if not self._tracker.indices:
            return []
        return self._tracker.velocities(position, velocity, self._tracker.places(position))


def _law_force(law: Law, value: float, rate: float, seconds: float) -> tuple[float]:
    """Return the force by a law, for `call`."""
    return (law.force(law.segment(value, rate, seconds), value, rate, seconds),)


def _check_stiffness(blamed: str, fastest: float, method: str, step: float) -> None:
    remedy = 'write a smaller stiffness or damping'
    check_step(f'loads.{blamed}', fastest, method, step, 'it is too stiff', remedy, EXACT)


def _fastest_eigenvalue(stiffness: float, damping: float) -> float:
    """Return the greatest |s| of s² + damping·s + stiffness = 0, in [1/s]."""
    half = 0.5 * damping
    if half * half > stiffness:
        return half + sqrt(half * half - stiffness)
    return sqrt(stiffness)


def _spring_stretch(joint: JointCoordinate, spring: JointSpring, position: Position) -> float:
    """Return how far a spring is from where it has no force, in [rad] or [m]."""
    stretch = joint.value(position) - spring.free
    return remainder(stretch, tau) if joint.is_revolute and not joint.driven else stretch


def _check_loads(closure: PlanarClosure, applied: AppliedLoads) -> None:
    """Refuse loads that make no sense."""
    linkage = closure.linkage
    for name in applied.stops:
        limits = linkage.limits.get(name)
        if limits is None or not limits.is_bounded:
            raise DefinitionError(
                f'loads.stops.{name}',
                'the joint has no limits',
                'write limits: [low, high] for it into the linkage file',
            )
    units = {driven.joint: driven.unit for driven in linkage.inputs}
    units |= {name: joint.unit for name, joint in linkage.joints.items()}
    loads: list[tuple[str, JointLoad | PointLoad, str]] = []
    loads += [
        (f'loads.efforts.{name}', load, units[name]) for name, load in applied.efforts.items()
    ]
    for name, force in applied.forces.items():
        key = f'loads.forces.{name}'
        loads.append((key, force, linkage.inputs[0].unit))
        if name.rpartition('.')[0] == GROUND:
            raise DefinitionError(
                key, 'lies on the ground, which a force does not move', 'name another point'
            )
        if not any(force.direction):
            raise DefinitionError(f'{key}.direction', '[0, 0] is not a direction', 'write [1, 0]')
        check_vector(linkage, f'{key}.direction', force.direction)
        if len(linkage.inputs) > 1 and (force.over_position or force.over_rate):
            raise DefinitionError(
                key,
                f'there is a table over the input, and there are {len(linkage.inputs)}',
                'write over_time',
            )
    for link, wrench in applied.wrenches.items():
        points = linkage.links.get(link, ())
        if wrench.point and wrench.point not in points:
            raise DefinitionError(
                f'loads.wrenches.{link}.point',
                f'{quote(wrench.point)} is not a point of {quote(link)}',
                did_you_mean(wrench.point, points, f'name one of {list_names(sorted(points))}'),
            )
    for key, load, unit in loads:
        tables = {'over_time': 's', 'over_position': unit, 'over_rate': f'{unit}/s'}
        if not load.constant and not any(getattr(load, over) for over in tables):
            raise DefinitionError(
                key, 'is a load of 0', f'write constant, or one of {", ".join(tables)}'
            )
        for over, given_in in tables.items():
            _check_table(f'{key}.{over}', getattr(load, over), given_in)


def _check_table(key: str, table: Sequence[tuple[float, float]], unit: str) -> None:
    if len(table) == 1:
        raise DefinitionError(key, 'has one row', 'write two or more, or constant')
    for row, ((before, _), (after, _)) in enumerate(pairwise(table), 2):
        if after <= before:
            raise DefinitionError(
                key,
                f'row {row} begins with {after:g} {unit}, not after {before:g} {unit} of row '
                f'{row - 1}',
                'write rows in which the first number increases',
            )
