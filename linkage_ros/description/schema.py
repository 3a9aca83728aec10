# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
JSON Schemas of scene and linkage files, as `load` and `linkage_file` read them.

A schema accepts what the reader accepts, as far as it can know: it does not check names of joints,
pins and links. It uses draft 7 and ``$defs``, which editors support, and conditions rather than
alternatives, so that a violation has one location.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
import json
from math import inf
from typing import Any

from linkage_ros.description.linkage_file import FARTHEST, HEAVIEST, STRONGEST
from linkage_ros.description.parameters import (
    CHARACTER,
    mapping_schema,
    named_mapping,
    Number,
    parameters_schema,
    Point,
    Schema,
    TextOf,
)
from linkage_ros.description.scene import AS_THE_RUN_GOES, LEASTS, SPLITS, StorageParameters
from linkage_ros.description.scene_file import (
    HIGHEST_RATE,
    LOWEST_RATE,
    PUBLISHED_ANGLES,
)
from linkage_ros.description.units import ANGLES, LENGTHS
from linkage_ros.dynamics import AppliedLoads, GREATEST_LOAD, STIFFEST
from linkage_ros.stages.drives import DRIVES
from linkage_ros.stages.effects import EFFECTS
from linkage_ros.stages.faults import FAULTS

DIALECT = 'https://json-schema.org/draft/2020-12/schema'

ROS_NAME = '^[A-Za-z][A-Za-z0-9_]*$'

DOTTED = r'^[^.\s]+(\.[^.\s]+)+$'
"""Pattern of the name of a module within a package."""

_RATE = 'ticks a second; 0: one for every crank sample'
_NO_PLAY_UNDER_TORQUE: Schema = {
    'if': {
        'required': ['drive'],
        'properties': {'drive': {'required': ['torque']}},
    },
    'then': {'properties': {'effects': {'properties': {'backlash': False}}}},
}
_OWN_EFFECT: Schema = {
    'description': 'A user-defined effect: a module that Python finds, and its parameters.',
    'type': 'object',
    'additionalProperties': True,
}
_SHORTHANDS = ('four_bar', 'inverted_slider_crank')
_WRITTEN_OUT = ('links', 'input', 'joints')


_NAMED = (
    'path of the linkage file, relative to the folder of this file; or the name of a linkage that '
    'comes with the package'
)

_either_slider: Schema = {
    'if': {'required': ['slider']},
    'then': {'properties': {'parent': False, 'child': False}},
    'else': {'required': ['parent', 'child']},
}


def as_text(schema: Schema) -> str:
    """Return a schema as the text of its file."""
    return json.dumps(schema, indent=2, ensure_ascii=False, allow_nan=False) + '\n'


def _text_schema(description: str, pattern: str = f'^{CHARACTER}+$') -> Schema:
    return TextOf(description, pattern).json_schema()


def _number_schema(
    description: str,
    unit: str = '',
    *,
    least: float = -inf,
    most: float = inf,
    above: float = -inf,
) -> Schema:
    return Number(description, unit, least, most, above).json_schema()


def _point_schema(description: str, unit: str, most: float) -> Schema:
    return Point(description, unit, most).json_schema()


def parameter_types(registry: Mapping[str, str]) -> dict[str, Any]:
    """Return the parameter types of all drives or effects in a registry."""
    return {name: import_module(module).PARAMETERS for name, module in registry.items()}


