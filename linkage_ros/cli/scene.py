# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Describe a scene, or list its errors; or list what scenes can name."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import chain
import sys
from threading import Event
from typing import Any

from linkage_ros.cli.arguments import add_set, check_no_settings, finite_or_none, SCENE_HELP
from linkage_ros.cli.result import add_result, Result, show_result, tables_json
from linkage_ros.cli.table import Column, facts_table, Table
from linkage_ros.description import (
    as_text,
    declared_fields,
    default_of,
    first_docstring_line,
    is_required,
    linkage_schema,
    load_scene,
    parameter_rows,
    Scene,
    scene_notes,
    scene_schema,
    Units,
)
from linkage_ros.errors import did_you_mean, LinkageError, list_names
from linkage_ros.messages import JOINT_STATE_TYPE
from linkage_ros.stages.drives import drive_class, DRIVES
from linkage_ros.stages.effects import effect_class, EFFECTS, effects_requiring
from linkage_ros.stages.faults import FAULTS
from linkage_ros.tick import LinkagePipeline, Pipeline

_MOST_NAMES = 4
_LONGEST = 60

REGISTRIES: Mapping[str, Mapping[str, Any]] = {
    'drive': DRIVES,
    'effect': EFFECTS,
    'fault': FAULTS,
}
"""Everything that a scene can name, by kind."""

_STAGE = (
    Column('>', 'number'),
    Column('stage', 'name'),
    'where',
    Column('what it does', 'meaning'),
    Column('in this scene', 'parameters'),
    Column('', 'needed_by'),
)
_FAULT = (
    'name',
    'kind',
    Column('in this scene', 'parameters'),
    'injected',
    Column(None, 'at', 's'),
    Column(None, 'seconds', 's'),
)
_TOPIC = (
    Column('', 'what'),
    Column('topic', 'name'),
    Column('message', 'type'),
    Column('', 'note'),
)
_PARAMETER = [Column(name, name) for name in ('parameter', 'unit', 'default', 'values', 'meaning')]

SCHEMAS = {'scene': scene_schema, 'linkage': linkage_schema}
"""Functions that make the JSON Schema of each kind of file."""

EXAMPLE = 'linkage scene worn_press --set rate=500'


def scene_tables(scene: Scene, pipeline: Pipeline, title: str) -> Iterator[Table]:
    """Yield the tables of a scene that has been built."""
    yield facts_table(title, chain(_scene_facts(scene), _force_facts(pipeline)))
    for lines in _group_alike(pipeline.linkages):
        names = _shorten_list(
            [line.scene_linkage.name for line in lines if line.scene_linkage.name]
        )
        title = f'Stages of {names}' if names else 'Stages'
        yield Table(title, _STAGE, list(_stage_rows(lines[0])), 'stages')
    if scene.faults:
        yield Table('Faults', _FAULT, list(_fault_rows(scene)), 'faults')
    yield Table('Topics', _TOPIC, list(_topic_rows(scene, pipeline)), 'topics')


def _scene_facts(scene: Scene) -> Iterator[tuple[str, str]]:
    if scene.linkages[0].name:
        yield 'linkages', _shorten_list([scene_linkage.name for scene_linkage in scene.linkages])
    joints = list(scene.joint_names)
    yield 'joints', _shorten_list(joints)
    rate = f'{scene.rate:g} a second' if scene.rate else 'one for every crank sample'
    yield 'ticks', rate
    yield 'angles', 'wrapped to (−π, π]' if scene.wrapped else 'continuous'
    yield 'seed', str(scene.seed)
    record = scene.record
    recorded = (
        f'{record.directory}/{record.name or f"{scene.name}, and the time"}' if record else 'no'
    )
    yield 'recorded', recorded


def _force_facts(pipeline: Pipeline) -> Iterator[tuple[str, str]]:
    """Yield what is not certain of the forces in joints."""
    for line in pipeline.linkages:
        if 'pin_forces' in line.wanted.effects and line.context.reactions.uncertain:
            yield 'not certain', line.context.reactions.uncertain


def _group_alike(linkages: list[LinkagePipeline]) -> list[list[LinkagePipeline]]:
    """Return the linkages; those with the same drive and effects share a row."""
    groups: dict[str, list[LinkagePipeline]] = {}
    for line in linkages:
        groups.setdefault(repr((line.scene_linkage.drive, line.scene_linkage.effects)), []).append(
            line
        )
    return list(groups.values())


