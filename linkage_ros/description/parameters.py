# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Declare the keys of a mapping in a file once, for reader, table and schema.

The parameters of a drive, an effect or a fault are a frozen dataclass whose fields are made by the
functions below. Mappings that are read into another type are `Keys`, with the same fields. Each
field has a kind, which reads the value from a section of a file, describes it in tables, and gives
its JSON Schema.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, Field, field, fields, is_dataclass, MISSING, replace
from functools import partial
from math import inf
from os.path import join
from re import fullmatch
from typing import Any, ClassVar

from linkage_ros.description.section import Section
from linkage_ros.description.units import most_in_one, unit_of
from linkage_ros.errors import did_you_mean, list_names, quote, read_each

_KEY = 'parameter'

Schema = dict[str, Any]

Parts = Mapping[str, Sequence[str]]
"""
The existing names for each kind of part.

Of joints and pins, 'slide' and 'slider' slide; 'axis' has the axes that vectors have components
along.
"""

KINDS = {
    'joint': 'published joint',
    'input': 'driven joint',
    'any_joint': 'driven or published joint',
    'pin': 'pin or slider',
    'bearing': 'pin, in space hinge or ball',
    'link': 'moving link',
    'body': 'link or the ground',
    'point': 'point: LINK.POINT',
    'hole': 'point, in space also hinge: LINK.POINT',
}
"""Kinds of parts that a parameter can name, and their terms in messages."""

_SLIDING = {'joint': 'slide', 'input': 'slide', 'any_joint': 'slide', 'pin': 'slider'}
"""Kinds whose parts turn or slide, and the names of sliding parts."""

CHARACTER = r'[^\u0000-\u001f\u007f-\u00a0\u2028\u2029]'
"""Pattern of a printable character."""


@dataclass(frozen=True, slots=True)
class Kind(ABC):
    """Kind of a parameter, with its meaning as text."""

    meaning: str
    unit: ClassVar[str] = ''

    @abstractmethod
    def read(self, content: Section, key: str, parts: Parts, folder: str) -> Any:
        """Read the value of a key; arguments and errors as in `read_parameters`."""

    @abstractmethod
    def json_schema(self) -> Schema:
        """Return the JSON Schema of the value."""

    def example(self, _parts: Parts) -> str:
        """Return a value as it is written; '…' if only a user knows one."""
        return '…'

    def values_text(self) -> str:
        """Return the allowed values, for a table of parameters; '' for what no parameter is."""
        return ''

    def default_text(self, default: Any) -> str:
        """Return a default, for a table."""
        return str(default) or "''"

    def table_rows(self, key: str, default: str) -> Iterator[tuple[str, ...]]:
        """Yield rows of a table: key, unit, default, values, meaning."""
        yield key, self.unit, default, self.values_text(), self.meaning

    def _described_schema(self, **schema: Any) -> Schema:
        return {'description': self.meaning + (f' [{self.unit}]' if self.unit else ''), **schema}


class Rule:
    """A rule between the keys of a mapping."""

    def check(self, content: Section) -> None:
        """Refuse a mapping that breaks the rule, before its values are read."""

    def check_values(self, content: Section, values: Mapping[str, Any]) -> None:
        """Refuse values that break the rule."""

    def needed_keys(self, content: Section) -> Sequence[str]:
        """Return the optional keys that this mapping must have."""
        return ()

    def unknown_keys(self, content: Section) -> Sequence[str]:
        """Return the keys that this mapping cannot have."""
        return ()

    def json_schema(self) -> Schema:
        """Return what the rule adds to the JSON Schema of the mapping."""
        return {}