def scene_schema() -> Schema:
    """Return the schema of a scene file; it imports all drives, effects and faults."""
    own = {key: {'$ref': f'#/$defs/{key}'} for key in _of_a_linkage()}
    whole = mapping_schema(
        'One or more linkages, their drives and effects, faults, and a recording.',
        {
            'linkage': _text_schema(_NAMED),
            'linkages': _linkages_schema(own),
            'rate': {
                **_number_schema(_RATE, 'Hz', least=0.0, most=HIGHEST_RATE),
                'if': {'type': 'number', 'exclusiveMinimum': 0},
                'then': _number_schema(_RATE, 'Hz', least=LOWEST_RATE),
                'default': 1000,
            },
            'units': _units_schema(),
            'angles': _angles_schema(),
            'seed': {
                'description': 'Seed of all random numbers; without it, a number that follows '
                'from the name of the scene.',
                'type': 'integer',
                'minimum': 0,
                'maximum': 2**53,
            },
            **own,
            'faults': {
                **named_mapping('Faults that can be injected, by name.', _fault_schema()),
                'propertyNames': _text_schema(
                    'a name: letters, digits and _, a letter first', ROS_NAME
                ),
            },
            'record': _record_schema(),
            'robot_description': {
                'description': 'Whether the node publishes the linkages as URDF on '
                'robot_description.',
                'type': 'boolean',
                'default': False,
            },
        },
    )
    return {
        '$schema': DIALECT,
        'title': 'Scene',
        **whole,
        'if': {'required': ['linkages']},
        'then': {'properties': {'linkage': False}},
        'else': {'required': ['linkage'], **_NO_PLAY_UNDER_TORQUE},
        '$defs': _of_a_linkage(),
    }


def _units_schema() -> Schema:
    return {
        'description': 'Unit of the lengths in this file: of all values whose unit is m, m/s or '
        'm/s². All other units are SI.',
        'enum': list(LENGTHS),
        'default': 'm',
    }


def _angles_schema() -> Schema:
    one = {'enum': [*PUBLISHED_ANGLES, *ANGLES]}
    return {
        'description': 'Whether published angles continue beyond a turn or are wrapped to '
        '(−π, π]; and the unit of the angles in this file: of all values whose unit is rad, '
        'rad/s or rad/s². One word, or one of each: [wrapped, degrees].',
        'if': {'type': 'array'},
        'then': {'items': one, 'maxItems': 2, 'uniqueItems': True},
        'else': one,
        'default': [PUBLISHED_ANGLES[0], ANGLES[0]],
    }


def _linkages_schema(own: Mapping[str, Schema]) -> Schema:
    one = mapping_schema(
        'A linkage; keys that it leaves out have the values of the scene.',
        {
            'name': _text_schema(
                'its name, and the prefix of its joints: letters, digits and _',
                ROS_NAME,
            ),
            'linkage': _text_schema(_NAMED),
            **own,
        },
        required=('name', 'linkage'),
    )
    one |= _NO_PLAY_UNDER_TORQUE
    return {
        'description': 'Several linkages instead of one.',
        'if': {'type': 'array'},
        'then': {'minItems': 1, 'items': one},
        'else': one,
    }


def _of_a_linkage() -> dict[str, Schema]:
    """Return the entries that a scene may have for all linkages, and each linkage for itself."""
    drives, effects = (
        {name: parameters_schema(of) for name, of in parameter_types(registry).items()}
        for registry in (DRIVES, EFFECTS)
    )
    return {
        'prefix': {
            'description': 'Put before the names of joints and links in messages and models; '
            "without it NAME_ where there are several linkages, else ''.",
            'type': 'string',
            'pattern': '^[A-Za-z0-9_/.-]*$',
        },
        'publish_input': {
            'description': 'Whether the input joints are published too, before the others; '
            'without it, yes if the drive is not a topic or the effect effort is named.',
            'type': 'boolean',
        },
        'beyond_limits': {
            'description': 'What is published while a joint is beyond its limits: the same as '
            'within them, or nothing.',
            'enum': ['publish', 'silent'],
            'default': 'publish',
        },
        'drive': {
            **mapping_schema('Source of the crank: one drive.', drives),
            'maxProperties': 1,
            'default': {'topic': {}},
        },
        'effects': {
            **mapping_schema('What to compute beyond positions.', effects),
            'patternProperties': {DOTTED: _OWN_EFFECT},
            'default': {},
        },
        'loads': mapping_schema(
            'The forces that act on the links, where effects or the drive ask for them.',
            {
                'gravity': {**_point_schema('gravity: [x, y]', 'm/s²', 1e3), 'default': [0, 0]},
                'springs': named_mapping(
                    'springs between points of links, by name', _spring_schema()
                ),
                'drive_inertia': {
                    **_number_schema(
                        'inertia of the motor, at the input',
                        'kg·m², or kg of a slide',
                        least=0.0,
                        most=GREATEST_LOAD,
                    ),
                    'default': 0,
                },
                **parameters_schema(AppliedLoads)['properties'],
            },
        ),
    }


