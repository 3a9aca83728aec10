# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A scene of several linkages: each as it would be alone, and one joint state for all."""

from linkage_ros.description import load_scene, parse_scene
from linkage_ros.errors import FileError
from linkage_ros.messages import input_samples, JointStateWriter, Rejection
from linkage_ros.tick import Pipeline
import pytest

from ..support.messages import read_joint_state as read, STORE
from ..support.scenes import four_bar_text, pipeline_of

MS = 1_000_000
BEGIN = 1_700_000_000_000_000_000
FOUR_BAR = 'four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1}'
HALF_OPEN = 'four_bar: {a: 1, b: 1, c: 1, d: 2.5}'  # reaches a part of the turn only
TWO = """
linkages:
  - {name: left, linkage: four_bar.yaml}
  - {name: right, linkage: half_open.yaml}
effects: {velocity: {}}
"""
LEFT = ['left_coupler_joint', 'left_rocker_joint']
RIGHT = ['right_coupler_joint', 'right_rocker_joint']


@pytest.fixture
def load(tmp_path):
    """Return a function that writes a scene and loads it."""
    (tmp_path / 'four_bar.yaml').write_text(FOUR_BAR)
    (tmp_path / 'half_open.yaml').write_text(HALF_OPEN)

    def load(text):
        (tmp_path / 'scene.yaml').write_text(text)
        return load_scene(tmp_path / 'scene.yaml')

    return load


def crank(now, **angles):
    names = list(angles)
    return JointStateWriter(names).write(now, list(angles.values()), [1.0] * len(names))


def test_each_of_two_linkages_equals_its_own_scene(load):
    both = Pipeline(load(TWO))
    left, right = (
        pipeline_of('effects: {velocity: {}}', FOUR_BAR),
        pipeline_of('effects: {velocity: {}}', HALF_OPEN),
    )
    for index in range(200):
        now = BEGIN + index * MS
        one, two = 0.03 * index, 0.001 * index
        assert both.offer(crank(now, right_crank_joint=two, left_crank_joint=one), now) is None
        assert left.offer(crank(now, crank_joint=one), now) is None
        assert right.offer(crank(now, crank_joint=two), now) is None
        state = read(both.tick(now).message)
        parts = [read(each.tick(now).message) for each in (left, right)]
        assert state.name == LEFT + RIGHT
        for field in ('position', 'velocity'):
            assert list(getattr(state, field)) == [v for p in parts for v in getattr(p, field)]


@pytest.mark.parametrize('effects', ['{velocity: {}}', '{}'])
def test_one_compiled_function_of_all_gives_equal_bytes(load, effects, monkeypatch):
    turning = 'drive: {constant_rate: {rate: 40.0}}'
    scene = load(f"""
linkages:
  - {{name: left, linkage: four_bar.yaml, {turning}, effects: {{velocity: {{}}}}}}
  - {{name: middle, linkage: four_bar.yaml, {turning}, effects: {effects}}}
  - {{name: right, linkage: half_open.yaml, {turning}, effects: {{velocity: {{}}}}}}
""")
    whole = Pipeline(scene)
    monkeypatch.setattr('linkage_ros.tick.compiled_tick._is_whole', lambda _: False)
    apart = Pipeline(scene)
    usual = 0
    for index in range(400):
        one, other = (work.tick(BEGIN + index * MS) for work in (whole, apart))
        usual += all(type(state) is tuple for state in one.computed)
        assert one.message == other.message
        for look, beside in zip(one.states, other.states, strict=True):
            assert (look.crank, look.reading) == (beside.crank, beside.reading)
    assert 0 < usual < 400


def test_message_is_parsed_only_for_new_joint_names(monkeypatch):
    parsed = []
    head_of = input_samples.head_of
    monkeypatch.setattr(
        input_samples, 'head_of', lambda message: parsed.append(message) or head_of(message)
    )
    routes = input_samples.SampleRouter({'left': ['a'], 'right': ['b']})
    wanted = {('a', 'b'): ('left', 'right'), ('b', 'c'): ('right',), ('b', 'a'): ('left', 'right')}
    writers = {names: JointStateWriter(names) for names in wanted}
    for stamp in range(1, 5):  # other stamps and values, the same names
        for names, receivers in wanted.items():
            message = writers[names].write(stamp, [0.1 * stamp, 7.0], [])
            assert routes.find_receivers(message) == receivers
    assert len(parsed) == len(wanted)


