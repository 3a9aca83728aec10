# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The keys of a scene file, declared once: how each is read, and its JSON Schema."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from functools import partial
import json
from pathlib import Path
from re import fullmatch
from typing import Any

from linkage_ros.description.grammar import (
    DIALECT,
    LENGTH_UNIT,
    ListOf,
    Named,
    one_or_more,
    optional_keys,
)
from linkage_ros.description.parameters import (
    CHARACTER,
    choice,
    components,
    declare,
    declared_fields,
    example_of,
    flag,
    is_required,
    Keys,
    Kind,
    mapping_schema,
    Number,
    number,
    ParameterGroup,
    parameters_schema,
    Parts,
    read_parameters,
    Rule,
    Schema,
    text,
    TextOf,
    whole_number,
)
from linkage_ros.description.scene import (
    AS_THE_RUN_GOES,
    RecordParameters,
    SPLITS,
    StorageParameters,
)
from linkage_ros.description.section import Section
from linkage_ros.description.units import ANGLES
from linkage_ros.dynamics import AppliedLoads, GREATEST_LOAD, Loads, Spring, STIFFEST
from linkage_ros.errors import DefinitionError, did_you_mean, list_names, quote, read_each
from linkage_ros.stages.drives import drive_class, DRIVES
from linkage_ros.stages.effects import effect_class, EFFECTS, in_order

LOWEST_RATE, HIGHEST_RATE = 0.01, 20_000.0
"""Bounds of the tick rate, in [Hz]; the higher was measured as what one core sustains."""

PUBLISHED_ANGLES = ('continuous', 'wrapped')
"""How angles are published; see `Scene.wrapped`."""

_ROS_NAME = '^[A-Za-z][A-Za-z0-9_]*$'
_DOTTED = r'^[^.\s]+(\.[^.\s]+)+$'
"""Pattern of the name of a module within a package."""

_NAMED_LINKAGE = TextOf(
    'path of the linkage file, relative to the folder of this file; or the name of a linkage that '
    'comes with the package'
)


class _Prefix(TextOf):
    """A beginning of joint names; '' is one too."""

    def read(self, content: Section, key: str, parts: Parts, folder: str) -> str:
        prefix = content.text(key, '')
        if not fullmatch(self.pattern, prefix):
            reason = f'{quote(prefix)} cannot begin a joint name'
            raise content.error(key, reason, 'use letters, digits and _/.-')
        return prefix


class _DriveChoice(Kind):
    """One drive, read as its name and parameters."""

    def read(self, content: Section, key: str, parts: Parts, folder: str) -> tuple[str, Any]:
        drives = drive_section(content, key)
        name = drive_name(drives)
        driven = drives.section(
            name, required=False, example=lambda _: example_of(drive_class(name), parts)
        )
        return name, read_parameters(driven, drive_class(name), parts, folder)

    def json_schema(self) -> Schema:
        drives = {name: parameters_schema(of) for name, of in parameter_types(DRIVES).items()}
        return {**mapping_schema(self.meaning, drives), 'maxProperties': 1}


class _Effects(Kind):
    """Effects, read as their parameters by name; the part 'left_out' has those not imported."""

    def read(self, content: Section, key: str, parts: Parts, folder: str) -> dict[str, Any]:
        effects = effects_section(content, lambda: parts, key)
        types = effect_types(effects, parts['left_out'])
        for name in types:
            effects.remove_key(name)
        readers: dict[str, Callable[[], Any]] = {
            name: partial(ParameterGroup('', of).read, effects, name, parts, '')
            for name, of in types.items()
        }
        values = read_each(readers | {'': partial(effects.finish, tuple(EFFECTS))})
        del values['']
        return values

    def json_schema(self) -> Schema:
        effects = {name: parameters_schema(of) for name, of in parameter_types(EFFECTS).items()}
        own = {
            'description': 'A user-defined effect: a module that Python finds, and its '
            'parameters.',
            'type': 'object',
            'additionalProperties': True,
        }
        return {**mapping_schema(self.meaning, effects), 'patternProperties': {_DOTTED: own}}


