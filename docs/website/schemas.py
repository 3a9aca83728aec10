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


"""The reference of scene and linkage files, from their JSON Schemas."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
import json
from typing import Any

from linkage_ros.scene.schema import linkage_schema, scene_schema

from docs.website.markdown import code, plain, table

_ELSEWHERE = ('drive', 'effects', 'solver')
"""Keys whose own keys are in the reference of parameters."""

_NAMED = 'NAME'
_HEADS = ('key', 'takes', 'default', 'meaning')


def scene_keys() -> str:
    """Return the keys of scene files."""
    return _keys(scene_schema())


def linkage_keys() -> str:
    """Return the keys of linkage files."""
    return _keys(linkage_schema())


def _keys(whole: Mapping[str, Any]) -> str:
    return table(_HEADS, _rows('', whole, whole))


def _rows(path: str, schema: Mapping[str, Any], whole: Mapping[str, Any]) -> Iterator[Any]:
    required = schema.get('required', ())
    for key, of in schema.get('properties', {}).items():
        if isinstance(of, dict):
            yield from _row(f'{path}{key}', of, whole, key in required)


def _row(
    key: str, schema: Mapping[str, Any], whole: Mapping[str, Any], needed: bool
) -> Iterator[Any]:
    of = _resolved(schema, whole)
    default = code(json.dumps(of['default'])) if 'default' in of else 'required' if needed else ''
    yield code(key), plain(_takes(of)), default, plain(str(of.get('description', '')))
    if key.rpartition('.')[2] in _ELSEWHERE or key.startswith('faults'):
        return
    if len(key.split('.')) > 1 and 'linkages' in key:
        return
    for part, inner in _within(of):
        found = _resolved(inner, whole)
        if 'properties' in found or part == _NAMED:
            yield from _rows(f'{key}{part and f".{part}"}.', found, whole)


def _within(of: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield the mappings within a value: itself, one for each name, one for each item."""
    if 'properties' in of:
        yield '', of
    if isinstance(of.get('additionalProperties'), dict):
        yield _NAMED, of['additionalProperties']
    for branch in ('then', 'else'):
        inner = of.get(branch, {})
        if 'properties' in inner and 'properties' not in of:
            yield '', inner


def _resolved(schema: Mapping[str, Any], whole: Mapping[str, Any]) -> Mapping[str, Any]:
    if '$ref' in schema:
        return {**whole['$defs'][schema['$ref'].rpartition('/')[2]], **schema}
    return schema


def _number(value: float) -> str:
    """Return a number as a person writes it, and exactly."""
    short = f'{value:g}'.replace('e+', 'e').replace('e0', 'e').replace('e-0', 'e-')
    return short if float(short) == value else str(value)


_WORDS = {'object': 'a mapping', 'array': 'a list', 'string': 'a text', 'boolean': 'true or false'}


def _takes(of: Mapping[str, Any]) -> str:
    """Return which values a key takes."""
    if 'enum' in of:
        return ' or '.join(map(str, of['enum']))
    kind = of.get('type', '')
    if kind in ('number', 'integer'):
        word = 'a whole number' if kind == 'integer' else 'a number'
        bounds = (
            (' more than', 'exclusiveMinimum'),
            (' from', 'minimum'),
            (' to', 'maximum'),
        )
        said = [f'{before} {_number(of[key])}' for before, key in bounds if key in of]
        return word + ''.join(said)
    if not kind and 'then' in of:
        branches = (_takes(of['then']) or 'a list', _takes(of.get('else', {})))
        return ' or '.join(dict.fromkeys(filter(None, branches)))
    return _WORDS.get(kind, '')
