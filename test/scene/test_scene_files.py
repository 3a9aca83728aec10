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


"""What scene and linkage files say: the shipped ones, defaults, numbers, shorthands."""

from __future__ import annotations

from math import pi

from linkage_ros.drives.topic import TopicParameters
from linkage_ros.effects.velocity import VelocityParameters
from linkage_ros.kinematics.linkage import RevoluteJoint, SlideJoint
from linkage_ros.pipeline import Pipeline
from linkage_ros.scene.load import load_scene, parse_scene
from linkage_ros.scene.scene import RecordParameters, StorageParameters
import pytest

from .files import CONFIG, FOUR_BAR, SCENE

ANGLES = [-7.0, -pi, -1.0, 0.0, 1e-9, 0.5, 2.0, 3.0, 100.0]


@pytest.mark.parametrize('file', sorted((CONFIG / 'scenes').glob('*.yaml')), ids=lambda f: f.stem)
def test_every_shipped_scene_is_read_and_closes(file):
    scene = load_scene(file)
    assert scene.name == file.stem
    for closure in Pipeline(scene).closures:
        assert_it_closes(closure)


@pytest.mark.parametrize(
    'file', sorted((CONFIG / 'linkages').glob('*.yaml')), ids=lambda f: f.stem
)
def test_shipped_linkage(build, file):
    _, pipeline = build(SCENE, file.read_bytes())
    assert_it_closes(*pipeline.closures)


def assert_it_closes(closure):
    if len(closure.linkage.inputs) == 1:
        for interval in closure.input_ranges:
            for i in range(1, 10):
                value = interval.lowest + 0.1 * i * (interval.highest - interval.lowest)
                assert closure.position(value).joints, value
    else:
        assert closure.position(1.5, 1.5).joints


def test_a_seed_that_is_not_said_follows_from_the_name_of_the_scene():
    files = {'scene.yaml': SCENE, 'linkage.yaml': FOUR_BAR}
    one, other = (parse_scene(name, 'here', files).seed for name in ('press', 'leg'))
    assert one != other
    assert one == parse_scene('press', 'there', files).seed
    # A bag says what it was; older ones, which do not, had 0.
    assert parse_scene('press', 'bag', files, seed=0).seed == 0
    said = {**files, 'scene.yaml': SCENE + b'\nseed: 7\n'}
    assert parse_scene('press', 'bag', said, seed=3).seed == 7


def test_a_scene_that_says_nothing(build):
    scene, _ = build()
    assert scene.rate == 1000.0
    assert not scene.wrapped
    (member,) = scene.members
    assert member.drive == (
        'topic',
        TopicParameters(carry_forward=True, max_age=0.2, max_lead=0.1),
    )
    assert member.effects == {}
    assert (member.name, member.loads, scene.faults) == ('', None, {})
    assert scene.record is None
    assert scene.files == {'scene.yaml': SCENE, 'linkage.yaml': FOUR_BAR}


def test_a_scene_that_says_all(build):
    scene, _ = build(
        SCENE
        + b"""
rate: 0
angles: wrapped
drive: {topic: {carry_forward: false, max_age: 0.5, max_lead: 0}}
effects: {velocity: {}}
record: {directory: bags, name: first, queue: 1000}
"""
    )
    assert scene.rate == 0.0
    assert scene.wrapped
    (member,) = scene.members
    assert member.drive == (
        'topic',
        TopicParameters(carry_forward=False, max_age=0.5, max_lead=0.0),
    )
    assert member.effects == {'velocity': VelocityParameters()}
    assert scene.record == RecordParameters(directory='bags', name='first', queue=1000)


def test_a_record_that_says_nothing(build):
    scene, _ = build(SCENE + b'record: {}')
    assert scene.record == RecordParameters(directory='runs', name='', queue=20_000)


def test_a_record_that_says_how_it_is_stored(build):
    scene, _ = build(
        SCENE
        + b"""
record:
  flush_period: 0.25
  split_bytes: 1e8
  split_seconds: 60
  keep_files: 10
  min_free_bytes: 1000000000
  compression: zstd
"""
    )
    assert scene.record.storage == StorageParameters(
        flush_period=0.25,
        split_bytes=100_000_000,
        split_seconds=60.0,
        keep_files=10,
        min_free_bytes=1_000_000_000,
        compression='zstd',
    )


def test_a_record_that_is_kept_in_memory(build):
    scene, _ = build(SCENE + b'record: {snapshot_seconds: 30, min_free_bytes: 1}')
    assert scene.record.storage == StorageParameters(
        snapshot_seconds=30.0, snapshot_bytes=256_000_000, min_free_bytes=1
    )


@pytest.mark.parametrize(
    ('text', 'value'),
    [('1e3', 1000.0), ('2E+1', 20.0), ('1e-1', 0.1), ('.5', 0.5), ('7.', 7.0), ('010', 10.0)],
)
def test_numbers_are_those_of_yaml_1_2(build, text, value):
    scene, _ = build(SCENE + f'rate: {text}'.encode())
    assert scene.rate == value