def test_linkage_without_a_crank_is_left_out(load):
    both = Pipeline(load(TWO))
    assert both.tick(BEGIN).message == b''
    # Each crank may come in a message of its own.
    assert both.offer(crank(BEGIN, right_crank_joint=0.1), BEGIN) is None
    assert read(both.tick(BEGIN).message).name == RIGHT
    assert both.offer(crank(BEGIN, left_crank_joint=0.1), BEGIN) is None
    assert read(both.tick(BEGIN).message).name == LEFT + RIGHT
    # The right one falls silent after max_age, the left one goes on.
    now = BEGIN + 250 * MS
    assert both.offer(crank(now, left_crank_joint=0.1), now) is None
    assert read(both.tick(now).message).name == LEFT


def test_open_linkage_is_left_out(load):
    both = Pipeline(load(TWO))
    both.offer(crank(BEGIN, left_crank_joint=0.1, right_crank_joint=3.0), BEGIN)
    tick = both.tick(BEGIN)
    assert read(tick.message).name == LEFT
    assert [look.reading is None for look in tick.states] == [False, True]


def test_message_without_any_input_is_rejected(load):
    both = Pipeline(load(TWO))
    for _ in range(2):  # the second time from memory
        message = crank(BEGIN, middle_crank_joint=0.1)
        assert both.offer(message, BEGIN) is Rejection.MISSING
    assert both.offer(b'rubbish', BEGIN) is Rejection.MALFORMED


def test_router_caches_at_most_1000_joint_layouts(load):
    both = Pipeline(load(TWO))
    for index in range(3000):
        both.offer(crank(BEGIN, **{f'joint_{index}': 0.1}), BEGIN)
    assert len(both._router._found) <= 1000
    assert both.offer(crank(BEGIN, left_crank_joint=0.1), BEGIN) is None


def test_each_linkage_may_have_its_drive_and_effects(load):
    text = """
linkages:
  - name: left
    linkage: four_bar.yaml
    drive: {constant_rate: {rate: 1.0}}
    effects: {acceleration: {}}
  - {name: right, linkage: half_open.yaml, publish_input: false}
drive: {constant_rate: {rate: 2.0}}
"""
    both = Pipeline(load(text))
    both.tick(BEGIN)
    tick = both.tick(BEGIN + 100 * MS)
    state = read(tick.message)
    assert state.name == ['left_crank_joint', *LEFT, *RIGHT]
    assert state.position[0] == pytest.approx(0.1, rel=1e-15)
    # One has rates and the other does not: an array for some joints is none of JointState's.
    assert len(state.velocity) == 0
    assert [extra.topic for extra in both.extras] == ['~/left/motion']
    motion = STORE.deserialize_cdr(tick.extras[0], 'trajectory_msgs/msg/JointTrajectory')
    assert motion.joint_names == ['left_crank_joint', *LEFT]
    assert tick.states[1].crank.angles == (pytest.approx(0.2, rel=1e-15),)


def test_noise_differs_from_linkage_to_linkage(load):
    text = """
linkages:
  - {name: left, linkage: four_bar.yaml}
  - {name: right, linkage: four_bar.yaml}
drive: {constant_rate: {rate: 1.0}}
effects: {noise: {joints: {rocker_joint: {white: 1.0e-3}}}}
"""
    both = Pipeline(load(text))
    state = read(both.tick(BEGIN).message)
    left, right = (state.position[state.name.index(f'{side}_rocker_joint')] for side in LR)
    assert left != right
    assert left == pytest.approx(right, abs=1e-2)


LR = ('left', 'right')


