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

"""What a scene consists of, as tables."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from importlib import import_module
from importlib.util import find_spec
from os.path import isfile
from pathlib import Path
import sys
from threading import Event
from typing import Any

from linkage_ros.cli.terminal import show, Table
from linkage_ros.drives.drive import DRIVES
from linkage_ros.effects.dispatch import bringing, module_of
from linkage_ros.effects.stage import EFFECTS
from linkage_ros.errors import did_you_mean, FileError, LinkageError, listed
from linkage_ros.faults.fault import FAULTS
from linkage_ros.files.parameters import declared, default_of, is_required, parameter_rows, summary
from linkage_ros.files.section import Section
from linkage_ros.files.yaml_file import read_yaml
from linkage_ros.pipeline.pipeline import LinkagePipeline, Pipeline
from linkage_ros.scene.load import kind_of, load_scene
from linkage_ros.scene.scene import Scene
from linkage_ros.scene.schema import as_text, linkage_schema, scene_schema
from linkage_ros.solvers.registry import SOLVERS

_WHERE = {
    'alter': 'in the place of the linkage that is drawn',
    'drive_stage': 'between motor and crank',
    'begin': 'in the mechanism',
    'stage': 'in the mechanism',
    'sensor': 'between mechanism and message',
    'writer': 'beside the joint states',
}
"""Where in a tick an effect stands, by the function that builds it."""

_JOINT_STATE = 'sensor_msgs/msg/JointState'
_MOST_NAMES = 4
_LONGEST = 60


def tables(scene: Scene, pipeline: Pipeline, title: str) -> Iterator[Table]:
    """Yield what there is to say of a scene that has been built."""
    yield Table(title, ('', ''), [*_facts(scene), *_solvers(pipeline.lines)])
    for lines in _alike(pipeline.lines):
        names = _some([line.member.name for line in lines if line.member.name])
        heads = ('>', 'stage', 'where', 'what it does', 'as said here', '')
        yield Table(f'Stages of {names}' if names else 'Stages', heads, list(_stages(lines[0])))
    if scene.faults:
        yield Table('Faults', ('name', 'kind', 'as said here', 'by itself'), list(_faults(scene)))
    yield Table('Topics', ('', 'topic', 'message', ''), list(_topics(scene, pipeline)))


def brought_in_by(stage: str, named: Any) -> str:
    """Return what of the effects that are named brings in one that is not, with commas."""
    return ', '.join(bringing(stage, named))


def _facts(scene: Scene) -> Iterator[tuple[str, str]]:
    if scene.members[0].name:
        yield 'linkages', _some([member.name for member in scene.members])
    joints = list(scene.joints)
    yield 'joints', _some(joints)
    rate = f'{scene.rate:g} a second' if scene.rate else 'one for every crank sample'
    yield 'ticks', rate
    yield 'angles', 'wrapped to (−π, π]' if scene.wrapped else 'continuous'
    yield 'seed', str(scene.seed)
    record = scene.record
    recorded = (
        f'{record.directory}/{record.name or f"{scene.name}, and the time"}' if record else 'no'
    )
    yield 'recorded', recorded


def _solvers(lines: list[LinkagePipeline]) -> Iterator[tuple[str, str]]:
    """Yield what closes the loops, where the scene says so."""
    for line in lines:
        name = f'{line.member.name}: ' if line.member.name else ''
        if line.choice is not None:
            yield 'solver', f'{name}for an accuracy of {line.member.accuracy:g}: {line.choice.why}'
        elif line.member.solver is not None:
            solver, parameters = line.member.solver
            said = _said(parameters)
            yield 'solver', f'{name}{solver}{said and ", "}{said}'


def _alike(lines: list[LinkagePipeline]) -> list[list[LinkagePipeline]]:
    """Return the linkages, those together that have the same drive and effects."""
    groups: dict[str, list[LinkagePipeline]] = {}
    for line in lines:
        groups.setdefault(repr((line.member.drive, line.member.effects)), []).append(line)
    return list(groups.values())


def _stages(line: LinkagePipeline) -> Iterator[tuple[str, ...]]:
    name, parameters = line.member.drive
    module = import_module(DRIVES[name])
    yield '0', name, 'drive', summary(module.PARAMETERS), _said(parameters), ''
    for number, stage in enumerate(line.stages, 1):
        module = module_of(stage)
        named = line.member.effects
        yield (
            str(number),
            stage,
            next(
                (where for has, where in _WHERE.items() if hasattr(module, has)), 'in the forces'
            ),
            summary(module.PARAMETERS),
            _said(named[stage]) if stage in named else '',
            '' if stage in named else f'brought in by {brought_in_by(stage, named)}',
        )


def _faults(scene: Scene) -> Iterator[tuple[str, ...]]:
    for name, fault in scene.faults.items():
        times = ', '.join(f'{time:g}' for time in fault.at)
        when = f'at {times} s, for {fault.seconds:g} s' if fault.at else 'on demand only'
        yield name, fault.kind, _said(fault.parameters), when


def _topics(scene: Scene, pipeline: Pipeline) -> Iterator[tuple[str, ...]]:
    if pipeline.topic:
        yield 'listens to', pipeline.topic, _JOINT_STATE, ''
    yield 'publishes', 'joint_states', _JOINT_STATE, f'{len(scene.joints)} joints'
    for extra in pipeline.extras:
        yield 'publishes', extra.topic, extra.message, ''
    if scene.faults:
        yield 'publishes', '~/faults', 'std_msgs/msg/String', 'which are injected'
        services = [f'~/inject/{name}' for name in scene.faults]
        yield 'serves', _some(services), 'std_srvs/srv/SetBool', ''


def _said(parameters: Any) -> str:
    """Return the parameters that are not as by default."""
    said = [
        f'{entry.name} {_shown(getattr(parameters, entry.name))}'
        for entry, _ in declared(type(parameters))
        if is_required(entry)
        or _shown(getattr(parameters, entry.name)) != _shown(default_of(entry))
    ]
    text = ', '.join(said)
    return text if len(text) <= _LONGEST else f'{text[: _LONGEST - 1]}…'


def _shown(value: Any) -> str:
    if isinstance(value, tuple | list):
        return f'[{", ".join(map(_shown, value))}]'
    if isinstance(value, dict):
        return f'{{{", ".join(f"{key}: {_shown(one)}" for key, one in value.items())}}}'
    if hasattr(value, '__dataclass_fields__'):
        return f'{{{_said(value)}}}'
    return f'{value:g}' if isinstance(value, float) else str(value)


def _some(names: list[str]) -> str:
    """Return names, the first ones where there are many, and how many."""
    if len(names) <= _MOST_NAMES + 1:
        return ', '.join(names)
    return f'{", ".join(names[:_MOST_NAMES])}, … ({len(names)})'


# Drives, effects, faults and solvers as tables: parameters, units, defaults and bounds.

REGISTRIES: Mapping[str, Mapping[str, str]] = {
    'drive': DRIVES,
    'effect': EFFECTS,
    'fault': FAULTS,
    'solver': SOLVERS,
}
"""All that a scene can name, by what it is."""

_HEADS = ('parameter', 'unit', 'default', 'values', 'meaning')


def table_of(what: str, name: str) -> Table:
    """Return the table of what a scene can name: ``what`` is a key of `REGISTRIES`."""
    module = module_of(name) if what == 'effect' else import_module(REGISTRIES[what][name])
    parameters = module.PARAMETERS
    title = f'{what} {name}: {summary(parameters)}'
    rows = list(parameter_rows(parameters))
    return Table(title, _HEADS, rows) if rows else Table(title, ('',), [('no parameters',)])


# Say what a scene consists of, or all that is wrong with it; or what scenes can name.

SCHEMAS = {'scene': scene_schema, 'linkage': linkage_schema}
"""What makes the JSON Schema of each kind of file."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.epilog = (
        'Where the library jsonschema is installed, everything that is wrong with the files is '
        'said at once; elsewhere the first thing.'
    )
    one = parser.add_mutually_exclusive_group(required=True)
    one.add_argument('file', nargs='?', help='the scene file, or a linkage file')
    one.add_argument(
        '--list',
        nargs='*',
        metavar='NAME',
        help='drives, effects, faults and solvers: their parameters, units, defaults and bounds; '
        'all of them, or those named',
    )
    one.add_argument('--schema', choices=SCHEMAS, help='the JSON Schema of scene or linkage files')