@dataclass(frozen=True, slots=True)
class Keys:
    """The keys of a mapping that is read into a type which knows nothing of files."""

    meaning: str
    build: Callable[..., Any]  # Called with the values by key; without keys that have no value
    entries: Mapping[str, Any]  # A field for each key, by the functions below
    rules: tuple[Rule, ...] = ()

    def __post_init__(self) -> None:
        for name, entry in self.entries.items():
            entry.name = name

    def read_key(self, content: Section, key: str, parts: Parts, folder: str = '') -> Any:
        """Return the value of a key, or its default."""
        return _read_entry(self.entries[key], content, parts, folder)


@dataclass(frozen=True, slots=True)
class Number(Kind):
    """
    A finite number: least ≤ value ≤ most, and value > above; with ``whole`` an integer.

    It may be 0, for never, where it is otherwise at least ``unless_zero``.
    """

    unit: str = ''  # type: ignore[misc]  # a constant without a unit
    least: float = -inf
    most: float = inf
    above: float = -inf
    whole: bool = False
    unless_zero: float = 0.0

    def read(self, content: Section, key: str, parts: Parts, folder: str) -> float | int:
        bounds: dict[str, Any] = {'least': self.least, 'most': self.most, 'unit': self.unit}
        number: float | int
        if self.whole:
            number = content.whole_number(key, **bounds)
        else:
            number = content.number(key, above=self.above, **bounds)
        if 0 < number < self.unless_zero:
            remedy = f'write {self.unless_zero:.9g} or more, or 0'
            raise content.error(key, f'{number:g} is too small', remedy)
        return number

    def json_schema(self) -> Schema:
        kind = 'integer' if self.whole else 'number'
        schema = self._described_schema(
            type=kind, **_bounds_schema(self.least, self.most, self.above, self.unit)
        )
        if self.unless_zero:
            least = {'minimum': _without_decimals(self.unless_zero)}
            schema |= {'if': {'exclusiveMinimum': 0}, 'then': least}
        return schema

    def example(self, _parts: Parts) -> str:
        least = max(self.least, self.unless_zero)
        fit = (n for n in (1, 0.1, 0.01, 1e-3, 1e-4) if least <= n <= self.most and n > self.above)
        bound = self.least if self.least > -inf else self.most
        return number_text(1 if self.whole and least <= 1 <= self.most else next(fit, bound))

    def values_text(self) -> str:
        least, most, above = map(number_text, (self.least, self.most, self.above))
        if self.above > -inf:
            bounds = f'more than {above}' + (f', to {most}' if self.most < inf else '')
        elif self.least > -inf:
            bounds = f'{least} to {most}' if self.most < inf else f'{least} or more'
        else:
            bounds = f'at most {most}' if self.most < inf else 'any number'
        return f'whole: {bounds}' if self.whole else bounds

    def default_text(self, default: Any) -> str:
        return number_text(default)


@dataclass(frozen=True, slots=True)
class NumberList(Kind):
    """A list of finite numbers, each within ±most."""

    unit: str = ''  # type: ignore[misc]
    most: float = inf

    def read(self, content: Section, key: str, parts: Parts, folder: str) -> tuple[float, ...]:
        return tuple(content.numbers(key, most=self.most, unit=self.unit))

    def json_schema(self) -> Schema:
        items = {'type': 'number', **_bounds_schema(-self.most, self.most, unit=self.unit)}
        return self._described_schema(type='array', items=items)

    def example(self, _parts: Parts) -> str:
        return '[0.1, 0.2]'

    def values_text(self) -> str:
        return f'a list of numbers{_each_at_most(self.most)}'


@dataclass(frozen=True, slots=True)
class Point(NumberList):
    """Two finite numbers [x, y], each within ±most."""

    def read(self, content: Section, key: str, parts: Parts, folder: str) -> tuple[float, float]:
        return content.point(key, most=self.most, unit=self.unit)

    def json_schema(self) -> Schema:
        return {**NumberList.json_schema(self), 'minItems': 2, 'maxItems': 2}

    def values_text(self) -> str:
        return f'[x, y]{_each_at_most(self.most)}'


