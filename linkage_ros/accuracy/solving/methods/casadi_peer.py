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

"""CasADi: the loop as an expression, and its fast Newton with the derivatives that it forms."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec

from linkage_ros.accuracy.solving.methods.four_bar import plain_four_bar
from linkage_ros.accuracy.solving.methods.method import Joints, Method
from linkage_ros.kinematics.linkage import Linkage
import numpy as np

NAME = 'CasADi'

_OPTIONS = {'abstol': 1e-14, 'max_iter': 20}
"""It ends where the loop is open by less than this part of the linkage's size."""


def casadi(linkage: Linkage) -> Method | None:
    """Return it, of a four-bar, where it is installed; it starts where it was last."""
    shape = plain_four_bar(linkage)
    if shape is None or find_spec('casadi') is None:
        return None
    made_with = import_module('casadi')
    angle, unknown = made_with.SX.sym('crank'), made_with.SX.sym('coupler_and_rocker', 2)
    coupler, rocker = unknown[0], unknown[1]
    lengths = (shape.a, shape.b, shape.c, shape.d)
    a, b, c, d = (length / sum(lengths) for length in lengths)
    cos, sin = made_with.cos, made_with.sin
    open_by = made_with.vertcat(
        a * cos(angle) + b * cos(coupler) - c * cos(rocker) - d,
        a * sin(angle) + b * sin(coupler) - c * sin(rocker),
    )
    problem = {'x': unknown, 'p': angle, 'g': open_by}
    solver = made_with.rootfinder('loop', 'fast_newton', problem, _OPTIONS)
    # As its manual has it for calls from Python: memory that both look at, no copies.
    buffer, solve = solver.buffer()
    start, given, found = np.zeros(2), np.zeros(1), np.zeros(2)
    buffer.set_arg(0, start.data)
    buffer.set_arg(1, given.data)
    buffer.set_res(0, found.data)
    joints = shape.joints
    told = False

    def position(angle: float) -> Joints:
        nonlocal told
        given[0] = theta = shape.turn * angle + shape.offset
        if not told:
            start[:] = shape.closed_at(theta)
            told = True
        try:
            solve()
        except RuntimeError:  # It did not converge.
            return ()
        if buffer.ret():  # Whoever solves also keeps the buffer: without it the call crashes.
            return ()
        start[:] = found
        coupler, rocker = found.tolist()
        return joints((0.0, theta, coupler, rocker))

    return Method(NAME, '', position, remembers=True)
