# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Kinds of values in scene and linkage files, other than those of parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from linkage_ros.description.parameters import (
    choice,
    declare,
    example_of,
    Keys,
    Kind,
    named_mapping,
    Number,
    NumberList,
    ParameterGroup,
    parameters_schema,
    Parts,
    read_parameters,
    Rule,
    Schema,
    TextOf,
)
from linkage_ros.description.section import Section
from linkage_ros.description.units import LENGTHS
from linkage_ros.errors import read_each

DIALECT = 'https://json-schema.org/draft/2020-12/schema'
LENGTH_UNIT = choice(
    'Unit of the lengths in this file: of all values whose unit is m, m/s or m/s². All other '
    'units are SI.',
    tuple(LENGTHS),
    'm',
)


@dataclass(frozen=True, slots=True)
class Named(Kind):
    """
    Values of one kind by name, at most ``most`` of them.

    ``check`` refuses a name; ``names`` is the schema of the names. Where the parts name the
    slides, 'rad or m' is [m] for these names.
    """

    of: Kind
    most: int | None = None
    least: int = 0  # Their reader refuses fewer
    check: Callable[[Section, str, Parts], None] | None = None
    names: Schema | None = None

    def read(self, content: Section, key: str, parts: Parts, folder: str) -> dict[str, Any]:
        named = content.section(key, example=lambda name: self._example_for(name, parts))
        if self.most is not None and len(named.mapping) > self.most:
            count = len(named.mapping)
            raise content.error(key, f'there are {count}', f'write at most {self.most}')

        def read_value(name: str) -> Any:
            if self.check is not None:
                self.check(named, name, parts)
            if 'slide' in parts:
                named.units = replace(named.units, slides=name in parts['slide'])
            return self.of.read(named, name, parts, folder)

        return read_each({name: partial(read_value, name) for name in named})

    def example(self, parts: Parts) -> str:
        return self._example_for('', parts)

    def _example_for(self, name: str, parts: Parts) -> str:
        of_one = self.of.example(parts)
        return of_one if name else f'{{name: {of_one}}}'

    def json_schema(self) -> Schema:
        schema = named_mapping(self.meaning, self.of.json_schema())
        if self.names is not None:
            schema['propertyNames'] = self.names
        return schema | ({'minProperties': self.least} if self.least else {})


@dataclass(frozen=True, slots=True)
class OneOrMore(Kind):
    """A mapping, or a list of them; read as a list."""

    of: Keys

    def read(self, content: Section, key: str, parts: Parts, folder: str) -> list[Any]:
        sections = content.sections(key, example=lambda _: self.example(parts))
        readers = {
            i: partial(read_parameters, section, self.of, parts, folder)
            for i, section in enumerate(sections)
        }
        return [*read_each(readers).values()]

    def example(self, parts: Parts) -> str:
        return example_of(self.of, parts)

    def json_schema(self) -> Schema:
        return one_or_more(self.meaning, parameters_schema(self.of))


def one_or_more(meaning: str, schema: Schema) -> Schema:
    """Return the JSON Schema of one mapping, or a list of them."""
    return {
        'description': meaning,
        'if': {'type': 'array'},
        'then': {'minItems': 1, 'items': schema},
        'else': schema,
    }


@dataclass(frozen=True, slots=True)
class ListOf(Kind):
    """A list of numbers of one kind, or of names."""

    of: Kind

    def read(self, content: Section, key: str, parts: Parts, folder: str) -> tuple[Any, ...]:
        if isinstance(self.of, Number):
            return tuple(content.numbers(key, most=self.of.most, unit=self.of.unit))
        return tuple(content.texts(key))

    def json_schema(self) -> Schema:
        return {'description': self.meaning, 'type': 'array', 'items': self.of.json_schema()}


@dataclass(frozen=True, slots=True)
class NameOrNames(ListOf):
    """A name, or a list of names."""

    def read(self, content: Section, key: str, parts: Parts, folder: str) -> tuple[str, ...]:
        if isinstance(content.mapping.get(key), list):
            return tuple(content.texts(key))
        return (content.text(key),)

    def json_schema(self) -> Schema:
        several = ListOf.json_schema(self)
        return {'description': self.meaning, 'anyOf': [self.of.json_schema(), several]}

    def values_text(self) -> str:
        return 'a name, or several in a list'


def name_or_names(meaning: str, of: str) -> Any:
    """Declare a name or several in a list, read as a tuple; none if absent."""
    return declare(NameOrNames(meaning, TextOf(of)), ())


@dataclass(frozen=True, slots=True)
class LimitPair(NumberList):
    """Two numbers [low, high]; infinite for no limit on a side."""

    def read(self, content: Section, key: str, parts: Parts, folder: str) -> tuple[float, float]:
        return content.interval(key, most=self.most, unit=self.unit)

    def json_schema(self) -> Schema:
        # Infinite numbers are numbers in JSON Schema, and within no bounds.
        ends = {'type': 'array', 'minItems': 2, 'maxItems': 2, 'items': {'type': 'number'}}
        return {'description': self.meaning, **ends}


def optional_keys(of: Keys) -> Any:
    """Declare a mapping; if absent, nothing is passed on."""
    return declare(ParameterGroup(of.meaning, of), None)


@dataclass(frozen=True, slots=True)
class OnlyWith(Rule):
    """A key that means something only where another one has a value."""

    key: str
    other: str

    def check(self, content: Section) -> None:
        if self.key in content and content.mapping.get(self.other, '') == '':
            remedy = f'write {self.other} too, or leave it out'
            raise content.error(self.key, f'is without {self.other}', remedy)

    def json_schema(self) -> Schema:
        absent = {'properties': {self.key: False}}
        return {'if': {'required': [self.other]}, 'else': absent}


@dataclass(frozen=True, slots=True)
class Together(Rule):
    """Two keys that mean something only together."""

    keys: tuple[str, str]

    def check(self, content: Section) -> None:
        for key, second in (self.keys, self.keys[::-1]):
            if key in content and second not in content:
                remedy = f'write {second} too, or leave it out'
                raise content.error(key, f'is without {second}', remedy)

    def json_schema(self) -> Schema:
        first, second = self.keys
        return {'dependentRequired': {first: [second], second: [first]}}


@dataclass(frozen=True, slots=True)
class InsteadOf(Rule):
    """A key that stands in place of others, which are needed without it, or may be written."""

    key: str
    others: tuple[str, ...]
    optional: tuple[str, ...] = ()

    def needed_keys(self, content: Section) -> Sequence[str]:
        return (self.key,) if self.key in content else self.others

    def unknown_keys(self, content: Section) -> Sequence[str]:
        return (*self.others, *self.optional) if self.key in content else ()

    def json_schema(self) -> Schema:
        return {
            'if': {'required': [self.key]},
            'then': {'properties': dict.fromkeys((*self.others, *self.optional), False)},
            'else': {'required': list(self.others)},
        }