def drive_section(content: Section, key: str = 'drive') -> Section:
    """Return the mapping with the drive; an error shows an example."""

    def example(name: str) -> str:
        if not name:
            return '{topic: {}}'
        return example_of(drive_class(name), {}) if name in DRIVES else ''

    return content.section(key, required=False, example=example)


def effects_section(content: Section, parts: Callable[[], Parts], key: str = 'effects') -> Section:
    """Return the mapping of effects; an error shows an example, with names from ``parts``."""

    def example(name: str) -> str:
        if not name:
            return '{velocity: {}}'
        return example_of(effect_class(name), parts()) if name in EFFECTS else ''

    return content.section(key, required=False, example=example)


def effect_types(effects: Section, left_out: Sequence[str]) -> dict[str, Any]:
    """Return the classes of the named effects, in physical order."""
    for name in left_out:
        effects.section(name)
    known = [name for name in effects if name in EFFECTS or '.' in name]
    try:
        named = in_order([name for name in known if name not in left_out])
        return {name: effect_class(name) for name in named}
    except DefinitionError as error:
        raise effects.locate_error(error) from None


class _SpringEnd(TextOf):
    """A point of a link, read as the names of both."""

    def example(self, parts: Parts) -> str:
        return next(iter(parts.get('point', ())), '…')

    def read(self, content: Section, key: str, parts: Parts, folder: str) -> Any:
        link, dot, point_name = content.text(key).rpartition('.')
        if not dot or not link or not point_name:
            raise content.error(key, f'{content.text(key)!r} is not a point', 'write LINK.POINT')
        return link, point_name


def _build_spring(**values: Any) -> Spring:
    ends = (*values.pop('from'), *values.pop('to'))
    return Spring(*ends, **values)


_END = _SpringEnd('its end: LINK.POINT', rf'^{CHARACTER}+\.{CHARACTER}+$')
_SPRING = Keys(
    'A spring with a parallel damper.',
    _build_spring,
    {
        'from': declare(_END),
        'to': declare(_END),
        'stiffness': number('stiffness', unit='N/m', least=0.0, most=STIFFEST),
        'free_length': number('unloaded length', 0.0, unit='m', least=0.0, most=GREATEST_LOAD),
        'damping': number('damping along the spring', 0.0, unit='N·s/m', least=0.0, most=STIFFEST),
    },
)


def _build_loads(
    gravity: Any, drive_inertia: float, springs: Mapping[str, Spring] | None = None, **applied: Any
) -> Loads:
    named = tuple(replace(spring, name=name) for name, spring in (springs or {}).items())
    return Loads(gravity, named, drive_inertia, AppliedLoads(**applied))


_LOADS = Keys(
    'The forces that act on the links, where effects or the drive ask for them.',
    _build_loads,
    {
        'gravity': components(
            'gravity: [x, y], in space [x, y, z]', (0.0, 0.0), unit='m/s²', most=1e3
        ),
        'springs': declare(
            Named(
                'springs between points of links, by name',
                ParameterGroup(_SPRING.meaning, _SPRING),
            ),
            None,
        ),
        'drive_inertia': number(
            'inertia of the motor, at the input',
            0.0,
            unit='kg·m², or kg of a slide',
            least=0.0,
            most=GREATEST_LOAD,
        ),
        **{entry.name: entry for entry in fields(AppliedLoads)},
    },
)
DRIVE = _DriveChoice('Source of the crank: one drive.')
EFFECTS_BY_NAME = _Effects('What to compute beyond positions.')
OF_A_LINKAGE = Keys(
    'What a scene may say for all linkages, and each linkage for itself.',
    dict,
    {
        'prefix': declare(
            _Prefix(
                'Put before the names of joints and links in messages and models; without it '
                "NAME_ where there are several linkages, else ''.",
                '^[A-Za-z0-9_/.-]*$',
            ),
            None,
        ),
        'publish_input': flag(
            'Whether the input joints are published too, before the others; without it, yes if '
            'the drive is not a topic or the effect effort is named.',
            None,
        ),
        'beyond_limits': choice(
            'What is published while a joint is beyond its limits: the same as within them, or '
            'nothing.',
            ('publish', 'silent'),
            'publish',
        ),
        'drive': declare(DRIVE, {'topic': {}}),
        'effects': declare(EFFECTS_BY_NAME, {}),
        'loads': optional_keys(_LOADS),
    },
)


