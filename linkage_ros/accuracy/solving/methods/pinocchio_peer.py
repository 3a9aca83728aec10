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

"""Pinocchio: its places and Jacobians of frames, and Newton's method on where the loop is cut."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec

from linkage_ros.accuracy.solving.methods.cut_loop import newton_on_the_cut
from linkage_ros.accuracy.solving.methods.four_bar import plain_four_bar
from linkage_ros.accuracy.solving.methods.method import Method
from linkage_ros.kinematics.linkage import Linkage
import numpy as np
from numpy.typing import NDArray

NAME = 'Pinocchio'


def pinocchio(linkage: Linkage) -> Method | None:
    """Return it, of a four-bar, where it is installed; it starts where it was last."""
    shape = plain_four_bar(linkage)
    if shape is None or find_spec('pinocchio') is None:
        return None
    engine = import_module('pinocchio')
    model = engine.Model()

    def at(x: float) -> object:
        return engine.SE3(np.eye(3), np.array([x, 0.0, 0.0]))

    def link(parent: int, x: float, name: str) -> int:
        joint: int = model.addJoint(parent, engine.JointModelRZ(), at(x), name)
        return joint

    def end(joint: int, x: float, name: str) -> int:
        frame = engine.Frame(name, joint, 0, at(x), engine.FrameType.OP_FRAME)
        number: int = model.addFrame(frame)
        return number

    coupler = link(link(0, 0.0, 'crank'), shape.a, 'coupler')
    rocker = link(0, shape.d, 'rocker')
    ends = end(coupler, shape.b, 'one'), end(rocker, shape.c, 'other')
    data = model.createData()
    one, other = (data.oMf[frame] for frame in ends)
    facing = engine.ReferenceFrame.LOCAL_WORLD_ALIGNED

    def gap(angles: NDArray[np.float64]) -> NDArray[np.float64]:
        engine.computeJointJacobians(model, data, angles)
        engine.updateFramePlacements(model, data)
        return (one.translation - other.translation)[:2]  # type: ignore[no-any-return]

    def slopes() -> NDArray[np.float64]:
        first, second = (engine.getFrameJacobian(model, data, frame, facing) for frame in ends)
        return (first - second)[:2, 1:]  # type: ignore[no-any-return]

    return newton_on_the_cut(shape, NAME, gap, slopes)
