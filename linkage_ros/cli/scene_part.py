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


"""Say what a scene consists of, or all that is wrong with it; or what scenes can name."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from importlib.util import find_spec
from os.path import isfile
from pathlib import Path
import sys
from threading import Event

from linkage_ros.cli.parameter_tables import REGISTRIES, table_of
from linkage_ros.cli.scene import tables
from linkage_ros.cli.terminal import show
from linkage_ros.errors import did_you_mean, FileError, LinkageError, listed
from linkage_ros.files.schema import as_text, linkage_schema, scene_schema
from linkage_ros.files.section import Section
from linkage_ros.files.yaml_file import read_yaml
from linkage_ros.pipeline.pipeline import Pipeline
from linkage_ros.scene.load import kind_of, load_scene

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