class _Rate(Number):
    """A rate: 0, or within narrower bounds."""

    def read(self, content: Section, key: str, parts: Parts, folder: str) -> float:
        rate = Number.read(self, content, key, parts, folder)
        if 0.0 < rate < LOWEST_RATE:
            raise content.error(
                key,
                f'{rate:g} is out of bounds',
                f'write {LOWEST_RATE:g} to {self.most:g} [Hz], or 0 for once for every sample',
            )
        return rate

    def json_schema(self) -> Schema:
        then = replace(self, least=LOWEST_RATE, most=float('inf'))
        above = {'type': 'number', 'exclusiveMinimum': 0}
        return {**Number.json_schema(self), 'if': above, 'then': Number.json_schema(then)}


class _AngleWords(Kind):
    """One word, or a list of one of each group."""

    def read(self, content: Section, key: str, parts: Parts, folder: str) -> list[str]:
        return content.choose_words(key, (PUBLISHED_ANGLES, ANGLES))

    def json_schema(self) -> Schema:
        word = {'enum': [*PUBLISHED_ANGLES, *ANGLES]}
        return {
            'description': self.meaning,
            'if': {'type': 'array'},
            'then': {'items': word, 'maxItems': 2, 'uniqueItems': True},
            'else': word,
        }


class _FaultKind(Kind):
    """A fault of one kind, and when it is injected; only scenes with faults import them."""

    def read(self, content: Section, key: str, parts: Parts, folder: str) -> Any:
        from linkage_ros.stages.faults import FaultEntry, FAULTS  # local import: for few scenes

        name = content.ros_name(key)
        content = content.section(key, example=lambda kind: self._example_for(kind, parts))
        kinds = [kind for kind in content if kind in FAULTS]
        for stranger in () if kinds else content:
            if remedy := did_you_mean(stranger, FAULTS, ''):
                raise content.error(stranger, 'unknown key', remedy)
        if len(kinds) != 1:
            raise content.error('', *kinds_of_fault(name, kinds))
        of = FAULTS[kinds[0]]
        injected = content.section(kinds[0], example=lambda _: example_of(of, parts))
        parameters = read_parameters(injected, of, parts)
        at = _WHEN.read_key(content, 'at', parts) or ()
        if any(time < 0.0 for time in at):
            raise content.error(
                'at', f'{list(at)} has a negative time', 'write seconds after the first tick'
            )
        seconds = _WHEN.read_key(content, 'seconds', parts) if at else 0.0
        content.finish(tuple(_WHEN.entries))
        return FaultEntry(kinds[0], parameters, at, seconds)

    def example(self, parts: Parts) -> str:
        return self._example_for('', parts)

    def _example_for(self, kind: str, parts: Parts) -> str:
        from linkage_ros.stages.faults import FAULTS  # local import: as above

        if kind:
            return example_of(FAULTS[kind], parts) if kind in FAULTS else ''
        return f'{{silence: {example_of(FAULTS["silence"], parts)}}}'

    def json_schema(self) -> Schema:
        from linkage_ros.stages.faults import FAULTS  # local import: as above

        kinds = {name: parameters_schema(of) for name, of in FAULTS.items()}
        when = {entry.name: kind.json_schema() for entry, kind in declared_fields(_WHEN)}
        return {
            **mapping_schema(self.meaning, kinds | when),
            'oneOf': [{'required': [kind]} for kind in kinds],
            'if': {'required': ['at'], 'properties': {'at': {'minItems': 1}}},
            'then': {'required': ['seconds']},
            'else': {'properties': {'seconds': False}},
        }


def kinds_of_fault(name: str, kinds: Sequence[str]) -> tuple[str, str]:
    """Return reason and remedy for a fault that names no kind, or several."""
    from linkage_ros.stages.faults import FAULTS  # local import: as above

    if kinds:
        others = f'leave all but one of {list_names(kinds)} out'
        return f'names {len(kinds)} kinds of fault', others
    kind = name if name in FAULTS else 'freeze'
    needed = declared_fields(FAULTS[kind])
    parameters = ', '.join(f'{entry.name}: …' for entry, _ in needed if is_required(entry))
    shape = f'{name}: {{{kind}: {{{parameters}}}, at: [1], seconds: 2}}'
    return 'names no kind of fault', f'write {shape}; kinds: {list_names(FAULTS)}'


