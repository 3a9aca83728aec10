# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
MJCF in MuJoCo: it loads, its loops close where it starts, and it moves as the closure says.

A servo turns the input; where the engine's input then is, the closure is asked where every cut
pin should be. The engine's solver lets constraints yield, so that the two agree to a part of the
linkage's size that is measured here, and not to rounding.
"""

from cmath import rect

from linkage_ros.description import load
from linkage_ros.dynamics import Loads, Mechanics, Spring
from linkage_ros.errors import LinkageError
from linkage_ros.kinematics import usual_inputs
from linkage_ros.tools.models import model_of, ModelPart, mujoco_model
import numpy as np
import pytest

from .odd import closure_of, ODD
from .walked import moving
from ...support.scenes import LINKAGES, ONE_INPUT, size_of

mujoco = pytest.importorskip('mujoco')
AT_START, MOVING = 1e-9, 1e-4
"""What cut pins may miss each other by, of the linkage's size."""


def started(data):
    """Return the engine's model, and its state at the key frame."""
    model = mujoco.MjModel.from_xml_string(data.decode())
    state = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, state, model.key('start').id)
    mujoco.mj_forward(model, state)
    return model, state


def joint_value(model, state, name):
    return float(state.qpos[model.joint(name).qposadr[0]])


def opened(model, state):
    """Return the farthest that cut pins are apart, in [m]."""
    ends = zip(model.eq_obj1id, model.eq_obj2id, model.eq_type, strict=True)
    pins = [(a, b) for a, b, kind in ends if kind == mujoco.mjtEq.mjEQ_CONNECT]
    return max(float(np.linalg.norm(state.site_xpos[a] - state.site_xpos[b])) for a, b in pins)


def off(model, state, closure):
    """Return how far links are from where the closure has them at the engine's inputs, in [m]."""
    inputs = [joint_value(model, state, each.joint) for each in closure.linkage.inputs]
    position = closure.position(*inputs)
    points, angles = closure.points(position), closure.link_angles(position)
    worst = 0.0
    for link, named in closure.linkage.links.items():
        body = state.body(link)
        facing = complex(body.xmat[0], body.xmat[3])
        worst = max(worst, size_of(closure) * abs(facing - rect(1.0, angles[link])))
        assert body.xpos[2] == pytest.approx(0.0, abs=1e-12)
        if link != 'ground':
            place = complex(body.xpos[0], body.xpos[1])
            worst = max(worst, min(abs(place - points[link, point]) for point in named))
    return worst


CASES = [*ONE_INPUT, 'five_bar', *ODD]


def case(name):
    return closure_of(name) if name in ODD else moving(LINKAGES / f'{name}.yaml').closures[0]


@pytest.mark.sample(5)
@pytest.mark.parametrize('name', CASES)
def test_mujoco_model_starts_closed(name):
    closure = case(name)
    model, state = started(mujoco_model(name, [ModelPart(closure)]))
    assert model.neq >= 1
    assert opened(model, state) <= AT_START * size_of(closure)
    assert off(model, state, closure) <= AT_START * size_of(closure)
    for joint in (each.joint for each in closure.linkage.inputs):
        assert model.actuator(joint).trnid[0] == model.joint(joint).id
    position = closure.position(*usual_inputs(closure))
    values = dict(zip(closure.linkage.joints, position.joints, strict=True))
    inputs = zip(closure.linkage.inputs, usual_inputs(closure), strict=True)
    values |= {each.joint: value for each, value in inputs}
    names = {model.joint(i).name for i in range(model.njnt)}
    assert names >= {each.joint for each in closure.linkage.inputs}
    for joint in names & set(values):
        turned = joint_value(model, state, joint) - values[joint]
        assert abs(np.sin(0.5 * turned)) <= 1e-9


ROUNDING = 1e-14
"""Of the linkage's size: what the sums of some ten lengths round to."""


