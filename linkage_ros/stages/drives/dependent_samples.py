# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Samples of other joints than the inputs: the state of the inputs that they ask for.

The linkage is planned again with these joints as its inputs, in the assembly of their branch, or
of the pose. Where that plan leads on into another assembly, beyond a toggle of the inputs, the
linkage itself has other joints at the inputs that are found: then there are none.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite, nan, remainder, tau
from typing import NamedTuple

from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics import (
    CarriedEfforts,
    Closure,
    CrankBranch,
    Position,
    turn_to_pose,
)
from linkage_ros.messages import CrankSample, JointStateReader, Rejection
from linkage_ros.stages.drives.drive import LARGEST

Values = tuple[float, ...]

_SAME = 1e-6
"""Farthest that a joint may be from what is asked for, in [rad] or of the linkage's size."""


class ExchangedMotion(NamedTuple):
    """Inputs with what they have; NaN where they have none, or none is given."""

    inputs: Values
    rates: Values
    accelerations: Values
    efforts: Values


class ExchangedInputs:
    """
    The inputs of a linkage as functions of as many other joints.

    ``branch`` is the number of a branch of a single joint; 0 for that of the pose, or the only
    one. The errors of `Closure.driven_by` are raised with the key of the scene.
    """

    def __init__(self, closure: Closure, joints: Sequence[str], branch: int) -> None:
        try:
            self._measured = measured = closure.measuring(*joints)
            self.branch: CrankBranch | None = None
            if len(closure.input_names) == 1 == len(joints):
                self.branch = measured.find_branch(joints[0], branch or None)
                branch = self.branch.number
            self.inverse = measured.driven_by(*joints, branch=branch or None)
        except DefinitionError as error:
            key = 'drive.topic.branch' if branch else 'drive.topic.joint'
            raise DefinitionError(key, f'{error.where}: {error.reason}', error.remedy) from None
        self._names = closure.input_names
        self._rows = [self._measured.joint_names.index(name) for name in joints]
        self._turns = [self._measured.turning[row] for row in self._rows]
        self._carried = CarriedEfforts(self._measured, joints, self._names)

    def find_position(self, values: Sequence[float]) -> Position | None:
        """Return the position of the exchanged linkage at values; None if there is none."""
        position = self.inverse.position(*turn_to_pose(self.inverse, values))
        return position if position.status.has_pose and self._is_own(position) else None

    def _is_own(self, position: Position) -> bool:
        """Return whether the linkage itself has these joints at the inputs that are found."""
        closed = self._measured.close_unlimited(*self._inputs_of(position))
        for row, value, turns in zip(self._rows, position.inputs, self._turns, strict=True):
            if not closed.joints:
                return False
            off = closed.joints[row] - value
            off = remainder(off, tau) if turns else off / self._measured.scale
            if not abs(off) < _SAME:
                return False
        return True

    def _inputs_of(self, position: Position) -> Values:
        values = dict(zip(self.inverse.input_names, position.inputs, strict=True))
        return tuple(values[name] if name in values else position[name] for name in self._names)

    def motion_at(
        self, position: Position, rates: Sequence[float], accelerations: Sequence[float] = ()
    ) -> ExchangedMotion:
        """Return the inputs at a position with rates and accelerations of the joints."""
        none = (nan,) * len(self._names)
        motion = ExchangedMotion(self._inputs_of(position), none, none, none)
        if not (position.status.has_rates and rates and all(map(isfinite, rates))):
            return motion
        velocity = self.inverse.velocity(position, *rates)
        known = dict(zip(self.inverse.input_names, rates, strict=True))
        known |= dict(zip(self.inverse.joint_names, velocity.joints, strict=True))
        motion = motion._replace(rates=tuple(known[name] for name in self._names))
        if not (accelerations and all(map(isfinite, accelerations))):
            return motion
        acceleration = self.inverse.acceleration(position, velocity, *accelerations)
        known = dict(zip(self.inverse.input_names, accelerations, strict=True))
        known |= dict(zip(self.inverse.joint_names, acceleration.joints, strict=True))
        return motion._replace(accelerations=tuple(known[name] for name in self._names))

    def efforts_at(self, inputs: Sequence[float], efforts: Sequence[float]) -> Values:
        """Return the efforts of the inputs for those of the joints; empty if undetermined."""
        return self._carried.carry_from(self._measured.close_unlimited(*inputs), efforts)

    def joints_at(self, inputs: Sequence[float], rates: Sequence[float]) -> tuple[Values, Values]:
        """Return the joints and their rates at inputs; beyond the branch, those at its end."""
        branch = self.branch
        if branch is not None:
            turns = branch.period and branch.period * ((inputs[0] - branch.least) // branch.period)
            within = min(max(inputs[0] - turns, branch.least), branch.most)
            rates = rates if within == inputs[0] - turns else (0.0,)
            inputs = (within + turns,)
        position = self._measured.close_unlimited(*inputs)
        values = tuple(position.joints[row] for row in self._rows)
        if not position.status.has_rates:
            return values, (0.0,) * len(values)
        velocity = self._measured.velocity(position, *rates)
        return values, tuple(velocity.joints[row] for row in self._rows)


class DependentSampleReader:
    """
    Reads samples of dependent joints from serialized messages, and returns those of the inputs.

    A message names all of the joints. Where they turn back the inputs have no rates: NaN.
    """

    __slots__ = ('_exchange', '_read')

    def __init__(
        self, exchange: ExchangedInputs, joints: Sequence[str], with_efforts: bool = False
    ) -> None:
        self._exchange = exchange
        self._read = JointStateReader(joints, with_efforts).read

    def read(self, data: bytes) -> CrankSample | Rejection:
        """Return the sample of the inputs, or the reason for its rejection."""
        sample = self._read(data)
        if isinstance(sample, Rejection):
            return sample
        stamp, values, rates, _, efforts = sample
        if not all(-LARGEST <= value <= LARGEST for value in values):
            return sample  # The drive says why not.
        position = self._exchange.find_position(values)
        if position is None:
            return Rejection.NO_CRANK
        motion = self._exchange.motion_at(position, rates or ())
        if efforts is not None:
            efforts = self._exchange.efforts_at(motion.inputs, efforts) or None
        return CrankSample(stamp, motion.inputs, motion.rates if rates else None, -1, efforts)
