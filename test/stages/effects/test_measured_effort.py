# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Measured efforts of motors become those of joints on the published message, and back."""

from math import nan

from linkage_ros import DefinitionError, load
from linkage_ros.errors import FileError
import numpy as np
import pytest

from ...support.messages import joint_state, read_joint_state
from ...support.scenes import LINKAGES, pipeline_of

NOW = 5_000_000_000
ANKLE = (LINKAGES / 'space' / 'ankle_motors.yaml').read_bytes()
FOUR_BAR = (LINKAGES / 'four_bar.yaml').read_bytes()
BEGIN = 'drive: {topic: {carry_forward: false}}\n'


def published(pipeline, *samples, at=NOW):
    """Return the message that is published for samples: names, positions, efforts."""
    for names, values, efforts in samples:
        data = joint_state(names, values, [0.0] * len(names), efforts, stamp=(4, 999_000_000))
        assert pipeline.offer(data, at) is None
    found = read_joint_state(pipeline.tick(at).message)
    return dict(zip(found.name, found.position, strict=True)), dict(
        zip(found.name, found.effort, strict=bool(len(found.effort)))
    )


def slopes(values, joints=('pitch', 'roll')):
    """Return the ankle's joints by its motors, by differences."""
    closure = load('ankle_motors')
    step = 1e-5
    columns = []
    for k in range(2):
        ends = [
            closure.position(*[v + s * step * (i == k) for i, v in enumerate(values)])
            for s in (-1, 1)
        ]
        columns.append([(ends[1][name] - ends[0][name]) / (2 * step) for name in joints])
    return np.array(columns).T


def test_motor_efforts_are_published_at_pitch_and_roll():
    scene = f'{BEGIN}effects: {{effort: {{measured: true, joints: [pitch, roll]}}}}'
    pipeline = pipeline_of(scene, ANKLE)
    motors, efforts = (0.2, -0.1), (1.5, -0.4)
    _, found = published(pipeline, (['m2', 'm1'], motors[::-1], efforts[::-1]))
    assert [*found] == ['m1', 'm2', 'pitch', 'roll']
    assert (found['m1'], found['m2']) == efforts
    at_joints = slopes(motors).T @ [found['pitch'], found['roll']]
    assert at_joints == pytest.approx(efforts, rel=1e-7)


def test_pitch_and_roll_efforts_are_published_at_motors():
    scene = 'drive: {topic: {joint: [pitch, roll], carry_forward: false}}\npublish_input: true\n'
    pipeline = pipeline_of(f'{scene}effects: {{effort: {{measured: true}}}}', ANKLE)
    there = load('ankle_motors').position(0.2, -0.1)
    efforts = (2.0, -3.0)
    at, found = published(pipeline, (['pitch', 'roll'], (there['pitch'], there['roll']), efforts))
    assert (at['m1'], at['m2']) == pytest.approx((0.2, -0.1), abs=1e-10)
    assert slopes((0.2, -0.1)).T @ efforts == pytest.approx((found['m1'], found['m2']), rel=1e-7)
    assert (found['pitch'], found['roll']) == pytest.approx(efforts, rel=1e-9)


def test_each_motor_has_a_publisher_of_its_own():
    pipeline = pipeline_of(f'{BEGIN}effects: {{effort: {{measured: true}}}}', ANKLE)
    _, found = published(pipeline, (['m1'], [0.1], [2.0]), (['m2'], [0.0], [-1.0]))
    assert found == {'m1': 2.0, 'm2': -1.0, 'pitch': 0.0, 'roll': 0.0}
    _, found = published(pipeline, (['m1'], [0.1], [3.0]))
    assert found['m1'] == 3.0
    assert found['m2'] == -1.0


@pytest.mark.parametrize('efforts', [[], [nan]])
def test_sample_without_effort_publishes_none(efforts):
    scene = f'{BEGIN}effects: {{effort: {{measured: true, joints: [rocker_joint]}}}}'
    pipeline = pipeline_of(scene, FOUR_BAR)
    at, found = published(pipeline, (['crank_joint'], [1.0], efforts))
    assert at
    assert not found
    assert published(pipeline, (['crank_joint'], [1.1], [0.5]), at=NOW + 1)[1]
    assert not published(pipeline, (['crank_joint'], [1.2], efforts), at=NOW + 2)[1]


def test_no_effort_is_published_where_the_rocker_turns_back():
    scene = f'{BEGIN}effects: {{effort: {{measured: true, joints: [rocker_joint]}}}}'
    pipeline = pipeline_of(scene, FOUR_BAR)
    end = load('four_bar').branches('rocker_joint')[0].most
    for k, off in enumerate((0.1, 0.0, 1e-9, 0.1)):
        _, found = published(pipeline, (['crank_joint'], [end + off], [1.0]), at=NOW + k)
        assert bool(found) == (off == 0.1)


@pytest.mark.parametrize(
    ('scene', 'reason'),
    [
        (
            'effects: {effort: {joints: [rocker_joint]}}',
            'joints: has no effort to start from',
        ),
        (
            'effects: {effort: {measured: true, joints: [rocker_joint, coupler_joint]}}',
            'joints: rocker_joint, coupler_joint: for 1 input; name 1 different joints',
        ),
        (
            'drive: {sine: {amplitude: 1, frequency: 1}}\neffects: {effort: {measured: true}}',
            'measured: the drive sine takes no samples with efforts; write drive: {topic: {}}',
        ),
    ],
)
def test_wrong_measured_effort_is_refused_in_one_line(scene, reason):
    with pytest.raises((DefinitionError, FileError)) as error:
        pipeline_of(scene, FOUR_BAR)
    assert reason in str(error.value)
    assert '\n' not in str(error.value)
