# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What a wrong sample is suspected to come from: degrees, two drivers, or two clocks."""

from linkage_ros.description import load_scene
from linkage_ros.messages import CrankSample, JointStateWriter
from linkage_ros.node import Warnings
from linkage_ros.tick import Counts, Pipeline
import pytest

from .observed import fake_loop, observe, Said

SECOND = 10**9


@pytest.mark.parametrize(
    ('linkage', 'angles', 'said'),
    [
        ('four_bar', [170.0, 179.0, -180.0, -171.0], 1),  # degrees, wrapped
        ('four_bar', [0.0, 90.0, 180.0, 270.0], 1),  # degrees, four samples a turn
        ('four_bar', [3.0, 3.1, -3.1, -3.0], 0),  # radians, wrapped
        ('four_bar', [0.0, 0.1, 6.3, 12.5], 0),  # radians, nearly a turn a sample
        ('elliptic_trammel', [0.0, 0.1], 0),
    ],
)
def test_crank_samples_in_degrees_are_warned_of_once(linkage, angles, said):
    pipeline = Pipeline(load_scene(linkage, ['drive={topic: {}}']))
    (line,) = pipeline.linkages
    for index, angle in enumerate(angles):
        stamp = (1 + index) * SECOND // 100
        assert line.drive.offer(CrankSample(stamp, (angle,), (0.0,)), stamp) is None
    lines = Said()
    counts = Counts(chatter=[0])
    warnings = Warnings(lines, counts)
    for _ in range(3):
        warnings.warn_of_conditions(observe(fake_loop(pipeline=pipeline), counts), 0.0)
    assert len(lines) == said
    assert all('if these are degrees, publish radians' in each for each in lines)


def test_messages_without_any_input_are_reported():
    pipeline = Pipeline(load_scene('five_bar', ['drive={topic: {}}']))
    last = JointStateWriter(['left_motor']).write(SECOND, [0.5])
    counts = Counts(chatter=[0], received=9, ignored=9, last_ignored=last)
    lines = Said()
    Warnings(lines, Counts(chatter=[0])).warn_of_conditions(
        observe(fake_loop(pipeline=pipeline), counts), 0.0
    )
    (line,) = lines
    assert line == (
        "messages on /crank hold 'left_motor'; the linkage needs 'left_crank_joint', "
        "'right_crank_joint': name the joint so there, or remap the topic"
    )


def test_stamps_ahead_of_the_clock_suggest_arrival_stamps():
    # A crank that is let in 0.5 s ahead would be carried back by 0.5 s.
    pipeline = Pipeline(load_scene('four_bar', ['drive={topic: {}}']))
    (line,) = pipeline.linkages
    ahead = CrankSample(SECOND + SECOND // 2, (0.0,), (0.0,))
    rejection = line.drive.offer(ahead, SECOND)
    counts = Counts(chatter=[0], received=1)
    counts.rejected[rejection] = 1
    lines = Said()
    Warnings(lines, Counts(chatter=[0])).warn_of_conditions(
        observe(fake_loop(pipeline=pipeline), counts), 0.0
    )
    (told,) = lines
    assert told == (
        '/crank: 1 samples rejected: stamp in the future (1): synchronise the clocks, or write '
        'drive: {topic: {stamp: arrival}}'
    )


@pytest.mark.parametrize(
    'other', ['constant_rate: {rate: 1}', 'sine: {amplitude: 1, frequency: 1}']
)
def test_torque_linkage_shares_a_scene_with_any_drive(tmp_path, other):
    file = tmp_path / 'scene.yaml'
    file.write_text(
        'linkages:\n'
        '- {name: a, linkage: four_bar, drive: {torque: {on_timeout: brake, brake: 0.2}}}\n'
        f'- {{name: b, linkage: four_bar, drive: {{{other}}}}}\n'
    )
    pipeline = Pipeline(load_scene(file))
    run = observe(fake_loop(pipeline=pipeline), Counts(chatter=[0, 0]))
    assert run.takes_commands
    assert run.idle_text == 'the brake of 0.2 N·m holds a_crank_joint'
