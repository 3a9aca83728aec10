# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Spatial linkages in MuJoCo: the model loads, starts closed, and moves as the closure says."""

from linkage_ros.description import load
from linkage_ros.dynamics import Loads, Mechanics
from linkage_ros.errors import LinkageError
from linkage_ros.kinematics import Closure, SpatialMass
from linkage_ros.resources import spatial_linkage_names
from linkage_ros.tools.models import model_of, ModelPart, mujoco_model
import numpy as np
import pytest

from .test_mjcf import joint_value, started

mujoco = pytest.importorskip('mujoco')
AT_START, MOVING = 1e-12, 5e-5
"""What joints and points may be off, of the linkage's size."""


def off(model, state, closure):
    """Return how far sites and joints are from where the closure has them, of the size."""
    inputs = [joint_value(model, state, each.joint) for each in closure.linkage.inputs]
    position = closure.position(*inputs)
    points = closure.points(position)
    worst, compared = 0.0, 0
    for number in range(model.nsite):
        point = model.site(number).name.split('_on_')[0]
        if point in points:
            far = np.linalg.norm(state.site_xpos[number] - points[point])
            worst, compared = max(worst, float(far)), compared + 1
    names = {model.joint(number).name for number in range(model.njnt)}
    for name, value in zip(closure.joint_names, position.joints, strict=True):
        if name in names:
            apart = joint_value(model, state, name) - value
            turns = name in closure.linkage.hinges
            worst = max(worst, abs(2.0 * np.sin(0.5 * apart)) * closure.scale if turns else apart)
            compared += 1
    assert compared
    return worst / closure.scale


@pytest.mark.sample(2)
@pytest.mark.parametrize('name', spatial_linkage_names())
def test_spatial_mjcf_starts_closed_and_moves_as_the_closure(name):
    closure = load(name)
    model, state = started(mujoco_model(name, [ModelPart(closure)]))
    assert model.neq >= 1
    assert off(model, state, closure) <= AT_START
    sliding = [bool(each.slider) for each in closure.linkage.inputs]
    far, first, worst = np.where(sliding, 0.03 * closure.scale, 0.2), state.ctrl.copy(), 0.0
    for index in range(800):
        state.ctrl[:] = first + far * min(index / 600.0, 1.0)
        mujoco.mj_step(model, state)
        if index % 20 == 0:
            mujoco.mj_forward(model, state)
            worst = max(worst, off(model, state, closure))
    moved = [joint_value(model, state, each.joint) for each in closure.linkage.inputs]
    assert np.all(abs(moved - first) > 0.5 * far), 'the servo did not turn it'
    assert worst <= MOVING
    assert not any(warning.number for warning in state.warning)


def test_masses_and_gravity_are_those_of_the_scene():
    model, state = started(model_of('torque_ankle', mujoco_model))
    assert model.opt.gravity.tolist() == [0.0, 0.0, -9.81]
    closure = load('ankle_motors')
    given = sum(mass.mass for mass in closure.linkage.masses.values())
    assert model.body_mass.sum() == pytest.approx(given, rel=0.01)
    for _ in range(8000):
        mujoco.mj_step(model, state)
    # What the servos hold, at rest, is what the links weigh on the motors.
    inputs = [joint_value(model, state, name) for name in ('m1', 'm2')]
    position = closure.position(*inputs)
    still = closure.velocity(position, 0.0, 0.0)
    rest = closure.acceleration(position, still, 0.0, 0.0)
    mechanics = Mechanics(closure, Loads((0.0, 0.0, -9.81)))
    expected = mechanics.drive_efforts(position, still, rest)
    assert max(map(abs, expected)) > 0.1
    # The bodies of rods that the linkage does not weigh have a thousandth each.
    assert state.actuator_force == pytest.approx(expected, rel=0.02, abs=0.01)


def test_a_massless_link_with_points_is_refused():
    rocker = SpatialMass(1.0, (0.1, 0.0, 0.1), (1.0, 0.0, 0.0, 1.0, 0.0, 1.0))
    linkage = load('rssr').linkage.with_masses({'rocker': rocker}, ('crank', 'rod'))
    with pytest.raises(LinkageError, match=r'masses.*MuJoCo moves no massless body'):
        mujoco_model('x', [ModelPart(Closure(linkage))])
