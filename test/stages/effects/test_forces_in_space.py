# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Scenes of spatial linkages: forces in joints, and what play and stretch move, in an RSSR."""

from linkage_ros.errors import FileError
import numpy as np
import pytest

from ...support.messages import read_joint_state, STORE
from ...support.multipliers import AbsoluteMotion
from ...support.scenes import pipeline_of

BEGIN = 1_700_000_000_000_000_000
TYPE = 'sensor_msgs/msg/MultiDOFJointState'
RSSR = b"""
points: {A: [0.04, 0, 0], B: [0.1, 0.02, 0.12]}
links: {crank: [A], rod: [A, B], rocker: [B]}
hinges:
  crank_joint: {parent: ground, child: crank, at: [0, 0, 0], axis: [0, 0, 1]}
  rocker_joint: {parent: ground, child: rocker, at: [0.15, 0.05, 0.03], axis: [0, 1, 0.3]}
input: crank_joint
masses:
  crank: {mass: 0.1, center: [0.01, 0, 0.01], inertia: [1e-4, 0, 0, 1e-4, 0, 2e-4]}
  rod: {mass: 0.05}
  rocker: {mass: 0.3, center: [0.12, 0.05, 0.06], inertia: [3e-4, 0, 1e-5, 2e-4, 0, 1e-4]}
"""
GRAVITY = (0.0, 0.0, -9.81)
SCENE = """
drive: {{constant_rate: {{rate: 9, start: 0.3}}}}
loads: {{gravity: [0, 0, -9.81]}}
effects: {{{}}}
"""


def pipeline(effects, linkage=RSSR):
    return pipeline_of(SCENE.format(effects).encode(), linkage)


def at_times():
    return [BEGIN + 37_000_000 * count for count in range(12)]


def test_spatial_pin_forces_are_published_as_wrenches():
    at_work = pipeline('pin_forces: {}')
    closure = at_work.linkages[0].closure
    for now in at_times():
        tick = at_work.tick(now)
        message = STORE.deserialize_cdr(tick.extras[0], TYPE)
        assert message.joint_names == ['crank_joint', 'rocker_joint', 'A', 'B']
        crank = tick.states[0].crank
        motion = AbsoluteMotion(closure, crank.angles, crank.rates, crank.accelerations)
        wrenches = motion.wrenches(GRAVITY)
        pairs = ('crank', 'ground'), ('rocker', 'ground'), ('crank', 'rod'), ('rocker', 'rod')
        for pair, sign, wrench in zip(pairs, (1, 1, -1, 1), message.wrench, strict=True):
            found = [wrench.force.x, wrench.force.y, wrench.force.z]
            assert found == pytest.approx(sign * wrenches[pair][0], rel=1e-9, abs=1e-11)
        torque = message.wrench[1].torque
        place = np.array([0.15, 0.05, 0.03])
        expected = wrenches['rocker', 'ground'][1] - np.cross(
            place, wrenches['rocker', 'ground'][0]
        )
        found = [torque.x, torque.y, torque.z]
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-11)


def rocker_by_hand(motion, stretch, moved_start, moved_end):
    """Return how far the rocker turns if the rod is longer, and its ends are moved."""
    places = [
        motion.place('crank', (0.04, 0.0, 0.0)), motion.place('rocker', (0.1, 0.02, 0.12))
    ]  # fmt: skip
    along = places[1] - places[0]
    along /= np.linalg.norm(along)
    axis = np.array([0.0, 1.0, 0.3]) / np.hypot(1.0, 0.3)
    swung = np.cross(axis, places[1] - np.array([0.15, 0.05, 0.03]))
    return (stretch + along @ (moved_start - moved_end)) / (along @ swung), along


def differences(effects):
    """Yield the motion, and how far an effect moves the rocker."""
    plain, moved = pipeline('effort: {}'), pipeline(effects)
    closure = plain.linkages[0].closure
    for now in at_times():
        tick = plain.tick(now)
        crank = tick.states[0].crank
        motion = AbsoluteMotion(closure, crank.angles, crank.rates, crank.accelerations)
        before, after = (
            read_joint_state(one.message).position[1] for one in (tick, moved.tick(now))
        )
        yield motion, motion.wrenches(GRAVITY), after - before


def test_spatial_rod_stretches_under_its_force():
    none = np.zeros(3)
    for motion, wrenches, moved in differences('compliance: {links: {rod: 1.0e+4}}'):
        _, along = rocker_by_hand(motion, 0.0, none, none)
        # Forces on the rod: the rocker's is the opposite of its own.
        at_a, at_b = -wrenches['crank', 'rod'][0], -wrenches['rocker', 'rod'][0]
        stretch = 0.5 * (at_b - at_a) @ along / 1.0e4
        expected, _ = rocker_by_hand(motion, stretch, none, none)
        assert moved == pytest.approx(expected, rel=1e-9, abs=1e-15)


