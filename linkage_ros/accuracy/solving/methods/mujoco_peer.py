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

from linkage_ros.accuracy.solving.methods.cut_loop import newton_on_the_cut
from linkage_ros.accuracy.solving.methods.four_bar import plain_four_bar
from linkage_ros.accuracy.solving.methods.method import Method
from linkage_ros.kinematics.linkage import Linkage
import numpy as np
from numpy.typing import NDArray

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


def mujoco(linkage: Linkage) -> Method | None:
    """Return it, of a four-bar, where it is installed; it starts where it was last."""
    shape = plain_four_bar(linkage)
    if shape is None or find_spec('mujoco') is None:
        return None
    engine = import_module('mujoco')
    model = engine.MjModel.from_xml_string(
        _MODEL.format(a=shape.a, b=shape.b, c=shape.c, d=shape.d)
    )
    data = engine.MjData(model)
    jacobians = np.zeros((2, 3, model.nv))

    def gap(angles: NDArray[np.float64]) -> NDArray[np.float64]:
        data.qpos = angles
        engine.mj_kinematics(model, data)
        engine.mj_comPos(model, data)
        one, other = data.site_xpos
        return one[:2] - other[:2]  # type: ignore[no-any-return]

    def slopes() -> NDArray[np.float64]:
        for jacobian, site in zip(jacobians, (0, 1), strict=True):
            engine.mj_jacSite(model, data, jacobian, None, site)
        return (jacobians[0] - jacobians[1])[:2, 1:]  # type: ignore[no-any-return]

    return newton_on_the_cut(shape, NAME, gap, slopes)