@dataclass(frozen=True, slots=True)
class Components(NumberList):
    """The components of a vector along the axes of the linkage: [x, y], in space [x, y, z]."""

    def read(self, content: Section, key: str, parts: Parts, folder: str) -> tuple[float, ...]:
        take = content.place if 'z' in parts.get('axis', ()) else content.point
        return take(key, most=self.most, unit=self.unit)

    def json_schema(self) -> Schema:
        return {**NumberList.json_schema(self), 'minItems': 2, 'maxItems': 3}

    def values_text(self) -> str:
        return f'[x, y], in space [x, y, z]{_each_at_most(self.most)}'


@dataclass(frozen=True, slots=True)
class RowsOf(Kind):
    """A list of rows of finite numbers, one per column, each within ±most."""

    columns: tuple[str, ...]  # The meaning of each column, with its unit
    most: float = inf

    def read(self, content: Section, key: str, parts: Parts, folder: str) -> Any:
        return content.rows(key, self.columns, most=self.most)

    def json_schema(self) -> Schema:
        row, count = f'[{", ".join(self.columns)}]', len(self.columns)
        bounds = _bounds_schema(
            -self.most, self.most, unit=' or '.join(map(unit_of, self.columns))
        )
        items = {
            **NumberList(row).json_schema(),
            'items': {'type': 'number', **bounds},
            'minItems': count,
            'maxItems': count,
        }
        description = f'{self.meaning}: rows of {row}'
        return {'description': description, 'type': 'array', 'minItems': 1, 'items': items}

    def example(self, _parts: Parts) -> str:
        rows = (', '.join([str(number)] * len(self.columns)) for number in (0, 1))
        return f'[{", ".join(f"[{row}]" for row in rows)}]'

    def values_text(self) -> str:
        return f'rows of [{", ".join(self.columns)}]{_each_at_most(self.most)}'


@dataclass(frozen=True, slots=True)
class Flag(Kind):
    """True or false."""

    def read(self, content: Section, key: str, parts: Parts, folder: str) -> bool:
        return content.flag(key)

    def json_schema(self) -> Schema:
        return self._described_schema(type='boolean')

    def example(self, _parts: Parts) -> str:
        return 'true'

    def values_text(self) -> str:
        return 'true or false'

    def default_text(self, default: Any) -> str:
        return 'true' if default else 'false'


@dataclass(frozen=True, slots=True)
class ChoiceOf(Kind):
    """One of a set of words."""

    words: tuple[str, ...]

    def read(self, content: Section, key: str, parts: Parts, folder: str) -> str:
        return content.choice(key, self.words)

    def json_schema(self) -> Schema:
        return self._described_schema(enum=list(self.words))

    def example(self, _parts: Parts) -> str:
        return self.words[0]

    def values_text(self) -> str:
        return ' or '.join(self.words)


@dataclass(frozen=True, slots=True)
class TextOf(Kind):
    """A string; without a pattern, a printable one that is not empty."""

    pattern: str = f'^{CHARACTER}+$'

    def read(self, content: Section, key: str, parts: Parts, folder: str) -> str:
        if content.mapping.get(key) == '' and fullmatch(self.pattern, ''):
            return content.text(key, '')
        return content.text(key, expected=self.meaning)

    def json_schema(self) -> Schema:
        return self._described_schema(type='string', pattern=self.pattern)

    def values_text(self) -> str:
        return 'a text'


@dataclass(frozen=True, slots=True)
class File(TextOf):
    """A path, relative to the folder of the scene file."""

    def read(self, content: Section, key: str, parts: Parts, folder: str) -> str:
        return join(folder, content.text(key))  # noqa: PTH118 (Path's raises on a NUL)

    def example(self, _parts: Parts) -> str:
        return 'my_bag'

    def values_text(self) -> str:
        return 'a file'


