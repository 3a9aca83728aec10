# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Samples of a dependent joint, turned into samples of the crank on a branch of that joint."""

from __future__ import annotations

from math import floor, isfinite, isnan, nan
from typing import TYPE_CHECKING

from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics import Closure
from linkage_ros.messages import CrankSample, JointStateReader, Rejection
from linkage_ros.stages.drives.drive import LARGEST

if TYPE_CHECKING:
    from linkage_ros.kinematics import CrankBranch


def sampled_branch(closure: Closure, joint: str, number: int) -> CrankBranch:
    """
    Return the branch of a joint by its number; 0 means the only branch.

    Raise the errors of `Closure.driven_by`, with the key of the scene.
    """
    if (count := len(closure.linkage.inputs)) > 1:
        raise DefinitionError(
            'drive.topic.joint',
            f'one joint does not determine {count} inputs',
            'leave it out, and send the inputs; or name other joints as inputs of the linkage',
        )
    try:
        return closure.find_branch(joint, number or None)
    except DefinitionError as error:
        key = 'drive.topic.branch' if number else 'drive.topic.joint'
        raise DefinitionError(key, f'{error.where}: {error.reason}', error.remedy) from None


def crank_of(branch: CrankBranch, value: float, rate: float) -> tuple[float, float]:
    """Return the crank and its rate for a value of the joint that is reached, and its rate."""
    crank, slope = branch.find_crank(value)
    if abs(slope) < branch.flat:
        return crank, nan
    return crank, rate / (branch.evaluate(crank)[1] if isfinite(slope) else slope)


def joint_of(branch: CrankBranch, crank: float, rate: float) -> tuple[float, float]:
    """Return the joint and its rate for a crank and its rate; at rest at the end of the branch."""
    turns = floor((crank - branch.least) / branch.period) if branch.period else 0
    crank -= turns * branch.period
    within = min(max(crank, branch.least), branch.most)
    value, slope = branch.evaluate(within)
    value += turns * (branch.rise if branch.rises else -branch.rise)
    return value, rate * slope if within == crank else 0.0


class DependentSampleReader:
    """
    Reads samples of a dependent joint from serialized messages, and returns the crank's samples.

    Where the joint turns back, the crank has no rate: it is absent, NaN.
    """

    __slots__ = ('_branch', '_read')

    def __init__(self, branch: CrankBranch, joint: str) -> None:
        self._branch = branch
        self._read = JointStateReader([joint]).read

    def read(self, data: bytes) -> CrankSample | Rejection:
        """Return the sample of the crank, or the reason for its rejection."""
        sample = self._read(data)
        if isinstance(sample, Rejection):
            return sample
        stamp, (value,), rates, _ = sample
        if not -LARGEST <= value <= LARGEST:
            return sample  # The drive says why not.
        if self._branch.distance_beyond(value):
            return Rejection.NO_CRANK
        crank, rate = crank_of(self._branch, value, rates[0] if rates else nan)
        if isnan(crank):
            return Rejection.NO_CRANK
        return CrankSample(stamp, (crank,), (rate,) if rates else None)
