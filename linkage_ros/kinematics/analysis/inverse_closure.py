# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A linkage with one of its dependent joints as the input.

The closed form stays as it is and is inverted: the crank comes from a branch of the joint over the
crank, everything else from the closed form at that crank. With the joint y = f(θ), θ the crank::

    θ̇ = ẏ/f′        θ̈ = (ÿ − f″·θ̇²)/f′
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from math import inf, isfinite, isnan, nan, tau
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.kinematics.analysis.crank_branches import CrankBranch, Inverse, Output
from linkage_ros.kinematics.arithmetic import all_finite, UndecidedError
from linkage_ros.kinematics.built_once import BuiltProperty
from linkage_ros.kinematics.compiling import TracedMotion
from linkage_ros.kinematics.doubles import columns_of, to_doubles
from linkage_ros.kinematics.limits import Bounds
from linkage_ros.kinematics.plane.closure import Closure
from linkage_ros.kinematics.plane.linkage import AssemblyPose, Input
from linkage_ros.kinematics.results import (
    Acceleration,
    InputRange,
    Position,
    SingularInput,
    SingularityMargin,
    Velocity,
)
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import LinkState, Step

if TYPE_CHECKING:
    from linkage_ros.kinematics.batch import Batch

_INSIDE = 1e-8
"""Distance from a toggle of the crank at which rates are taken, of the branch's width."""


class _GivenState(LinkState):
    """A state of the linkage with the joint that is the input, or its rate."""

    given: tuple[float, ...]


def _given_state(value: float, coordinates: list[float], pins: list[complex]) -> _GivenState:
    state = _GivenState(coordinates, pins)
    state.given = (value,)
    return state


class CrankPose(NamedTuple):
    """The result of a `CrankStep`."""

    status: Status
    crank: Any  # None without a pose
    gap: float = 0.0


class CrankStep(Step):
    """The first step of compiled code: the crank takes the place of the joint."""

    def __init__(self, closure: InverseClosure) -> None:
        self._closure = closure

    def close(self, solved: LinkState) -> CrankPose:
        """Replace the joint by the crank; only symbols come here."""
        closure = self._closure
        status, crank = closure.branch.trace_crank(solved.coordinates[1], self._output_at)
        if crank is not None:
            begin = closure.closed.initial_state(crank)
            solved.coordinates[:], solved.pins[:] = begin.coordinates, begin.pins
        return CrankPose(status, crank)

    def _output_at(self, crank: Any) -> tuple[Any, Any]:
        closed = self._closure.closed
        position = closed.close_unlimited(crank)
        if position.status is not Status.CLOSED:
            raise UndecidedError
        motion = TracedMotion(position, closed.velocity(position, 1.0), None)
        (value,), (slope,) = self._closure.inverse.output.wanted(motion)
        return value, slope


