# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Scene and linkage files are read as they say, also a linkage file in place of a scene."""

from math import acos, hypot, pi, tau

from linkage_ros.description import load_scene, parse_scene, RecordParameters, StorageParameters
from linkage_ros.errors import FileError
from linkage_ros.kinematics import RevoluteJoint, SlideJoint, SpaceClosure, Status
from linkage_ros.messages import JointStateWriter
from linkage_ros.stages.drives import ConstantRateDrive, TopicDrive
from linkage_ros.stages.effects import VelocityEffect
from linkage_ros.tick import Pipeline
import pytest

from .conftest import CONFIG, FOUR_BAR, is_one_line, SCENE
from ..support.scenes import four_bar_text

# Content of scene and linkage files: the shipped ones, defaults, numbers, shorthands.


ANGLES = [-7.0, -pi, -1.0, 0.0, 1e-9, 0.5, 2.0, 3.0, 100.0]


@pytest.mark.parametrize('file', sorted((CONFIG / 'scenes').glob('*.yaml')), ids=lambda f: f.stem)
def test_shipped_scene_loads_and_closes(file):
    scene = load_scene(file)
    assert scene.name == file.stem
    for closure in Pipeline(scene).closures:
        assert_it_closes(closure)


@pytest.mark.parametrize(
    'file', sorted((CONFIG / 'linkages').glob('*.yaml')), ids=lambda f: f.stem
)
def test_shipped_linkage_loads_and_closes(build, file):
    _, pipeline = build(SCENE, file.read_bytes())
    assert_it_closes(*pipeline.closures)


def assert_it_closes(closure):
    if len(closure.linkage.inputs) == 1:
        for interval in closure.input_ranges:
            for i in range(1, 10):
                value = interval.lowest + 0.1 * i * (interval.highest - interval.lowest)
                assert closure.position(value).joints, value
    else:
        inputs = closure.linkage.pose.inputs if isinstance(closure, SpaceClosure) else (1.5, 1.5)
        assert closure.position(*inputs).joints


def test_default_seed_follows_from_the_scene_name():
    files = {'scene.yaml': SCENE, 'linkage.yaml': FOUR_BAR}
    one, other = (parse_scene(name, 'here', files).seed for name in ('press', 'leg'))
    assert one != other
    assert one == parse_scene('press', 'there', files).seed
    # A bag says what it was; older ones, which do not, had 0.
    assert parse_scene('press', 'bag', files, seed=0).seed == 0
    said = {**files, 'scene.yaml': SCENE + b'\nseed: 7\n'}
    assert parse_scene('press', 'bag', said, seed=3).seed == 7


def test_minimal_scene_gets_the_defaults(build):
    scene, _ = build()
    assert scene.rate == 1000.0
    assert not scene.wrapped
    (scene_linkage,) = scene.linkages
    assert scene_linkage.drive == (
        'topic',
        TopicDrive(carry_forward=True, max_age=0.2, max_lead=0.1),
    )
    assert scene_linkage.effects == {}
    assert (scene_linkage.name, scene_linkage.loads, scene.faults) == ('', None, {})
    assert scene.record is None
    assert scene.files == {'scene.yaml': SCENE, 'linkage.yaml': FOUR_BAR}


def test_full_scene_keeps_every_value(build):
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
    (scene_linkage,) = scene.linkages
    assert scene_linkage.drive == (
        'topic',
        TopicDrive(carry_forward=False, max_age=0.5, max_lead=0.0),
    )
    assert scene_linkage.effects == {'velocity': VelocityEffect()}
    assert scene.record == RecordParameters(directory='bags', name='first', queue=1000)


def test_empty_record_gets_the_defaults(build):
    scene, _ = build(SCENE + b'record: {}')
    assert scene.record == RecordParameters(directory='runs', name='', queue=20_000)


def test_record_storage_values_are_read(build):
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


def test_snapshot_record_values_are_read(build):
    scene, _ = build(SCENE + b'record: {snapshot_seconds: 30, min_free_bytes: 1}')
    assert scene.record.storage == StorageParameters(
        snapshot_seconds=30.0, snapshot_bytes=256_000_000, min_free_bytes=1
    )


