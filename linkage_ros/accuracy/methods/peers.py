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
Methods of other packages, each imported only where it is measured.

Engines of rigid bodies know a tree of links, the positions of their points and their Jacobians,
but no loops. So the four-bar is cut where coupler and rocker meet, and Newton's method closes the
gap.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from math import atan2, cos, sin

from linkage_ros.accuracy.methods import Joints, Method
from linkage_ros.accuracy.methods.formulas import plain_four_bar, PlainFourBar
from linkage_ros.kinematics.linkage import Linkage
import numpy as np
from numpy.typing import NDArray

Gap = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""Takes the angles of crank, coupler to crank, and rocker [rad]; returns the gap, (2,) [m]."""

Slopes = Callable[[], NDArray[np.float64]]
"""Returns the gap's derivatives by the latter two there, (2, 2) [m]."""

_ENOUGH = 1e-14
"""Gap at which the iteration ends, relative to the linkage's size."""

_STEPS = 20


def newton_on_the_cut(shape: PlainFourBar, name: str, gap: Gap, slopes: Slopes) -> Method:
    """Return a method of this name, which starts from its last state."""
    enough, joints = _ENOUGH * (shape.a + shape.b + shape.c + shape.d), shape.joints
    angles = np.zeros(3)
    started = False

    def position(angle: float) -> Joints:
        nonlocal started
        angles[0] = theta = shape.turn * angle + shape.offset
        if not started:
            coupler, rocker = shape.closed_at(theta)
            angles[1:] = coupler - theta, rocker
            started = True
        for _ in range(_STEPS):
            apart = gap(angles)
            if abs(apart[0]) + abs(apart[1]) <= enough:
                break
            try:
                angles[1:] -= np.linalg.solve(slopes(), apart)
            except np.linalg.LinAlgError:
                return ()
        _, coupler, rocker = angles.tolist()
        return joints((0.0, theta, theta + coupler, rocker))

    return Method(name, 'Newton on the loop', position, remembers=True)


CASADI = 'CasADi'

_OPTIONS = {'abstol': 1e-14, 'max_iter': 20}
"""The tolerance is relative to the linkage's size."""


def casadi(linkage: Linkage) -> Method | None:
    """Return CasADi for a four-bar if it is installed; it starts from its last state."""
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
    # As its manual advises for calls from Python: shared memory, no copies.
    buffer, solve = solver.buffer()
    start, given, found = np.zeros(2), np.zeros(1), np.zeros(2)
    buffer.set_arg(0, start.data)
    buffer.set_arg(1, given.data)
    buffer.set_res(0, found.data)
    joints = shape.joints
    started = False

    def position(angle: float) -> Joints:
        nonlocal started
        given[0] = theta = shape.turn * angle + shape.offset
        if not started:
            start[:] = shape.closed_at(theta)
            started = True
        try:
            solve()
        except RuntimeError:  # It did not converge.
            return ()
        if buffer.ret():  # This function must hold the buffer: without it the call crashes.
            return ()
        start[:] = found
        coupler, rocker = found.tolist()
        return joints((0.0, theta, coupler, rocker))

    return Method(CASADI, '', position, remembers=True)


MUJOCO = 'MuJoCo'

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
    """Return MuJoCo for a four-bar if it is installed; it starts from its last state."""
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

    return newton_on_the_cut(shape, MUJOCO, gap, slopes)


PINOCCHIO = 'Pinocchio'


def pinocchio(linkage: Linkage) -> Method | None:
    """Return Pinocchio for a four-bar if it is installed; it starts from its last state."""
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

    return newton_on_the_cut(shape, PINOCCHIO, gap, slopes)


PYLINKAGE = 'pylinkage'


def pylinkage(linkage: Linkage) -> Method | None:
    """
    Return pylinkage for a four-bar, or None if it is not installed.

    It takes the assembly that is nearest to its last state; the first one is given to it.
    """
    shape = plain_four_bar(linkage)
    if shape is None or find_spec(PYLINKAGE) is None:
        return None
    components = import_module('pylinkage.components')
    actuators, dyads = import_module('pylinkage.actuators'), import_module('pylinkage.dyads')
    failure = import_module('pylinkage.exceptions').UnbuildableError
    a, b, c, d, _, turn, offset, _ = shape
    crank = actuators.Crank(anchor=components.Ground(0.0, 0.0), radius=a)
    other = components.Ground(d, 0.0)
    pin = dyads.RRRDyad(crank.output, other, b, c, x=0.0, y=0.0)
    joints = shape.joints
    started = False

    def position(angle: float) -> Joints:
        nonlocal started
        theta = turn * angle + offset
        x, y = a * cos(theta), a * sin(theta)
        crank.x, crank.y = x, y
        if not started:
            _, rocker = shape.closed_at(theta)
            pin.x, pin.y = d + c * cos(rocker), c * sin(rocker)
            started = True
        try:
            pin.reload(0)
        except failure:
            return ()
        return joints((0.0, theta, atan2(pin.y - y, pin.x - x), atan2(pin.y, pin.x - d)))

    return Method(PYLINKAGE, '', position, remembers=True)