def _spring_schema() -> Schema:
    end = _text_schema('its end: LINK.POINT', rf'^{CHARACTER}+\.{CHARACTER}+$')
    free = _number_schema('unloaded length', 'm', least=0.0, most=GREATEST_LOAD)
    damping = _number_schema('damping along the spring', 'N·s/m', least=0.0, most=STIFFEST)
    return mapping_schema(
        'A spring with a parallel damper.',
        {
            'from': end,
            'to': end,
            'stiffness': _number_schema('stiffness', 'N/m', least=0.0, most=STIFFEST),
            'free_length': {**free, 'default': 0},
            'damping': {**damping, 'default': 0},
        },
        required=('from', 'to', 'stiffness'),
    )


def _fault_schema() -> Schema:
    kinds = {name: parameters_schema(of) for name, of in FAULTS.items()}
    return {
        **mapping_schema(
            'A fault of one kind, injected by service or at given times.',
            {
                **kinds,
                'at': {
                    'description': 'when it is injected without a call, after the first tick [s]',
                    'type': 'array',
                    'items': _number_schema('a time', 's', least=0.0, most=1e9),
                },
                'seconds': _number_schema('how long it lasts', 's', least=1e-6, most=1e9),
            },
        ),
        'oneOf': [{'required': [kind]} for kind in kinds],
        'if': {'required': ['at'], 'properties': {'at': {'minItems': 1}}},
        'then': {'required': ['seconds']},
        'else': {'properties': {'seconds': False}},
    }


def _record_schema() -> Schema:
    storage = parameters_schema(StorageParameters)['properties']
    for key, least in LEASTS.items():
        above = {'if': {'exclusiveMinimum': 0}, 'then': {'minimum': least}}
        storage[key] = {**storage[key], **above}
    whole = mapping_schema(
        'How the run is recorded; without it, there is no recording.',
        {
            'directory': {
                **_text_schema(
                    'folder of the bags, relative to the working directory of the node'
                ),
                'default': 'runs',
            },
            'name': {
                **_text_schema(
                    "name of the bag's folder; '': the scene's name and the time; one that exists "
                    'gets a number',
                    rf'^(?!\.\.?$)(?!.*/){CHARACTER}*$',
                ),
                'default': '',
            },
            'queue': {
                'description': 'how many messages wait for the disk before more are dropped; one '
                'of more than 16 KiB counts as one for each 16 KiB',
                'type': 'integer',
                'minimum': 100,
                'maximum': 10_000_000,
                'default': 20_000,
            },
            **storage,
        },
    )
    one = {'required': ['split_bytes'], 'properties': {'split_bytes': {'maximum': 0}}}
    split = {'anyOf': [{'not': one}, _wanted_schema('split_seconds')]}
    one_file = f'without {" or ".join(SPLITS)} there is one file'
    alone = {'properties': {'keep_files': {'description': one_file, 'maximum': 0}}}
    in_memory = 'leave it out: with snapshot_seconds the run is kept in memory'
    not_in_memory = 'leave it out: without snapshot_seconds nothing is kept in memory'
    for_a_run = {'description': in_memory, 'maximum': 0}
    for_memory = {'description': not_in_memory, 'maximum': 0}
    return {
        **whole,
        'allOf': [
            {'if': split, 'else': alone},
            {
                'if': _wanted_schema('snapshot_seconds'),
                'then': {'properties': dict.fromkeys(AS_THE_RUN_GOES, for_a_run)},
                'else': {'properties': {'snapshot_bytes': for_memory}},
            },
        ],
    }


def _wanted_schema(key: str) -> Schema:
    """Return the schema of a mapping in which a number is given and not 0."""
    return {'required': [key], 'properties': {key: {'exclusiveMinimum': 0}}}


