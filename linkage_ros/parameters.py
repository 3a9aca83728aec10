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
How a drive, an effect or a fault declares its parameters: once, for reader, list and schema.

Parameters are a frozen dataclass whose fields are made by the functions below. The scene reads a
section of a file into it, the command line lists it, and the JSON Schema is written from it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, Field, field, fields, MISSING
from math import inf
from typing import Any

_KEY = 'parameter'


@dataclass(frozen=True, slots=True)
class Number:
    """A finite number: least ≤ value ≤ most, and value > above; ``whole``, without decimals."""

    meaning: str
    unit: str
    least: float = -inf
    most: float = inf
    above: float = -inf
    whole: bool = False


@dataclass(frozen=True, slots=True)
class Numbers:
    """A list of finite numbers."""

    meaning: str
    unit: str
    most: float


@dataclass(frozen=True, slots=True)
class Rows:
    """A list of rows of finite numbers, one for each column."""

    meaning: str
    columns: tuple[str, ...]
    """What each column is, with its unit."""
    most: float


@dataclass(frozen=True, slots=True)
class Flag:
    """True or false."""

    meaning: str


@dataclass(frozen=True, slots=True)
class Choice:
    """One of several words."""

    meaning: str
    words: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Text:
    """A text that is not empty."""

    meaning: str


@dataclass(frozen=True, slots=True)
class File:
    """A path, relative to the folder of the scene file."""

    meaning: str


@dataclass(frozen=True, slots=True)
class Point:
    """Two finite numbers [x, y]."""

    meaning: str
    unit: str
    most: float


@dataclass(frozen=True, slots=True)
class Name:
    """The name of a part of the linkage: one of ``kind`` (see `KINDS`)."""

    meaning: str
    kind: str


@dataclass(frozen=True, slots=True)
class Names:
    """A list of names of parts of the linkage."""

    meaning: str
    kind: str


@dataclass(frozen=True, slots=True)
class Each:
    """For each of some parts of the linkage a `Number`, a `Point`, or parameters of their own."""

    meaning: str
    kind: str
    of: Any
    """A `Number`, a `Point`, or a type of parameters."""


@dataclass(frozen=True, slots=True)
class Group:
    """Parameters within these."""

    meaning: str
    of: Any


KINDS = ('joint', 'input', 'pin', 'link', 'body', 'point')
"""
Parts that a parameter can name: a published joint, a driven joint, a pin or slider, a moving link,
a link or the ground, and a point of one of these: link.point.
"""

Kind = Number | Numbers | Rows | Flag | Choice | Text | File | Point | Name | Names | Each | Group


def number(
    meaning: str,
    default: Any = MISSING,
    *,
    unit: str = '',
    least: float = -inf,
    most: float = inf,
    above: float = -inf,
) -> Any:
    """Declare a number; without a default it must be given."""
    return _declared(Number(meaning, unit, least, most, above), default)


def whole(
    meaning: str, default: Any = MISSING, *, unit: str = '', least: float, most: float
) -> Any:
    """Declare a whole number."""
    return _declared(Number(meaning, unit, least, most, whole=True), default)


def numbers(meaning: str, default: Any = MISSING, *, unit: str = '', most: float = inf) -> Any:
    """Declare a list of numbers, read as a tuple."""
    return _declared(Numbers(meaning, unit, most), default)


def rows(meaning: str, columns: Sequence[str], *, most: float = inf) -> Any:
    """Declare a list of rows of numbers, read as a tuple of tuples."""
    return _declared(Rows(meaning, tuple(columns), most), MISSING)


def flag(meaning: str, default: Any = MISSING) -> Any:
    """Declare true or false."""
    return _declared(Flag(meaning), default)


def choice(meaning: str, words: Sequence[str], default: Any = MISSING) -> Any:
    """Declare one of several words."""
    return _declared(Choice(meaning, tuple(words)), default)


def text(meaning: str, default: Any = MISSING) -> Any:
    """Declare a text."""
    return _declared(Text(meaning), default)


def file(meaning: str) -> Any:
    """Declare the path of a file, read as a text with the scene's folder before it."""
    return _declared(File(meaning), MISSING)


def point(meaning: str, default: Any = MISSING, *, unit: str = '', most: float = inf) -> Any:
    """Declare a point or a vector, read as a tuple of two."""
    return _declared(Point(meaning, unit, most), default)


def name(meaning: str, kind: str, default: Any = MISSING) -> Any:
    """Declare the name of a part of the linkage."""
    return _declared(Name(meaning, kind), default)


def names(meaning: str, kind: str, default: Any = ()) -> Any:
    """Declare names of parts, read as a tuple; () where none are given stands for all."""
    return _declared(Names(meaning, kind), default)


def each(meaning: str, kind: str, of: Any, *, required: bool = False) -> Any:
    """Declare values for parts by their names, read as a mapping; empty if not required."""
    declared = Each(meaning, kind, of)
    if required:
        return _declared(declared, MISSING)
    return field(default_factory=dict, metadata={_KEY: declared})


def group(meaning: str, of: Any) -> Any:
    """Declare parameters within these; absent, they are as by default."""
    return field(default_factory=of, metadata={_KEY: Group(meaning, of)})


def declared(parameters: Any) -> list[tuple[Field[Any], Kind]]:
    """Return the fields of a type of parameters, each with what it was declared as."""
    return [(each_field, each_field.metadata[_KEY]) for each_field in fields(parameters)]


def _declared(kind: Kind, default: Any) -> Any:
    return field(default=default, metadata={_KEY: kind})