@dataclass(frozen=True, slots=True)
class Name(Kind):
    """The name of a part of the linkage: one of ``kind``, a key of `KINDS`."""

    kind: str

    def read(self, content: Section, key: str, parts: Parts, folder: str) -> Any:
        return self._known_name(content, key, content.text(key), parts)

    def json_schema(self) -> Schema:
        # It cannot know the existing names.
        return TextOf(f'{self.meaning} (name of a {KINDS[self.kind]})').json_schema()

    def example(self, parts: Parts) -> str:
        return next(iter(parts.get(self.kind, ())), '…')

    def values_text(self) -> str:
        return f'a {KINDS[self.kind]}'

    def _known_name(self, content: Section, key: str, name: str, parts: Parts) -> str:
        """Return the name if such a part exists."""
        names = parts[self.kind]
        if name in names:
            return name
        raise content.error(
            key,
            f'there is no {self.kind.removeprefix("any_")} {quote(name)}',
            did_you_mean(name, names, f'there are: {list_names(names) or "none"}'),
        )


@dataclass(frozen=True, slots=True)
class NamesOf(Name):
    """A list of names of parts of the linkage."""

    def read(self, content: Section, key: str, parts: Parts, folder: str) -> tuple[str, ...]:
        return tuple(self._known_name(content, key, name, parts) for name in content.texts(key))

    def json_schema(self) -> Schema:
        description = f'{self.meaning} (names, each of a {KINDS[self.kind]})'
        return {
            'description': description,
            'type': 'array',
            'items': TextOf('a name').json_schema(),
        }

    def example(self, parts: Parts) -> str:
        return f'[{Name.example(self, parts)}]'

    def values_text(self) -> str:
        return f'names, each of a {KINDS[self.kind]}'

    def default_text(self, default: Any) -> str:
        return ', '.join(default) or 'all'


@dataclass(frozen=True, slots=True)
class Each(Name):
    """A value of a `Kind`, or a section of parameters, for each named part of the linkage."""

    of: Any

    @property
    def _value_kind(self) -> Kind:
        return ParameterGroup('', self.of) if isinstance(self.of, type) else self.of

    def read(self, content: Section, key: str, parts: Parts, folder: str) -> dict[str, Any]:
        inner = content.section(key, example=partial(self._example_for, parts))

        def read_value(name: str) -> tuple[str, Any]:
            part = self._known_name(inner, name, name, parts)
            if sliding := _SLIDING.get(self.kind):
                inner.units = replace(inner.units, slides=name in parts.get(sliding, ()))
            return part, self._value_kind.read(inner, name, parts, folder)

        return dict(read_each({name: partial(read_value, name) for name in inner}).values())

    def json_schema(self) -> Schema:
        of = parameters_schema(self.of) if isinstance(self.of, type) else self.of.json_schema()
        return named_mapping(f'{self.meaning} (by the name of a {KINDS[self.kind]})', of)

    def example(self, parts: Parts) -> str:
        return self._example_for(parts, '')

    def _example_for(self, parts: Parts, name: str) -> str:
        of_one = self._value_kind.example(parts)
        if name:
            return of_one if name in parts.get(self.kind, ()) else ''
        return f'{{{Name.example(self, parts)}: {of_one}}}'

    @property
    def part_keys(self) -> tuple[str, ...]:
        """Return the keys of each part; none if it has a single value."""
        return tuple(e.name for e in fields(self.of)) if isinstance(self.of, type) else ()

    def values_text(self) -> str:
        return f'for each {KINDS[self.kind]}'

    def default_text(self, default: Any) -> str:
        return ''  # its own rows have the defaults

    def table_rows(self, key: str, default: str) -> Iterator[tuple[str, ...]]:
        """Yield one row, and the rows of the values."""
        yield from Kind.table_rows(self, key, default)
        entry = (
            'LINK.POINT'
            if self.kind in ('point', 'hole')
            else self.kind.removeprefix('any_').upper()
        )
        part = f'{key}.{entry}'
        rows = self._value_kind.table_rows(part, '')
        if isinstance(self.of, type):
            next(rows)
        yield from rows