def linkage_schema() -> Schema:
    """Return the schema of a linkage file."""
    units = {
        'units': _units_schema(),
        'angles': _choice_schema('Unit of the angles.', ANGLES, ANGLES[0]),
    }
    whole = mapping_schema(
        'A planar linkage.', {**units, **_linkage_keys(), **_shorthand_schemas()}
    )
    return {
        '$schema': DIALECT,
        'title': 'Linkage',
        **whole,
        'if': {'anyOf': [{'required': [shorthand]} for shorthand in _SHORTHANDS]},
        'then': {
            'propertyNames': {'enum': [*units, *_SHORTHANDS]},
            'not': {'required': list(_SHORTHANDS)},
        },
        'else': {'required': list(_WRITTEN_OUT)},
    }


def _linkage_keys() -> dict[str, Schema]:
    place = _point_schema('where the point lies in the frame of its link: [x, y]', 'm', FARTHEST)
    return {
        'links': named_mapping(
            'Links, each with its points; a point on two links is a pin; one link is the ground.',
            named_mapping('points of the link, by name', place),
        ),
        'input': _input_schema(),
        'assembly': named_mapping(
            'Side of each pin or slider that closes a dyad; not needed if `pose` gives it.',
            _choice_schema('the side', ('left', 'right', 'ahead', 'behind')),
        ),
        'sliders': named_mapping(
            'Points that stay on lines of other links, by name.', _slider_schema()
        ),
        'joints': {
            **named_mapping('Published joints, in this order, by name.', _joint_schema()),
            'minProperties': 1,
        },
        'ratios': named_mapping(
            'Joints that follow others: gears, belts, racks, mimic.', _ratio_schema()
        ),
        'traced': {
            'description': 'Points whose paths are drawn.',
            'type': 'array',
            'items': _text_schema('a point'),
        },
        'pose': _pose_schema(),
        'masses': named_mapping('Masses of the links, by link name.', _mass_schema()),
    }


def _shorthand_schemas() -> dict[str, Schema]:
    lengths = {
        key: _number_schema(link, 'm', above=0.0, most=FARTHEST)
        for key, link in zip('abcd', ('crank', 'coupler', 'rocker', 'ground'), strict=True)
    }
    left, ahead = ('left', 'right'), ('ahead', 'behind')
    return {
        'four_bar': mapping_schema(
            'A four-bar by the lengths of its links; shorthand for a full file.',
            {
                **lengths,
                'assembly': _choice_schema('side of A→O4 on which B lies', left, left[0]),
                'pose': _pose_schema(),
                **_limits_of('coupler_joint', 'rocker_joint'),
            },
            required=tuple(lengths),
        ),
        'inverted_slider_crank': mapping_schema(
            'A crank whose rod slides through a swivel; shorthand for a full file.',
            {
                'a': _number_schema('crank', 'm', above=0.0, most=FARTHEST),
                'swivel': _point_schema(
                    "the swivel from the crank's pivot: [x, y]", 'm', FARTHEST
                ),
                'assembly': _choice_schema('side of B on which the swivel lies', ahead, ahead[0]),
                'pose': _pose_schema(),
                **_limits_of('rod_joint', 'rod_slide'),
            },
            required=('a', 'swivel'),
        ),
    }


def _input_schema() -> Schema:
    """Return the schema of one input, or a list of them."""
    one = {
        **mapping_schema(
            'The driven joint; several in a list.',
            {
                'joint': _text_schema('its name in crank messages'),
                'parent': _text_schema('the link that carries the motor'),
                'child': _text_schema('the link that is turned'),
                'slider': _text_schema('the driven slider, instead of parent and child'),
                **_limits_schemas(),
            },
            required=('joint',),
        ),
        **_either_slider,
    }
    return {
        'description': one['description'],
        'if': {'type': 'array'},
        'then': {'minItems': 1, 'items': one},
        'else': one,
    }


def _ratio_schema() -> Schema:
    return mapping_schema(
        'A published joint, as ratio · other joint + offset.',
        {
            'of': _text_schema('the joint that it follows: an input, or a published joint'),
            'ratio': _number_schema(
                'its displacement [rad or unit of length] when the other joint moves by 1',
                least=-FARTHEST,
                most=FARTHEST,
            )
            | {'default': 1},
            'offset': _number_schema(
                'its value where the other joint is at 0',
                'rad or m',
                least=-FARTHEST,
                most=FARTHEST,
            )
            | {'default': 0},
        },
        required=('of',),
    )