def run(arguments: argparse.Namespace, _stop: Event) -> int:
    """Check a scene, list, or print a schema."""
    if arguments.schema:
        print(as_text(SCHEMAS[arguments.schema]()), end='')
        return 0
    if arguments.file is None:
        found = list(_named(arguments.list))
        for number, (what, name) in enumerate(found):
            if number:
                print()
            show(table_of(what, name))
        return 0
    wrong = _violations(arguments.file)
    for error in wrong:
        print(f'linkage scene: {error}', file=sys.stderr)
    if wrong:
        return 2
    scene = load_scene(arguments.file)
    for number, table in enumerate(tables(scene, Pipeline(scene), arguments.file)):
        if number:
            print()
        show(table)
    return 0


def _named(names: list[str]) -> Iterator[tuple[str, str]]:
    """Yield what is to be listed, as arguments of `table_of`."""
    known = [(what, name) for what, registry in REGISTRIES.items() for name in registry]
    if not names:
        yield from known
    for name in names:
        found = [entry for entry in known if entry[1] == name]
        if '.' in name:
            # One of one's own, which no list has.
            found = [('effect', name)]
        if not found:
            words = [word for _, word in known]
            raise LinkageError(
                f'--list {name}',
                'there is no such drive, effect, fault or solver',
                did_you_mean(name, words, f'known: {listed(words)}'),
            )
        yield from found


def _violations(file: str) -> list[FileError]:
    """Return all that is wrong by the schemas with a scene and the linkages that it names."""
    if find_spec('jsonschema') is None:
        return []
    from linkage_ros.scene.violations import violations

    content, _ = read_yaml(file)
    if kind_of(content) == 'linkage':
        return violations(content, linkage_schema())
    wrong = violations(content, scene_schema())
    if wrong:
        return wrong
    for linkage in dict.fromkeys(_linkages(content)):
        # One that is not there is for the reader to tell, with the line that names it.
        path = Path(file).parent / linkage
        if isfile(path):  # noqa: PTH113 (Path's raises where a name is too long)
            wrong += violations(read_yaml(path)[0], linkage_schema())
    return wrong


def _linkages(content: Section) -> list[str]:
    if 'linkages' in content:
        return [entry.text('linkage') for entry in content.sections('linkages')]
    return [content.text('linkage')]
