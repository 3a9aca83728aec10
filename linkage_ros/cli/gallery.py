# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
List the linkages and scenes that come with the package; print one, or copy it.

All commands take these names: linkage check jansen_leg. With -o the file is copied, and with a
scene the linkage files that it names, into the same folder.
"""

from __future__ import annotations

import argparse
from pathlib import Path
import re
from threading import Event

from linkage_ros.cli.arguments import add_output, LINKAGES, RESULTS
from linkage_ros.cli.result import add_result, Result, show_result, tables_json
from linkage_ros.cli.table import Column, Table
from linkage_ros.description import atomic_write, check_output_name
from linkage_ros.errors import FileError
from linkage_ros.resources import (
    linkage_names,
    named_file,
    scene_names,
    shipped_path,
    SPATIAL,
    spatial_linkage_names,
)

EXAMPLE = 'linkage gallery worn_press -o my_press.yaml'

_FOLDERS = ('linkages', 'scenes')

_SCHEMA = re.compile(r'^# yaml-language-server:.*\n')
_REFERENCE = re.compile(r'^( *linkage: +)\.\./(linkages/(?:space/)?)([^/\s]+)', re.MULTILINE)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        'name', nargs='?', metavar='NAME', help='linkage or scene; without it, all are listed'
    )
    parser.add_argument(
        '--scene',
        action='store_true',
        help='the scene, where a linkage and a scene have the same name',
    )
    add_result(parser, output=False)
    add_output(parser, (*LINKAGES, *RESULTS), 'the file, or the list, is printed')


def run(arguments: argparse.Namespace, _stop: Event) -> int:
    """List, print or copy."""
    if arguments.name is None:
        if arguments.output is not None and arguments.output.suffix.lower() in LINKAGES:
            raise FileError('-o', '', 'needs a NAME', 'name what to copy')
        tables = [_gallery_table(folder) for folder in _FOLDERS]
        show_result(Result(tables_json(tables), tables), arguments)
        return 0
    if arguments.output is not None:
        check_output_name(arguments.output, LINKAGES)
    file = _shipped_file(arguments.name, ('scenes',) if arguments.scene else _FOLDERS)
    if arguments.output is None:
        print(file.read_text('utf-8'), end='')
        return 0
    for copy, text in _copied_files(file, arguments.output).items():
        atomic_write(copy, text.encode())
        print(copy)
    return 0


def _gallery_table(folder: str) -> Table:
    names = dict.fromkeys({'linkages': linkage_names, 'scenes': scene_names}[folder](), folder)
    if folder == 'linkages':
        names |= dict.fromkeys(spatial_linkage_names(), SPATIAL)
    rows = [
        (name, first_sentence(shipped_path(f'{of}/{name}.yaml'))) for name, of in names.items()
    ]
    return Table('', (Column(folder, 'name'), Column('', 'description')), rows, folder)


def _shipped_file(name: str, folders: tuple[str, ...]) -> Path:
    """Return a file of the gallery; a path is none, even of a file that exists."""
    file = named_file(name, *folders)
    if not file.is_relative_to(shipped_path('')):
        raise FileError(name, '', 'is not in the gallery', 'linkage gallery lists its names')
    return file


def _copied_files(file: Path, output: Path) -> dict[Path, str]:
    """
    Return the files of a copy and their texts: the file, and the linkages that it names.

    The copies name each other by their new places. Their schemas, which stand in the checkout,
    are left out.
    """
    text = _SCHEMA.sub('', file.read_text('utf-8'))
    copies = {output: _REFERENCE.sub(r'\1\3', text)}
    for reference in _REFERENCE.finditer(text):
        copy, linkage = output.with_name(reference[3]), shipped_path(reference[2] + reference[3])
        linkage_text = _SCHEMA.sub('', linkage.read_text('utf-8'))
        if copy == output or (copy.exists() and copy.read_bytes() != linkage_text.encode()):
            raise FileError(
                copy, '', 'is another file, and the scene needs a linkage of this name',
                'name a file in another folder with -o',
            )  # fmt: skip
        copies[copy] = linkage_text
    return copies


def first_sentence(file: Path) -> str:
    """Return the first sentence of the comment at the head of a file."""
    comment = []
    for line in file.read_text('utf-8').splitlines():
        if not line.startswith('#'):
            break
        if not line.startswith('# yaml-language-server:'):
            comment.append(line.lstrip('# '))
    return ' '.join(comment).partition('. ')[0].rstrip('.')
