# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Violations of a file's JSON Schema, one line each, found by the library jsonschema."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from re import search
import sys
from types import ModuleType
from typing import Any, TYPE_CHECKING

from linkage_ros.description.parameters import Schema, under_part
from linkage_ros.description.scene_grammar import kinds_of_fault
from linkage_ros.description.section import LinedDict, Section
from linkage_ros.description.units import ANGLES, LENGTHS, most_in_one, unit_of, Units
from linkage_ros.errors import did_you_mean, FileError, list_names, quote

if TYPE_CHECKING:
    from jsonschema import ValidationError

_TYPES = {
    'object': 'a mapping',
    'array': 'a list',
    'string': 'a string',
    'number': 'a number',
    'integer': 'a whole number',
    'boolean': 'true or false',
}
_BOUNDS = {
    'exclusiveMinimum': 'more than',
    'minimum': 'at least',
    'maximum': 'at most',
}

_Path = tuple[str | int, ...]
_Problem = tuple[_Path, str, str]


_IRI_GRAMMAR = 'rfc3987_syntax'


def import_jsonschema() -> ModuleType:
    """
    Return the library without its check of IRIs, which no schema of this package asks for.

    Where another package, such as Jupyter, has brought the grammar, it is compiled for seconds.
    """
    sys.modules.setdefault(_IRI_GRAMMAR, None)  # type: ignore[arg-type]
    import jsonschema

    if sys.modules[_IRI_GRAMMAR] is None:
        del sys.modules[_IRI_GRAMMAR]
    return jsonschema


def find_violations(content: Section, schema: Schema) -> list[FileError]:
    """Return the violations of a JSON Schema in a file, in the order of its lines."""
    whole = content.mapping
    validator = import_jsonschema().Draft202012Validator(schema)
    broken: list[ValidationError] = list(validator.iter_errors(whole))
    # A value of the wrong type breaks further rules, which are not worth reporting.
    mistyped = {tuple(error.absolute_path) for error in broken if error.validator == 'type'}
    units = _file_units(whole)
    errors = [
        FileError(
            content.file,
            _dotted_path(path),
            reason,
            units.convert_brackets(remedy),
            _line_number(whole, path),
        )
        for error in broken
        if error.validator == 'type' or tuple(error.absolute_path) not in mistyped
        for path, reason, remedy in _describe_error(error, schema)
    ]
    return sorted(errors, key=lambda error: (error.line, error.key))


def _file_units(whole: Mapping[str, Any]) -> Units:
    """Return the units of a file; where they are wrong themselves, SI."""
    length, angle = whole.get('units'), whole.get('angles')
    degrees = angle == ANGLES[1] or (isinstance(angle, list) and ANGLES[1] in angle)
    if not isinstance(length, str) or length not in LENGTHS:
        length = 'm'
    return Units(length, ANGLES[1] if degrees else ANGLES[0])


def _describe_error(error: ValidationError, whole: Schema) -> Iterator[_Problem]:
    """Yield path, reason and remedy for one broken rule."""
    path = tuple(error.absolute_path)
    value: Any = error.instance
    wanted: Any = error.validator_value
    schema: Any = error.schema
    rule: Any = error.validator
    match rule:
        case 'additionalProperties':
            known = list(schema['properties'])
            others = '|'.join(schema.get('patternProperties', ())) or '$^'
            for key in value:
                if key not in known and not search(others, key):
                    yield (
                        (*path, key),
                        'unknown key',
                        _misplaced_remedy(key, schema) or _near_key(key, known),
                    )
        case 'required':
            # Each missing key is a separate error, which names the key in its message only.
            missing = next(key for key in wanted if error.message.startswith(repr(key)))
            meaning = _description_text(schema.get('properties', {}).get(missing, {}), whole)
            yield path, f'the key {missing!r} is missing', f'add {missing}: {meaning or "…"}'
        case 'maxProperties':
            others = f'leave all but {wanted} out'
            yield path, f'{list_names(value)} cannot be combined', others
        case 'minProperties':
            yield path, 'is empty', 'name at least one'
        case 'oneOf':
            kinds = [kind['required'][0] for kind in wanted]
            named = [kind for kind in kinds if kind in value]
            yield path, *kinds_of_fault(str(path[-1]), named)
        case 'not':
            one, other = wanted['required']
            yield (*path, other), f'cannot be combined with {one}', 'write one of the two'
        case None:
            yield path, 'cannot be combined with the other keys', 'leave it out'
        case _:
            meaning = schema.get('description', '')
            expected = f'write {_expected_text(error)}{meaning and f" ({meaning})"}'
            yield path, f'{quote(value)} {_reason_text(error)}', expected


def _reason_text(error: ValidationError) -> str:
    rule: Any = error.validator
    wanted: Any = error.validator_value
    match rule:
        case 'type':
            return f'is not {_TYPES[wanted]}'
        case 'minItems':
            return 'is too short'
        case 'maxItems':
            return 'is too long'
        case _ if rule in _BOUNDS:
            return 'is out of bounds'
    return 'does not fit'


def _expected_text(error: ValidationError) -> str:
    """Return the values that the broken rule, and those beside it, allow."""
    rule: Any = error.validator
    wanted: Any = error.validator_value
    schema: Any = error.schema
    match rule:
        case 'type':
            quote = '; quote what looks like a number' if wanted == 'string' else ''
            return f'{_TYPES[wanted]}{_bounds_text(schema)}{quote}'
        case 'enum':
            return ' or '.join(wanted)
        case 'minItems' | 'maxItems':
            least, most = schema.get('minItems', 0), schema.get('maxItems')
            return f'{least} of them{"" if least == most else " at least"}'
        case _ if rule in _BOUNDS:
            return f'a number{_bounds_text(schema)}'
    return 'a string on one line'


def _bounds_text(schema: Mapping[str, Any]) -> str:
    # Of a length or an angle the schema has the bound in the smallest unit, not in the file's.
    unit = unit_of(schema.get('description', ''))
    bounds = ' and '.join(
        f'{word} {schema[key]:g}'
        for key, word in _BOUNDS.items()
        if key in schema and (schema[key] == 0 or most_in_one(unit) == 1.0)
    )
    return f', {bounds}' if bounds else ''


def _description_text(schema: Schema, whole: Schema) -> str:
    if '$ref' in schema:
        schema = whole['$defs'][schema['$ref'].rpartition('/')[2]]
    return str(schema.get('description', ''))


def _misplaced_remedy(key: str, schema: Schema) -> str:
    """Return the remedy for a key of the parts in a section beside it; '' for another key."""
    for section, of in schema['properties'].items():
        part = of.get('additionalProperties') if isinstance(of, dict) else None
        if isinstance(part, dict) and key in part.get('properties', ()):
            return under_part(key, section, (key,), ())
    return ''


def _near_key(key: str, known: Sequence[str]) -> str:
    otherwise = f'known: {list_names(sorted(known))}' if known else 'leave it out'
    return did_you_mean(key, known, otherwise)


def _dotted_path(path: _Path) -> str:
    """Return a path as in messages; list items count from 1."""
    return ''.join(
        f'[{part + 1}]' if isinstance(part, int) else f'.{part}' for part in path
    ).removeprefix('.')


def _line_number(content: Any, path: _Path) -> int:
    """Return the line of a key, or of the last existing key on its path."""
    line = 0
    for part in path:
        if isinstance(content, LinedDict) and isinstance(part, str):
            line = content.lines[part]
        content = content[part]
    return line
