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


"""
Parts of which the JSON Schemas of scenes and linkages are made, and what parameters declare.

A schema says what the reader takes, as far as it can know: names of joints, pins and links pass as
they come. Its words are those of draft 7 and ``$defs``, which editors know, and conditions rather
than alternatives, so that a violation names one place.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, Field, is_dataclass, MISSING
import json
from math import inf
from typing import Any

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

Schema = dict[str, Any]
DIALECT = 'https://json-schema.org/draft/2020-12/schema'

CHARACTER = r'[^\u0000-\u001f\u007f-\u00a0\u2028\u2029]'
"""Pattern of a character that prints."""

ROS_NAME = '^[A-Za-z][A-Za-z0-9_]*$'

DOTTED = r'^[^.\s]+(\.[^.\s]+)+$'
"""Pattern of the name of a module within a package."""

KIND_NAMES = {
    'joint': 'published joint',
    'input': 'driven joint',
    'pin': 'pin or slider',
    'link': 'moving link',
    'body': 'link or the ground',
    'point': 'point: LINK.POINT',
}
"""What `linkage_ros.parameters.KINDS` are called."""


def as_text(schema: Schema) -> str:
    """Return a schema as the text of its file."""
    return json.dumps(schema, indent=2, ensure_ascii=False, allow_nan=False) + '\n'


def summary(parameters: Any) -> str:
    """Return the first line of what a type of parameters says of itself."""
    return str(parameters.__doc__).strip().splitlines()[0]


def mapping(
    description: str, properties: Mapping[str, Schema], *, required: tuple[str, ...] = ()
) -> Schema:
    """Return the schema of a mapping that has these keys and no others."""
    schema: Schema = {'description': description, 'type': 'object'}
    if required:
        schema['required'] = list(required)
    return {**schema, 'properties': dict(properties), 'additionalProperties': False}


def named(description: str, of: Schema) -> Schema:
    """Return the schema of a mapping whose keys are names."""
    return {'description': description, 'type': 'object', 'additionalProperties': of}


def text(description: str, pattern: str = f'^{CHARACTER}+$') -> Schema:
    """Return the schema of a text; without a pattern, of one that is not empty."""
    return {'description': description, 'type': 'string', 'pattern': pattern}


def number(
    description: str, *, least: float = -inf, most: float = inf, above: float = -inf
) -> Schema:
    """Return the schema of a number within bounds."""
    return {'description': description, 'type': 'number', **_bounds(least, most, above)}


def point(description: str, most: float = inf) -> Schema:
    """Return the schema of two numbers [x, y]."""
    return {**_numbers(description, most), 'minItems': 2, 'maxItems': 2}


def parameters_schema(of: Any) -> Schema:
    """
    Return the schema of what is read into a type of parameters.

    Parameters
    ----------
    of
        The type, as `linkage_ros.parameters` has it.

    """
    entries = declared(of)
    return mapping(
        summary(of),
        {entry.name: _with_default(_kind(kind), entry) for entry, kind in entries},
        required=tuple(entry.name for entry, _ in entries if is_required(entry)),
    )


def is_required(entry: Field[Any]) -> bool:
    """Return whether a parameter has no default."""
    return entry.default is MISSING and entry.default_factory is MISSING


def default_of(entry: Field[Any]) -> Any:
    """Return the default of a parameter that has one, as JSON has it."""
    value = entry.default
    if entry.default_factory is not MISSING:
        value = entry.default_factory()
    if is_dataclass(value) and not isinstance(value, type):
        value = asdict(value)
    return json.loads(json.dumps(value))


def with_unit(meaning: str, unit: str) -> str:
    """Return a meaning with the unit behind it."""
    return f'{meaning} [{unit}]' if unit else meaning


def _with_default(schema: Schema, entry: Field[Any]) -> Schema:
    return schema if is_required(entry) else {**schema, 'default': default_of(entry)}


def _kind(kind: Kind) -> Schema:
    match kind:
        case Number():
            return _number(kind)
        case Numbers():
            return _numbers(with_unit(kind.meaning, kind.unit), kind.most)
        case Rows():
            return _rows(kind)
        case Flag():
            return {'description': kind.meaning, 'type': 'boolean'}
        case Choice():
            return {'description': kind.meaning, 'enum': list(kind.words)}
        case Text() | File():
            return text(kind.meaning)
        case Point():
            return point(with_unit(kind.meaning, kind.unit), kind.most)
        case Name():
            return text(f'{kind.meaning} (name of a {KIND_NAMES[kind.kind]})')
        case Names():
            description = f'{kind.meaning} (names, each of a {KIND_NAMES[kind.kind]})'
            return {'description': description, 'type': 'array', 'items': text('a name')}
        case Group():
            return {**parameters_schema(kind.of), 'description': kind.meaning}
        case Each():
            of = parameters_schema(kind.of) if isinstance(kind.of, type) else _kind(kind.of)
            return named(f'{kind.meaning} (by the name of a {KIND_NAMES[kind.kind]})', of)


def _number(kind: Number) -> Schema:
    schema = number(
        with_unit(kind.meaning, kind.unit), least=kind.least, most=kind.most, above=kind.above
    )
    return {**schema, 'type': 'integer'} if kind.whole else schema


def _numbers(description: str, most: float) -> Schema:
    items = {'type': 'number', **_bounds(-most, most)}
    return {'description': description, 'type': 'array', 'items': items}


def _rows(kind: Rows) -> Schema:
    row = f'[{", ".join(kind.columns)}]'
    of = _numbers(row, kind.most)
    count = len(kind.columns)
    return {
        'description': f'{kind.meaning}: rows of {row}',
        'type': 'array',
        'minItems': 1,
        'items': {**of, 'minItems': count, 'maxItems': count},
    }


def _bounds(least: float, most: float, above: float = -inf) -> Schema:
    said = (('minimum', least), ('maximum', most), ('exclusiveMinimum', above))
    return {word: _plain(bound) for word, bound in said if abs(bound) < inf}


def _plain(bound: float) -> float:
    """Return a whole number without its decimals: a reader of the file sees 1, not 1.0."""
    return int(bound) if float(bound).is_integer() and abs(bound) < 1e15 else bound