@pytest.mark.parametrize('name', ['yes', 'off', 'NO', '1:30', '1_000', 'gelenk_ä', '関節', "a'b"])
def test_what_yaml_1_1_would_change_is_a_name(build, name):
    joint = f'{{parent: ground, child: {name}}}'
    linkage = (CONFIG / 'linkages' / 'four_bar.yaml').read_text()
    linkage = linkage.replace('rocker:', f'{name}:')
    linkage = linkage.replace('{parent: ground, child: rocker}', joint)
    scene, _ = build(SCENE, linkage.encode())
    assert name in scene.members[0].linkage.links


@pytest.mark.parametrize(
    'rewrite',
    [
        lambda data: b'\xef\xbb\xbf' + data,
        lambda data: data.replace(b'\n', b'\r\n'),
        lambda data: b'--- # a document\n' + data + b'...\n',
        lambda data: b'{' + data.replace(b'\n', b' ') + b'}',
    ],
    ids=['byte order mark', 'CRLF', 'document marks', 'flow style'],
)
def test_the_same_file_written_otherwise(build, rewrite):
    assert build(rewrite(SCENE), rewrite(FOUR_BAR))[0].members == build()[0].members


FOUR_BAR_WRITTEN_OUT = b"""
links:
  ground: {O2: [0, 0], O4: [0.1, 0]}
  crank: {O2: [0, 0], A: [0.04, 0]}
  coupler: {A: [0, 0], B: [0.12, 0]}
  rocker: {O4: [0, 0], B: [0.08, 0]}
input: {joint: crank_joint, parent: ground, child: crank}
assembly: {B: %s}
joints:
  coupler_joint: {parent: crank, child: coupler}
  rocker_joint: {parent: ground, child: rocker}
"""

SLIDER_WRITTEN_OUT = b"""
links:
  ground: {O: [0, 0], C: [0.25, 0.1]}
  crank: {O: [0, 0], B: [0.15, 0]}
  rod: {B: [0, 0], tip: [0.4, 0]}
sliders: {swivel: {point: C, along: rod, through: B, direction: [1, 0]}}
input: {joint: crank_joint, parent: ground, child: crank}
assembly: {swivel: %s}
joints:
  rod_joint: {parent: crank, child: rod}
  rod_slide: {slider: swivel}
"""


@pytest.mark.parametrize(
    ('shorthand', 'written_out', 'sides'),
    [
        (FOUR_BAR, FOUR_BAR_WRITTEN_OUT, (b'left', b'right')),
        (
            b'inverted_slider_crank: {a: 0.15, swivel: [0.25, 0.1]}',
            SLIDER_WRITTEN_OUT,
            (b'ahead', b'behind'),
        ),
    ],
    ids=['four_bar', 'inverted_slider_crank'],
)
def test_a_shorthand_stands_for_the_file_written_out(build, shorthand, written_out, sides):
    default, _ = build(SCENE, shorthand)
    for side in sides:
        short, loop = linkage_of(build(SCENE, shorthand.replace(b'}', b', assembly: %s}' % side)))
        full, full_loop = linkage_of(build(SCENE, written_out % side))
        assert short.inputs == full.inputs
        assert list(short.joints.items()) == list(full.joints.items())
        assert short.assembly == full.assembly
        for angle in ANGLES:
            assert loop.position(angle) == full_loop.position(angle)
        if side == sides[0]:
            assert default.members[0].linkage == short


def linkage_of(built):
    scene, pipeline = built
    return scene.members[0].linkage, pipeline.closures[0]


def test_joints_come_in_the_order_of_the_file(build):
    full = FOUR_BAR_WRITTEN_OUT % b'left'
    scene, pipeline = build(SCENE, full)
    assert list(scene.members[0].linkage.joints) == ['coupler_joint', 'rocker_joint']
    lines = full.splitlines()
    swapped, other = build(SCENE, b'\n'.join([*lines[:-2], lines[-1], lines[-2]]))
    assert list(swapped.members[0].linkage.joints) == ['rocker_joint', 'coupler_joint']
    one, two = (each.closures[0].position(1.0).joints for each in (pipeline, other))
    assert one == two[::-1]


def test_joints_turn_or_slide(build):
    scene, pipeline = build(SCENE, SLIDER_WRITTEN_OUT % b'ahead')
    assert scene.members[0].linkage.joints == {
        'rod_joint': RevoluteJoint('crank', 'rod'),
        'rod_slide': SlideJoint('swivel'),
    }
    assert pipeline.closures[0].turning == (True, False)


def test_a_bag_holds_enough_to_build_the_scene_again(build):
    scene, pipeline = build(SCENE + b'effects: {velocity: {}}')
    again = parse_scene(scene.name, 'a bag', scene.files)
    assert again == scene
    assert Pipeline(again).closures[0].position(1.0) == pipeline.closures[0].position(1.0)