_WHEN = Keys(
    'When a fault is injected without a call.',
    dict,
    {
        'at': declare(
            ListOf(
                'when it is injected without a call, after the first tick [s]',
                Number('a time', 's', 0.0, 1e9),
            ),
            None,
        ),
        'seconds': number('how long it lasts', unit='s', least=1e-6, most=1e9),
    },
)


class _BagName(TextOf):
    """A name without folders; '' is one too."""

    def read(self, content: Section, key: str, parts: Parts, folder: str) -> str:
        name = content.text(key, '')
        if name != Path(name).name or name == '..':
            raise content.error(key, f'{name!r} is not a plain name', 'leave out the folders')
        return name


def _has_value(key: str) -> Schema:
    """Return the schema of a mapping in which a number is given and not 0."""
    return {'required': [key], 'properties': {key: {'exclusiveMinimum': 0}}}


class _InMemoryOrOnDisk(Rule):
    """What is for a bag is 0 for a run in memory, and the other way round; files need a split."""

    def check_values(self, content: Section, values: Mapping[str, Any]) -> None:
        """Refuse settings without an effect."""
        if values['snapshot_seconds']:
            for key in AS_THE_RUN_GOES:
                if content.mapping.get(key, 0) != 0:
                    raise content.error(
                        key,
                        'is for a bag that is written as the run goes, and snapshot_seconds keeps '
                        'the run in memory',
                        'leave one of the two out',
                    )
        elif 'snapshot_bytes' in content:
            reason = 'nothing is kept in memory'
            raise content.error('snapshot_bytes', reason, 'write snapshot_seconds too')
        if values['keep_files'] and not any(values[key] for key in SPLITS):
            remedy = f'write {" or ".join(SPLITS)} too'
            raise content.error('keep_files', 'the bag has only one file', remedy)

    def json_schema(self) -> Schema:
        unsplit = {'required': ['split_bytes'], 'properties': {'split_bytes': {'maximum': 0}}}
        one_file = f'without {" or ".join(SPLITS)} there is one file'
        in_memory = 'leave it out: with snapshot_seconds the run is kept in memory'
        not_in_memory = 'leave it out: without snapshot_seconds nothing is kept in memory'
        for_a_run = {'description': in_memory, 'maximum': 0}
        for_memory = {'description': not_in_memory, 'maximum': 0}
        return {
            'allOf': [
                {
                    'if': {'anyOf': [{'not': unsplit}, _has_value('split_seconds')]},
                    'else': {
                        'properties': {'keep_files': {'description': one_file, 'maximum': 0}}
                    },
                },
                {
                    'if': _has_value('snapshot_seconds'),
                    'then': {'properties': dict.fromkeys(AS_THE_RUN_GOES, for_a_run)},
                    'else': {'properties': {'snapshot_bytes': for_memory}},
                },
            ]
        }


def _build_record(directory: str, name: str, queue: int, **storage: Any) -> RecordParameters:
    return RecordParameters(directory, name, queue, StorageParameters(**storage))


