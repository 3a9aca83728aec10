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


"""The JSON Schema of a scene file: what `linkage_ros.scene.load` reads."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any

from linkage_ros.drives.drive import DRIVES
from linkage_ros.effects.stage import EFFECTS
from linkage_ros.faults.fault import FAULTS
from linkage_ros.parameters import declared
from linkage_ros.scene.load import HIGHEST_RATE, LOWEST_RATE
from linkage_ros.scene.schema import (
    CHARACTER,
    DIALECT,
    DOTTED,
    is_required,
    mapping,
    named,
    number,
    parameters_schema,
    point,
    ROS_NAME,
    Schema,
    text,
)
from linkage_ros.scene.solving import COARSEST_ACCURACY, FINEST_ACCURACY
from linkage_ros.scene.storage import AS_THE_RUN_GOES, LEASTS, SPLITS, StorageParameters
from linkage_ros.solvers.registry import SOLVERS

_RATE = 'Ticks a second [Hz]; 0: one for every crank sample.'
_ONE_SOLVER: Schema = {'not': {'required': ['solver', 'accuracy']}}
_NO_PLAY_UNDER_TORQUE: Schema = {
    'if': {
        'required': ['drive'],
        'properties': {'drive': {'required': ['torque']}},
    },
    'then': {'properties': {'effects': {'properties': {'backlash': False}}}},
}
_OWN_EFFECT: Schema = {
    'description': "An effect of one's own: a module that Python finds, and its parameters.",
    'type': 'object',
    'additionalProperties': True,
}
_STRONGEST = 1e9
_STIFFEST = 1e12


def parameter_types(registry: Mapping[str, str]) -> dict[str, Any]:
    """Return the type of parameters of each drive, effect or fault of a registry."""
    return {name: import_module(module).PARAMETERS for name, module in registry.items()}


def scene_schema() -> Schema:
    """Return the schema of a scene file; it imports all drives, effects and faults."""
    own = {key: {'$ref': f'#/$defs/{key}'} for key in _of_a_linkage()}
    whole = mapping(
        'A linkage or several, what drives them, what is called for, and a recording.',
        {
            'linkage': text('path of the linkage file, relative to the folder of this file'),
            'linkages': _linkages(own),
            'rate': {
                **number(_RATE, least=0.0, most=HIGHEST_RATE),
                'if': {'exclusiveMinimum': 0},
                'then': number(_RATE, least=LOWEST_RATE),
                'default': 1000,
            },
            'angles': {
                'description': 'Whether published angles run on, or lie in (−π, π].',
                'enum': ['continuous', 'wrapped'],
                'default': 'continuous',
            },
            'seed': {
                'description': 'From which everything random comes; if not said, a number that '
                'follows from the name of the scene.',
                'type': 'integer',
                'minimum': 0,
                'maximum': 2**53,
            },
            **own,
            'faults': {
                **named('What can go wrong on demand, by a name for each.', _fault()),
                'propertyNames': text('a name: letters, digits and _, a letter first', ROS_NAME),
            },
            'record': _record(),
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
        **_ONE_SOLVER,
        '$defs': _of_a_linkage(),
    }


def _linkages(own: Mapping[str, Schema]) -> Schema:
    one = mapping(
        'A linkage; what it does not say for itself is as the scene says.',
        {
            'name': text(
                'its name, which its joints have before their own: letters, digits and _',
                ROS_NAME,
            ),
            'linkage': text('path of its file, relative to the folder of this file'),
            **own,
        },
        required=('name', 'linkage'),
    )
    one |= _ONE_SOLVER | _NO_PLAY_UNDER_TORQUE
    return {
        'description': 'Several linkages in the place of one.',
        'if': {'type': 'array'},
        'then': {'minItems': 1, 'items': one},
        'else': one,
    }


def _of_a_linkage() -> dict[str, Schema]:
    """Return what the scene says for all linkages, and each may say for itself."""
    drives, effects = (
        {name: parameters_schema(of) for name, of in parameter_types(registry).items()}
        for registry in (DRIVES, EFFECTS)
    )
    return {
        'publish_input': {
            'description': 'Whether the input joints are published too, before the others; '
            'without it, they are where the drive is no topic, or effort is named.',
            'type': 'boolean',
        },
        'beyond_limits': {
            'description': 'What is published while a joint is beyond its limits: the same as '
            'within them, or nothing.',
            'enum': ['publish', 'silent'],
            'default': 'publish',
        },
        'drive': {
            **mapping('Where the crank comes from: one drive.', drives),
            'maxProperties': 1,
            'default': {'topic': {}},
        },
        'effects': {
            **mapping('What is called for beyond positions.', effects),
            'patternProperties': {DOTTED: _OWN_EFFECT},
            'default': {},
        },
        'solver': _solver(),
        'accuracy': number(
            'Of the positions [rad or m]: the cheapest solver that proves it is chosen.',
            least=FINEST_ACCURACY,
            most=COARSEST_ACCURACY,
        ),
        'loads': mapping(
            'The forces that act on the links, where effects or the drive ask for them.',
            {
                'gravity': {**point('gravity: [x, y] [m/s²]', 1e3), 'default': [0, 0]},
                'springs': named('springs between points of links, by name', _spring()),
                'drive_inertia': {
                    **number(
                        'of the motor, at the input [kg·m², or kg of a slide]',
                        least=0.0,
                        most=_STRONGEST,
                    ),
                    'default': 0,
                },
            },
        ),
    }


def _solver() -> Schema:
    solvers = parameter_types(SOLVERS)
    alone = [
        name
        for name, of in solvers.items()
        if not any(is_required(entry) for entry, _ in declared(of))
    ]
    one = mapping(
        'How the loops are closed: one solver.',
        {name: parameters_schema(of) for name, of in solvers.items()},
    )
    others = ', '.join(f'{{{name}: {{…}}}}' for name in solvers if name not in alone)
    return {
        'description': one['description'],
        'if': {'type': 'string'},
        'then': {'enum': alone, 'description': f'or with its parameters: {others}'},
        'else': {**one, 'minProperties': 1, 'maxProperties': 1},
        'default': 'closed_form',
    }


def _spring() -> Schema:
    end = text('where it ends: LINK.POINT', rf'^{CHARACTER}+\.{CHARACTER}+$')
    free = number('length without a force [m]', least=0.0, most=_STRONGEST)
    damping = number('damping along it [N·s/m]', least=0.0, most=_STIFFEST)
    return mapping(
        'A spring, with a damper beside it.',
        {
            'from': end,
            'to': end,
            'stiffness': number('stiffness [N/m]', least=0.0, most=_STIFFEST),
            'free_length': {**free, 'default': 0},
            'damping': {**damping, 'default': 0},
        },
        required=('from', 'to', 'stiffness'),
    )


def _fault() -> Schema:
    kinds = {name: parameters_schema(of) for name, of in parameter_types(FAULTS).items()}
    return {
        **mapping(
            'A fault of one kind, injected by service, or at the times that are said.',
            {
                **kinds,
                'at': {
                    'description': 'when it is injected by itself, from the first tick on [s]',
                    'type': 'array',
                    'items': number('a time [s]', least=0.0, most=1e9),
                },
                'seconds': number('how long it lasts then [s]', least=1e-6, most=1e9),
            },
        ),
        'oneOf': [{'required': [kind]} for kind in kinds],
        'if': {'required': ['at'], 'properties': {'at': {'minItems': 1}}},
        'then': {'required': ['seconds']},
        'else': {'properties': {'seconds': False}},
    }


def _record() -> Schema:
    storage = parameters_schema(StorageParameters)['properties']
    for key, least in LEASTS.items():
        above = {'if': {'exclusiveMinimum': 0}, 'then': {'minimum': least}}
        storage[key] = {**storage[key], **above}
    whole = mapping(
        'How the run is recorded; without it, it is not.',
        {
            'directory': {
                **text("folder of the bags' folders, relative to where the node is started"),
                'default': 'runs',
            },
            'name': {
                **text(
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
    split = {'anyOf': [{'not': one}, _wanted('split_seconds')]}
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
                'if': _wanted('snapshot_seconds'),
                'then': {'properties': dict.fromkeys(AS_THE_RUN_GOES, for_a_run)},
                'else': {'properties': {'snapshot_bytes': for_memory}},
            },
        ],
    }


def _wanted(key: str) -> Schema:
    """Return the schema of a mapping in which a number is given that is not 0."""
    return {'required': [key], 'properties': {key: {'exclusiveMinimum': 0}}}