def _joint_schema() -> Schema:
    return {
        **mapping_schema(
            "The child's angle less the parent's [rad], or the slide of a slider [m].",
            {
                'parent': _text_schema('the link from which the angle is measured'),
                'child': _text_schema('the link whose angle it is'),
                'slider': _text_schema('the slider, instead of parent and child'),
                **_limits_schemas(),
            },
        ),
        **_either_slider,
    }


def _limits_schemas() -> dict[str, Schema]:
    """Return the schemas of a joint's limits."""
    return {
        'limits': {
            'description': 'limits of the joint: [low, high] [rad or m]; '
            '-.inf or .inf for no limit on a side',
            'type': 'array',
            'minItems': 2,
            'maxItems': 2,
            # The bounds may be -.inf and .inf: JSON Schema accepts these as numbers.
            'items': {'type': 'number'},
        },
        'velocity': _number_schema('its highest rate', 'rad/s or m/s', above=0.0, most=FARTHEST),
        'effort': _number_schema(
            'its highest torque or force', 'N·m or N', above=0.0, most=STRONGEST
        ),
    }


def _limits_of(*joints: str) -> dict[str, Schema]:
    """Return the schemas of the limits that a shorthand gives to its joints."""
    return {
        'input': mapping_schema('Limits of the driven joint.', _limits_schemas()),
        'joints': mapping_schema(
            'Limits of the published joints, by name.',
            {name: mapping_schema('Limits of the joint.', _limits_schemas()) for name in joints},
        ),
    }


def _slider_schema() -> Schema:
    return {
        **mapping_schema(
            'A point that stays on a line of the link `along`.',
            {
                'point': _text_schema('the point, on another link than `along`'),
                'along': _text_schema('the link that carries the line'),
                'through': _text_schema(
                    'point of `along` on the line; the slide is measured from it'
                ),
                'direction': _point_schema(
                    'direction of the line, in the frame of `along`: [x, y]', '', FARTHEST
                ),
                'block': {
                    **_text_schema('the link that slides without turning', f'^{CHARACTER}*$'),
                    'default': '',
                },
                'angle': {
                    **_number_schema(
                        'angle of the block relative to `along`',
                        'rad',
                        least=-FARTHEST,
                        most=FARTHEST,
                    ),
                    'default': 0,
                },
            },
            required=('point', 'along', 'through', 'direction'),
        ),
        'if': {'required': ['block']},
        'else': {'properties': {'angle': False}},
    }


def _pose_schema() -> Schema:
    return mapping_schema(
        'The pose as drawn, where the linkage starts. Points and angles select the assembly: as '
        'few as are needed; for links outside dyads they start the iteration.',
        {
            'inputs': {
                'description': 'a value for each input [rad or m]',
                'type': 'array',
                'items': _number_schema('a value', 'rad or m', least=-FARTHEST, most=FARTHEST),
            },
            'points': named_mapping(
                'points in the frame of the ground, roughly',
                _point_schema('[x, y]', 'm', FARTHEST),
            ),
            'angles': named_mapping(
                'angles of links to the ground, roughly',
                _number_schema('the angle', 'rad', least=-FARTHEST, most=FARTHEST),
            ),
        },
        required=('inputs',),
    )


def _mass_schema() -> Schema:
    return mapping_schema(
        'Mass properties of a link.',
        {
            'mass': _number_schema(
                'mass; 0: the link is massless', 'kg', least=0.0, most=HEAVIEST
            ),
            'center': _point_schema("centre of mass in the link's frame: [x, y]", 'm', FARTHEST),
            'inertia': _number_schema(
                'moment of inertia about the centre of mass', 'kg·m²', least=0.0, most=HEAVIEST
            ),
        },
        required=('mass', 'center', 'inertia'),
    )


def _choice_schema(description: str, words: tuple[str, ...], default: str = '') -> Schema:
    schema: Schema = {'description': description, 'enum': list(words)}
    return {**schema, 'default': default} if default else schema
