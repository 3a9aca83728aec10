# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""linkage.launch.py, run against stubs: no launch that pip could install exists."""

import asyncio
from cmath import exp
from dataclasses import dataclass, field
import importlib.util
import sys
from types import ModuleType, SimpleNamespace

from linkage_ros.description import load_scene
from linkage_ros.errors import LinkageError, quote
from linkage_ros.kinematics import usual_inputs
from linkage_ros.messages import JointStateWriter
from linkage_ros.resources import linkage_names, spatial_linkage_names
from linkage_ros.tick import Pipeline
import pytest

from ..support.messages import joint_state, read_joint_state
from ..support.scenes import FOUR_BAR, pipeline_of
from ..tools.models.walked import BEGIN, heard, MS, Walked


@dataclass
class Recorded:
    """Takes the place of an action of launch: remembers what it was made with."""

    arguments: tuple = ()
    options: dict = field(default_factory=dict)

    def __init__(self, *arguments, **options):
        self.arguments = arguments
        self.options = options

    def perform(self, context):
        """Substitute, as LaunchConfiguration does."""
        return context[self.arguments[0]]


@pytest.fixture
def launch_file(root, monkeypatch):
    stubs = {
        'ament_index_python.packages': {'get_package_share_directory': lambda _: str(root)},
        'launch': {'LaunchDescription': list},
        'launch.actions': {'DeclareLaunchArgument': Recorded, 'OpaqueFunction': Recorded},
        'launch.substitutions': {'LaunchConfiguration': Recorded},
        'launch_ros.actions': {'Node': Recorded},
    }
    for name, contents in stubs.items():
        stub = ModuleType(name)
        vars(stub).update(contents)
        monkeypatch.setitem(sys.modules, name, stub)
        monkeypatch.setitem(
            sys.modules, name.split('.')[0], sys.modules.get(name.split('.')[0], stub)
        )
    path = root / 'launch' / 'linkage.launch.py'
    spec = importlib.util.spec_from_file_location('linkage_launch', path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def start(launch_file):
    """Return a function that gives the nodes' options for some launch arguments."""

    def start(**arguments):
        *declared, function = launch_file.generate_launch_description()
        context = {
            argument.arguments[0]: argument.options['default_value'] for argument in declared
        }
        assert set(arguments) <= set(context)
        return [node.options for node in function.options['function'](context | arguments)]

    return start


def test_launch_starts_the_node_with_installed_parameters(root, start):
    (node,) = start()
    assert node['executable'] == 'linkage_node'
    assert node['parameters'] == [str(root / 'config' / 'linkage_node.yaml'), {}]


def test_scene_argument_overrides_the_parameter_file(start):
    (node,) = start(scene='/scenes/mine.yaml', params_file='/mine.yaml')
    assert node['parameters'][0] == '/mine.yaml'
    assert node['parameters'][-1]['scene'] == '/scenes/mine.yaml'


def test_launch_arguments_reach_the_node(start):
    (node,) = start(namespace='arm', use_sim_time='true', crank_states='joint_states')
    assert node['namespace'] == 'arm'
    assert node['parameters'][-1]['use_sim_time'] is True
    assert node['remappings'] == [('crank_states', 'joint_states')]


@pytest.mark.parametrize(
    ('said', 'meant'),
    [
        ('true', True),
        ('True', True),
        ('1', True),
        ('false', False),
        ('FALSE', False),
        ('0', False),
    ],
)
def test_use_sim_time_argument_overrides_the_parameter_file(start, said, meant):
    (node,) = start(use_sim_time=said, params_file='/mine.yaml')
    assert node['parameters'] == ['/mine.yaml', {'use_sim_time': meant}]


@pytest.mark.parametrize('said', ['yes', 'no', 'on', 'tru', '2', ' '])
@pytest.mark.parametrize('name', ['use_sim_time', 'robot_state_publisher'])
def test_launch_refuses_a_flag_that_is_not_boolean(start, name, said):
    with pytest.raises(LinkageError) as caught:
        start(**{name: said})
    assert str(caught.value) == ' '.join(
        f'{name}: {said!r} is not true or false; write true or false'.split()
    )


@pytest.mark.parametrize(
    ('file', 'reason'),
    [
        ('none.urdf', 'No such file or directory'),
        ('.', 'Is a directory'),
        (
            'latin.urdf',
            "'utf-8' codec can't decode byte 0xff in position 6: invalid start byte",
        ),
    ],
)
def test_launch_refuses_an_unreadable_robot_description(start, tmp_path, file, reason):
    (tmp_path / 'latin.urdf').write_bytes(b'<robot\xff')
    path = tmp_path / file
    with pytest.raises(LinkageError) as caught:
        start(robot_description_file=str(path))
    assert str(caught.value) == (
        f'robot_description_file {quote(str(path))}: cannot be read ({reason}); name a URDF file'
    )


@pytest.mark.parametrize('code', [2, 1, -9, 0])
def test_launch_exits_with_1_after_a_node_failure(start, code):
    """
    As launch ends where an exception is handled (launch_service.py, run_async).

    That is what its loop's handler of exceptions sets, without a shutdown of other nodes.
    """
    (node,) = start()
    loop = asyncio.new_event_loop()
    handled = []
    loop.set_exception_handler(lambda _, what: handled.append(what['message']))
    context = SimpleNamespace(asyncio_loop=loop)
    assert node['on_exit'](SimpleNamespace(returncode=code), context) is None
    loop.close()
    said = f'linkage_node ended with {code}: its last lines say why'
    assert handled == ([said] if code else [])


def test_both_launched_nodes_share_one_clock_parameter(start, root):
    scene = root / 'config' / 'scenes' / 'bare.yaml'
    own, publisher = start(scene=str(scene), params_file='/mine.yaml', robot_state_publisher='1')
    assert own['parameters'][0] == publisher['parameters'][1] == '/mine.yaml'
    assert 'use_sim_time' not in publisher['parameters'][-1]


def test_urdf_argument_starts_robot_state_publisher(start, tmp_path):
    urdf = tmp_path / 'robot.urdf'
    urdf.write_text('<robot name="r"/>', encoding='utf-8')
    _, publisher = start(robot_description_file=str(urdf), namespace='arm')
    assert publisher['package'] == publisher['executable'] == 'robot_state_publisher'
    assert publisher['namespace'] == 'arm'
    assert publisher['parameters'][-1]['robot_description'] == '<robot name="r"/>'


def test_robot_state_publisher_receives_the_model_of_the_scene(start, root):
    scene = root / 'config' / 'scenes' / 'two_fingers.yaml'
    _, publisher = start(scene=str(scene), robot_state_publisher='true')
    model = publisher['parameters'][-1]['robot_description']
    assert '<robot name="two_fingers">' in model
    assert '<joint name="left_rocker_joint" type="revolute">' in model


def test_robot_state_publisher_without_a_scene_is_refused(start):
    with pytest.raises(LinkageError, match='has no scene; name scene:=FILE too'):
        start(robot_state_publisher='true')


def test_publish_frequency_and_frame_prefix_reach_robot_state_publisher(start, root):
    given = {'scene': str(root / 'config' / 'scenes' / 'bare.yaml'), 'robot_state_publisher': '1'}
    _, publisher = start(**given)
    first, _, last = publisher['parameters']
    assert first == {'publish_frequency': 1000.0}, 'the file may change it'
    assert set(last) == {'robot_description'}
    _, publisher = start(**given, publish_frequency='250', frame_prefix='left/')
    last = publisher['parameters'][-1]
    assert (last['publish_frequency'], last['frame_prefix']) == (250.0, 'left/')
    with pytest.raises(LinkageError) as caught:
        start(**given, publish_frequency='fast')
    assert str(caught.value) == "publish_frequency 'fast': is not a number; write 1 to 1000"


class RobotStatePublisher:
    """What robot_state_publisher 3.3 does with joint states: it throttles by their stamps."""

    def __init__(self, frequency):
        self._interval = int(1000.0 / frequency) * 1_000_000
        self._stamps, self.angles = {}, {}

    def take(self, names, positions, stamp):
        """Take a message; the transforms of all of its joints are published, or none."""
        if stamp >= min(self._stamps.get(name, 0) for name in names) + self._interval:
            self.angles |= zip(names, positions, strict=True)
            self._stamps |= dict.fromkeys(names, stamp)


A, B, C, D = 0.04, 0.12, 0.08, 0.1


def gap_of_pin(angles):
    """Return how far both ends of the four-bar's cut pin are apart in tf, in [m]."""
    crank, coupler, rocker = (angles[f'{name}_joint'] for name in ('crank', 'coupler', 'rocker'))
    over_coupler = A * exp(1j * crank) + B * exp(1j * (crank + coupler))
    return abs(over_coupler - D - C * exp(1j * rocker))


# (rate of the scene, whether it publishes the input, least and greatest gap in [m]).
STREAMS = {
    'at its default of 20 Hz the streams come apart': (100, False, 20.0, 2e-3, 1e-2),
    'at that of the launch file by less than a period of the crank': (100, False, None, 0, 8e-4),
    'once for every sample not at all': (0, False, None, 0, 1e-12),
    'in one message not at all': (100, True, None, 0, 1e-12),
    'in one message not at all, whatever the frequency': (100, True, 20.0, 0, 1e-12),
}


@pytest.mark.parametrize('name', STREAMS)
def test_two_streams_of_joint_states_agree_in_tf(start, root, name):
    """A broadcaster at 100 Hz, the crank at 1 rad/s; the node ticks 3 ms after it."""
    rate, publish_input, frequency, least, most = STREAMS[name]
    if frequency is None:
        scene = str(root / 'config' / 'scenes' / 'bare.yaml')
        _, publisher = start(scene=scene, robot_state_publisher='true')
        frequency = publisher['parameters'][0]['publish_frequency']
    pipeline = pipeline_of(
        f'rate: {rate}\npublish_input: {str(publish_input).lower()}\neffects: {{velocity: {{}}}}',
        FOUR_BAR,
    )
    tf = RobotStatePublisher(frequency)
    gaps = []
    for index in range(500):
        stamp = 10**12 + index * 10_000_000
        angle = 0.01 * index
        message = joint_state(['crank_joint'], [angle], [1.0], stamp=divmod(stamp, 10**9))
        assert pipeline.offer(message, stamp) is None
        if not publish_input:
            tf.take(['arm', 'crank_joint'], [0.0, angle], stamp)
        at = stamp if rate == 0 else stamp + 3_000_000
        # It starts a little after the broadcaster, so that each stream has a phase of its own.
        if index >= 2:
            state = read_joint_state(pipeline.tick(at).message)
            tf.take(state.name, state.position, at)
            gaps.append(gap_of_pin(tf.angles))
    assert least <= max(gaps) <= most


@pytest.mark.sample(4)
@pytest.mark.parametrize('name', [*linkage_names(), *spatial_linkage_names()])
def test_tf_of_every_gallery_linkage_closes_its_loops(start, name):
    """What its two processes publish places every link, and the loops meet."""
    node, publisher = start(scene=name, robot_state_publisher='true')
    given = node['parameters'][-1]
    settings = [f'{key}={value!s}'.lower() for key, value in given.items() if key != 'scene']
    scene = load_scene(given['scene'], settings)
    pipeline, (scene_linkage,) = Pipeline(scene), scene.linkages
    model = Walked(publisher['parameters'][-1]['robot_description'].encode())
    inputs = scene_linkage.linkage.inputs
    pose = usual_inputs(scene_linkage.closure)
    writer = JointStateWriter([driven.joint for driven in inputs])
    shown = 0
    for index in range(8):
        now = BEGIN + 20 * index * MS
        at = [value + 0.002 * index * (1 if k % 2 else -1) for k, value in enumerate(pose)]
        driven = dict(zip([driven.joint for driven in inputs], at, strict=True))
        if scene_linkage.drive[0] == 'topic':
            pipeline.offer(writer.write(now, at, [0.0] * len(at)), now)
        message = pipeline.tick(now).message
        if message:
            joints = dict(zip(*heard(message), strict=True))
            model.pose(*zip(*{**driven, **joints}.items(), strict=True))
            assert model.gap() < 1e-9
            shown += 1
    assert shown > 4
