# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Beyond the limits of a joint a tick publishes what the scene says, and the node tells of it."""

from collections import Counter
from math import pi, tau

from linkage_ros.description import parse_scene
from linkage_ros.kinematics import Status
from linkage_ros.messages import JointStateWriter
from linkage_ros.tick import Pipeline, TickLoop
import pytest
from rosbags.typesys import get_typestore, Stores

from .observed import BEGIN, observe, status_of, told

STORE = get_typestore(Stores.ROS2_JAZZY)
MS = 1_000_000
WARN = b'\1'
LIMITED = 'four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1, input: {limits: [0.5, 1.5]}}'
CRANK = JointStateWriter(['crank_joint'])


def scene(said='', linkage=LIMITED):
    files = {
        'scene.yaml': f'linkage: linkage.yaml\n{said}'.encode(),
        'linkage.yaml': linkage.encode(),
    }
    return parse_scene('s', 's', files)


def read(message):
    return STORE.deserialize_cdr(message, 'sensor_msgs/msg/JointState')


def at(pipeline, angle, number=0, rate=1.0):
    now = BEGIN + number * MS
    assert pipeline.offer(CRANK.write(now, [angle], [rate]), now) is None
    return pipeline.tick(now)


def test_states_beyond_limits_are_published_by_default():
    tick = at(Pipeline(scene('effects: {velocity: {}}')), 2.0)
    free = LIMITED.replace(', input: {limits: [0.5, 1.5]}', '')
    other = at(Pipeline(scene('effects: {velocity: {}}', free)), 2.0)
    assert tick.states[0].position.status is Status.LIMITED
    assert tick.message == other.message != b''


@pytest.mark.parametrize('effects', ['{}', '{velocity: {}}', '{acceleration: {}}'])
def test_silent_beyond_limits_publishes_only_within_limits(effects):
    said = f'effects: {effects}\n'
    silent = Pipeline(scene(said + 'beyond_limits: silent'))
    free = Pipeline(scene(said))
    for index, angle in enumerate((1.0, 1.4, 1.6, 2.0, 1.5, 1.2, 0.4)):
        tick, other = at(silent, angle, index), at(free, angle, index)
        assert other.message
        if angle in (1.6, 2.0, 0.4):
            assert tick.message == b''
            assert tick.states[0].position.status is Status.LIMITED
        else:
            assert tick.message == other.message


def test_silent_beyond_limits_includes_the_toggle():
    """It has another status, and is beyond the limits all the same."""
    linkage = 'four_bar: {a: 0.1, b: 0.07, c: 0.06, d: 0.05, input: {limits: [-0.5, 0.5]}}'
    silent = Pipeline(scene('beyond_limits: silent', linkage))
    (closure,) = silent.closures
    (one,) = closure.closing_ranges
    assert closure.position(one.highest).status is Status.TOGGLE
    assert at(silent, one.highest).message == b''
    assert at(Pipeline(scene('', linkage)), one.highest).message


@pytest.mark.parametrize('turns', [-2, -1, 0, 1])
def test_published_angles_start_within_joint_limits(turns):
    """So a consumer that has the limits from a URDF is never told of another turn."""
    low, high = (end + turns * tau for end in (1.5, 2.0))
    linkage = LIMITED.replace(
        'input: {limits: [0.5, 1.5]}', f'joints: {{rocker_joint: {{limits: [{low!r}, {high!r}]}}}}'
    )
    pipeline = Pipeline(scene('', linkage))
    for index in range(100):
        message = read(at(pipeline, 2.0 + 0.005 * index, index).message)
        values = dict(zip(message.name, message.position, strict=True))
        assert low <= values['rocker_joint'] <= high
        assert -pi < values['coupler_joint'] <= pi


def test_limited_input_is_published_as_driven():
    linkage = LIMITED.replace('[0.5, 1.5]', '[8, 12]')
    pipeline = Pipeline(scene('drive: {sine: {amplitude: 1, mean: 10, frequency: 1}}', linkage))
    message = read(pipeline.tick(BEGIN).message)
    assert message.position[0] == 10.0


def ran(said, angles, linkage=LIMITED):
    """Return a tick loop that has seen crank angles, and what was published."""
    made = scene(said, linkage)
    messages = [CRANK.write(BEGIN + n * MS, [angle], [1.0]) for n, angle in enumerate(angles)]
    waiting, published = [], []

    def take():
        return (waiting.pop(0), {'source_timestamp': 0}) if waiting else None

    loop = TickLoop(lambda: Pipeline(made), take, published.append)
    for index, message in enumerate(messages):
        waiting.append(message)
        loop.tick_at(BEGIN + index * MS)
    return loop, published


ANGLES = (1.0, 2.0, 2.1, 1.0)


@pytest.mark.parametrize(('said', 'published'), [('', 4), ('beyond_limits: silent', 2)])
def test_ticks_beyond_limits_are_counted_and_reported(said, published):
    loop, messages = ran(said, ANGLES)
    counts = loop.counts
    assert Counter(counts.unclosed) == Counter({Status.LIMITED: 2})
    assert (len(messages), counts.published, counts.suppressed) == (published, published, 0)
    what = 'nothing published' if said else 'published anyway'
    line = f'2 ticks beyond limits, {what}: crank_joint at 2.1 rad, limits [0.5, 1.5] rad'
    run = observe(loop)
    assert told(run) == [line]
    status, values = status_of(run, 'loop closure')
    assert (status.level, status.message) == (WARN, line)
    assert values['Ticks beyond limits'] == '2'
    assert values['Reachable'] == '0.5 to 1.5 rad'


def test_diagnostics_compare_rates_with_velocity_limits():
    linkage = LIMITED.replace(
        'input: {limits: [0.5, 1.5]}',
        'input: {velocity: 0.8}, joints: {rocker_joint: {velocity: 100}}',
    )
    loop, _ = ran('effects: {velocity: {}}', (1.0,), linkage)
    status, values = status_of(observe(loop), 'loop closure')
    assert (status.level, status.message) == (
        WARN, 'Velocity of crank_joint is 1, its limit 0.8',
    )  # fmt: skip
    assert values['Velocity of crank_joint, of its limit'] == '1.25'
    (rate,) = [
        rate
        for name, rate in zip(
            loop.pipeline.closures[0].linkage.joints,
            loop.counts.last_tick.states[0].reading.rates,
            strict=True,
        )
        if name == 'rocker_joint'
    ]
    assert values['Velocity of rocker_joint, of its limit'] == f'{abs(rate) / 100:.4g}'
    bare, _ = ran('', (1.0,), linkage)
    _, values = status_of(observe(bare), 'loop closure')
    assert not any('rocker_joint, of its limit' in key for key in values)


def test_diagnostics_without_limits_name_no_limits():
    loop, _ = ran('', (1.0,), LIMITED.replace(', input: {limits: [0.5, 1.5]}', ''))
    _, values = status_of(observe(loop), 'loop closure')
    assert [key for key in values if 'limit' in key] == ['Ticks beyond limits']
