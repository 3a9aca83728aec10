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


"""linkage.launch.py, run against stubs: no launch that pip could install exists."""

import asyncio
from dataclasses import dataclass, field
import importlib.util
import sys
from types import ModuleType, SimpleNamespace

from linkage_ros.errors import LinkageError, quoted
import pytest


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


def test_by_default_the_node_runs_alone_with_the_installed_parameters(root, start):
    (node,) = start()
    assert node['executable'] == 'linkage_node'
    assert node['parameters'] == [str(root / 'config' / 'linkage_node.yaml'), {}]


def test_a_scene_goes_before_that_of_the_parameter_file(start):
    (node,) = start(scene='/scenes/mine.yaml', params_file='/mine.yaml')
    assert node['parameters'][0] == '/mine.yaml'
    assert node['parameters'][-1]['scene'] == '/scenes/mine.yaml'


def test_arguments_reach_the_node(start):
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
def test_a_clock_that_is_said_goes_before_that_of_the_parameter_file(start, said, meant):
    (node,) = start(use_sim_time=said, params_file='/mine.yaml')
    assert node['parameters'] == ['/mine.yaml', {'use_sim_time': meant}]


@pytest.mark.parametrize('said', ['yes', 'no', 'on', 'tru', '2', ' '])
@pytest.mark.parametrize('name', ['use_sim_time', 'robot_state_publisher'])
def test_what_is_no_flag_is_refused(start, name, said):
    with pytest.raises(LinkageError) as caught:
        start(**{name: said})
    assert str(caught.value) == ' '.join(
        f'{name}: {said!r} is not a flag; write true or false'.split()
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
def test_a_description_that_cannot_be_read(start, tmp_path, file, reason):
    (tmp_path / 'latin.urdf').write_bytes(b'<robot\xff')
    path = tmp_path / file
    with pytest.raises(LinkageError) as caught:
        start(robot_description_file=str(path))
    assert str(caught.value) == (
        f'robot_description_file {quoted(str(path))}: cannot be read ({reason}); name a URDF file'
    )


@pytest.mark.parametrize('code', [2, 1, -9, 0])
def test_launch_ends_with_1_where_the_node_does_not_end_well(start, code):
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


def test_both_nodes_have_one_clock(start, root):
    scene = root / 'config' / 'scenes' / 'bare.yaml'
    own, publisher = start(scene=str(scene), params_file='/mine.yaml', robot_state_publisher='1')
    assert own['parameters'][0] == publisher['parameters'][0] == '/mine.yaml'
    assert 'use_sim_time' not in publisher['parameters'][1]


def test_a_urdf_starts_robot_state_publisher(start, tmp_path):
    urdf = tmp_path / 'robot.urdf'
    urdf.write_text('<robot name="r"/>', encoding='utf-8')
    _, publisher = start(robot_description_file=str(urdf), namespace='arm')
    assert publisher['package'] == publisher['executable'] == 'robot_state_publisher'
    assert publisher['namespace'] == 'arm'
    assert publisher['parameters'][-1]['robot_description'] == '<robot name="r"/>'


def test_robot_state_publisher_takes_the_model_that_the_scene_makes(start, root):
    scene = root / 'config' / 'scenes' / 'two_fingers.yaml'
    _, publisher = start(scene=str(scene), robot_state_publisher='true')
    model = publisher['parameters'][-1]['robot_description']
    assert '<robot name="two_fingers">' in model
    assert '<joint name="left_rocker_joint" type="revolute">' in model


def test_without_a_scene_there_is_no_model(start):
    with pytest.raises(LinkageError, match='has no scene; name scene:=FILE too'):
        start(robot_state_publisher='true')
