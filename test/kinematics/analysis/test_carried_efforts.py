# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Efforts at some joints as those at others: statics by hand, and the power on both sides."""

from itertools import combinations
from math import cos, sin

from linkage_ros import DefinitionError, load
import numpy as np
import pytest

from ...support.scenes import closure_of


def turned(axis, angle, vector):
    """Return a vector turned about a unit axis, by Rodrigues' formula."""
    axis, vector = np.array(axis, float), np.array(vector, float)
    across = np.cross(axis, vector)
    along = axis * (axis @ vector)
    return along + (vector - along) * cos(angle) + across * sin(angle)


# A body that only two joints hold bears a force along their line: so bars carry torques on.


def moment(axis, at, point, force):
    """Return the moment of a force at a point about an axis through ``at``."""
    return float(np.cross(np.subtract(point, at), force) @ np.array(axis, float))


def lever(place, direction):
    """Return the moment of a unit force in the plane about the origin."""
    return float(place[0] * direction[1] - place[1] * direction[0])


def in_space(*plane):
    return [np.array([*point, 0.0]) for point in plane]


@pytest.mark.parametrize('crank', [0.3, 1.1, 2.4, 4.0, 5.6])
def test_carried_effort_equals_statics_along_the_coupler(crank):
    a, b, c, d = 0.04, 0.12, 0.08, 0.1
    tip = np.array([a * cos(crank), a * sin(crank)])
    across = np.array([d, 0.0]) - tip
    reach = float(np.hypot(*across))
    along = (b * b - c * c + reach * reach) / (2.0 * reach)
    left = np.array([-across[1], across[0]]) / reach
    pin = tip + across / reach * along + left * np.sqrt(b * b - along * along)
    o2, o4, tip, pin = in_space((0.0, 0.0), (d, 0.0), tip, pin)
    rod = (pin - tip) / b
    z = (0.0, 0.0, 1.0)
    torque = 1.5
    press = torque / moment(z, o2, tip, rod)
    closure = load('four_bar')
    position = closure.position(crank)
    (found,) = closure.carry_efforts(position, {'crank_joint': torque}, ['rocker_joint'])
    assert found == pytest.approx(moment(z, o4, pin, press * rod), rel=1e-12)
    (back,) = closure.carry_efforts(position, {'rocker_joint': found})
    assert back == pytest.approx(torque, rel=1e-13)
    inverse = closure.driven_by('rocker_joint', near=crank)
    there = inverse.position(position['rocker_joint'])
    assert inverse.carry_efforts(there, {'crank_joint': torque}) == pytest.approx((found,))


@pytest.mark.parametrize('motor', [0.05, 0.25, 0.7])
def test_a_motor_of_a_gripper_presses_its_parallel_pads(motor):
    # Each finger is the coupler of a parallelogram and does not turn: both pads go where the
    # knuckle's end goes, and the mirror image doubles the opening.
    x, y = -0.0344, -0.0492
    height = sin(motor) * x + cos(motor) * y
    closure = load('gripper').measuring('left_pad-right_pad')
    found = closure.carry_efforts(
        closure.position(motor), {'left_knuckle_joint': 1.2}, ['left_pad-right_pad']
    )
    assert found == pytest.approx((1.2 / (2.0 * height),), rel=1e-12)


ANKLE = {
    'm1': ((0.035, 0.0, 0.150), (0.035, 0.0165, 0.146), (0.022, 0.015, -0.010)),
    'm2': ((0.040, 0.0, 0.215), (0.040, -0.0165, 0.211), (0.022, -0.015, -0.010)),
}
"""Each motor's axis, its end of the rod, and the end at the foot, in the pose of the file."""
PITCH, ROLL, ROLL_AT = (0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, -0.018)


@pytest.mark.sample(4)
@pytest.mark.parametrize('motors', [(0.0, 0.0), (0.2, -0.1), (-0.35, 0.15), (0.3, 0.3)])
@pytest.mark.parametrize('torques', [(1.0, 0.0), (2.0, -3.0), (-0.7, -0.9)])
def test_rod_forces_turn_an_ankle_as_its_motors(motors, torques):
    closure = load('ankle_motors')
    position = closure.position(*motors)
    pitch, roll = position['pitch'], position['roll']
    on_pitch = on_roll = 0.0
    roll_axis = turned(PITCH, pitch, ROLL)
    roll_at = turned(PITCH, pitch, ROLL_AT)
    for (at, bar, foot), angle, torque in zip(ANKLE.values(), motors, torques, strict=True):
        high = np.array(at) + turned(ROLL, angle, np.subtract(bar, at))
        low = turned(PITCH, pitch, ROLL_AT + turned(ROLL, roll, np.subtract(foot, ROLL_AT)))
        assert np.linalg.norm(high - low) == pytest.approx(
            np.linalg.norm(np.subtract(bar, foot)), abs=1e-14
        )
        rod = (low - high) / np.linalg.norm(low - high)
        force = rod * torque / moment(ROLL, at, high, rod)
        on_pitch += moment(PITCH, (0.0, 0.0, 0.0), low, force)
        on_roll += moment(roll_axis, roll_at, low, force)
    given = dict(zip(ANKLE, torques, strict=True))
    found = closure.carry_efforts(position, given, ['pitch', 'roll'])
    assert found == pytest.approx((on_pitch, on_roll), rel=1e-11, abs=1e-13)
    back = closure.carry_efforts(position, {'pitch': on_pitch, 'roll': on_roll})
    assert back == pytest.approx(torques, rel=1e-10, abs=1e-12)
    inverse = closure.driven_by('pitch', 'roll')
    there = inverse.position(pitch, roll)
    assert inverse.carry_efforts(there, given) == pytest.approx(found, rel=1e-11, abs=1e-13)