def _list_stages(linkage: LinkagePipeline) -> Iterator[tuple[str, str, Any, tuple[str, ...]]]:
    """Yield the stages of a tick in order: name, place, parameters, the effects that need it."""
    name, parameters = linkage.scene_linkage.drive
    yield name, 'drive', parameters, ()
    named = linkage.scene_linkage.effects
    for name, effect in linkage.wanted.effects.items():
        yield name, effect.place, effect, () if name in named else effects_requiring(name, named)


def _stage_rows(line: LinkagePipeline) -> Iterator[tuple[str, ...]]:
    units, linkage = line.scene_linkage.content.units, line.scene_linkage.linkage
    slides = {name: joint.unit == 'm' for name, joint in linkage.joints.items()}
    slides |= {driven.joint: driven.unit == 'm' for driven in linkage.inputs}
    for index, (name, where, parameters, needed_by) in enumerate(_list_stages(line)):
        yield (
            *(str(index), name, where, first_docstring_line(type(parameters))),
            _parameters_text(parameters, units, slides),
            f'needed by {", ".join(needed_by)}' if needed_by else '',
        )


def _fault_rows(scene: Scene) -> Iterator[tuple[Any, ...]]:
    for name, fault in scene.faults.items():
        times = ', '.join(f'{time:g}' for time in fault.at)
        when = f'at {times} s, for {fault.seconds:g} s' if fault.at else 'on demand only'
        parameters = _parameters_text(fault.parameters, Units(), {})
        yield name, fault.kind, parameters, when, list(fault.at), fault.seconds


def _topic_rows(scene: Scene, pipeline: Pipeline) -> Iterator[tuple[str, ...]]:
    if pipeline.topic:
        yield 'listens to', pipeline.topic, JOINT_STATE_TYPE, ''
    for wrench in pipeline.wrenches:
        yield 'listens to', wrench.topic, 'geometry_msgs/msg/WrenchStamped', wrench.key
    yield 'publishes', 'joint_states', JOINT_STATE_TYPE, f'{len(scene.joint_names)} joints'
    for extra in pipeline.extras:
        yield 'publishes', extra.topic, extra.message, ''
    if scene.faults:
        yield 'publishes', '~/faults', 'std_msgs/msg/String', 'which are injected'
        services = [f'~/inject/{name}' for name in scene.faults]
        yield 'serves', _shorten_list(services), 'std_srvs/srv/SetBool', ''


def _parameters_text(parameters: Any, units: Units, slides: Mapping[str, bool]) -> str:
    """
    Return the parameters that differ from their defaults, in the units of a file.

    ``slides`` says of each joint whether it slides.
    """

    def value_text(value: Any, unit: str, units: Units) -> str:
        if isinstance(value, tuple | list):
            return f'[{", ".join(value_text(item, unit, units) for item in value)}]'
        if isinstance(value, dict):
            texts = (
                f'{key}: {value_text(item, unit, replace(units, slides=slides.get(key)))}'
                for key, item in value.items()
            )
            return f'{{{", ".join(texts)}}}'
        if hasattr(value, '__dataclass_fields__'):
            return f'{{{_parameters_text(value, units, slides)}}}'
        return f'{units.to_file_unit(value, unit):g}' if isinstance(value, float) else str(value)

    texts = []
    for entry, kind in declared_fields(type(parameters)):
        unit = kind.unit or getattr(getattr(kind, 'of', kind), 'unit', '')  # of each, if of many
        text = value_text(getattr(parameters, entry.name), unit, units)
        if is_required(entry) or text != value_text(default_of(entry), unit, units):
            suffix = f' {units.file_unit(kind.unit)}' if kind.unit else ''
            texts.append(f'{entry.name} {text}{suffix}')
    text = ', '.join(texts)
    return text if len(text) <= _LONGEST else f'{text[: _LONGEST - 1]}…'


