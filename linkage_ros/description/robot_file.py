# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Read a robot whose URDF has loops: the keys that a scene says of it, declared once."""

from __future__ import annotations

from contextlib import suppress

from linkage_ros.description.grammar import ListOf, Named
from linkage_ros.description.linkage_grammar import FARTHEST, MOST_LINKS
from linkage_ros.description.parameters import (
    declare,
    Keys,
    Number,
    read_parameters,
    text,
    TextOf,
)
from linkage_ros.description.robot_loops import CLOSE_KINDS, RobotLoops
from linkage_ros.description.section import Section
from linkage_ros.description.space_grammar import NameOrNames
from linkage_ros.description.urdf_file import read_urdf
from linkage_ros.errors import DefinitionError, FileError, list_names
from linkage_ros.kinematics import check_limits, check_pose, SpaceClosure, SpaceLinkage

ROBOT = Keys(
    'A robot whose URDF has loops; all joints in them that are no inputs are published.',
    dict,
    {
        'urdf': text('path of the URDF, relative to the folder of this file'),
        'input': declare(
            NameOrNames(
                'The driven joint of the robot; several in a list.', TextOf('a joint of the robot')
            ),
            (),
        ),
        'at': declare(
            Named(
                'Values of joints at which all loops close, where they are not 0, by name.',
                Number('a value', 'rad or m', -FARTHEST, FARTHEST),
                MOST_LINKS,
            ),
            {},
        ),
        'close': declare(
            ListOf(
                'What else meets: FRAME=FRAME, links whose origins a ball joins, or places '
                f'LINK.x,y,z; FRAME=FRAME:KIND for another, {list_names(CLOSE_KINDS, " or ")}: a '
                'hinge turns about the z axis of the first frame.',
                TextOf('two frames'),
            ),
            (),
        ),
    },
)


def read_robot_closure(
    content: Section, name: str = '', *, publish_inputs: bool = False
) -> SpaceClosure:
    """Read the loops of a robot and check that they close; errors as in `read_closure`."""
    urdf = read_urdf(content.named_data, content.mapping['urdf'])
    slides = [joint.name for joint in urdf.joints.values() if joint.kind == 'prismatic']
    given = read_parameters(content, ROBOT, {'slide': slides})
    try:
        loops = RobotLoops(urdf, given['input'], given['at'], given['close'], publish_inputs)
        if loops.needless:
            # A robot may say roughly by a mimic what its loops do exactly.
            with suppress(DefinitionError):
                return _checked_closure(loops.close(loops.needless), name)
        return _checked_closure(loops.close(), name)
    except DefinitionError as error:
        raise _locate_error(content, error, urdf.file) from None


def _checked_closure(linkage: SpaceLinkage, name: str) -> SpaceClosure:
    closure = SpaceClosure(linkage, name)
    check_pose(closure)
    check_limits(closure)
    return closure


def _locate_error(content: Section, error: DefinitionError, file: str) -> FileError:
    """Return an error as one of the keys of the robot, or of a part of its URDF."""
    section, _, part = error.where.partition('.')
    if section in ('input', 'at', 'close', 'pose'):
        key = 'at' if section == 'pose' else section
        return content.error(key if key in content else '', error.reason, error.remedy)
    where = f'joint {part.partition(".")[0]}' if part else ''
    return FileError(file, where, error.reason, error.remedy)