NAMES = {
    'five_bar': ('P.x', 'P.y', 'left_elbow', 'right_elbow'),
    'ankle_motors': ('pitch', 'roll', 'm1'),
    'delta': ('x', 'y', 'z'),
    'rssr': ('rocker_joint', 'B.x'),
    'jansen_leg': ('foot.x', 'foot.y'),
}
STEP = 1e-5


@pytest.mark.parametrize('name', NAMES)
def test_carried_efforts_keep_the_power(name):
    plain = load(name)
    names = [each for each in NAMES[name] if each in plain.joint_names or '.' in each]
    closure = plain.measuring(*[each for each in names if each not in plain.input_names])
    count = len(closure.input_names)
    pose = [0.1 + 0.05 * k for k in range(count)]
    pose = [*(closure.linkage.pose.inputs if closure.linkage.pose else pose)]
    pose = [value + 0.03 for value in pose]
    joints = dict(zip(closure.joint_names, range(99), strict=False))
    ends = [
        [closure.position(*[v + s * STEP * (i == k) for i, v in enumerate(pose)]) for s in (-1, 1)]
        for k in range(count)
    ]
    for chosen in combinations(names, count):
        slopes = np.array(
            [
                [
                    float(each == closure.input_names[k])
                    if each in closure.input_names
                    else (after.joints[joints[each]] - before.joints[joints[each]]) / (2 * STEP)
                    for each in chosen
                ]
                for k, (before, after) in enumerate(ends)
            ]
        )
        efforts = [1.0 + 0.7 * k for k in range(count)]
        position = closure.position(*pose)
        given = dict(zip(closure.input_names, efforts, strict=True))
        found = closure.carry_efforts(position, given, chosen)
        assert slopes @ np.array(found) == pytest.approx(efforts, rel=1e-6, abs=1e-6)
        back = closure.carry_efforts(position, dict(zip(chosen, found, strict=True)))
        assert back == pytest.approx(efforts, rel=1e-9)


def test_undetermined_efforts_are_left_out():
    closure = load('four_bar')
    ends = [closure.branches('rocker_joint')[0].least, closure.branches('rocker_joint')[0].most]
    for end in ends:
        there = closure.position(end)
        assert closure.carry_efforts(there, {'crank_joint': 1.0}, ['rocker_joint']) == ()
        # The rocker's effort has no lever on the crank.
        assert closure.carry_efforts(there, {'rocker_joint': 1.0}) == pytest.approx(
            (0.0,), abs=1e-7
        )
        for off in (1e-12, 1e-9, 1e-7, 1e-5, 1e-3):
            near = closure.position(end + off)
            found = closure.carry_efforts(near, {'crank_joint': 1.0}, ['rocker_joint'])
            assert all(abs(one) <= 1e6 for one in found)
            assert bool(found) == (off > 1e-6)
    stretched = closure_of('four_bar: {a: 1, b: 1, c: 1, d: 3}')
    toggle = stretched.position(0.0)
    assert toggle.status.value == 'toggle'
    assert stretched.carry_efforts(toggle, {'rocker_joint': 1.0}) == ()
    assert closure.carry_efforts(closure.position(1.0), {'rocker_joint': float('nan')}) == ()


def test_stretched_five_bar_arm_bears_any_force_along_it():
    # Crank and forearm in one line: a force along them has no lever on either crank.
    left = 1.2
    tip = 0.2 * np.array([cos(left), sin(left)])
    away = tip - (0.12, 0.0)
    reach = float(np.hypot(*away))
    bent = np.arccos((0.09**2 + reach**2 - 0.11**2) / (2.0 * 0.09 * reach))
    closure = load('five_bar').measuring('P.x', 'P.y')
    given = {'left_crank_joint': 1.0, 'right_crank_joint': 0.5}
    for side in (-1.0, 1.0):
        right = float(np.arctan2(away[1], away[0]) + side * bent)
        position = closure.position(left, right)
        if np.hypot(position['P.x'] - tip[0], position['P.y'] - tip[1]) < 1e-9:
            break
    assert closure.carry_efforts(position, given, ['P.x', 'P.y']) == ()
    bend = closure.position(left - 0.05, right)
    force = np.array(closure.carry_efforts(bend, given, ['P.x', 'P.y']))
    elbow = 0.09 * np.array([cos(left - 0.05), sin(left - 0.05)])
    # The part along the other forearm presses on the other crank alone.
    other = np.array([0.12, 0.0]) + 0.09 * np.array([cos(right), sin(right)])
    pin = np.array([bend['P.x'], bend['P.y']])
    along = np.column_stack([(pin - elbow) / 0.11, (pin - other) / 0.11])
    one, two = np.linalg.solve(along, force)
    assert one * lever(elbow, along[:, 0]) == pytest.approx(1.0, rel=1e-9)
    assert two * lever(other - (0.12, 0.0), along[:, 1]) == pytest.approx(0.5, rel=1e-9)


@pytest.mark.parametrize(
    ('efforts', 'to', 'message'),
    [
        ({'rockr_joint': 1.0}, (), 'rockr_joint: is not a joint of the linkage; did you mean'),
        ({'rocker_joint': 1.0}, ('A.x',), 'A.x: is not a joint of the linkage; it has '),
        (
            {'crank_joint': 1.0},
            ('rocker_joint', 'coupler_joint'),
            'rocker_joint, coupler_joint: for 1 input; name 1 different joints',
        ),
    ],
)
def test_carry_efforts_refuses_wrong_joint_names(efforts, to, message):
    closure = load('four_bar')
    with pytest.raises(DefinitionError) as error:
        closure.carry_efforts(closure.position(1.0), efforts, to)
    assert message in str(error.value)
