# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Start linkage_node, and robot_state_publisher on request.

``ros2 launch linkage_ros linkage.launch.py scene:=/path/to/scene.yaml``

CI does not run it, since pip cannot install launch: a test there runs it against stubs.
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from linkage_ros.errors import LinkageError, quote
from linkage_ros.tools.models import model_of, urdf_model as write_urdf

SHARE = Path(get_package_share_directory('linkage_ros'))

ARGUMENTS = {
    'scene': ('', "Scene file; '': the scene of params_file."),
    'params_file': (str(SHARE / 'config' / 'linkage_node.yaml'), 'Parameters of linkage_node.'),
    'namespace': ('', 'Namespace of both nodes and their relative topics.'),
    'use_sim_time': (
        '',
        "true: tick on /clock instead of the steady clock; '': the value of params_file.",
    ),
    'crank_states': (
        'crank_states',
        'Topic of the crank; joint_states if joint_state_broadcaster publishes it.',
    ),
    'robot_description_file': ('', "URDF for robot_state_publisher; '': do not start it."),
    'robot_state_publisher': (
        'false',
        'Start it without a file too, with the model of the scene; Jazzy reads no topic.',
    ),
    'publish_frequency': (
        '',
        "Most transforms of a joint a second, 1 to 1000; '': those of params_file, or 1000.",
    ),
    'frame_prefix': ('', "Before all frames, as left/; '': the value of params_file."),
}

FASTEST = 1000.0
"""Most that robot_state_publisher takes [Hz]; by default it takes 20, each topic by itself."""


FLAGS = {'true': True, '1': True, 'false': False, '0': False}


def nodes(context):
    """Return the nodes to start, from the values of the arguments."""
    value = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    # Later parameters override earlier ones: an empty argument must not override the file.
    scene = {'scene': value['scene']} if value['scene'] else {}
    shows = not value['robot_description_file'] and flag(value, 'robot_state_publisher')
    # Else the publisher would know joints that nobody publishes.
    model = {'model_joints': True} if shows else {}
    clock = {'use_sim_time': flag(value, 'use_sim_time')} if value['use_sim_time'] else {}
    yield Node(
        package='linkage_ros',
        executable='linkage_node',
        name='linkage_node',
        namespace=value['namespace'],
        parameters=[value['params_file'], {**clock, **scene, **model}],
        remappings=[('crank_states', value['crank_states'])],
        output='screen',
        on_exit=tell_failure,
    )
    urdf = ''
    if value['robot_description_file']:
        urdf = text_of(value['robot_description_file'])
    elif shows:
        if not value['scene']:
            raise LinkageError('robot_state_publisher', 'has no scene', 'name scene:=FILE too')
        urdf = model_of(value['scene'], write_urdf).decode()
    if urdf:
        yield Node(
            package='robot_state_publisher',
            executable='robot_state_publisher',
            name='robot_state_publisher',
            namespace=value['namespace'],
            # The file sets its clock, which has to be that of the node.
            parameters=[
                {'publish_frequency': FASTEST},
                value['params_file'],
                {**clock, **frames(value), 'robot_description': urdf},
            ],
            output='screen',
        )


def frames(value):
    """Return the parameters of the transforms that are given."""
    given = {'frame_prefix': value['frame_prefix']} if value['frame_prefix'] else {}
    if text := value['publish_frequency']:
        try:
            given['publish_frequency'] = float(text)
        except ValueError:
            where = f'publish_frequency {quote(text)}'
            raise LinkageError(where, 'is not a number', f'write 1 to {FASTEST:g}') from None
    return given


def flag(value, name):
    """Return the value of an argument that is true or false."""
    text = value[name].lower()
    if text not in FLAGS:
        raise LinkageError(
            name, f'{quote(value[name])} is not true or false', 'write true or false'
        )
    return FLAGS[text]


def text_of(file):
    """Return the robot model in a file."""
    try:
        return Path(file).read_text(encoding='utf-8')
    except (OSError, ValueError) as error:  # the latter for a NUL in the name, or no UTF-8
        reason = getattr(error, 'strerror', None) or str(error)
        where = f'robot_description_file {quote(file)}'
        raise LinkageError(where, f'cannot be read ({reason})', 'name a URDF file') from None


def tell_failure(event, context):
    """Make launch end with exit code 1 if the node fails, and keep the other nodes running."""
    if event.returncode:
        # A raised exception would shut down all other nodes of the launch file.
        message = f'linkage_node ended with {event.returncode}: its last lines say why'
        context.asyncio_loop.call_exception_handler({'message': message})


def generate_launch_description():
    """Return the launch description, as `ros2 launch` requires it."""
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=text)
                for name, (default, text) in ARGUMENTS.items()
            ),
            OpaqueFunction(function=lambda context: list(nodes(context))),
        ]
    )
