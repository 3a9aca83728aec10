# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The loop closure of a linkage: from its inputs to its joints, and to every point of its links.

Position first; what a scene calls for beyond it starts from the position and repeats nothing.
"""

from __future__ import annotations

from cmath import rect
from collections.abc import Iterable, Sequence
from math import inf
from operator import mul
from typing import Any, overload, TYPE_CHECKING

from linkage_ros.errors import escape_unprintable, list_names, quote
from linkage_ros.kinematics.arithmetic import all_finite
from linkage_ros.kinematics.built_once import BUILD_LOCK, BuiltProperty
from linkage_ros.kinematics.checks import check_linkage
from linkage_ros.kinematics.doubles import HUGE, SHRINK, to_double
from linkage_ros.kinematics.limits import Bounds, limit_status, without_mirrored, zero_length
from linkage_ros.kinematics.linkage import Linkage, RevoluteJoint, SlideJoint
from linkage_ros.kinematics.plan import SolutionPlan
from linkage_ros.kinematics.ranges import closing_ranges, input_ranges
from linkage_ros.kinematics.results import (
    Acceleration,
    InputRange,
    PointMotion,
    Position,
    SingularInput,
    SingularityMargin,
    Velocity,
)
from linkage_ros.kinematics.singularity_margin import singular_inputs, singularity_margin
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import LinkState, StepPose
from linkage_ros.kinematics.topology import assur_groups, Structure

if TYPE_CHECKING:
    from linkage_ros import InverseClosure, LinkagePage
    from linkage_ros.kinematics.batch import Batch
    from linkage_ros.kinematics.compiling import Compiled, OutputSelection, SolverOutline
    from linkage_ros.kinematics.crank_branches import CrankBranch, Inverse
    from linkage_ros.kinematics.link_frames import LinkFrames
    from linkage_ros.kinematics.point_tracker import PointTracker
    from numpy.typing import ArrayLike


def _no_motion(what: str, given: tuple[float, ...], status: Status) -> ValueError:
    if not status.has_rates:
        return ValueError(f'{what}: a linkage that is {status.value} has none; check its status')
    return ValueError(f'{what}: {list(given)} is not finite')


def _multiply(
    found: Velocity | Acceleration, factor: float
) -> tuple[tuple[float, ...], LinkState]:
    """Return joints and state of a velocity or an acceleration times a factor."""
    coordinates, pins = found.state
    return (
        tuple(value * factor for value in found.joints),
        LinkState(
            [value * factor for value in coordinates],
            [complex(pin.real * factor, pin.imag * factor) for pin in pins],
        ),
    )


class Closure:
    """
    A linkage, ready to be solved.

    Parameters
    ----------
    linkage
        The linkage.
    name
        Its name, which messages and pictures show; `load` takes it from the file.

    Attributes
    ----------
    linkage, name
        As given.
    input_names
        Names of the driven joints, in the order in which `position` takes their values.
    joint_names
        Names of the published joints, in the order of `Position.joints`.

    Raises
    ------
    DefinitionError
        If the parts do not form a linkage, or the inputs do not move all of it.
    TypeError
        If ``linkage`` is not a `Linkage`.

    """

    gap_unit: str = 'm'
    """Unit of the gap of an open position."""

    def __init__(self, linkage: Linkage, name: str = '') -> None:
        if not isinstance(linkage, Linkage):
            raise TypeError(f'linkage: {quote(linkage)} is not a Linkage; load() reads files')
        check_linkage(linkage)
        self.linkage = linkage
        self.name = name
        self.input_names = tuple(given.joint for given in linkage.inputs)
        self.joint_names = tuple(linkage.joints)
        self.structure: Structure = assur_groups(linkage)
        planner = SolutionPlan(linkage, self.structure)
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
        self.ratio_turns = planner.ratio_turns
        """Whole turns of a single input after which its ratios repeat; 0 if they never do."""
        self._terms = tuple(self._joint_term(joint) for joint in linkage.joints.values())
        self._rate_terms = tuple((i, j, factor) for i, j, factor, _ in self._terms)
        self._point_index = {
            (link, name): planner.place_point(link, point)
            for link, points in planner.points.items()
            for name, point in points.items()
        }
        self.steps = steps
        needed = len(steps)
        self._more_steps = tuple(planner.steps[needed:])
        factors = [1.0 / self.scale if given.slider else 1.0 for given in linkage.inputs]
        self._factors = None if set(factors) == {1.0} else factors
        self._single = factors == [1.0]
        self.bounds = Bounds(linkage)
        """The limits between which its joints stay."""
        if self.bounds:
            self.position = limit_status(self.position, self.bounds)  # type: ignore[method-assign]
        self._compiled: list[Compiled] = []
        self._inverses: dict[str, Inverse] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        """Copy and pickle the definition: the copy builds the rest anew, to the same bits."""
        return type(self), (self.linkage, self.name)

    def __repr__(self) -> str:
        counts = ((len(self.input_names), 'input'), (len(self.joint_names), 'joint'))
        has = ', '.join(f'{n} {what}{"s" * (n != 1)}' for n, what in counts)
        named = ' '.join(filter(None, (type(self).__name__, escape_unprintable(self.name))))
        return f'<{named}: {has}>'

    def _repr_svg_(self) -> str:
        from linkage_ros import svg  # local import: only a notebook asks for pictures

        return svg(self)

    def view(self) -> LinkagePage:
        """
        Return the page of `linkage view`, which a notebook shows in a cell.

        Raises
        ------
        LinkageError
            If plotly is not installed.

        """
        from linkage_ros import LinkagePage  # local import: only a notebook asks for pages

        return LinkagePage(self)

    def position(self, *inputs: float) -> Position:
        """
        Close the loops.

        Parameters
        ----------
        *inputs
            One value for each driven joint, in [rad] or [m]. If one is not finite, the position
            is indeterminate.

        Returns
        -------
        position : Position
            Its status says whether the loops close.

        Raises
        ------
        ValueError
            If there is not one input for each driven joint.
        TypeError
            If an input is not a number.

        """
        x = self._input_coordinates('inputs', inputs, 0.0, inf)
        if x is None:
            numbers = self._as_doubles('inputs', inputs)
            state = LinkState([0.0, *self._scale_inputs(numbers)], [])
            return Position(Status.INDETERMINATE, 0.0, (), state, [], self)
        state = LinkState(x, [])
        poses: list[StepPose] = []
        status = Status.CLOSED
        for step in self.steps:
            pose = step.close(state)
            poses.append(pose)
            found = pose.status
            if found is not Status.CLOSED:
                if not found.has_pose:
                    return Position(found, pose.gap * self.scale, (), state, poses, self)
                if status.has_rates:
                    status = found
        joints: tuple[float, ...] = ()
        for i, j, factor, constant in self._terms:
            joints += (factor * (x[i] - x[j]) + constant,)
        return Position(status, 0.0, joints, state, poses, self)

    def initial_state(self, *inputs: float) -> LinkState:
        """Return the state before the first step: the coordinates of the ground and the inputs."""
        return LinkState(self._input_coordinates('inputs', inputs, 0.0, inf) or [], [])

    def close_unlimited(self, *inputs: float) -> Position:
        """Close the loops as `position` does, without limits."""
        return type(self).position(self, *inputs)

    def velocity(self, position: Position, *rates: float) -> Velocity:
        """
        Return the rates of the linkage at a position.

        Parameters
        ----------
        position
            A position that this closure found, with ``position.status.has_rates``.
        *rates
            One rate for each driven joint, in [rad/s] or [m/s].

        Raises
        ------
        ValueError
            If the position has no rates, as at a toggle, if a rate is not finite, or if there is
            not one for each driven joint.
        TypeError
            If a rate is not a number, or the position is one of another linkage.

        """
        if getattr(position, 'closure', None) is not self:
            self._check_own('position', position)
        v = self._input_coordinates('rates', rates)
        if v is None or not position.status.has_rates:
            return self._huge_velocity(position, self._as_doubles('rates', rates))
        velocities = LinkState(v, [])
        found = []
        for step, pose in zip(self.steps, position.poses, strict=True):
            found.append(step.rates(pose, position.state, velocities))
        return Velocity(self._joint_rates(v), velocities, found, self)

    def acceleration(
        self, position: Position, velocity: Velocity, *accelerations: float
    ) -> Acceleration:
        """
        Return the accelerations of the linkage at a position.

        Parameters
        ----------
        position, velocity
            A position and a velocity that this closure found.
        *accelerations
            One acceleration for each driven joint, in [rad/s²] or [m/s²].

        Raises
        ------
        ValueError, TypeError
            As `velocity`.

        """
        if getattr(velocity, 'closure', None) is not self:
            self._check_own('velocity', velocity)
        a = self._input_coordinates('accelerations', accelerations, -0.0, HUGE * HUGE)
        if a is None or type(velocity.rates) is Velocity:
            numbers = self._as_doubles('accelerations', accelerations)
            return self._huge_acceleration(position, velocity, numbers)
        state_accelerations = LinkState(a, [])
        for step, pose, rate in zip(self.steps, position.poses, velocity.rates, strict=True):
            step.accelerations(pose, rate, position.state, velocity.state, state_accelerations)
        return Acceleration(self._joint_rates(a), state_accelerations, self)

    def _huge_velocity(self, position: Position, rates: tuple[float, ...]) -> Velocity:
        """Return the velocity at rates of which one is huge: infinite where it overflows."""
        if not (position.status.has_rates and all_finite(rates)):
            raise _no_motion('rates', rates, position.status)
        found = self.velocity(position, *(rate * SHRINK for rate in rates))
        return Velocity(*_multiply(found, 1.0 / SHRINK), found, self)

    def _huge_acceleration(
        self, position: Position, velocity: Velocity, accelerations: tuple[float, ...]
    ) -> Acceleration:
        if not all_finite(accelerations):
            raise _no_motion('accelerations', accelerations, position.status)
        scaled = velocity.rates
        if not isinstance(scaled, Velocity):
            rates = self.inputs_of(velocity.state)
            scaled = self.velocity(position, *(rate * SHRINK for rate in rates))
        changes = (change * SHRINK * SHRINK for change in accelerations)
        found = self.acceleration(position, scaled, *changes)
        once = Acceleration(*_multiply(found, 1.0 / SHRINK), self)
        return Acceleration(*_multiply(once, 1.0 / SHRINK), self)

    def compile_linkage(
        self, derivatives: int, wanted: OutputSelection | None = None, given_count: int = 0
    ) -> Compiled:
        """
        Return the linkage compiled; for the same numbers it is compiled once.

        ``derivatives``: 0 for positions, 1 for velocities too, 2 for accelerations too. ``wanted``
        selects the numbers, by the motion and ``given_count`` numbers beside it; without it they
        are all published joints.
        """
        from linkage_ros.kinematics.compiling import (
            linkage,  # local import: they trace
            trace,  # local import: they trace
        )

        wanted = wanted or trace.published_joints
        with BUILD_LOCK:
            for compiled in self._compiled:
                if (compiled.derivatives, compiled.wanted) == (derivatives, wanted):
                    return compiled
            compiled = linkage.Compiled(self, derivatives, wanted, given_count=given_count)
            self._compiled.append(compiled)
            return compiled

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

        The memory beyond the results does not grow with the number of states. Links that need
        iteration are solved state by state, as slowly as `position` solves them.

        Parameters
        ----------
        *inputs
            For each driven joint an array (N,) of its values, in [rad] or [m]. A state with a
            value that is not finite is indeterminate.
        rates, accelerations
            For each driven joint a number or an array (N,); with one driven joint, without a list.
            Without ``rates`` the rate of a single driven joint is 1; several driven joints need
            them. Without ``accelerations`` these are 0.
        derivatives
            0 solves for positions, 1 also for velocities, 2 also for accelerations.
        out
            Arrays that take the results, and that are returned.

        Returns
        -------
        batch : Batch
            With a row for each published joint, in the order of `joint_names`: arrays (joints, N).

        Raises
        ------
        ValueError
            If the arrays do not fit each other, the linkage or ``out``, or values are masked.
        TypeError
            If a value is not a number.

        """
        return self._solver.solve(inputs, rates, accelerations, derivatives, out)

    @BuiltProperty
    def _solver(self) -> SolverOutline:
        from linkage_ros.kinematics.compiling import SolverOutline  # local import: numpy

        return SolverOutline(self, len(self.linkage.joints))

    @overload
    def driven_by(
        self, joint: str, /, *, branch: int | None = None, near: float | None = None
    ) -> InverseClosure: ...

    @overload
    def driven_by(self, joint: str, other: str, /, *others: str) -> Closure: ...

    def driven_by(
        self, *joints: str, branch: int | None = None, near: float | None = None
    ) -> Closure:
        """
        Return the linkage with other joints as its inputs.

        With one input the closed form is inverted, along a branch. With several the loops are
        solved in another order, in the assembly of the pose; some links may have to be iterated.

        Parameters
        ----------
        *joints
            As many joints as there are inputs: published ones; with one input also a coordinate
            of a traced point, such as ``P.x``; with several also inputs that stay.
        branch
            With one input, the number of the branch on which the crank is, as `cranks`
            returns it. If there is only one branch within the limits, it need not be named.
        near
            Instead of the branch a crank on it, in [rad] or [m].

        Raises
        ------
        DefinitionError
            If a joint is unknown or does not move, several branches are within the limits, or the
            joints do not move all of the linkage.

        """
        if len(self.input_names) > 1 or len(joints) != 1:
            from linkage_ros.kinematics.exchanged_inputs import (
                exchange_inputs,  # local import: only few ask for it
            )

            return Closure(exchange_inputs(self, joints, Closure), self.name)
        from linkage_ros import InverseClosure  # local import: only few ask for it

        inverse = self._joint_inverse(*joints)
        return InverseClosure(self, inverse, inverse.find_branch(branch, near))

    def cranks(self, joint: str, value: float) -> list[tuple[int, float]]:
        """
        Return all cranks at which a joint has a value, within the limits.

        Parameters
        ----------
        joint
            As in `driven_by`.
        value
            Its value, in [rad] or [m].

        Returns
        -------
        cranks : list
            Pairs of a branch's number and the crank on it, in [rad] or [m].

        Raises
        ------
        DefinitionError
            As `driven_by`.

        """
        return self._joint_inverse(joint).find_cranks(to_double('value', value))

    def branches(self, joint: str, *, limited: bool = True) -> Sequence[CrankBranch]:
        """
        Return the branches of a joint over the single input: on each it moves one way.

        The joint is as in `driven_by`, and so are the errors. If ``limited``, limits of joints cut
        the branches.
        """
        from linkage_ros.kinematics.crank_branches import (
            inverse_of,  # local import: only few ask for it
        )

        return (self._joint_inverse(joint) if limited else inverse_of(self, joint, False)).branches

    def _joint_inverse(self, joint: str) -> Inverse:
        """Return a joint with its branches over the crank; they are made once."""
        from linkage_ros.kinematics.crank_branches import (
            inverse_of,  # local import: only few ask for it
        )

        with BUILD_LOCK:
            if joint not in self._inverses:
                self._inverses[joint] = inverse_of(self, joint)
            return self._inverses[joint]

    def points(self, position: Position) -> dict[tuple[str, str], complex]:
        """
        Return every point of every link, by link and name, in the ground's frame.

        Returns
        -------
        points : dict
            For each pair of names the place x + iy, in [m].

        Raises
        ------
        ValueError
            If the linkage has no pose.

        """
        if not position.status.has_pose:
            raise ValueError(f'points: {position!r} has none; check its status first')
        places = self._with_all_points(position).pins
        return {key: places[i] * self.scale for key, i in self._point_index.items()}

    def point_motion(
        self, position: Position, velocity: Velocity, acceleration: Acceleration
    ) -> dict[tuple[str, str], PointMotion]:
        """Return place, velocity and acceleration of every point of every link."""
        state = self._with_all_points(position)
        velocities = LinkState(velocity.state.coordinates, list(velocity.state.pins))
        accelerations = LinkState(acceleration.state.coordinates, list(acceleration.state.pins))
        for step in self._more_steps:
            rates = step.rates((), state, velocities)
            step.accelerations((), rates, state, velocities, accelerations)
        return {
            key: PointMotion(
                *(values.pins[i] * self.scale for values in (state, velocities, accelerations))
            )
            for key, i in self._point_index.items()
        }

    def point_tracker(self, points: Sequence[tuple[str, complex]]) -> PointTracker:
        """
        Return a tracker of certain points of links, which computes no others.

        Each point is the name of its link and its place in that link's frame, in [m].
        """
        from linkage_ros.kinematics.point_tracker import (
            PointTracker,  # local import: only forces need it
        )

        return PointTracker(self._known, points)

    @BuiltProperty
    def link_frames(self) -> LinkFrames:
        """Return the frames of the links and blocks that move."""
        from linkage_ros.kinematics.link_frames import (
            LinkFrames,  # local import: only drawings need it
        )

        return LinkFrames(self.linkage, self.structure, self._known)

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

    def limit_exceeded(self, position: Position) -> str:
        """Return which joint of a pose is beyond its limits, as text; '' if none is."""
        inputs = position.inputs
        joints = position.joints or self.position(*inputs).joints
        bound = self.bounds.first_exceeded(inputs, joints) if joints else None
        if bound is None:
            return ''
        driven_one = bound in self.bounds.inputs
        number = bound.number
        value = bound.turn_to_middle((inputs if driven_one else joints)[number])
        turns = not self.linkage.inputs[number].slider if driven_one else self.turning[number]
        unit = 'rad' if turns else 'm'
        limits = self.linkage.limits[bound.name]
        return f'{bound.name} at {value:.6g} {unit}, limits {limits} {unit}'

    def inputs_of(self, state: LinkState) -> tuple[float, ...]:
        """Return the driven joints in a state, or their rates, in [rad] or [m]."""
        factors = self._factors or [1.0] * len(self.input_names)
        driven = zip(state.coordinates[1:], factors, strict=False)
        return tuple(value / factor for value, factor in driven)

    def residual(self, position: Position) -> float:
        """
        Return the closure error of a closed position, in [m].

        Each link is placed by its own pin or slider and its angle. The result is the largest
        distance between the two places of a pin, or of a slider's point. Ratios between joints
        join no places, and are not counted.
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

    @BuiltProperty
    def input_ranges(self) -> tuple[InputRange, ...]:
        """
        Ranges of a single input, in [rad] or [m]; empty for several inputs.

        Every loop closes there, and no joint is beyond its limits.
        """
        return input_ranges(self)

    @BuiltProperty
    def singular_inputs(self) -> tuple[SingularInput, ...]:
        """Toggles and change points of a single input; empty for several inputs."""
        return singular_inputs(self)

    @BuiltProperty
    def closing_ranges(self) -> tuple[InputRange, ...]:
        """
        Ranges in which a single input closes every loop, without limits; empty for several.

        A cylinder has only the ranges of positive length, unless it starts in the others or is
        limited to them.
        """
        found = closing_ranges(self)
        return without_mirrored(self.linkage, self.structure, found) if found else ()

    @BuiltProperty
    def zero_length(self) -> float | None:
        """Slide at which the two pins of a cylinder meet, in [m]; None if there is none."""
        return zero_length(self.linkage, self.structure)

    def singularity_margin(self, position: Position) -> SingularityMargin:
        """Return how near a closed position is to a singularity."""
        return singularity_margin(self, position)

    def _with_all_points(self, position: Position) -> LinkState:
        """Return a position with all points placed, also those that no loop needs."""
        state = LinkState(position.state.coordinates, list(position.state.pins))
        for step in self._more_steps:
            step.close(state)
        return state

    def _input_coordinates(
        self, what: str, values: tuple[float, ...], zero: float = -0.0, most: float = HUGE
    ) -> list[float] | None:
        """
        Return the coordinates of the ground and the inputs, as doubles.

        Each is a value plus ``zero``: 0.0 makes 0.0 of −0.0, which is the same input, and −0.0
        changes nothing. None if a value is not between ``-most`` and ``most``.
        """
        if self._single and len(values) == 1:
            (value,) = values
            if type(value) is float and -most < value < most:
                return [0.0, value + zero]
        if len(values) != len(self.input_names):
            names = list_names(self.input_names)
            raise ValueError(f'{what}: {len(values)} given; give {len(self.input_names)}: {names}')
        numbers = self._as_doubles(what, values)
        x = [0.0, *self._scale_inputs([number + zero for number in numbers])]
        if any(hasattr(number, 'apply') for number in numbers):
            return x if all_finite(numbers) else None
        return x if all(-most < number < most for number in (*numbers, *x)) else None

    def _as_doubles(self, what: str, values: tuple[float, ...]) -> tuple[float, ...]:
        """Return values of any type as doubles; symbols as they are."""
        return tuple(
            value
            if type(value) is float or hasattr(value, 'apply')
            else to_double(what, value, '; solve() takes arrays')
            for value in values
        )

    def _scale_inputs(self, values: Sequence[float]) -> Iterable[float]:
        """Return values of the inputs, or their rates, in the unit of the steps."""
        factors = self._factors
        return values if factors is None else map(mul, values, factors)

    def _check_own(self, what: str, found: Position | Velocity) -> None:
        """Refuse a result of another linkage: the steps would read its numbers."""
        closure = getattr(found, 'closure', None)
        linkage = getattr(closure, 'linkage', None)
        if linkage is not self.linkage and linkage != self.linkage:
            message = f'{what}: {quote(found)} is not from {self!r}; give one that it returned'
            raise TypeError(message)

    def _joint_rates(self, values: list[float]) -> tuple[float, ...]:
        """Return the derivatives of the published joints."""
        joints: tuple[float, ...] = ()
        for i, j, factor in self._rate_terms:
            joints += (factor * (values[i] - values[j]),)
        return joints

    def _joint_term(self, joint: RevoluteJoint | SlideJoint) -> tuple[int, int, float, float]:
        """Return a published joint as factor·(x[i] − x[j]) + constant, in [rad] or [m]."""
        i, j, factor, constant = self._known.joint_term(joint)
        unit = self.scale if isinstance(joint, SlideJoint) else 1.0
        return i, j, factor * unit, constant * unit