class InverseClosure(Closure):
    """
    A linkage with a dependent joint, or a coordinate of a traced point, as its input.

    Its joints are the crank and the other published joints. `Closure.driven_by` makes it.

    Parameters
    ----------
    closed
        The linkage with its crank as the input.
    inverse
        The output with its branches.
    branch
        The branch on which the crank is.

    """

    def __init__(self, closed: Closure, inverse: Inverse, branch: CrankBranch) -> None:
        output = inverse.output
        (crank,) = closed.linkage.inputs
        joints = {crank.joint: crank.as_joint()}
        others = [name for name in closed.joint_names if name not in (output.name, crank.joint)]
        joints |= {name: closed.linkage.joints[name] for name in others}
        self.closed, self.inverse, self.branch = closed, inverse, branch
        self.gap_unit = output.unit
        self.linkage = replace(
            closed.linkage,
            inputs=(_as_input(output),),
            joints=joints,
            pose=AssemblyPose((0.5 * (branch.low + branch.high),), {}),
        )
        self.name = closed.name
        for same in (
            'structure', 'scale', 'steps', 'step_groups', 'angles', 'slides', 'turns_with',
            '_known', '_more_steps', '_point_index',
        ):  # fmt: skip
            setattr(self, same, getattr(closed, same))
        self.input_names, self.joint_names = (output.name,), tuple(joints)
        self._factors, self._single = None, True
        self._others = [closed.joint_names.index(name) for name in others]
        self.turning = (not crank.slider, *(closed.turning[number] for number in self._others))
        self.bounds = Bounds(self.linkage)

    def __reduce__(self) -> tuple[Any, ...]:
        drive = partial(Closure.driven_by, branch=self.branch.number)
        return drive, (self.closed, *self.input_names)

    def position(self, *inputs: float) -> Position:
        """
        Close the loops at a value of the joint, in [rad] or [m].

        Where the joint turns back, the position is a toggle: the crank is valid, its rate is not.
        A value that the joint does not reach is open; the gap is how much it is beyond, in its
        unit.
        """
        (y,) = self._single_number('inputs', inputs)
        if hasattr(y, 'apply'):
            return self._trace_position(y)
        branch = self.branch
        if isfinite(y) and (beyond := branch.distance_beyond(y)):
            return Position(Status.OPEN, beyond, (), _given_state(y, [0.0], []), [], self)
        crank, slope = branch.find_crank(y) if isfinite(y) else (nan, nan)
        if isnan(crank):
            return Position(Status.INDETERMINATE, 0.0, (), _given_state(y, [0.0], []), [], self)
        found = self.closed.position(crank)
        status = found.status
        if abs(slope) < branch.flat:
            status = Status.TOGGLE
        elif status is Status.TOGGLE and self._beside_toggle(found, crank):
            status = Status.CLOSED
        joints = self._joints_with(crank, found.joints)
        return Position(
            status, found.gap, joints, _given_state(y, *found.state), found.poses, self
        )

    def _trace_position(self, y: Any) -> Position:
        """Return the position at a symbol."""
        status, crank, _ = CrankStep(self).close(self.initial_state(y))
        if not status.has_rates:
            return Position(status, 0.0, (), _given_state(y, [0.0], []), [], self)
        found = self.closed.close_unlimited(crank)
        joints = self._joints_with(crank, found.joints)
        given = _given_state(y, *found.state)
        return Position(found.status, found.gap, joints, given, found.poses, self)

    @property
    def program_steps(self) -> tuple[Any, ...]:
        return (CrankStep(self), *self.steps)

    def velocity(self, position: Position, *rates: float) -> Velocity:
        if getattr(position, 'closure', None) is not self:
            self._check_own('position', position)
        (rate,) = self._single_number('rates', rates)
        if not (position.status.has_rates and all_finite((rate,))):
            return self._huge_velocity(position, (rate,))
        places = self._beside_toggle(position, position.joints[0])
        ways = places or [self._crank_position(position)]
        cranks = [rate / self._output_slope(way) for way in ways]
        if any(map(_overflows, cranks)):
            return self._huge_velocity(position, (rate,))
        found = [self.closed.velocity(way, crank) for way, crank in zip(ways, cranks, strict=True)]
        if any(type(one.rates) is Velocity for one in found):
            return self._huge_velocity(position, (rate,))
        (crank,) = self.closed.inputs_of(found[-1].state)
        joints = found[-1].joints
        if places:  # The crank stands there; the others are extrapolated.
            crank, joints = 0.0, _extrapolate(*(one.joints for one in found))
        state = _given_state(rate, *found[-1].state)
        return Velocity(self._joints_with(crank, joints), state, found[-1].rates, self)

    def acceleration(
        self, position: Position, velocity: Velocity, *accelerations: float
    ) -> Acceleration:
        if getattr(velocity, 'closure', None) is not self:
            self._check_own('velocity', velocity)
        (change,) = self._single_number('accelerations', accelerations)
        (rate,) = self.inputs_of(velocity.state)
        if type(velocity.rates) is Velocity or _overflows(change):
            return self._huge_acceleration(position, velocity, (change,))
        places = self._beside_toggle(position, position.joints[0])
        found = []
        for place in places or [self._crank_position(position)]:
            moving = self._crank_velocity(place, rate)
            bent = self.closed.acceleration(place, moving, 0.0)
            *_, (bend,) = self._output_groups(place, moving, bent)
            crank = (change - bend) / self._output_slope(place)
            if _overflows(crank):
                return self._huge_acceleration(position, velocity, (change,))
            found.append(self.closed.acceleration(place, moving, crank))
        ends = [(*self.closed.inputs_of(one.state), *one.joints) for one in found]
        crank, *joints = _extrapolate(*ends) if places else ends[0]
        state = _given_state(change, *found[-1].state)
        return Acceleration(self._joints_with(crank, joints), state, self)

    def _huge_velocity(self, position: Position, rates: tuple[float, ...]) -> Velocity:
        found = super()._huge_velocity(position, rates)
        return replace(found, state=_given_state(rates[0], *found.state))

    def _huge_acceleration(
        self, position: Position, velocity: Velocity, accelerations: tuple[float, ...]
    ) -> Acceleration:
        found = super()._huge_acceleration(position, velocity, accelerations)
        return replace(found, state=_given_state(accelerations[0], *found.state))

    def solve(
        self,
        *inputs: Any,
        rates: Any = None,
        accelerations: Any = None,
        derivatives: int = 2,
        out: Batch | None = None,
    ) -> Batch:
        """Solve many states as `Closure.solve`, one by one."""
        from linkage_ros.kinematics.batch import Batch, CODES  # local import: it loads numpy
        import numpy as np  # local import: the batch alone needs it

        columns = columns_of('inputs', inputs[0]) if len(inputs) == 1 else None
        (given,) = self._single_input('inputs', tuple(columns or inputs))
        values = to_doubles('inputs', given)
        speeds = np.broadcast_to(
            to_doubles('rates', 1.0 if rates is None else rates), values.shape
        )
        changes = to_doubles('accelerations', 0.0 if accelerations is None else accelerations)
        changes = np.broadcast_to(changes, values.shape)
        shape = len(self.joint_names), len(values)
        arrays = [np.full(shape, np.nan) for _ in range(1 + derivatives)]
        status = np.empty(len(values), np.uint8)
        for k, y in enumerate(values.tolist()):
            position = self.position(y)
            status[k] = CODES[position.status]
            if not position.joints:
                continue
            arrays[0][:, k] = position.joints
            if derivatives and position.status.has_rates:
                velocity = self.velocity(position, float(speeds[k]))
                arrays[1][:, k] = velocity.joints
                if derivatives > 1:
                    found = self.acceleration(position, velocity, float(changes[k]))
                    arrays[2][:, k] = found.joints
        if out is None:
            return Batch(status, *arrays)
        for mine, theirs in zip((status, *arrays), out, strict=False):
            assert theirs is not None, 'it takes what was asked for'
            theirs[...] = mine
        return out

    def inputs_of(self, state: LinkState) -> tuple[float, ...]:
        """Return the joint that is the input, or its rate, in [rad] or [m]."""
        assert isinstance(state, _GivenState), 'it makes all its states'
        return state.given

    @BuiltProperty
    def input_ranges(self) -> tuple[InputRange, ...]:
        """Return the range of the joint on its branch."""
        one = self.branch
        turns = max(1, round(abs(one.rise) / tau))
        limited = not one.endless[0], not one.endless[1]
        ends = one.low, one.high
        return (InputRange(*ends, self.inverse.output.turning, limited, turns, one.by),)

    @BuiltProperty
    def closing_ranges(self) -> tuple[InputRange, ...]:
        """Return the same: limits cut the branch."""
        return self.input_ranges

    @BuiltProperty
    def singular_inputs(self) -> tuple[SingularInput, ...]:
        """Return where the joint turns back: there the crank has no rate."""
        ends = zip((self.branch.low, self.branch.high), self.branch.turns_back, strict=True)
        return tuple(SingularInput(end, Status.TOGGLE) for end, back in ends if back)

    @BuiltProperty
    def zero_length(self) -> float | None:
        """Return None: the branch limits the range."""
        return None

    def singularity_margin(self, position: Position) -> SingularityMargin:
        """Return how near a closed position is to a singularity, of the crank or of the joint."""
        (y,) = position.inputs
        distance = min((abs(y - one.value) for one in self.singular_inputs), default=inf)
        margin = self.closed.singularity_margin(self._crank_position(position))
        return margin._replace(toggle_distance=distance)

    def _single_input(self, what: str, values: tuple[Any, ...]) -> tuple[Any, ...]:
        if len(values) != 1:
            name = self.input_names[0]
            raise ValueError(f'{what}: {len(values)} given; give 1: {name}')
        return values

    def _single_number(self, what: str, values: tuple[float, ...]) -> tuple[float, ...]:
        return self._as_doubles(what, self._single_input(what, values))

    def _joints_with(self, crank: float, joints: Sequence[float]) -> tuple[float, ...]:
        return (crank, *(joints[number] for number in self._others)) if joints else ()

    def _crank_position(self, position: Position) -> Position:
        """Return a position of this closure as one of the linkage with its crank as the input."""
        closed, status = self.closed, position.status
        return Position(status, position.gap, (), position.state, position.poses, closed)

    def _beside_toggle(self, found: Position, crank: float) -> list[Position]:
        """Return positions beside the end of the crank if it is a toggle there; else none."""
        if not any(pose.status is Status.TOGGLE for pose in found.poses):
            return []
        branch = self.branch
        end = int(abs(crank - branch.last) < abs(crank - branch.first))
        if not branch.steep[end]:
            return []
        way = (branch.last - branch.first) * (-1.0 if end else 1.0)
        return [self.closed.position(crank + way * _INSIDE * part) for part in (1.0, 0.25)]

    def _output_groups(self, *motion: Any) -> Any:
        return self.inverse.output.wanted(TracedMotion(*motion))

    def _output_slope(self, forward: Position) -> Any:
        _, (slope,) = self._output_groups(forward, self.closed.velocity(forward, 1.0), None)
        return slope

    def _crank_velocity(self, forward: Position, rate: float) -> Velocity:
        return self.closed.velocity(forward, rate / self._output_slope(forward))


def _overflows(number: Any) -> bool:
    return isinstance(number, float) and not isfinite(number)


def _as_input(output: Output) -> Input:
    if output.joint is not None:
        return Input.from_joint(output.name, output.joint)
    return Input(output.name, slider=output.name)  # It slides, though along no line of a link.


def _extrapolate(far: Sequence[float], near: Sequence[float]) -> tuple[float, ...]:
    """Return values at a toggle from those at a distance and a quarter of it: √ distance."""
    return tuple(2.0 * b - a for a, b in zip(far, near, strict=True))