@pytest.mark.parametrize(
    ('text', 'value'),
    [('1e3', 1000.0), ('2E+1', 20.0), ('1e-1', 0.1), ('.5', 0.5), ('7.', 7.0), ('010', 10.0)],
)
def test_numbers_follow_yaml_1_2(build, text, value):
    scene, _ = build(SCENE + f'rate: {text}'.encode())
    assert scene.rate == value


@pytest.mark.parametrize('name', ['yes', 'off', 'NO', '1:30', '1_000', 'gelenk_ä', '関節', "a'b"])
def test_yaml_1_1_keywords_stay_names(build, name):
    joint = f'{{parent: ground, child: {name}}}'
    linkage = (CONFIG / 'linkages' / 'four_bar.yaml').read_text()
    linkage = linkage.replace('rocker:', f'{name}:')
    linkage = linkage.replace('{parent: ground, child: rocker}', joint)
    scene, _ = build(SCENE, linkage.encode())
    assert name in scene.linkages[0].linkage.links


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
def test_equivalent_file_encodings_give_the_same_scene(build, rewrite):
    assert build(rewrite(SCENE), rewrite(FOUR_BAR))[0].linkages == build()[0].linkages


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
def test_shorthand_equals_the_file_written_out(build, shorthand, written_out, sides):
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
            assert default.linkages[0].linkage == short


def linkage_of(built):
    scene, pipeline = built
    return scene.linkages[0].linkage, pipeline.closures[0]


def test_joints_keep_the_order_of_the_file(build):
    full = FOUR_BAR_WRITTEN_OUT % b'left'
    scene, pipeline = build(SCENE, full)
    assert list(scene.linkages[0].linkage.joints) == ['coupler_joint', 'rocker_joint']
    lines = full.splitlines()
    swapped, other = build(SCENE, b'\n'.join([*lines[:-2], lines[-1], lines[-2]]))
    assert list(swapped.linkages[0].linkage.joints) == ['rocker_joint', 'coupler_joint']
    one, two = (each.closures[0].position(1.0).joints for each in (pipeline, other))
    assert one == two[::-1]


def test_joints_are_read_as_revolute_or_slide(build):
    scene, pipeline = build(SCENE, SLIDER_WRITTEN_OUT % b'ahead')
    assert scene.linkages[0].linkage.joints == {
        'rod_joint': RevoluteJoint('crank', 'rod'),
        'rod_slide': SlideJoint('swivel'),
    }
    assert pipeline.closures[0].turning == (True, False)


def test_scene_is_rebuilt_from_its_bag_files(build):
    scene, pipeline = build(SCENE + b'effects: {velocity: {}}')
    again = parse_scene(scene.name, 'a bag', scene.files)
    assert again == scene
    assert Pipeline(again).closures[0].position(1.0) == pipeline.closures[0].position(1.0)


# A linkage file in place of a scene: the linkage moves from its start, within its range.


BEGIN = 1_700_000_000_000_000_000
MS = 1_000_000
SIXTY = pi / 3.0

# Ends of the input ranges in the gallery, from one triangle each; all others turn fully.
_FARTHEST = 2.0 * acos(0.75)
_MIDDLE = hypot(1.18 - 0.22, 0.30 - 0.01)

LIMITED = {
    # The arms reach B from O only as far as 0.125 − 0.05, and |OB| = 2·0.05·cos(φ/2).
    'peaucellier': (-_FARTHEST, _FARTHEST),
    # Coupler and right rocker, 0.08 and 0.2, folded and stretched; between them 0.2 and 0.16.
    'double_rocker': (acos(0.8), acos(-0.2)),
    # The bar lies along the slot.
    'elliptic_trammel': (-0.12, 0.12),
    # Cylinder and rocker in line, from K over I.
    'excavator_bucket': (_MIDDLE - 0.32, _MIDDLE + 0.32),
}


