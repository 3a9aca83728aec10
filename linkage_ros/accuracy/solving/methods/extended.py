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
Extended precision: Newton's method in mpmath on all constraints, until 30 digits are right.

It is the reference itself with fewer digits, and so its error is against one with more.
"""

from __future__ import annotations

from linkage_ros.accuracy.reference.reference import Reference, SingularError
from linkage_ros.accuracy.solving.methods.method import (
    ACCELERATION,
    Joints,
    Method,
    Motion,
    NOTHING,
    RATE,
)
from linkage_ros.kinematics.linkage import Linkage

NAME = 'extended precision'

_DIGITS, _GUARD = 30, 8


def extended(linkage: Linkage) -> Method:
    """Return it; rates and accelerations come with the position, whether asked for or not."""
    reference = Reference(linkage, _DIGITS, _GUARD)
    driven = len(linkage.inputs)
    rates, accelerations = [RATE] * driven, [ACCELERATION] * driven

    def position(*inputs: float) -> Joints:
        return motion(*inputs)[0]

    def motion(*inputs: float) -> Motion:
        try:
            truth = reference.solve(inputs, rates, accelerations)
        except (SingularError, ValueError):
            return NOTHING
        return truth.joints, truth.rates, truth.accelerations

    return Method(NAME, f'{_DIGITS} digits', position, motion, together=True)
