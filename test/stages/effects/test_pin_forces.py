# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Pin forces: the balance of every link, published as one message of one instant."""

from cmath import rect

from hypothesis import given, strategies as st
from linkage_ros.description import parse_scene
from linkage_ros.tick import Pipeline
import pytest

from .four_bar_by_hand import FourBar
from .loaded import context, GRAVITY, moved
from ...support.messages import read_joint_state, STORE
from ...support.scenes import linkage_of, LINKAGES, PENDULUM, shipped

TYPE = 'sensor_msgs/msg/MultiDOFJointState'
FOUR_BAR = shipped('four_bar')
numbers = st.floats(-10.0, 10.0)


def reactions(within, *crank):
    return moved(within, crank, {'pin_forces': ()}).reactions


@given(numbers, numbers, numbers)
def test_pendulum_pin_force_equals_weight_and_inertia(angle, rate, acceleration):
    # m·(a + g), with a = r·(iα − ω²)·e^{iθ}.
    (found,) = reactions(context(linkage_of(PENDULUM)), angle, rate, acceleration)
    pull = 0.3 * (1j * acceleration - rate * rate) * rect(1.0, angle)
    force = 2.0 * (pull + 1j * GRAVITY)
    assert found == pytest.approx((force.real, force.imag, 0.0), abs=1e-11)


@pytest.mark.parametrize(
    'motion', [(1.0, 0.0, 0.0), (0.4, 0.0, 20.0), (2.5, -6.0, 30.0), (-1.2, 12.0, -80.0)]
)
def test_four_bar_pin_forces_balance_every_link(motion):
    within = context(FOUR_BAR)
    _, _, forces = FourBar(FOUR_BAR, motion, GRAVITY).balance()
    found = dict(zip(within.reactions.names, reactions(within, *motion), strict=True))
    # By hand the force on the link that stands later in the file, as there.
    assert set(found) == {'O2', 'A', 'B', 'O4'}
    for name, force in zip(('O2', 'A', 'B', 'O4'), forces, strict=True):
        expected = (float(force.real), float(force.imag), 0.0)
        assert found[name] == pytest.approx(expected, rel=1e-10, abs=1e-12)


def test_singular_balance_gives_no_pin_forces():
    within = context(FOUR_BAR)
    vars(within)['reactions'] = type('Singular', (), {'solve': lambda *_: None})()
    assert moved(within, (1.0, 1.0, 1.0), {'pin_forces': ()}).reactions == ()


def pipeline(effects, linkages=b'linkage: l.yaml'):
    four_bar = (LINKAGES / 'four_bar.yaml').read_bytes()
    scene = linkages + b'\ndrive: {constant_rate: {rate: 9, start: 1}}\neffects: ' + effects
    names = ['one.yaml', 'two.yaml'] if linkages.startswith(b'linkages') else ['linkage.yaml']
    files = {'scene.yaml': scene, **dict.fromkeys(names, four_bar)}
    return Pipeline(parse_scene('scene', 'here', files))


def test_pin_forces_are_published_beside_the_joint_states():
    at_work = pipeline(b'{pin_forces: {}}\nloads: {gravity: [0, -9.81]}')
    assert [(each.topic, each.message) for each in at_work.extras] == [('~/pin_forces', TYPE)]
    begin = 1_700_000_000_000_000_000
    for i in range(10):
        now = begin + i * 10_000_000
        tick = at_work.tick(now)
        state = read_joint_state(tick.message)
        (extra,) = tick.extras
        message = STORE.deserialize_cdr(extra, TYPE)
        assert message.header == state.header
        assert message.joint_names == list(context(FOUR_BAR).reactions.names)
        assert len(message.transforms) == len(message.twist) == 0
        expected = reactions(context(FOUR_BAR), 1.0 + 0.09 * i, 9.0, 0.0)
        for wrench, one in zip(message.wrench, expected, strict=True):
            found = wrench.force.x, wrench.force.y, wrench.torque.z
            assert found == pytest.approx(one, rel=1e-9, abs=1e-12)
            assert wrench.force.z == wrench.torque.x == wrench.torque.y == 0.0
        # What they start from is computed, and not published.
        assert len(state.velocity) == len(state.effort) == 0


def test_each_linkage_publishes_its_own_pin_forces():
    both = pipeline(
        b'{pin_forces: {}}', b'linkages: [{name: one, linkage: l}, {name: two, linkage: l}]'
    )
    assert [each.topic for each in both.extras] == ['~/one/pin_forces', '~/two/pin_forces']
    for name, extra in zip(('one', 'two'), both.tick(10**9).extras, strict=True):
        names = STORE.deserialize_cdr(extra, TYPE).joint_names
        assert names == [f'{name}_{pin}' for pin in context(FOUR_BAR).reactions.names]


@pytest.mark.parametrize('effects', [b'{}', b'{effort: {}}', b'{velocity: {}, acceleration: {}}'])
def test_scene_without_pin_forces_computes_none(effects):
    at_work = pipeline(effects)
    at_work.tick(10**9)
    assert all('reactions' not in vars(line.context) for line in at_work.linkages)
    assert '~/pin_forces' not in [each.topic for each in at_work.extras]