@pytest.mark.parametrize(
    ('fault', 'held'),
    [
        ('stuck: {joint: left_rocker_joint}', [True, False]),
        ('freeze: {}', [True, True]),
    ],
)
def test_fault_affects_only_the_named_joint(load, fault, held):
    both = Pipeline(
        load(f'{TWO}\ndrive: {{constant_rate: {{rate: 1.0}}}}\nfaults: {{f: {{{fault}}}}}')
    )
    before = read(both.tick(BEGIN).message)
    both.injection.switch_fault('f', True)
    after = read(both.tick(BEGIN + 100 * MS).message)
    for side, is_held in zip(LR, held, strict=True):
        place = before.name.index(f'{side}_rocker_joint')
        assert (before.position[place] == after.position[place]) == is_held


def test_broken_link_affects_one_linkage_only(load):
    text = f'{TWO}\ndrive: {{constant_rate: {{rate: 1.0}}}}\n'
    both = Pipeline(load(f'{text}faults: {{f: {{broken_link: {{link: right_coupler}}}}}}'))
    both.injection.switch_fault('f', True)
    assert read(both.tick(BEGIN).message).name == ['left_crank_joint', *LEFT]


def test_scene_files_of_a_bag_rebuild_the_scene(load):
    scene = load(TWO)
    assert list(scene.files) == ['scene.yaml', 'linkage_1.yaml', 'linkage_2.yaml']
    again = parse_scene(scene.name, 'a bag', scene.files)
    assert again == scene


def test_scene_of_100_linkages_publishes_200_joints(load):
    entries = '\n'.join(f'  - {{name: bar_{i}, linkage: four_bar.yaml}}' for i in range(100))
    scene = Pipeline(load(f'linkages:\n{entries}'))
    cranks = {f'bar_{i}_crank_joint': 0.01 * i for i in range(100)}
    assert scene.offer(crank(BEGIN, **cranks), BEGIN) is None
    state = read(scene.tick(BEGIN).message)
    assert len(state.name) == len(state.position) == 200
    one = pipeline_of('effects: {velocity: {}}', FOUR_BAR)
    for i in (0, 17, 99):
        one.offer(crank(BEGIN, crank_joint=0.01 * i), BEGIN)
        found = [state.position[2 * i], state.position[2 * i + 1]]
        assert found == list(read(one.tick(BEGIN).message).position)


@pytest.mark.parametrize(
    ('text', 'expected'),
    [
        ('linkages: []', 'linkages: the list is empty'),
        ('linkages: [{linkage: four_bar.yaml}]', "the key 'name' is missing"),
        ('linkages: [{name: a/b, linkage: four_bar.yaml}]', "'a/b' is not a ROS name"),
        ('linkages: [{name: a}]', "the key 'linkage' is missing"),
        ('linkages: [{name: a, linkage: none.yaml}]', 'is not a file'),
        (
            'linkages: [{name: a, linkage: four_bar.yaml}, {name: a, linkage: four_bar.yaml}]',
            "'a' is taken; give each its own",
        ),
        (
            'linkage: four_bar.yaml\nlinkages: [{name: a, linkage: four_bar.yaml}]',
            'linkage: cannot be combined with linkages; write one of the two',
        ),
        ('linkages: [{name: a, linkage: four_bar.yaml, rate: 5}]', 'rate: unknown key'),
        (
            'linkages: [{name: a, linkage: four_bar.yaml, effects: {velosity: {}}}]',
            "did you mean 'velocity'?",
        ),
    ],
)
def test_wrong_list_of_linkages_is_refused_in_one_line(load, text, expected):
    with pytest.raises(FileError) as caught:
        load(text)
    assert expected in str(caught.value)
    assert '\n' not in str(caught.value)


MEASURED = 'delay: {seconds: 0.004, stamp: measured}'


@pytest.mark.parametrize(
    ('left', 'right', 'fits'),
    [
        (MEASURED, MEASURED, True),
        (MEASURED, '', False),
        (MEASURED, 'delay: {seconds: 0.005, stamp: measured}', False),
        (MEASURED, 'delay: {seconds: 0.004}', False),
        ('delay: {seconds: 0.004}', '', True),
    ],
)
def test_measured_stamp_must_be_set_for_all_linkages(load, left, right, fits):
    scene = load(
        'linkages:\n'
        f'  - {{name: left, linkage: four_bar.yaml, effects: {{{left}}}}}\n'
        f'  - {{name: right, linkage: half_open.yaml, effects: {{{right}}}}}\n'
    )
    if fits:
        Pipeline(scene)
        return
    with pytest.raises(
        FileError, match=r'effects\.delay\.stamp: measured gives a linkage its own stamp'
    ):
        Pipeline(scene)