@pytest.mark.sample(3)
@pytest.mark.parametrize(
    'file', sorted((CONFIG / 'linkages').glob('*.yaml')), ids=lambda file: file.stem
)
def test_shipped_linkage_runs_five_seconds_with_closed_loops(file):
    scene = load_scene(file)
    assert (scene.name, scene.rate, scene.record) == (file.stem, 1000.0, None)
    pipeline = Pipeline(scene)
    ends = LIMITED.get(file.stem)
    cranks = []
    for index in range(5001):
        now = BEGIN + index * MS
        if file.stem == 'five_bar':  # it has two inputs, which come from a topic
            inputs = JointStateWriter(scene.linkages[0].input_names)
            assert pipeline.offer(inputs.write(now, [SIXTY, SIXTY], [0.0, 0.0]), now) is None
        (state,) = pipeline.tick(now).states
        crank, position, reading = state.crank, state.position, state.reading
        assert crank is not None
        assert position is not None
        assert position.status is Status.CLOSED, crank
        assert reading is not None
        assert len(reading[2]) == len(scene.joint_names)  # rates
        cranks.append(crank.angles[0])
    if file.stem == 'five_bar':
        assert scene.linkages[0].drive == ('topic', TopicDrive())
    elif file.stem == 'gripper':  # its motor has limits, and starts at the pose
        assert cranks[0] == 0.25
        assert [min(cranks), max(cranks)] == pytest.approx([0.0, 0.74], abs=1e-6)
    elif ends is None:
        assert scene.linkages[0].drive == ('constant_rate', ConstantRateDrive(1.0, SIXTY))
        assert cranks[0] == SIXTY
        assert cranks[-1] == pytest.approx(SIXTY + 5.0, rel=1e-15)
    else:
        low, high = ends
        unit = high - low
        assert cranks[0] == pytest.approx(low + 2.0 / 3.0 * unit, abs=1e-14 * unit)
        # Within five seconds a sine of four has been at both its ends, to a tick.
        assert min(cranks) == pytest.approx(low + 0.02 * unit, abs=1e-6 * unit)
        assert max(cranks) == pytest.approx(high - 0.02 * unit, abs=1e-6 * unit)


# A coupler and a rocker, 8 and 3, that are folded where the crank's pin is 5 from the rocker's
# pivot, on a crank of 4 and a ground of 6: the crank goes from there round to the other side.
FOLDS = four_bar_text(4, 8, 3, 6)
LOW = acos((4**2 + 6**2 - 5**2) / (2 * 4 * 6))
HIGH = tau - LOW
NEAR = 0.02 * (HIGH - LOW)
"""Where the middle 96 % begin, from an end of the range."""

# Its crank and its rocker so long that the crank turns fully.
TURNS = four_bar_text(2, 8, 5, 6)

# Text of the file; the start; the lowest and the highest value reached in 4 s.
STARTS = {
    'a full turn': (TURNS, 0.436, 0.436, 4.436),
    'a full turn, backward beyond one': (TURNS, -7.0, -7.0, -3.0),
    'a full turn, at an end of what is searched': (TURNS, pi, pi, pi + 4.0),
    'the middle': (FOLDS, pi, LOW + NEAR, HIGH - NEAR),
    'within the 96 %': (FOLDS, 2.0, LOW + NEAR, HIGH - NEAR),
    'within them, a turn lower': (FOLDS, 2.0 - tau, LOW + NEAR - tau, HIGH - NEAR - tau),
    'nearer to the lower end': (FOLDS, LOW + 0.01, LOW + 0.01, HIGH - NEAR),
    'nearer to the upper end': (FOLDS, HIGH - 0.01, LOW + NEAR, HIGH - 0.01),
}


@pytest.mark.parametrize('kind', STARTS)
def test_linkage_run_begins_at_its_pose(tmp_path, kind):
    text, start, lowest, highest = STARTS[kind]
    file = tmp_path / 'designed.yaml'
    file.write_text(f'{text}pose: {{inputs: [{start!r}]}}\n')
    pipeline = Pipeline(load_scene(file))
    values = []
    for index in range(4001):
        (state,) = pipeline.tick(BEGIN + index * MS).states
        crank, position = state.crank, state.position
        assert crank is not None
        assert position is not None
        assert position.status is Status.CLOSED
        values.append(crank.angles[0])
    assert values[0] == pytest.approx(start, abs=4e-15)
    assert min(values) == pytest.approx(lowest, abs=1e-5)
    assert max(values) == pytest.approx(highest, abs=1e-5)