@dataclass(frozen=True, slots=True)
class ParameterGroup(Kind):
    """A section of parameters within a section."""

    of: Any

    def read(self, content: Section, key: str, parts: Parts, folder: str) -> Any:
        inner = content.section(key, example=lambda _: self.example(parts))
        return read_parameters(inner, self.of, parts, folder)

    def example(self, parts: Parts) -> str:
        return example_of(self.of, parts)

    def json_schema(self) -> Schema:
        return {**parameters_schema(self.of), 'description': self.meaning}

    def values_text(self) -> str:
        return 'a mapping'

    def default_text(self, default: Any) -> str:
        return ''  # its own rows have the defaults

    def table_rows(self, key: str, default: str) -> Iterator[tuple[str, ...]]:
        """Yield one row, and the rows of the parameters."""
        yield from Kind.table_rows(self, key, default)
        yield from parameter_rows(self.of, f'{key}.')


def number(
    meaning: str,
    default: Any = MISSING,
    *,
    unit: str = '',
    least: float = -inf,
    most: float = inf,
    above: float = -inf,
    unless_zero: float = 0.0,
) -> Any:
    """Declare a number; it is required if it has no default."""
    return declare(Number(meaning, unit, least, most, above, False, unless_zero), default)


def whole_number(
    meaning: str,
    default: Any = MISSING,
    *,
    unit: str = '',
    least: float,
    most: float,
    unless_zero: float = 0.0,
) -> Any:
    """Declare a whole number."""
    return declare(Number(meaning, unit, least, most, -inf, True, unless_zero), default)


def number_list(meaning: str, default: Any = MISSING, *, unit: str = '', most: float = inf) -> Any:
    """Declare a list of numbers, read as a tuple."""
    return declare(NumberList(meaning, unit, most), default)


def number_rows(
    meaning: str, columns: Sequence[str], *, default: Any = MISSING, most: float = inf
) -> Any:
    """Declare a list of rows of numbers, read as a tuple of tuples."""
    return declare(RowsOf(meaning, tuple(columns), most), default)


def flag(meaning: str, default: Any = MISSING) -> Any:
    """Declare a boolean."""
    return declare(Flag(meaning), default)


def choice(meaning: str, words: Sequence[str], default: Any = MISSING) -> Any:
    """Declare one of a set of words."""
    return declare(ChoiceOf(meaning, tuple(words)), default)


def text(meaning: str, default: Any = MISSING, *, pattern: str = f'^{CHARACTER}+$') -> Any:
    """Declare a string."""
    return declare(TextOf(meaning, pattern), default)


def file(meaning: str) -> Any:
    """Declare the path of a file, read as a string with the scene's folder prepended."""
    return declare(File(meaning), MISSING)


def point(meaning: str, default: Any = MISSING, *, unit: str = '', most: float = inf) -> Any:
    """Declare a point or a vector, read as a tuple of two."""
    return declare(Point(meaning, unit, most), default)


def components(meaning: str, default: Any = MISSING, *, unit: str = '', most: float = inf) -> Any:
    """Declare a vector, read as a tuple of two, or of three in space."""
    return declare(Components(meaning, unit, most), default)


def part_name(meaning: str, kind: str, default: Any = MISSING) -> Any:
    """Declare the name of a part of the linkage."""
    return declare(Name(meaning, kind), default)


def part_names(meaning: str, kind: str, default: Any = ()) -> Any:
    """Declare names of parts, read as a tuple; the default () stands for all parts."""
    return declare(NamesOf(meaning, kind), default)


def each_part(meaning: str, kind: str, of: Any, *, required: bool = False) -> Any:
    """Declare values for parts by name, read as a mapping; empty if not required."""
    declared = Each(meaning, kind, of)
    if required:
        return declare(declared, MISSING)
    return field(default_factory=dict, metadata={_KEY: declared})


