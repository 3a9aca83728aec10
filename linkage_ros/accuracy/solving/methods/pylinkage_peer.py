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


"""pylinkage: the pin of coupler and rocker where two circles meet, next to where it was last."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from math import atan2, cos, sin

from linkage_ros.accuracy.solving.methods.four_bar import plain_four_bar
from linkage_ros.accuracy.solving.methods.method import Joints, Method
from linkage_ros.kinematics.linkage import Linkage

NAME = 'pylinkage'


def pylinkage(linkage: Linkage) -> Method | None:
    """
    Return it, of a four-bar, where it is installed.

    It takes the assembly that is nearest to its last state; of the first it is told which.
    """
    shape = plain_four_bar(linkage)
    if shape is None or find_spec(NAME) is None:
        return None
    components = import_module('pylinkage.components')
    actuators, dyads = import_module('pylinkage.actuators'), import_module('pylinkage.dyads')
    failure = import_module('pylinkage.exceptions').UnbuildableError
    a, b, c, d, _, turn, offset, _ = shape
    crank = actuators.Crank(anchor=components.Ground(0.0, 0.0), radius=a)
    other = components.Ground(d, 0.0)
    pin = dyads.RRRDyad(crank.output, other, b, c, x=0.0, y=0.0)
    joints = shape.joints
    told = False

    def position(angle: float) -> Joints:
        nonlocal told
        theta = turn * angle + offset
        x, y = a * cos(theta), a * sin(theta)
        crank.x, crank.y = x, y
        if not told:
            _, rocker = shape.closed_at(theta)
            pin.x, pin.y = d + c * cos(rocker), c * sin(rocker)
            told = True
        try:
            pin.reload(0)
        except failure:
            return ()
        return joints((0.0, theta, atan2(pin.y - y, pin.x - x), atan2(pin.y, pin.x - d)))

    return Method(NAME, '', position, remembers=True)
