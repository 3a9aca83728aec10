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


"""MuJoCo: its places and Jacobians of sites, and Newton's method on where the loop is cut."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from math import atan2, cos, sin, sqrt

from linkage_ros.accuracy.solving.methods.four_bar import plain_four_bar
from linkage_ros.accuracy.solving.methods.method import Joints, Method
from linkage_ros.kinematics.linkage import Linkage
import numpy as np

NAME = 'MuJoCo'

_MODEL = """
<mujoco>
  <worldbody>
    <body name="crank">
      <joint type="hinge" axis="0 0 1"/><geom size="0.01" mass="1"/>
      <body name="coupler" pos="{a!r} 0 0">
        <joint type="hinge" axis="0 0 1"/><geom size="0.01" mass="1"/>
        <site name="one" pos="{b!r} 0 0"/>
      </body>
    </body>
    <body name="rocker" pos="{d!r} 0 0">
      <joint type="hinge" axis="0 0 1"/><geom size="0.01" mass="1"/>
      <site name="other" pos="{c!r} 0 0"/>
    </body>
  </worldbody>
</mujoco>
"""

_ENOUGH = 1e-14
"""Of the linkage's size: a gap at which the iteration ends."""

_STEPS = 20


def mujoco(linkage: Linkage) -> Method | None:
    """Return it, of a four-bar, where it is installed; it starts where it was last."""
    shape = plain_four_bar(linkage)
    if shape is None or find_spec('mujoco') is None:
        return None
    engine = import_module('mujoco')
    a, b, c, d, side, turn, offset, _ = shape
    model = engine.MjModel.from_xml_string(_MODEL.format(a=a, b=b, c=c, d=d))
    data = engine.MjData(model)
    jacobians = np.zeros((2, 3, model.nv))
    enough, joints = _ENOUGH * (a + b + c + d), shape.joints
    told = False

    def position(angle: float) -> Joints:
        nonlocal told
        theta = turn * angle + offset
        data.qpos[0] = theta
        if not told:
            x, y = a * cos(theta), a * sin(theta)
            across = complex(d - x, -y)
            s = abs(across)
            along = 0.5 * (s + (b - c) * (b + c) / s)
            up = complex(along, side * sqrt(max(b * b - along * along, 0.0))) * (across / s)
            data.qpos[1] = atan2(up.imag, up.real) - theta
            data.qpos[2] = atan2(y + up.imag, x + up.real - d)
            told = True
        for _ in range(_STEPS):
            engine.mj_kinematics(model, data)
            engine.mj_comPos(model, data)
            one, other = data.site_xpos
            gap = one[:2] - other[:2]
            if abs(gap[0]) + abs(gap[1]) <= enough:
                break
            for jacobian, site in zip(jacobians, (0, 1), strict=True):
                engine.mj_jacSite(model, data, jacobian, None, site)
            slopes = (jacobians[0] - jacobians[1])[:2, 1:]
            try:
                data.qpos[1:] -= np.linalg.solve(slopes, gap)
            except np.linalg.LinAlgError:
                return ()
        _, coupler, rocker = data.qpos.tolist()
        return joints((0.0, theta, theta + coupler, rocker))

    return Method(NAME, 'Newton on the loop', position, remembers=True)
