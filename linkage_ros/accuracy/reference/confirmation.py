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


"""Whether the two references say the same, at some of the states that methods are measured at."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec
from typing import Any

from linkage_ros.accuracy.reference.reference import Truth
from linkage_ros.accuracy.solving.methods.method import ACCELERATION, RATE
from linkage_ros.accuracy.solving.poses import Poses
from linkage_ros.kinematics.linkage import Linkage, RevoluteJoint

PROVED = 1e-40
"""Radius of a ball that proves a number, of 1 or of itself where that is more."""

_SAMPLE = 3


def confirmed(poses: Poses, truths: Sequence[Truth]) -> int:
    """
    Return how many states were confirmed by balls; none where python-flint is not installed.

    Raises
    ------
    ArithmeticError
        Where the references differ.

    """
    if find_spec('flint') is None:
        return 0
    from linkage_ros.accuracy.reference.enclosure import prove  # local import: an extra of its own

    driven = len(poses.linkage.inputs)
    rates, accelerations = [RATE] * driven, [ACCELERATION] * driven
    chosen = range(0, len(truths), max(1, len(truths) // _SAMPLE))
    for k in chosen:
        proof = prove(poses.linkage, poses.inputs[k], rates, accelerations)
        if not same(poses.linkage, proof, truths[k]):
            raise ArithmeticError(f'{poses.name} at {poses.inputs[k]}: the references differ')
    return len(chosen)


def same(linkage: Linkage, proof: Any, truth: Truth) -> bool:
    """Return whether small balls hold joints, rates and accelerations, angles modulo 2π."""
    from flint import arb, ctx  # local import: an extra

    before, ctx.prec = ctx.prec, 512
    try:
        for order, (balls, values) in enumerate(zip(proof, truth.orders, strict=True)):
            joints = linkage.joints.values()
            for joint, ball, value in zip(joints, balls, values, strict=True):
                number = arb(value.context.nstr(value, 100))
                if isinstance(joint, RevoluteJoint) and not order:
                    turn = 2 * arb.pi()
                    number -= turn * round(float(((number - ball) / turn).mid()))
                enough = PROVED * max(1.0, abs(float(value)))
                if float(ball.rad()) > enough or not (number + arb(0, enough)).overlaps(ball):
                    return False
    finally:
        ctx.prec = before
    return True
