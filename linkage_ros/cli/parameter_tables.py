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


"""Drives, effects, faults and solvers as tables: parameters, units, defaults and bounds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from importlib import import_module
from math import inf
from typing import Any

from linkage_ros.cli.tables import Table
from linkage_ros.drives.drive import DRIVES
from linkage_ros.effects.stage import EFFECTS, module_of
from linkage_ros.faults.fault import FAULTS
from linkage_ros.parameters import (
    Choice,
    declared,
    Each,
    File,
    Flag,
    Group,
    Kind,
    Name,
    Names,
    Number,
    Numbers,
    Point,
    Rows,
    Text,
)
from linkage_ros.scene.schema import default_of, is_required, KIND_NAMES, summary
from linkage_ros.solvers.registry import SOLVERS

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
    rows = list(_rows('', parameters))
    return Table(title, _HEADS, rows) if rows else Table(title, ('',), [('no parameters',)])


def _rows(prefix: str, parameters: Any) -> Iterator[tuple[str, ...]]:
    for entry, kind in declared(parameters):
        default = 'required' if is_required(entry) else _default(kind, default_of(entry))
        yield from _rows_of(prefix + entry.name, kind, default)


def _rows_of(key: str, kind: Kind, default: str) -> Iterator[tuple[str, ...]]:
    yield key, _unit(kind), default, _values(kind), kind.meaning
    match kind:
        case Group():
            yield from _rows(f'{key}.', kind.of)
        case Each():
            part = f'{key}.{_placeholder(kind.kind)}'
            if isinstance(kind.of, type):
                yield from _rows(f'{part}.', kind.of)
            else:
                yield from _rows_of(part, kind.of, '')


def _placeholder(kind: str) -> str:
    return 'LINK.POINT' if kind == 'point' else kind.upper()


def _unit(kind: Kind) -> str:
    return kind.unit if isinstance(kind, Number | Numbers | Point) else ''


def _default(kind: Kind, default: Any) -> str:
    match kind:
        case Names():
            return ', '.join(default) or 'all'
        case Each() | Group():
            return ''
        case Flag():
            return 'true' if default else 'false'
        case Number() | Numbers() | Point():
            return _number(default) if isinstance(default, int | float) else str(default)
    return str(default) or "''"


def _values(kind: Kind) -> str:
    match kind:
        case Number():
            return _bounds(kind)
        case Numbers():
            return f'a list of numbers{_at_most(kind.most)}'
        case Point():
            return f'[x, y]{_at_most(kind.most)}'
        case Rows():
            return f'rows of [{", ".join(kind.columns)}]{_at_most(kind.most)}'
        case Flag():
            return 'true or false'
        case Choice():
            return ' or '.join(kind.words)
        case Text():
            return 'a text'
        case File():
            return 'a file'
        case Name():
            return f'a {KIND_NAMES[kind.kind]}'
        case Names():
            return f'names, each of a {KIND_NAMES[kind.kind]}'
        case Each():
            return f'for each {KIND_NAMES[kind.kind]}'
        case Group():
            return 'a mapping'


def _bounds(kind: Number) -> str:
    least, most, above = map(_number, (kind.least, kind.most, kind.above))
    if kind.above > -inf:
        said = f'more than {above}' + (f', to {most}' if kind.most < inf else '')
    elif kind.least > -inf:
        said = f'{least} to {most}' if kind.most < inf else f'{least} or more'
    else:
        said = f'at most {most}' if kind.most < inf else 'any number'
    return f'whole: {said}' if kind.whole else said


def _at_most(most: float) -> str:
    return f', each of at most {_number(most)}' if most < inf else ''


def _number(value: float) -> str:
    """Return a number as a person writes it: 1e9, but 4096."""
    short = f'{value:g}'.replace('e+0', 'e').replace('e-0', 'e-').replace('e+', 'e')
    return short if float(short) == value else f'{value:.15g}'
