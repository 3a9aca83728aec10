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
The four-bar's textbook form: a quadratic in the height of the pin, with K1 … K4.

With A = (a·cos θ2, a·sin θ2) the pin of the crank, (Bx, By) that of coupler and rocker::

    K1 = (b² − c² − a² + d²)/(2(d − Ax))      K2 = Ay/(d − Ax)           Bx = K1 + K2·By
    K3 = 2(d − K1)·K2/(K2² + 1)               K4 = ((d − K1)² − c²)/(K2² + 1)
    By = K3/2 ± √((K3/2)² − K4)

It divides by zero where A stands above or below the rocker's pivot, Ax = d, an ordinary pose, and
loses digits near it; the root's sign is not the assembly: on the other side of that pose the same
sign belongs to the other. It is taken as it is printed, with one sign throughout. It has no rates.
"""

from __future__ import annotations

from math import atan2, cos, sin, sqrt

from linkage_ros.accuracy.solving.methods.four_bar import plain_four_bar
from linkage_ros.accuracy.solving.methods.method import Joints, Method
from linkage_ros.kinematics.linkage import Linkage

NAME = 'textbook form'


def textbook(linkage: Linkage) -> Method | None:
    """Return it, of a four-bar."""
    shape = plain_four_bar(linkage)
    if shape is None:
        return None
    a, b, c, d, sign, turn, offset, _ = shape
    joints = shape.joints

    def position(angle: float) -> Joints:
        theta = turn * angle + offset
        ax, ay = a * cos(theta), a * sin(theta)
        try:
            k1 = (b**2 - c**2 - a**2 + d**2) / (2.0 * (d - ax))
            k2 = ay / (d - ax)
            k3 = 2.0 * (d - k1) * k2 / (k2**2 + 1.0)
            k4 = ((d - k1) ** 2 - c**2) / (k2**2 + 1.0)
            by = 0.5 * k3 + sign * sqrt((0.5 * k3) ** 2 - k4)
        except (ZeroDivisionError, ValueError):
            return ()
        bx = k1 + k2 * by
        return joints((0.0, theta, atan2(by - ay, bx - ax), atan2(by, bx - d)))

    return Method(NAME, '', position)