_RECORD = Keys(
    'How the run is recorded; without it, there is no recording.',
    _build_record,
    {
        'directory': text(
            'folder of the bags, relative to the working directory of the node', 'runs'
        ),
        'name': declare(
            _BagName(
                "name of the bag's folder; '': the scene's name and the time; one that exists "
                'gets a number',
                rf'^(?!\.\.?$)(?!.*/){CHARACTER}*$',
            ),
            '',
        ),
        'queue': whole_number(
            'how many messages wait for the disk before more are dropped; one of more than 16 KiB '
            'counts as one for each 16 KiB',
            20_000,
            least=100,
            most=10_000_000,
        ),
        **{entry.name: entry for entry in fields(StorageParameters)},
    },
    (_InMemoryOrOnDisk(),),
)
SCENE = Keys(
    'One or more linkages, their drives and effects, faults, and a recording.',
    dict,
    {
        'rate': declare(
            _Rate('ticks a second; 0: one for every crank sample', 'Hz', 0.0, HIGHEST_RATE), 1000.0
        ),
        'units': LENGTH_UNIT,
        'angles': declare(
            _AngleWords(
                'Whether published angles continue beyond a turn or are wrapped to (−π, π]; and '
                'the unit of the angles in this file: of all values whose unit is rad, rad/s or '
                'rad/s². One word, or one of each: [wrapped, degrees].'
            ),
            (PUBLISHED_ANGLES[0], ANGLES[0]),
        ),
        'seed': whole_number(
            'Seed of all random numbers; without it, a number that follows from the name of the '
            'scene.',
            None,
            least=0,
            most=2**53,
        ),
        **OF_A_LINKAGE.entries,
        'faults': declare(
            Named(
                'Faults that can be injected, by name.',
                _FaultKind('A fault of one kind, injected by service or at given times.'),
                names=TextOf(
                    'a name: letters, digits and _, a letter first', _ROS_NAME
                ).json_schema(),
            ),
            None,
        ),
        'record': optional_keys(_RECORD),
        'robot_description': flag(
            'Whether the node publishes the linkages as URDF on robot_description.', False
        ),
        'model_joints': flag(
            'Whether all joints of the robot model are published, in space also those by which '
            'rods and struts hang, and of links between joints; without it as robot_description.',
            None,
        ),
    },
)


def drive_name(drives: Section) -> str:
    """Return the name of the drive in its section."""
    named = list(drives) or ['topic']
    if len(named) > 1:
        raise drives.error(named[1], 'is a second drive', f'leave it, or {named[0]}, out')
    if named[0] not in DRIVES:
        drives.finish(tuple(DRIVES))
    return named[0]


def parameter_types(registry: Mapping[str, str]) -> dict[str, Any]:
    """Return the parameter types of all drives or effects in a registry."""
    class_of = effect_class if registry is EFFECTS else drive_class
    return {name: class_of(name) for name in registry}


def _refused_pairs() -> Schema:
    """Return the schema that refuses an effect with a drive that excludes it."""
    drives: dict[str, dict[str, bool]] = {}
    for name in EFFECTS:
        for drive in effect_class(name).refused_drives:
            drives.setdefault(drive, {})[name] = False
    ((drive, refused),) = drives.items()
    return {
        'if': {'required': ['drive'], 'properties': {'drive': {'required': [drive]}}},
        'then': {'properties': {'effects': {'properties': refused}}},
    }


def scene_schema() -> Schema:
    """Return the schema of a scene file; it imports all drives, effects and faults."""
    from linkage_ros.description.robot_file import ROBOT  # local import: for few scenes

    own = {key: {'$ref': f'#/$defs/{key}'} for key in OF_A_LINKAGE.entries}
    linkage = {'$ref': '#/$defs/linkage'}
    robot = {'if': {'type': ['object']}, 'then': parameters_schema(ROBOT)}
    named = _NAMED_LINKAGE.json_schema()
    either = {'description': f'{_NAMED_LINKAGE.meaning}; or a robot', **robot, 'else': named}
    name = TextOf('its name, and the prefix of its joints: letters, digits and _', _ROS_NAME)
    single = mapping_schema(
        'A linkage; keys that it leaves out have the values of the scene.',
        {'name': name.json_schema(), 'linkage': linkage, **own},
        required=('name', 'linkage'),
    )
    several = one_or_more('Several linkages instead of one.', single | _refused_pairs())
    keys = parameters_schema(SCENE)['properties'] | own
    return {
        '$schema': DIALECT,
        'title': 'Scene',
        **mapping_schema(SCENE.meaning, {'linkage': linkage, 'linkages': several, **keys}),
        'if': {'required': ['linkages']},
        'then': {'properties': {'linkage': False}},
        'else': {'required': ['linkage'], **_refused_pairs()},
        '$defs': parameters_schema(OF_A_LINKAGE)['properties'] | {'linkage': either},
    }


def as_text(schema: Schema) -> str:
    """Return a schema as the text of its file."""
    return json.dumps(schema, indent=2, ensure_ascii=False, allow_nan=False) + '\n'
