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
The methods that a scene can choose: the closed form, Newton's method and tables.

The closed form is compiled, as in the node. Where Newton's method does not converge (next to
toggles and change points), its states are those of the closed form, which it falls back to.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from linkage_ros.accuracy.methods import ACCELERATION, Joints, Method, Motion, NOTHING, RATE
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.linkage import Linkage
from linkage_ros.kinematics.ranges import iterated
from linkage_ros.kinematics.status import Status
from linkage_ros.solvers.newton import NewtonClosure
from linkage_ros.solvers.table import Order, TableClosure

CLOSED_FORM, ITERATED = 'closed form', 'iteration from knots'
NODE_DEFAULTS = (CLOSED_FORM, ITERATED)
"""Methods of the node: the first if dyads cover the linkage, else the second."""

_CLOSED = Status.CLOSED


def closed_form(linkage: Linkage) -> Method:
    """Return the closed form; links that no dyad covers are iterated, as in the node."""
    closure = Closure(linkage)
    poses, motions = closure.compiled(0), closure.compiled(2)
    fast, fast_motion = poses.fast, motions.fast
    more = (*[RATE] * len(linkage.inputs), *[ACCELERATION] * len(linkage.inputs))

    def position(*inputs: float) -> Joints:
        (joints,) = fast(*inputs) or poses.plain(*inputs).values
        return joints

    def motion(*inputs: float) -> Motion:
        values = fast_motion(*inputs, *more)
        if values is None:
            answer = motions.plain(*inputs, *more)
            if answer.status is not _CLOSED:
                return NOTHING
            values = answer.values
        joints, rates, accelerations = values
        return joints, rates, accelerations

    of_closure = closure_method(closure, ITERATED if iterated(closure) else CLOSED_FORM)
    return of_closure._replace(position=position, motion=motion)


def closure_method(
    closure: Any,
    name: str,
    setting: str = '',
    memory: int | None = None,
    build: float | None = None,
) -> Method:
    """Return a closure, or an object with the same calls, as a method."""
    linkage: Linkage = closure.linkage
    rates = [RATE] * len(linkage.inputs)
    accelerations = [ACCELERATION] * len(linkage.inputs)
    solve, solve_velocity, solve_acceleration = (
        closure.position,
        closure.velocity,
        closure.acceleration,
    )

    def position(*inputs: float) -> Joints:
        joints: Joints = solve(*inputs).joints
        return joints

    def motion(*inputs: float) -> Motion:
        found = solve(*inputs)
        if found.status is not _CLOSED:
            return NOTHING
        velocity = solve_velocity(found, *rates)
        change = solve_acceleration(found, velocity, *accelerations)
        return found.joints, velocity.joints, change.joints

    def batch(inputs: Sequence[Any], derivatives: int) -> Sequence[Any]:
        found: Sequence[Any] = closure.solve(
            *inputs, rates=rates, accelerations=accelerations, derivatives=derivatives
        )
        end = 2 + derivatives
        return found[1:end]

    return Method(
        name,
        setting,
        position,
        motion,
        batch if hasattr(closure, 'solve') else None,
        memory,
        build,
    )


FROM_KNOTS, WARM, COLD = 'Newton, from knots', 'Newton, warm', 'Newton, cold'

STARTS = {FROM_KNOTS: None, WARM: True, COLD: False}
"""Start of the iteration: the nearest of 256 knots a turn, the last state, or always one pose."""


def newton(linkage: Linkage, tolerance: float, name: str) -> Method:
    """Return Newton's method from one of `STARTS`, to a last correction in [rad] or [m]."""
    closure = NewtonClosure(linkage, tolerance, warm=STARTS[name])
    method = closure_method(closure, name, f'tolerance {tolerance:.0e}')
    # It solves the states of an array one after the other.
    return method._replace(batch=None, remembers=name == WARM)


TABLES: dict[Order, str] = {'linear': 'table, linear', 'hermite': 'table, Hermite'}


def table(linkage: Linkage, knots: int, order: Order) -> Method:
    """Return a table as a method, with its memory and the time to build it."""
    closure = TableClosure(linkage, knots=knots, order=order)
    return closure_method(
        closure, TABLES[order], f'{knots:,} knots', closure.memory, closure.build_time
    )