def own_parameters(meaning: str, of: Any) -> Any:
    """Declare parameters for each joint, read as a mapping; if absent, None."""
    return declare(Each(meaning, 'joint', of), None)


def parameter_section(meaning: str, of: Any) -> Any:
    """Declare a section of parameters; if absent, all have their defaults."""
    return field(default_factory=of, metadata={_KEY: ParameterGroup(meaning, of)})


def optional_section(meaning: str, of: Any) -> Any:
    """Declare a section of parameters; if absent, None."""
    return declare(ParameterGroup(meaning, of), None)


def declare(kind: Kind, default: Any = MISSING) -> Any:
    """Declare a value of a kind; it is required if it has no default."""
    return field(default=default, metadata={_KEY: kind})


def declared_fields(parameters: Any) -> list[tuple[Field[Any], Kind]]:
    """Return the fields of a parameter type, or of `Keys`, each with its kind."""
    if isinstance(parameters, Keys):
        return [(entry, entry.metadata[_KEY]) for entry in parameters.entries.values()]
    return [(entry, entry.metadata[_KEY]) for entry in fields(parameters)]


def is_required(entry: Field[Any]) -> bool:
    """Return whether a parameter has no default."""
    return entry.default is MISSING and entry.default_factory is MISSING


def default_of(entry: Field[Any]) -> Any:
    """Return the default of an optional parameter, in the form of JSON."""
    value = entry.default if entry.default_factory is MISSING else entry.default_factory()
    if is_dataclass(value) and not isinstance(value, type):
        value = asdict(value)
    return list(value) if isinstance(value, tuple) else value


def example_of(of: Any, parts: Parts) -> str:
    """Return a section of a parameter type as it is written: with the keys that it must have."""
    must = [(entry.name, kind) for entry, kind in declared_fields(of) if is_required(entry)]
    return f'{{{", ".join(f"{name}: {kind.example(parts)}" for name, kind in must)}}}'


def first_docstring_line(parameters: Any) -> str:
    """Return the first line of the docstring of a parameter type, or the meaning of `Keys`."""
    if isinstance(parameters, Keys):
        return parameters.meaning
    return str(parameters.__doc__).strip().splitlines()[0]


def read_parameters(content: Section, of: Any, parts: Parts, folder: str = '') -> Any:
    """
    Read a section of parameters, which may name parts of the linkage and files in a folder.

    A FileError has line and key of a wrong value, the expected values, and the nearest name.
    """
    entries = declared_fields(of)
    _refuse_misplaced(content, entries, parts)
    rules = of.rules if isinstance(of, Keys) else ()
    for rule in rules:
        rule.check(content)
    unknown = {key for rule in rules for key in rule.unknown_keys(content)}
    needed = {key for rule in rules for key in rule.needed_keys(content)}
    entries = [(entry, kind) for entry, kind in entries if entry.name not in unknown]
    known = [entry.name for entry, _ in entries]
    readers: dict[str, Callable[[], Any]] = {
        entry.name: partial(kind.read, content, entry.name, parts, folder)
        if entry.name in needed
        else partial(_read_entry, entry, content, parts, folder)
        for entry, kind in entries
    }
    values = read_each(readers | {'': partial(content.finish, known)})
    del values['']
    for rule in rules:
        rule.check_values(content, values)
    if isinstance(of, Keys):
        return of.build(**{key: value for key, value in values.items() if value is not None})
    return of(**values)


def _read_entry(entry: Field[Any], content: Section, parts: Parts, folder: str) -> Any:
    """Return the value of a key, or its default."""
    if entry.name in content or is_required(entry):
        return entry.metadata[_KEY].read(content, entry.name, parts, folder)
    content.remove_key(entry.name)
    return entry.default if entry.default_factory is MISSING else entry.default_factory()