@pytest.mark.sample(5)
@pytest.mark.parametrize('name', CASES)
def test_mujoco_model_is_closed_after_reset(name):
    """Where no key is asked for, a simulation starts at qpos0: that is the same pose."""
    closure = case(name)
    model = mujoco.MjModel.from_xml_string(mujoco_model(name, [ModelPart(closure)]).decode())
    state = mujoco.MjData(model)
    mujoco.mj_resetData(model, state)
    mujoco.mj_forward(model, state)
    size = size_of(closure)
    assert opened(model, state) <= ROUNDING * size
    assert off(model, state, closure) <= ROUNDING * size
    for joint, value in zip(closure.linkage.inputs, usual_inputs(closure), strict=True):
        assert joint_value(model, state, joint.joint) == value
    # The servos pull to 0 until they are told; some linkages do not come so far, and stay whole.
    for _ in range(500):
        mujoco.mj_step(model, state)
        assert opened(model, state) <= 0.01 * size
    assert not any(warning.number for warning in state.warning)
    assert np.isfinite(state.qpos).all()


@pytest.mark.sample(5)
@pytest.mark.parametrize('name', CASES)
def test_mujoco_model_moves_as_the_closure(name):
    closure = case(name)
    model, state = started(mujoco_model(name, [ModelPart(closure)]))
    size, worst, first = size_of(closure), 0.0, state.ctrl.copy()
    sliding = [bool(each.slider) for each in closure.linkage.inputs]
    far = np.where(sliding, 0.05 * size, 0.3)
    for index in range(800):
        state.ctrl[:] = first + far * min(index / 600.0, 1.0)
        mujoco.mj_step(model, state)
        if index % 20 == 0:
            mujoco.mj_forward(model, state)
            worst = max(worst, opened(model, state), off(model, state, closure))
    moved = state.qpos[[model.joint(e.joint).qposadr[0] for e in closure.linkage.inputs]]
    assert np.all(abs(moved - first) > 0.5 * far), 'the servo did not turn it'
    assert worst <= MOVING * size


def test_mujoco_model_has_the_scene_gravity_and_springs():
    """What holds the crank against them, by virtual work over MuJoCo's forces, is our effort."""
    closure = load(LINKAGES / 'stephenson_3.yaml')
    spring = Spring('coupler', 'C', 'ground', 'O6', 40.0, 0.03, 1.5, 'pull')
    loads = Loads((1.2, -9.81), (spring,), 0.01)
    model, state = started(mujoco_model('it', [ModelPart(closure, '', loads)]))
    crank = usual_inputs(closure)[0]
    order = [model.joint(name).dofadr[0] for name in ('crank_joint', *closure.linkage.joints)]
    assert len(order) == model.nv
    h = 1e-5
    before, after = (np.array(closure.position(crank + way).joints) for way in (-h, h))
    ratios = [1.0, *((after - before) / (2.0 * h))]
    held = (state.qfrc_bias - state.qfrc_passive)[order]
    position = closure.position(crank)
    velocity = closure.velocity(position, 0.0)
    still = closure.acceleration(position, velocity, 0.0)
    (effort,) = Mechanics(closure, loads).drive_efforts(position, velocity, still)
    assert effort == pytest.approx(np.array(ratios) @ held, rel=1e-8)
    assert model.dof_armature[order[0]] == 0.01
    assert model.tendon_damping[0] == 1.5
    assert model.body('coupler').mass[0] == closure.linkage.masses['coupler'].mass
    assert model.body('coupler').inertia.max() == closure.linkage.masses['coupler'].inertia


def test_linkages_with_different_gravity_are_refused():
    (closure,) = moving(LINKAGES / 'four_bar.yaml').closures
    parts = [
        ModelPart(closure, 'a_', Loads((0.0, -9.81))),
        ModelPart(closure, 'b_', Loads((0.0, 9.81))),
    ]
    with pytest.raises(LinkageError, match=r'\[0 9.81\] differs from the first .*one'):
        mujoco_model('it', parts)


def test_scene_of_two_linkages_becomes_one_model(tmp_path):
    data = model_of(str(LINKAGES.parent / 'scenes' / 'two_fingers.yaml'), mujoco_model)
    model, state = started(data)
    assert model.nu == 2
    assert model.neq == 2
    assert opened(model, state) < 1e-10
    assert joint_value(model, state, 'left_crank_joint') == state.ctrl[0]
