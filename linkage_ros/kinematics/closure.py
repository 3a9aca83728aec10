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
The loop closure of a linkage: from its inputs to its joints, and to every point of its links.

Position first; what a scene calls for beyond it starts from the position and repeats nothing.
"""

from __future__ import annotations

from cmath import rect
from collections.abc import Sequence
from functools import cached_property
from typing import Any, ClassVar, NamedTuple, TYPE_CHECKING

from linkage_ros.errors import quoted
from linkage_ros.kinematics.arithmetic import all_finite
from linkage_ros.kinematics.checks import check
from linkage_ros.kinematics.cylinder import without_mirrored, zero_length
from linkage_ros.kinematics.groups import find_groups
from linkage_ros.kinematics.limits import Bounds, limited
from linkage_ros.kinematics.linkage import Linkage, RevoluteJoint, SlideJoint
from linkage_ros.kinematics.machine_ranges import input_ranges
from linkage_ros.kinematics.nearness import (
    Nearness,
    nearness,
    singular_inputs,
    SingularInput,
)
from linkage_ros.kinematics.ranges import closing_ranges, InputRange
from linkage_ros.kinematics.solution import Planner
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import Pose, State
from linkage_ros.kinematics.structure import Structure

if TYPE_CHECKING:
    from linkage_ros.kinematics.batch import Batch
    from linkage_ros.kinematics.compiled.linkage import Compiled
    from linkage_ros.kinematics.compiled.solve import Solver
    from linkage_ros.kinematics.compiled.trace import Wanted
    from linkage_ros.kinematics.follower import Follower
    from numpy.typing import ArrayLike


class Position(NamedTuple):
    """
    The linkage at one state of its inputs.

    Attributes
    ----------
    status
        Whether every loop closes.
    gap
        What links miss each other by where one does not, else 0, in [m].
    joints
        Values of the published joints, in the order of the linkage, in [rad] or [m]; empty where a
        loop is open or indeterminate.
    state
        What the steps have found.
    poses
        The steps' own poses; the last one is that of the step that failed, if one did.

    """

    status: Status
    gap: float
    joints: tuple[float, ...]
    state: State
    poses: list[Pose]


class Velocity(NamedTuple):
    """
    The rates of a linkage.

    Attributes
    ----------
    joints
        Of the published joints, in [rad/s] or [m/s].
    state, rates
        What the steps have found.

    """

    joints: tuple[float, ...]
    state: State
    rates: list[Any]


class Acceleration(NamedTuple):
    """
    The accelerations of a linkage.

    Attributes
    ----------
    joints
        Of the published joints, in [rad/s²] or [m/s²].
    state
        What the steps have found.

    """

    joints: tuple[float, ...]
    state: State


def _no_motion(what: str, given: tuple[float, ...], status: Status) -> ValueError:
    if not status.has_rates:
        return ValueError(f'{what}: a linkage that is {status.value} has none; ask its status')
    return ValueError(f'{what}: {list(given)} is not finite')


class PointMotion(NamedTuple):
    """Place, velocity and acceleration of a point in the frame of the ground, in [m]."""

    place: complex
    velocity: complex
    acceleration: complex


class Closure:
    """
    A linkage, ready to be solved.

    Parameters
    ----------
    linkage
        What to solve.

    Raises
    ------
    DefinitionError
        Where the parts do not make a linkage that the inputs move, or that closes nowhere.

    """

    by_steps: ClassVar[bool] = True
    """Whether its steps close it, which can be compiled; other solvers have a way of their own."""

    def __init__(self, linkage: Linkage) -> None:
        check(linkage)
        self.linkage = linkage
        self.structure: Structure = find_groups(linkage)
        planner = Planner(linkage, self.structure)
        self.scale = planner.scale
        """Metres in the unit of length of the steps."""
        steps = tuple(planner.steps)
        self._known = planner
        self.step_groups = tuple(planner.step_groups)
        """For each step the number of the group that it belongs to."""
        self.turning = tuple(isinstance(j, RevoluteJoint) for j in linkage.joints.values())
        """For each published joint: whether it turns (an angle) or slides (a length)."""
        self.angles, self.slides = planner.angles, planner.slides
        self.turns_with = planner.turns_with
        """For each coordinate that is a sum of inputs, how often each input is in it."""
        self._terms = tuple(self._term(joint) for joint in linkage.joints.values())
        self._rate_terms = tuple((i, j, factor) for i, j, factor, _ in self._terms)
        self._point_index = {
            (link, name): planner.place(link, point)
            for link, points in planner.points.items()
            for name, point in points.items()
        }
        self.steps = steps
        needed = len(steps)
        self._more_steps = tuple(planner.steps[needed:])
        self._driven = len(linkage.inputs)
        factors = [1.0 / self.scale if given.slider else 1.0 for given in linkage.inputs]
        self._factors = None if set(factors) == {1.0} else factors
        self.bounds = Bounds(linkage)
        """The limits between which its joints stay."""
        self._keep_limits()
        self._compiled: list[Compiled] = []

    def _keep_limits(self) -> None:
        """Let positions tell of limits; where there are none, nothing is asked at any."""
        vars(self).pop('position', None)
        if self.bounds:
            self.position = limited(self.position, self.bounds)  # type: ignore[method-assign]

    def position(self, *inputs: float) -> Position:
        """
        Close the loops.

        Parameters
        ----------
        *inputs
            Values of the driven joints, in [rad] or [m]. Where one is not finite, the linkage is
            indeterminate.

        Raises
        ------
        ValueError
            Where there is not one input for each driven joint.
        TypeError
            Where an input is no number.

        """
        x = self._coordinates('inputs', inputs)
        if x is None:
            return Position(Status.INDETERMINATE, 0.0, (), State([0.0, *inputs], []), [])
        state = State(x, [])
        poses: list[Pose] = []
        status = Status.CLOSED
        for step in self.steps:
            pose = step.close(state)
            poses.append(pose)
            found = pose.status
            if found is not Status.CLOSED:
                if not found.has_pose:
                    return Position(found, pose.gap * self.scale, (), state, poses)
                if status.has_rates:
                    status = found
        joints: tuple[float, ...] = ()
        for i, j, factor, constant in self._terms:
            joints += (factor * (x[i] - x[j]) + constant,)
        return Position(status, 0.0, joints, state, poses)

    def known(self, *inputs: float) -> State:
        """Return what is known before the first step: the ground's coordinate and the inputs'."""
        return State(self._coordinates('inputs', inputs) or [], [])

    def posed(self, *inputs: float) -> Position:
        """Close the loops as `position` does, whatever the limits."""
        return type(self).position(self, *inputs)

    def velocity(self, position: Position, *rates: float) -> Velocity:
        """
        Return the rates at a position whose status has rates.

        Parameters
        ----------
        position
            As this closure has found it.
        *rates
            Of the driven joints, in [rad/s] or [m/s].

        Raises
        ------
        ValueError
            Where the position has no rates, as at a toggle, a rate is not finite, or there is not
            one for each driven joint.
        TypeError
            Where a rate is no number.

        """
        v = self._coordinates('rates', rates)
        if v is None or not position.status.has_rates:
            raise _no_motion('rates', rates, position.status)
        speeds = State(v, [])
        found = []
        for step, pose in zip(self.steps, position.poses, strict=True):
            found.append(step.rates(pose, position.state, speeds))
        return Velocity(self._joints(v), speeds, found)

    def acceleration(
        self, position: Position, velocity: Velocity, *accelerations: float
    ) -> Acceleration:
        """
        Return the accelerations at a closed position.

        Parameters
        ----------
        position, velocity
            As this closure has found them.
        *accelerations
            Of the driven joints, in [rad/s²] or [m/s²].

        Raises
        ------
        ValueError, TypeError
            As `velocity` raises them.

        """
        a = self._coordinates('accelerations', accelerations)
        if a is None:
            raise _no_motion('accelerations', accelerations, position.status)
        changes = State(a, [])
        for step, pose, rate in zip(self.steps, position.poses, velocity.rates, strict=True):
            step.accelerations(pose, rate, position.state, velocity.state, changes)
        return Acceleration(self._joints(a), changes)

    def compiled(self, derivatives: int, wanted: Wanted | None = None) -> Compiled:
        """
        Return the linkage compiled; for the same numbers it is compiled once.

        Parameters
        ----------
        derivatives
            Positions (0), velocities too (1), and accelerations (2).
        wanted
            Which numbers of these; all published joints if not given.

        """
        from linkage_ros.kinematics.compiled import linkage, trace  # local import: they trace

        wanted = wanted or trace.joints
        for compiled in self._compiled:
            if (compiled.derivatives, compiled.wanted) == (derivatives, wanted):
                return compiled
        self._compiled.append(linkage.Compiled(self, derivatives, wanted))
        return self._compiled[-1]

    def solve(
        self,
        *inputs: ArrayLike,
        rates: Any = None,
        accelerations: Any = None,
        derivatives: int = 2,
        out: Batch | None = None,
    ) -> Batch:
        """
        Solve many states at once, as `position`, `velocity` and `acceleration` solve one.

        Memory does not grow with the states beyond the results. Links that only iteration solves
        are iterated state by state, no faster than one at a time.

        Parameters
        ----------
        *inputs
            For each driven joint an array of its values, in [rad] or [m]. A state with one that is
            not finite is indeterminate.
        rates, accelerations
            Of the driven joints: for each a number, or an array of as many as there are states; of
            a single one without a list. They are 1 if not given, for a single one, and 0.
        derivatives
            What is worked out: positions (0), velocities too (1), and accelerations (2).
        out
            Where the results go, and what is returned, if given: arrays of the right shape.

        Raises
        ------
        ValueError
            Where the arrays do not fit each other, the linkage or ``out``.

        """
        return self._solver.solve(inputs, rates, accelerations, derivatives, out)

    @cached_property
    def _solver(self) -> Solver:
        from linkage_ros.kinematics.compiled.solve import Solver  # local import: needs numpy

        return Solver(self, len(self.linkage.joints))

    def points(self, position: Position) -> dict[tuple[str, str], complex]:
        """Return every point of every link, by link and name, in the ground's frame, in [m]."""
        places = self._all(position).pins
        return {key: places[i] * self.scale for key, i in self._point_index.items()}

    def point_motion(
        self, position: Position, velocity: Velocity, acceleration: Acceleration
    ) -> dict[tuple[str, str], PointMotion]:
        """Return place, velocity and acceleration of every point of every link."""
        state = self._all(position)
        speeds = State(velocity.state.coordinates, list(velocity.state.pins))
        changes = State(acceleration.state.coordinates, list(acceleration.state.pins))
        for step in self._more_steps:
            rates = step.rates((), state, speeds)
            step.accelerations((), rates, state, speeds, changes)
        return {
            key: PointMotion(*(values.pins[i] * self.scale for values in (state, speeds, changes)))
            for key, i in self._point_index.items()
        }

    def follower(self, points: Sequence[tuple[str, complex]]) -> Follower:
        """
        Return what follows certain points of links and computes no others.

        Parameters
        ----------
        points
            Each with the name of its link, and where it lies in that link's frame, in [m].

        """
        from linkage_ros.kinematics.follower import Follower  # local import: only forces need it

        return Follower(self._known, points)

    def link_angles(self, position: Position) -> dict[str, float]:
        """Return the angle of every link to the ground, in [rad], not wrapped."""
        x = position.state.coordinates
        return {link: x[angle.coordinate] + angle.constant for link, angle in self.angles.items()}

    def slide_values(self, position: Position) -> dict[str, float]:
        """Return the slide of every slider, in [m]."""
        x = position.state.coordinates
        return {
            name: self.scale * (slide.sign * x[slide.coordinate] + slide.constant)
            for name, slide in self.slides.items()
        }

    def beyond(self, position: Position) -> str:
        """Return of a pose which joint is beyond its limits, in words; '' where none is."""
        factors = self._factors or [1.0] * len(self.linkage.inputs)
        driven = zip(position.state.coordinates[1:], factors, strict=False)
        inputs = [value / factor for value, factor in driven]
        joints = position.joints or self.position(*inputs).joints
        bound = self.bounds.exceeded(inputs, joints) if joints else None
        if bound is None:
            return ''
        driven_one = bound in self.bounds.inputs
        value = bound.turned((inputs if driven_one else joints)[bound.number])
        return f'{bound.name} at {value:.6g}, limits {self.linkage.limits[bound.name]}'

    def residual(self, position: Position) -> float:
        """
        Return what is left open by a closed position, in [m].

        Every link is walked from where it is held, with its angle alone: the farthest that two of
        them miss a pin of theirs by, or a slider its place.
        """
        points, angles = self.points(position), self.link_angles(position)
        worst = 0.0
        for joint in self.structure.joints:
            if joint.kind == 'R':
                error = points[joint.link, joint.name] - points[joint.to, joint.name]
            else:
                slider = self.linkage.sliders[joint.name]
                between = points[joint.link, slider.point] - points[joint.to, slider.through]
                line = complex(*slider.direction) * rect(1.0, angles[joint.to])
                along = self.slide_values(position)[joint.name]
                error = between - along * line / abs(line)
            worst = max(worst, abs(error))
        return worst

    @cached_property
    def input_ranges(self) -> tuple[InputRange, ...]:
        """
        Where the single input can go, in [rad] or [m]; of several inputs, none.

        Every loop closes there, and no joint is beyond its limits.
        """
        return input_ranges(self)

    @cached_property
    def singular_inputs(self) -> tuple[SingularInput, ...]:
        """Where a single input meets toggles and change points; of several inputs, none."""
        return singular_inputs(self)

    @cached_property
    def closing_ranges(self) -> tuple[InputRange, ...]:
        """
        Where the single input closes every loop, whatever the limits; of several inputs, none.

        Of a cylinder those of positive length, unless it starts, or is limited to, the others.
        """
        found = closing_ranges(self)
        return without_mirrored(self.linkage, self.structure, 0, found) if found else ()

    @cached_property
    def zero_length(self) -> float | None:
        """Slide at which the two pins of a cylinder meet, in [m]; None without one."""
        return zero_length(self.linkage, self.structure, 0)

    def nearness(self, position: Position) -> Nearness:
        """Return how near trouble a closed position is."""
        return nearness(self, position)

    def _all(self, position: Position) -> State:
        """Return a position with all points placed, also those that no loop needs."""
        state = State(position.state.coordinates, list(position.state.pins))
        for step in self._more_steps:
            step.close(state)
        return state

    def _coordinates(self, what: str, values: tuple[float, ...]) -> list[float] | None:
        """Return the ground's coordinate and the inputs'; nothing where one is not finite."""
        if len(values) != self._driven:
            names = ', '.join(given.joint for given in self.linkage.inputs)
            raise ValueError(f'{what}: {len(values)} given; give {self._driven}: {names}')
        try:
            if not all_finite(values):
                return None
        except (TypeError, ValueError):
            wrong = next(value for value in values if not isinstance(value, (int, float)))
            message = f'{what}: {quoted(wrong)} is not a number; solve() takes arrays'
            raise TypeError(message) from None
        if self._factors is None:
            return [0.0, *values]
        return [0.0, *(v * factor for v, factor in zip(values, self._factors, strict=True))]

    def _joints(self, values: list[float]) -> tuple[float, ...]:
        """Return the derivatives of the published joints."""
        joints: tuple[float, ...] = ()
        for i, j, factor in self._rate_terms:
            joints += (factor * (values[i] - values[j]),)
        return joints

    def _term(self, joint: RevoluteJoint | SlideJoint) -> tuple[int, int, float, float]:
        """Return a published joint as factor·(x[i] − x[j]) + constant."""
        if isinstance(joint, SlideJoint):
            slide = self.slides[joint.slider]
            return slide.coordinate, 0, slide.sign * self.scale, slide.constant * self.scale
        child, parent = self.angles[joint.child], self.angles[joint.parent]
        return child.coordinate, parent.coordinate, 1.0, child.constant - parent.constant