@pytest.mark.parametrize('end', [LOW, HIGH])
@pytest.mark.parametrize('beyond', [0.0, 1e-12, -1e-12])
def test_start_at_a_toggle_becomes_the_swing_end(tmp_path, end, beyond):
    file = tmp_path / 'designed.yaml'
    file.write_text(f'{FOLDS}pose: {{inputs: [{end + beyond!r}]}}\n')
    pipeline = Pipeline(load_scene(file))
    crank = pipeline.tick(BEGIN).states[0].crank
    assert crank is not None
    assert crank.angles[0] == pytest.approx(end, abs=2e-12)
    for index in range(1, 4000):
        (state,) = pipeline.tick(BEGIN + index * MS).states
        crank, position = state.crank, state.position
        assert position is not None
        assert position.status is Status.CLOSED, index


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        (
            f'{FOLDS}pose: {{inputs: [0.5]}}',
            'no loop closes at 0.5 rad; start within 0.97339 to 5.3098 rad',
        ),
        (
            (CONFIG / 'linkages/elliptic_trammel.yaml').read_text('utf-8')
            + 'pose: {inputs: [0.13]}',
            'no loop closes at 0.13 m; start within -0.12 to 0.12 m',
        ),
    ],
)
def test_start_without_a_closed_loop_is_refused(tmp_path, text, said):
    (tmp_path / 'designed.yaml').write_text(text)
    with pytest.raises(FileError) as caught:
        load_scene(tmp_path / 'designed.yaml')
    assert is_one_line(caught.value)
    line = 1 + text[: text.index('pose:')].count('\n')
    assert f'designed.yaml:{line}: pose.inputs: {said}' in str(caught.value)


def test_pose_points_do_not_set_the_run_start(tmp_path):
    text = (CONFIG / 'linkages/class_3.yaml').read_text('utf-8')
    assert 'inputs: [0.0], points:' in text
    (tmp_path / 'posed.yaml').write_text(text)
    assert load_scene(tmp_path / 'posed.yaml').linkages[0].drive[1].start == SIXTY


def test_iterated_linkage_needs_the_pose_points(tmp_path):
    text = (CONFIG / 'linkages/class_3.yaml').read_text('utf-8')
    head, _, tail = text.partition(', points: {')
    (tmp_path / 'posed.yaml').write_text(head + tail.partition('}')[2])
    with pytest.raises(FileError) as caught:
        load_scene(tmp_path / 'posed.yaml')
    assert is_one_line(caught.value)
    line = 1 + text[: text.index('pose:')].count('\n')
    assert f"posed.yaml:{line}: pose.points: does not say where 'crank_arm' lies" in str(
        caught.value
    )


def test_linkage_run_is_rebuilt_from_its_files(tmp_path):
    (tmp_path / 'designed.yaml').write_bytes(FOUR_BAR)
    scene = load_scene(tmp_path / 'designed.yaml')
    assert set(scene.files) == {'scene.yaml', 'linkage.yaml'}
    assert scene.files['linkage.yaml'] == FOUR_BAR
    again = parse_scene(scene.name, 'a bag', scene.files)
    assert again == scene
    one, other = Pipeline(scene), Pipeline(again)
    for index in range(100):
        now = BEGIN + index * MS
        assert one.tick(now).message == other.tick(now).message != b''


def test_generated_scene_text_loads_as_a_scene(tmp_path):
    (tmp_path / 'linkage.yaml').write_bytes(FOUR_BAR)
    alone = load_scene(tmp_path / 'linkage.yaml')
    (tmp_path / 'scene.yaml').write_bytes(alone.files['scene.yaml'])
    beside = load_scene(tmp_path / 'scene.yaml')
    assert beside.files == alone.files
    assert (beside.linkages, beside.rate) == (alone.linkages, alone.rate)


def test_scene_may_name_a_gallery_linkage(tmp_path):
    file = tmp_path / 'scene.yaml'
    for name in ('hoeken', 'four_bar'):
        file.write_text(f'linkage: {name}')
        (scene_linkage,) = load_scene(file).linkages
        assert scene_linkage.linkage.links == load_scene(name).linkages[0].linkage.links
    # A file with a suffix, or in a folder, is the user's.
    (tmp_path / 'four_bar.yaml').write_text(load_scene('hoeken').files['linkage.yaml'].decode())
    file.write_text('linkage: four_bar.yaml')
    hoeken = load_scene('hoeken').linkages[0].linkage
    assert load_scene(file).linkages[0].linkage.links == hoeken.links