def built_scene_json(scene: Scene, pipeline: Pipeline) -> dict[str, Any]:
    """Return the description of a scene that has been built, as JSON holds it."""
    # local import: the modules that read bags take time to load, and only --json needs these
    from linkage_ros.cli.bag_reading import scene_json

    account = scene_json(scene)
    for linkage, line in zip(account['linkages'], pipeline.linkages, strict=True):
        linkage['stages'] = [
            {'name': name, 'parameters': _as_json(own), 'where': where, 'needed_by': [*needed_by]}
            for name, where, own, needed_by in _list_stages(line)
        ]
    record = scene.record
    return account | {
        'joints': list(scene.joint_names),
        'wrapped': scene.wrapped,
        'record': record and {'directory': record.directory, 'name': record.name or None},
        'fault_parameters': [
            {
                'name': name,
                'parameters': _as_json(fault.parameters),
                'kind': fault.kind,
                'at_s': list(fault.at),
                'seconds': fault.seconds,
            }
            for name, fault in scene.faults.items()
        ],
        'topics': [
            {'name': name, 'type': kind, 'what': what}
            for what, name, kind, _ in _topic_rows(scene, pipeline)
            if what != 'serves'
        ],
        'services': [f'~/inject/{name}' for name in scene.faults],
    }


def _as_json(value: Any) -> Any:
    """Return the value of a parameter as JSON holds it; null stands for infinity."""
    if hasattr(value, '__dataclass_fields__'):
        return {
            entry.name: _as_json(getattr(value, entry.name)) for entry, _ in declared_fields(value)
        }
    if isinstance(value, dict):
        return {key: _as_json(item) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return list(map(_as_json, value))
    if isinstance(value, float):
        return finite_or_none(value)
    return value if value is None or isinstance(value, str | int) else str(value)


def _shorten_list(names: list[str]) -> str:
    """Return names; of many names the first ones and the count."""
    if len(names) <= _MOST_NAMES + 1:
        return ', '.join(names)
    return f'{", ".join(names[:_MOST_NAMES])}, … ({len(names)})'


# Drives, effects and faults as tables: parameters, units, defaults and bounds.


def parameters_of(what: str, name: str) -> Any:
    """Return the parameter type of a drive, effect or fault."""
    if what == 'fault':
        return FAULTS[name]
    return effect_class(name) if what == 'effect' else drive_class(name)


def table_of(what: str, name: str) -> Table:
    """Return the table of a drive, effect or fault; ``what`` is a key of `REGISTRIES`."""
    parameters = parameters_of(what, name)
    title = f'{what} {name}: {first_docstring_line(parameters)}'
    rows = list(parameter_rows(parameters))
    return (
        Table(title, _PARAMETER, rows, name) if rows else Table(title, ('',), [('no parameters',)])
    )


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    choice = parser.add_mutually_exclusive_group(required=True)
    choice.add_argument('file', nargs='?', metavar='SCENE', help=SCENE_HELP)
    choice.add_argument(
        '--list',
        nargs='*',
        metavar='NAME',
        help='drives, effects and faults: their parameters, units, defaults and bounds; '
        'all of them, or those named',
    )
    choice.add_argument(
        '--schema', choices=SCHEMAS, help='the JSON Schema of scene or linkage files'
    )
    add_result(parser)
    add_set(parser)


def run(arguments: argparse.Namespace, _stop: Event) -> int:
    """Check a scene, list, or print a schema."""
    if arguments.schema:
        check_no_settings(arguments.set)
        print(as_text(SCHEMAS[arguments.schema]()), end='')
        return 0
    if arguments.file is None:
        check_no_settings(arguments.set)
        tables = [table_of(what, name) for what, name in _items_to_list(arguments.list)]
        account = tables_json(table for table in tables if table.key)
        show_result(Result(account, tables), arguments)
        return 0
    scene = load_scene(arguments.file, arguments.set)
    for note in scene_notes(scene):
        print(f'linkage scene: note: {note}', file=sys.stderr)
    pipeline = Pipeline(scene)
    account = {'file': arguments.file}
    if arguments.json or arguments.output is not None:
        account |= built_scene_json(scene, pipeline)
    show_result(Result(account, [*scene_tables(scene, pipeline, arguments.file)]), arguments)
    return 0


def _items_to_list(names: list[str]) -> Iterator[tuple[str, str]]:
    """Yield the arguments of `table_of` for each item to list."""
    known = [(what, name) for what, registry in REGISTRIES.items() for name in registry]
    if not names:
        yield from known
    for name in names:
        entries = [entry for entry in known if entry[1] == name]
        if '.' in name:
            # A user-defined effect, which no list has.
            entries = [('effect', name)]
        if not entries:
            words = [word for _, word in known]
            raise LinkageError(
                f'--list {name}',
                'there is no such drive, effect or fault',
                did_you_mean(name, words, f'known: {list_names(words)}'),
            )
        yield from entries