def _refuse_misplaced(
    content: Section, entries: Sequence[tuple[Field[Any], Kind]], parts: Parts
) -> None:
    """Refuse a key that belongs under the name of a part, and say where to write it."""
    known = [entry.name for entry, _ in entries]
    for key in content:
        for entry, kind in entries:
            if key in known or not isinstance(kind, Each):
                continue
            if remedy := under_part(key, entry.name, kind.part_keys, parts.get(kind.kind, ())):
                raise content.error(key, f'is for each {KINDS[kind.kind]}', remedy)


def under_part(key: str, section: str, keys: Sequence[str], names: Sequence[str]) -> str:
    """
    Return the remedy for a key that belongs into a section of named parts; '' for another key.

    The keys are the keys of a part: none if a part has a single value.
    """
    if key in keys:
        name = names[0] if names else 'NAME'
        return f'write it under {section}, as {section}: {{{name}: {{{key}: …}}}}'
    return f'write it under {section}, as {section}: {{{key}: …}}' if key in names else ''


def parameters_schema(of: Any) -> Schema:
    """Return the JSON Schema of the section of a parameter type."""
    entries = declared_fields(of)
    schema = mapping_schema(
        first_docstring_line(of),
        {
            entry.name: kind.json_schema()
            | (
                {}
                if is_required(entry) or entry.default is None
                else {'default': _plain_default(default_of(entry))}
            )
            for entry, kind in entries
        },
        required=tuple(entry.name for entry, _ in entries if is_required(entry)),
    )
    for rule in of.rules if isinstance(of, Keys) else ():
        schema |= rule.json_schema()
    return schema


def parameter_rows(of: Any, prefix: str = '') -> Iterator[tuple[str, ...]]:
    """Yield rows of a table of parameters: key, unit, default, values, meaning."""
    for entry, kind in declared_fields(of):
        default = 'required' if is_required(entry) else kind.default_text(default_of(entry))
        yield from kind.table_rows(prefix + entry.name, default)


def mapping_schema(
    description: str, properties: Mapping[str, Schema], *, required: tuple[str, ...] = ()
) -> Schema:
    """Return the JSON Schema of a mapping with these keys only."""
    schema: Schema = {'description': description, 'type': 'object'}
    if required:
        schema['required'] = list(required)
    return {**schema, 'properties': dict(properties), 'additionalProperties': False}


def named_mapping(description: str, of: Schema) -> Schema:
    """Return the JSON Schema of a mapping whose keys are names."""
    return {'description': description, 'type': 'object', 'additionalProperties': of}


def number_text(value: Any) -> str:
    """Return a number in its usual notation: 1e9, but 4096; a list unchanged."""
    if not isinstance(value, int | float):
        return str(value)
    short = f'{value:g}'.replace('e+0', 'e').replace('e-0', 'e-').replace('e+', 'e')
    return short if float(short) == value else f'{value:.15g}'


def _each_at_most(most: float) -> str:
    return f', each of at most {number_text(most)}' if most < inf else ''


def _bounds_schema(least: float, most: float, above: float = -inf, unit: str = '') -> Schema:
    # A schema does not know the file's units: the reader alone has the exact bounds.
    scale = most_in_one(unit)
    least, most, above = least * scale, most * scale, above * scale
    bounds = (('minimum', least), ('maximum', most), ('exclusiveMinimum', above))
    return {word: _without_decimals(bound) for word, bound in bounds if abs(bound) < inf}


def _plain_default(default: Any) -> Any:
    """Return a default whose whole numbers have no decimals."""
    if isinstance(default, list):
        return list(map(_plain_default, default))
    return _without_decimals(default) if isinstance(default, float) else default


def _without_decimals(bound: float) -> float:
    """Return a whole number without decimals: users see 1, not 1.0."""
    return int(bound) if float(bound).is_integer() and abs(bound) <= 2**53 else bound