def test_ball_and_hinge_clearance_move_the_rocker():
    none, axis = np.zeros(3), np.array([0.0, 1.0, 0.3]) / np.hypot(1.0, 0.3)
    for motion, wrenches, moved in differences('clearance: {pins: {B: 1.0e-5}}'):
        force = wrenches['rocker', 'rod'][0]
        hung = -1.0e-5 * force / np.linalg.norm(force)
        # The rocker's point is displaced from the rod's.
        expected, _ = rocker_by_hand(motion, 0.0, -hung, none)
        assert moved == pytest.approx(-expected, rel=1e-9, abs=1e-15)
    for motion, wrenches, moved in differences('clearance: {pins: {rocker_joint: 1.0e-5}}'):
        force = wrenches['rocker', 'ground'][0]
        force = force - axis * (axis @ force)
        hung = -1.0e-5 * force / np.linalg.norm(force)
        expected, _ = rocker_by_hand(motion, 0.0, none, hung)
        assert moved == pytest.approx(expected, rel=1e-9, abs=1e-15)


FLAT_LOOP = b"""
points: {P: [0.07, 0.12, 0.02], Q: [0.07, 0.12, 0.2]}
links: {coupler: [P], rod: [P, Q], lift: [Q]}
hinges:
  crank_joint: {parent: ground, child: crank, at: [0, 0, 0], axis: [0, 0, 1]}
  a: {parent: crank, child: coupler, at: [0.04, 0, 0], axis: [0, 0, 1]}
  b: {parent: coupler, child: rocker, at: [0.1, 0.1, 0], axis: [0, 0, 1]}
  rocker_joint: {parent: ground, child: rocker, at: [0.12, 0, 0], axis: [0, 0, 1]}
slides:
  lift_slide: {parent: ground, child: lift, axis: [0, 0, 1]}
input: crank_joint
joints: [rocker_joint, lift_slide]
masses:
  rod: {mass: 0.1}
  lift: {mass: 0.1, center: [0.07, 0.12, 0.2], inertia: [1e-5, 0, 0, 1e-5, 0, 1e-5]}
  crank: {mass: 0.1, center: [0.01, 0, 0], inertia: [1e-4, 0, 0, 1e-4, 0, 2e-4]}
  coupler: {mass: 0.2, center: [0.05, 0.02, 0], inertia: [1e-4, 0, 0, 1e-4, 0, 2e-4]}
  rocker: {mass: 0.3, center: [0.12, 0.05, 0], inertia: [3e-4, 0, 0, 2e-4, 0, 1e-4]}
"""


def test_over_constrained_linkage_publishes_only_determinate_forces():
    at_work = pipeline('pin_forces: {}', FLAT_LOOP)
    forces = at_work.linkages[0].context.reactions
    assert forces.uncertain == (
        'force along the axis in crank_joint, a, b, rocker_joint; moment across the axis in '
        'crank_joint, a, b, rocker_joint: the linkage is over-constrained, with 3 unknown forces '
        'more than equations'
    )
    message = STORE.deserialize_cdr(at_work.tick(BEGIN).extras[0], TYPE)
    assert message.joint_names == ['crank_joint', 'a', 'b', 'rocker_joint', 'lift_slide', 'P', 'Q']
    assert all(wrench.force.z == 0.0 != wrench.force.x for wrench in message.wrench[:4])


@pytest.mark.parametrize(
    ('effects', 'line'),
    [
        (
            'clearance: {pins: {a: 1.0e-4}}',
            'effects.clearance: the linkage is over-constrained',
        ),
        (
            'compliance: {links: {coupler: 1.0e+6}}',
            'effects.compliance: the linkage is over-constrained',
        ),
    ],
)
def test_over_constrained_linkage_refuses_clearance_and_compliance(effects, line):
    with pytest.raises(FileError) as caught:
        pipeline(effects, FLAT_LOOP)
    assert line in str(caught.value)
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize(
    ('friction', 'line'),
    [
        ('{coefficient: 0.1}', 'effects.friction.joints.rocker_joint.coefficient: friction by'),
        ('{radius: 0.1}', 'effects.friction.joints.rocker_joint.radius: friction by the force in'),
    ],
)
def test_load_dependent_hinge_friction_needs_a_radius(friction, line):
    with pytest.raises(FileError) as caught:
        pipeline(f'effort: {{}}, friction: {{joints: {{rocker_joint: {friction}}}}}')
    assert line in str(caught.value)
