# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
What the closures of planar and of spatial linkages share: they run steps, one after the other.

Position first; what a scene calls for beyond it starts from the position and repeats nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import inf
from operator import mul
from typing import Any, ClassVar, TYPE_CHECKING, TypeVar

from linkage_ros.errors import escape_unprintable, list_names, quote
from linkage_ros.kinematics.analysis.ranges import closing_ranges, input_ranges
from linkage_ros.kinematics.analysis.singularity_margin import singular_inputs, singularity_margin
from linkage_ros.kinematics.arithmetic import all_finite
from linkage_ros.kinematics.built_once import BUILD_LOCK, BuiltProperty
from linkage_ros.kinematics.doubles import HUGE, SHRINK, to_double
from linkage_ros.kinematics.limits import Bounds, limit_status
from linkage_ros.kinematics.plane.linkage import JointedLinkage, RevoluteJoint
from linkage_ros.kinematics.results import (
    Acceleration,
    InputRange,
    Near,
    Plan,
    Position,
    SingularInput,
    SingularityMargin,
    Velocity,
)
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import LinkState, Step, StepPose
from linkage_ros.workbench import find_tool

if TYPE_CHECKING:
    from linkage_ros import ArrayFunctions
    from linkage_ros.kinematics.analysis.crank_branches import CrankBranch, Inverse
    from linkage_ros.kinematics.batch import Array, Batch
    from linkage_ros.kinematics.compiling import Compiled, OutputSelection, SolverOutline
    from linkage_ros.kinematics.iterated.grid import Grid
    from numpy.typing import ArrayLike

_FILLED = 4096
"""Most cells of a grid that are made before the first state."""

Own = TypeVar('Own', bound='Closure')


def _no_motion(what: str, values: tuple[float, ...], status: Status) -> ValueError:
    if not status.has_rates:
        return ValueError(f'{what}: a linkage that is {status.value} has none; check its status')
    return ValueError(f'{what}: {list(values)} is not finite')


def _multiply(
    motion: Velocity | Acceleration, factor: float
) -> tuple[tuple[float, ...], LinkState]:
    """Return joints and state of a velocity or an acceleration times a factor."""
    coordinates, pins = motion.state
    return (
        tuple(value * factor for value in motion.joints),
        LinkState(
            [value * factor for value in coordinates],
            [_multiply_pin(pin, factor) for pin in pins],
        ),
    )


def _multiply_pin(pin: Any, factor: float) -> Any:
    """Return a pin's rate times a factor: a complex number, a vector, or a twist of vectors."""
    if isinstance(pin, tuple):
        parts = [_multiply_pin(part, factor) for part in pin]
        return type(pin)(*parts) if hasattr(pin, '_fields') else tuple(parts)
    return pin * factor if type(pin) is float else complex(pin.real * factor, pin.imag * factor)