def test_common_stamp_is_that_of_the_newest_measurement(load):
    """Each crank turns at 1 rad/s from 0 on: its angle is the time at which it was measured."""
    turning = 'drive: {constant_rate: {rate: 1.0}}, publish_input: true'
    pipeline = Pipeline(
        load(f"""
linkages:
  - {{name: left, linkage: four_bar.yaml, {turning}}}
  - {{name: right, linkage: four_bar.yaml, {turning}}}
effects: {{delay: {{seconds: 0.002, spread: 0.01, stamp: measured}}}}
""")
    )
    together = 0
    for index in range(400):
        message = pipeline.tick(BEGIN + index * MS).message
        if not message:
            continue
        state = read(message)
        measured = [
            angle
            for name, angle in zip(state.name, state.position, strict=True)
            if name.endswith('crank_joint')
        ]
        stamp = state.header.stamp.sec * 1_000_000_000 + state.header.stamp.nanosec - BEGIN
        assert stamp == pytest.approx(1e9 * max(measured), abs=2.0)
        together += len(set(measured)) == 2
    assert together >= 20


UNPREFIXED = """
linkages:
  - {name: left, linkage: left.yaml, prefix: ''}
  - {name: right, linkage: right.yaml}
drive: {topic: {}}
effects: {velocity: {}, pin_forces: {}, markers: {}}
"""


@pytest.mark.parametrize('where', ['entry', 'scene'])
def test_names_without_a_prefix_equal_those_of_the_files(load, tmp_path, where):
    # As a URDF has them; the crank is one motor for both.
    for side in ('left', 'right'):
        masses = ((0.2, 0.02, 1e-4), (0.3, 0.06, 1e-3), (0.2, 0.04, 1e-3))
        text = four_bar_text(0.04, 0.12, 0.08, 0.1, masses)
        text = text.replace('rocker_joint', f'{side}_knee')
        (tmp_path / f'{side}.yaml').write_text(text)
    text = UNPREFIXED.replace(', linkage: right.yaml', ", linkage: right.yaml, prefix: ''")
    if where == 'scene':
        text = text.replace(", prefix: ''", '') + "prefix: ''\n"
    scene = load(text)
    assert scene.joint_names == ('left_knee', 'right_knee')
    pipeline = Pipeline(scene)
    assert pipeline.offer(crank(BEGIN, crank_joint=0.5), BEGIN) is None
    state = read(pipeline.tick(BEGIN).message)
    assert state.name == ['left_knee', 'right_knee']
    assert state.position[0] == state.position[1]
    assert [extra.topic for extra in pipeline.extras] == [
        '~/left/pin_forces', '~/left/markers', '~/right/pin_forces', '~/right/markers',
    ]  # fmt: skip


PREFIXES = {
    'one of its own': ("prefix: 'arm/l-'", 'arm/l-coupler_joint'),
    'none for the only one': ("prefix: ''", 'coupler_joint'),
    'one for the only one': ('prefix: finger_', 'finger_coupler_joint'),
}


@pytest.mark.parametrize('kind', PREFIXES)
def test_prefix_precedes_the_joint_names_as_written(load, kind):
    text, joint = PREFIXES[kind]
    scene = load(f'linkage: four_bar.yaml\n{text}\n')
    assert scene.joint_names[0] == joint
    assert scene.linkages[0].input_names == (joint.replace('coupler', 'crank'),)


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        (
            TWO.replace('half_open.yaml}', "half_open.yaml, prefix: 'left_'}"),
            'prefix: a second linkage publishes left_coupler_joint, left_rocker_joint; give each',
        ),
        (TWO + "prefix: ''\n", 'a second linkage publishes coupler_joint, rocker_joint; give'),
        (TWO + "prefix: 'a b'\n", "prefix: 'a b' cannot begin a joint name; use letters"),
    ],
)
def test_prefix_with_colliding_joint_names_is_refused(load, text, said):
    with pytest.raises(FileError) as caught:
        load(text)
    assert said in str(caught.value)