class Closure:
    """
    A linkage, ready to be solved: a `PlanarClosure` or a `SpaceClosure`, as the linkage is.

    Parameters
    ----------
    linkage
        The linkage: a `Linkage` or a `SpaceLinkage`.
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
        If ``linkage`` is not a linkage of this kind.

    """

    takes: ClassVar[type[JointedLinkage]]
    """The kind of its linkages."""

    gap_unit: str = 'm'
    """Unit of the gap of an open position."""

    steps: tuple[Step, ...]
    step_groups: tuple[int, ...]
    """For each step the number of the group that it belongs to."""

    ratio_turns: int
    """Whole turns of a single input after which its ratios repeat; 0 if they never do."""

    turns_with: Any
    """For each coordinate that is a sum of inputs, how often each input is in it."""

    _terms: tuple[tuple[int, int, float, float], ...]
    """For each published joint i, j, factor, constant: it is factor·(x[i] − x[j]) + constant."""

    if TYPE_CHECKING:

        def __init__(self, linkage: JointedLinkage, name: str = '') -> None: ...

    def __new__(cls, linkage: JointedLinkage, _name: str = '') -> Closure:  # noqa: PYI034
        """Make a closure of the kind that the linkage needs."""
        kinds: tuple[type[Closure], ...] = (cls,)
        if cls is Closure:
            from linkage_ros import PlanarClosure  # local import: it is a closure

            kinds = (PlanarClosure,)
            if not isinstance(linkage, PlanarClosure.takes):
                from linkage_ros import SpaceClosure  # local import: in space only

                kinds = PlanarClosure, SpaceClosure
        for kind in kinds:
            if isinstance(linkage, kind.takes):
                return super().__new__(kind)
        wanted = list_names((kind.takes.__name__ for kind in kinds), ' or ')
        raise TypeError(f'linkage: {quote(linkage)} is not a {wanted}; load() reads files')

    def _set_linkage(self, linkage: Any, name: str, scale: float) -> None:
        """Set what follows from the linkage alone; ``scale`` is in [m]."""
        self.linkage = linkage
        self.name = name
        self.scale = scale
        """Metres in the unit of length of the steps."""
        self.input_names = tuple(driven.joint for driven in linkage.inputs)
        self.joint_names = tuple(linkage.joints)
        self.turning = tuple(isinstance(j, RevoluteJoint) for j in linkage.joints.values())
        """For each published joint: whether it turns (an angle) or slides (a length)."""
        factors = [1.0 / scale if driven.slider else 1.0 for driven in linkage.inputs]
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
            reached = pose.status
            if reached is not Status.CLOSED:
                if not reached.has_pose:
                    return Position(reached, pose.gap * self.scale, (), state, poses, self)
                if status.has_rates:
                    status = reached
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
        step_rates = []
        for step, pose in zip(self.steps, position.poses, strict=True):
            step_rates.append(step.rates(pose, position.state, velocities))
        return Velocity(self._joint_rates(v), velocities, step_rates, self)

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

    def driven_by(  # noqa: PYI019 (Python 3.10 has no Self)
        self: Own,
        *joints: str,
        branch: int | None = None,
        near: float | Sequence[float] | None = None,
    ) -> Own:
        """
        Return the linkage with other joints as its inputs.

        The loops are solved in another order, in the same assembly; some links may have to be
        iterated. The former inputs are published joints, before the others.

        Parameters
        ----------
        *joints
            As many as there are inputs: published joints, inputs that stay, coordinates of points
            such as ``P.x``, distances of points such as ``A-B``; in the plane angles of links to
            the ground, such as ``rod.angle``.
        branch
            With one input, the number of a branch that has the assembly, as `cranks` returns it.
            It need not be named if there is only one within the limits, or if the file has a pose.
        near
            Instead of the branch a crank on it, in [rad] or [m]. With several inputs, a value of
            each: the state that has the assembly; without it the pose has it.

        Raises
        ------
        DefinitionError
            If a joint is unknown or does not move, the branch is not certain, or the joints do not
            move all of the linkage.

        """
        from linkage_ros.kinematics.analysis.exchanged_inputs import (
            exchange_inputs,  # local import: only few ask for it
        )

        at = (near,) if isinstance(near, int | float) else near
        return exchange_inputs(self, joints, branch, at)

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
        from linkage_ros.kinematics.analysis.crank_branches import (
            inverse_of,  # local import: only few ask for it
        )

        if limited:
            return self._joint_inverse(joint).branches
        return inverse_of(self.measuring(joint), joint, False).branches

    def find_branch(
        self, joint: str, number: int | None = None, near: float | None = None
    ) -> CrankBranch:
        """
        Return the branch of a number, the one nearest a crank, or the only one of a joint.

        Of several that of the pose is returned, if the file has one.
        """
        pose = self.linkage.pose
        if number is None and near is None and pose is not None:
            near = pose.inputs[0]
        return self._joint_inverse(joint).find_branch(number, near)

    def _joint_inverse(self, joint: str) -> Inverse:
        """Return a joint with its branches over the crank; they are made once."""
        from linkage_ros.kinematics.analysis.crank_branches import (
            inverse_of,  # local import: only few ask for it
        )

        with BUILD_LOCK:
            if joint not in self._inverses:
                self._inverses[joint] = inverse_of(self.measuring(joint), joint)
            return self._inverses[joint]

    def measuring(self: Own, *names: str) -> Own:  # noqa: PYI019 (likewise)
        """
        Return the closure with these names among its joints; itself if it has them all.

        Names are as in `driven_by`, and so are the errors.
        """
        raise NotImplementedError

    def plan_exchange(self, names: Sequence[str], near: Near) -> Plan:
        """Return how the linkage is planned with other inputs, joints of this closure."""
        raise NotImplementedError

    def rate_term(self, number: int) -> tuple[int, int, float]:
        """Return i, j, factor of a published joint: its rate is factor·(v[i] − v[j])."""
        first, second, factor, _ = self._terms[number]
        return first, second, factor

    def jacobian(self, position: Position) -> Array:
        """
        Return the derivatives of the published joints by the inputs, (joints, inputs).

        Without masses and friction its transpose turns efforts of the joints into efforts of the
        inputs that do the same work, as `carry_efforts`.

        Parameters
        ----------
        position
            A position that this closure found, with ``position.status.has_rates``.

        Raises
        ------
        ValueError, TypeError
            As `velocity`.

        """
        import numpy as np  # local import: few ask for it

        units = np.eye(len(self.input_names)).tolist()
        return np.array([self.velocity(position, *unit).joints for unit in units]).T

    def carry_efforts(
        self, position: Position, efforts: Mapping[str, float], to: Sequence[str] = ()
    ) -> tuple[float, ...]:
        """
        Return efforts that do the same work as given ones, without masses and friction.

        Parameters
        ----------
        position
            A position that this closure found.
        efforts
            Efforts of joints and inputs by their names, in [N·m] or [N].
        to
            Names of as many other joints as there are inputs; without them, the inputs.

        Returns
        -------
        efforts : tuple
            In the order of ``to``, in [N·m] or [N]; empty where they are not determined, as at a
            toggle, or where a joint stands though the inputs move.

        Raises
        ------
        DefinitionError
            If a name is of no joint or input, or ``to`` has more or fewer than there are inputs.
        TypeError
            If the position is one of another linkage.

        """
        from linkage_ros.kinematics.analysis.carried_efforts import (
            CarriedEfforts,  # local import: few ask for it
        )

        self._check_own('position', position)
        numbers = [to_double(name, effort) for name, effort in efforts.items()]
        wanted = to or self.input_names
        return CarriedEfforts(self, [*efforts], wanted).carry_from(position, numbers)

    def _huge_velocity(self, position: Position, rates: tuple[float, ...]) -> Velocity:
        """Return the velocity at rates of which one is huge: infinite where it overflows."""
        if not (position.status.has_rates and all_finite(rates)):
            raise _no_motion('rates', rates, position.status)
        velocity = self.velocity(position, *(rate * SHRINK for rate in rates))
        return Velocity(*_multiply(velocity, 1.0 / SHRINK), velocity, self)

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
        acceleration = self.acceleration(position, scaled, *changes)
        once = Acceleration(*_multiply(acceleration, 1.0 / SHRINK), self)
        return Acceleration(*_multiply(once, 1.0 / SHRINK), self)

    def compile_linkage(
        self, derivatives: int, wanted: OutputSelection | None = None, given_count: int = 0
    ) -> Compiled:
        """
        Return the linkage compiled; for the same numbers it is compiled once.

        ``derivatives``: 0 for positions, 1 for velocities too, 2 for accelerations too. ``wanted``
        selects the numbers, by the motion and ``given_count`` further numbers; without it they
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
            for grid in self.grids:
                if grid.is_filled_at_once:
                    grid.fill(_FILLED)
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
        iteration are iterated for many states together; next to a singularity, and where they do
        not close, they are solved state by state, as slowly as `position` solves them.

        Parameters
        ----------
        *inputs
            For each driven joint an array (N,) of its values, in [rad] or [m]; or one array
            (N, inputs). A state with a value that is not finite is indeterminate.
        rates, accelerations
            For each driven joint a number or an array (N,); with one driven joint, without a list.
            With one array of inputs also one array (N, inputs).
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

    def as_torch(self) -> ArrayFunctions:
        """
        Return the linkage as functions of PyTorch's tensors.

        They are differentiable, and ``torch.compile`` works on them. They take any tensor of
        float64 or float32, on any device.

        Raises
        ------
        DefinitionError
            If the linkage cannot be compiled: its iterated links have no table and no cells.
        LinkageError
            If PyTorch is not installed.

        """
        return self._torch

    def as_jax(self) -> ArrayFunctions:
        """
        Return the linkage as functions of JAX's arrays.

        They are differentiable, and ``jax.jit``, ``jax.vmap`` and ``jax.grad`` work on them. JAX
        computes in single precision unless ``jax_enable_x64`` is set.

        Raises
        ------
        DefinitionError, LinkageError
            As `as_torch`.

        """
        return self._jax

    @BuiltProperty
    def _torch(self) -> ArrayFunctions:
        return self._make_functions('torch')

    @BuiltProperty
    def _jax(self) -> ArrayFunctions:
        return self._make_functions('jax')

    def _make_functions(self, package: str) -> ArrayFunctions:
        made: ArrayFunctions = find_tool('arrays').make_array_functions(self, package)
        return made

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
        """Ranges in which a single input closes every loop, without limits; empty for several."""
        return closing_ranges(self)

    @property
    def zero_length(self) -> float | None:
        """Slide at which the two pins of a cylinder meet, in [m]; None if there is none."""
        return None

    @property
    def slide_bound(self) -> float:
        """Return a length that no slide needs to exceed for a link to be stretched, in [m]."""
        raise NotImplementedError

    @property
    def grids(self) -> list[Grid]:
        """Return the cells of links that close only together, by several inputs."""
        return [grid for step in self.steps if (grid := step.grid) is not None]

    @property
    def makes_cells_in_motion(self) -> bool:
        """Whether some cells are made only where a motion leads."""
        return not all(grid.is_filled_at_once for grid in self.grids)

    def make_cells_ahead(self, inputs: Sequence[float], rates: Sequence[float]) -> None:
        """Make the cells that inputs at these rates meet next, in [rad] or [m] and per second."""
        factors = self._factors or [1.0] * len(inputs)
        for grid in self.grids:
            grid.look_ahead(
                *([values[k] * factors[k] for k in grid.numbers] for values in (inputs, rates))
            )

    def slide_reach(self, _number: int) -> tuple[float, float]:
        """Return between which values an input that slides is worth a trial, in [m]."""
        return -self.slide_bound, self.slide_bound

    def keep_usual(self, ranges: tuple[InputRange, ...]) -> tuple[InputRange, ...]:
        """Return the ranges of the first input that a user expects."""
        return ranges

    def needed_groups(self, number: int) -> set[int]:
        """Return the numbers of a group and of the groups that it starts from."""
        return set(range(number + 1))

    def links_of_group(self, number: int) -> list[str]:
        """Return the links of a group, for people."""
        raise NotImplementedError

    def named_points(self, position: Position) -> dict[str, Any]:
        """Return every point by its name, as `Position.points`."""
        raise NotImplementedError

    def named_motion(
        self, position: Position, velocity: Velocity, acceleration: Acceleration
    ) -> Mapping[str, Any]:
        """Return place, velocity and acceleration of points by name, of traced ones at least."""
        raise NotImplementedError

    def closing_errors(self, position: Position) -> list[float]:
        """Return by how much each equation of a closed position is off, in [m]."""
        raise NotImplementedError

    def residual(self, position: Position) -> float:
        """Return the closure error of a closed position, in [m]: the largest of all equations."""
        return max(map(abs, self.closing_errors(position)), default=0.0)

    def singularity_margin(self, position: Position) -> SingularityMargin:
        """Return how near a closed position is to a singularity."""
        return singularity_margin(self, position)

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

    def _check_own(self, what: str, result: Position | Velocity) -> None:
        """Refuse a result of another linkage: the steps would read its numbers."""
        closure = getattr(result, 'closure', None)
        linkage = getattr(closure, 'linkage', None)
        if linkage is not self.linkage and linkage != self.linkage:
            message = f'{what}: {quote(result)} is not from {self!r}; give one that it returned'
            raise TypeError(message)

    def _joint_rates(self, values: list[float]) -> tuple[float, ...]:
        """Return the derivatives of the published joints."""
        joints: tuple[float, ...] = ()
        for i, j, factor, _ in self._terms:
            joints += (factor * (values[i] - values[j]),)
        return joints
