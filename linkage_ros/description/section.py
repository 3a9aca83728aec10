# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Section of a YAML file: a mapping whose keys are taken one by one."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import pairwise, repeat
from math import inf, isfinite, isnan
from re import fullmatch
from typing import Any, cast

from linkage_ros.description.units import unit_of, Units
from linkage_ros.errors import (
    DefinitionError,
    did_you_mean,
    FileError,
    list_names,
    quote,
    raise_each,
)

SI = Units()


class LinedDict(dict[str, Any]):
    """A mapping with the line of each of its keys."""

    __slots__ = ('lines',)

    def __init__(self) -> None:
        super().__init__()
        self.lines: dict[str, int] = {}


class Section:
    """
    A mapping of a YAML file, whose keys are taken one by one; the getters return SI.

    Every getter removes its key from the section; `finish` refuses the remaining keys. The path is
    the dotted key of the mapping, the line its line, for error messages.
    """

    def __init__(
        self,
        file: str,
        path: str,
        content: Mapping[str, Any],
        line: int = 0,
        units: Units = SI,
    ) -> None:
        self.file = file
        self._path = path
        self._content = content
        self._line = line
        self.units = units
        self.named_data = b''  # Of the file that the section names, if it has been read
        self._taken: set[str] = set()

    def __contains__(self, key: str) -> bool:
        return key in self._content

    def __iter__(self) -> Iterator[str]:
        return iter(self._content)

    @property
    def mapping(self) -> Mapping[str, Any]:
        """Return the whole mapping, as it was read."""
        return self._content

    def error(self, key: str, reason: str, remedy: str) -> FileError:
        """Return the error for a key of this section ('' for the section itself)."""
        path = '.'.join(filter(None, (self._path, key)))
        return FileError(self.file, path, reason, remedy, self._line_of(key))

    def locate_error(self, error: DefinitionError) -> FileError:
        """Return an error of this content as one of its file, in the file's units."""
        convert = self.units.convert_quantities
        return self.error(error.where, convert(error.reason), convert(error.remedy))

    def number(
        self,
        key: str,
        default: float | None = None,
        *,
        least: float = -inf,
        most: float = inf,
        above: float = -inf,
        unit: str = '',
    ) -> float:
        """Return a finite number within bounds: least ≤ value ≤ most, and value > above."""
        name = self.units.file_unit(unit)
        value = self._take_value(key, default, f'a number{_unit_text(name)}')
        if not _is_number(value):
            raise self.error(
                key, f'{quote(value)} is not a number', f'write a number{_unit_text(name)}'
            )
        in_si = self._to_si(key, value, unit)
        if not isfinite(in_si) or not least <= in_si <= most or in_si <= above:
            bounds = ' and '.join(
                f'{word} {self.units.to_file_unit(bound, unit):g}'
                for word, bound in (('more than', above), ('at least', least), ('at most', most))
                if isfinite(bound)
            )
            raise self.error(
                key,
                f'{quote(value)} is out of bounds',
                f'write a finite number{bounds and f", {bounds}"}{name and f" [{name}]"}',
            )
        return in_si

    def whole_number(
        self,
        key: str,
        default: int | None = None,
        *,
        least: float,
        most: float,
        unit: str = '',
    ) -> int:
        """Return a whole number within bounds."""
        value = self.number(key, default, least=least, most=most, unit=unit)
        if not value.is_integer():
            raise self.error(key, f'{value:g} is not whole', 'write a whole number')
        return int(value)

    def flag(self, key: str, default: bool | None = None) -> bool:
        """Return a boolean."""
        value = self._take_value(key, default, 'true or false')
        if not isinstance(value, bool):
            raise self.error(key, f'{quote(value)} is not true or false', 'write true or false')
        return value

    def text(self, key: str, default: str | None = None, *, expected: str = 'a string') -> str:
        """Return a string that is not empty, or the default; ``expected`` is its meaning."""
        value = self._take_value(key, default, expected)
        if value == default and default is not None:
            return default
        if not isinstance(value, str) or not value.isprintable() or not value:
            raise self.error(key, f'{quote(value)} is not a string', 'write a name; quote numbers')
        return value

    def ros_name(self, name: str) -> str:
        """Return a key of this section, or a value in it, that will be part of a topic name."""
        if not fullmatch('[A-Za-z][A-Za-z0-9_]*', name):
            raise self.error(
                name if name in self._content else '',
                f'{quote(name)} is not a ROS name',
                'use letters, digits and _, a letter first',
            )
        return name

    def choice(self, key: str, choices: Sequence[str], default: str | None = None) -> str:
        """Return one of a set of words."""
        value = self._take_value(key, default, list_names(choices, ' or '))
        if value not in choices:
            raise self.error(
                key, f'{quote(value)} is not a choice', f'write {list_names(choices, " or ")}'
            )
        return cast(str, value)

    def choose_words(self, key: str, groups: Sequence[Sequence[str]]) -> list[str]:
        """
        Return a word of each group: one that the file names, else the group's first.

        The file names one word, or a list of words of different groups.
        """
        value = self._take_value(key, [], 'a word')
        named = value if isinstance(value, list) else [value]
        chosen = [[word for word in named if word in group] for group in groups]
        if sum(map(len, chosen)) != len(named) or any(len(words) > 1 for words in chosen):
            choices = ', '.join(' or '.join(group) for group in groups)
            both = ', '.join(group[-1] for group in groups)
            raise self.error(
                key,
                f'{quote(value)} is not a choice',
                f'write {choices}, or one of each: [{both}]',
            )
        return [
            words[0] if words else group[0] for words, group in zip(chosen, groups, strict=True)
        ]

    def point(self, key: str, *, most: float = inf, unit: str = '') -> tuple[float, float]:
        """Return two finite numbers, each within ±most."""
        name = self.units.file_unit(unit)
        value = self._take_value(key, None, f'two numbers [x, y]{_unit_text(name)}')
        if not _is_pair(value) or not all(map(isfinite, value)):
            remedy = 'write two finite numbers: [x, y]'
            if isinstance(value, list) and len(value) > 2 and all(map(_is_number, value)):
                remedy += (
                    '; a decimal has a point, not a comma: [0.040, 0]'
                    if _has_decimal_comma(value)
                    else '; a planar linkage has no z'
                )
            raise self.error(key, f'{quote(value)} is not a point', remedy)
        x, y = (self._to_si(key, part, unit) for part in value)
        self._check_most(key, value, (x, y), most, unit)
        return x, y

    def place(self, key: str, *, most: float = inf, unit: str = '') -> tuple[float, float, float]:
        """Return three finite numbers, each within ±most."""
        name = self.units.file_unit(unit)
        value = self._take_value(key, None, f'three numbers [x, y, z]{_unit_text(name)}')
        if not _is_list_of_finite(value) or len(value) != 3:
            remedy = 'write three finite numbers: [x, y, z]'
            if _is_pair(value):
                remedy += '; a linkage with points is spatial'
            raise self.error(key, f'{quote(value)} is not a place', remedy)
        x, y, z = (self._to_si(key, part, unit) for part in value)
        self._check_most(key, value, (x, y, z), most, unit)
        return x, y, z

    def interval(self, key: str, *, most: float = inf, unit: str = '') -> tuple[float, float]:
        """
        Return two numbers [low, high]; infinite for no limit, and if the key is absent.

        The caller checks their order.
        """
        value = self._take_value(key, [-inf, inf], 'two numbers [low, high]')
        if not _is_pair(value) or any(map(isnan, value)):
            raise self.error(
                key,
                f'{quote(value)} is not two numbers',
                'write [low, high]; -.inf or .inf for none on a side',
            )
        low, high = (self._to_si(key, end, unit) for end in value)
        self._check_most(key, value, filter(isfinite, (low, high)), most, unit)
        return low, high

    def section(
        self, key: str, *, required: bool = True, example: Callable[[str], str] | None = None
    ) -> Section:
        """
        Return a nested mapping; an empty one if it is absent and not required.

        Where something else stands, the error shows an ``example``: of what belongs to a name that
        stands there, or of the mapping for the name ''.
        """
        is_missing = required and key not in self._content
        expected = example('') if example and is_missing else 'a mapping'
        value = self._take_value(key, None if required else {}, expected)
        line = self._line_of(key)
        if not isinstance(value, dict):
            remedy = f'write {key}: {_as_mapping(value, example)}'
            reason = 'is empty' if value is None else f'{quote(value)} is not a mapping'
            raise self.error(key, reason, remedy)
        path = '.'.join(filter(None, (self._path, key)))
        return Section(self.file, path, value, line, self.units)

    def sections(self, key: str, *, example: Callable[[str], str] | None = None) -> list[Section]:
        """Return one mapping, or a list of them; ``example`` is as for `section`."""
        value = self._take_value(key, None, 'a mapping')
        if not isinstance(value, list):
            return [self.section(key, example=example)]
        sections = []
        for i, item in enumerate(value, 1):
            path = '.'.join(filter(None, (self._path, f'{key}[{i}]')))
            if not isinstance(item, dict):
                raise self.error(
                    key, f'{quote(item)} is not a mapping', f'write {_as_mapping(item, example)}'
                )
            sections.append(Section(self.file, path, item, self._line_of(key), self.units))
        if not sections:
            raise self.error(key, 'the list is empty', 'name at least one')
        return sections

    def numbers(self, key: str, *, most: float = inf, unit: str = '') -> list[float]:
        """Return a list of finite numbers, each within ±most."""
        value = self._take_value(key, None, 'a list of numbers')
        if not _is_list_of_finite(value):
            raise self.error(
                key, f'{quote(value)} is not a list of finite numbers', 'write [0.1, 0.2]'
            )
        numbers = [self._to_si(key, v, unit) for v in value]
        self._check_most(key, value, numbers, most, unit)
        return numbers

    def rows(
        self, key: str, columns: Sequence[str], *, most: float = inf
    ) -> tuple[tuple[float, ...], ...]:
        """Return a list of rows of finite numbers, each within ±most."""
        value = self._take_value(key, None, 'a list of rows of numbers')
        units = list(map(unit_of, columns))
        names = [
            column.replace(f'[{unit}]', f'[{self.units.file_unit(unit)}]')
            for column, unit in zip(columns, units, strict=True)
        ]
        row = f'[{", ".join(names)}]'
        table: list[tuple[float, ...]] = []
        if not isinstance(value, list) or not value:
            raise self.error(key, f'{quote(value)} is not a list of rows', f'write [{row}, …]')
        for number, numbers_of_row in enumerate(value, 1):
            if not _is_list_of_finite(numbers_of_row) or len(numbers_of_row) != len(units):
                raise self.error(
                    key,
                    f'row {number}, {quote(numbers_of_row)}, is not {row}',
                    'write finite numbers',
                )
            table.append(tuple(map(self._to_si, repeat(key), numbers_of_row, units)))
            for value, unit in zip(table[-1], units, strict=True):
                self._check_most(key, numbers_of_row, (value,), most, unit)
        return tuple(table)

    def texts(self, key: str) -> list[str]:
        """Return a list of names; empty if the key is absent."""
        value = self._take_value(key, [], 'a list of names')
        if not isinstance(value, list) or any(not isinstance(v, str) or not v for v in value):
            raise self.error(key, f'{quote(value)} is not a list of names', 'write [one, other]')
        return list(value)

    def remove_key(self, key: str) -> None:
        """Remove a key that another section uses."""
        self._taken.add(key)

    def finish(self, known: Sequence[str] = ()) -> None:
        """
        Refuse the remaining keys; the remedy suggests the read keys and ``known``.

        A file without any known key may be any file, and the error names none of its keys.
        """
        names = sorted(self._taken | set(known))
        known_names = f'known: {list_names(names)}' if names else 'leave it out'
        unknown = [key for key in self._content if key not in self._taken]
        if unknown and not self._path and not any(key in names for key in self._content):
            remedy = did_you_mean(unknown[0], names, known_names)
            raise self.error('', 'has no known key', remedy)
        raise_each(
            self.error(key, 'unknown key', did_you_mean(key, names, known_names))
            for key in unknown
        )

    def _line_of(self, key: str) -> int:
        """Return the line of a key, or of the longest existing part of a dotted key."""
        line, content = self._line, self._content
        while isinstance(content, LinedDict):
            # The name of a user-defined effect contains dots.
            part = key if key in content else key.partition('.')[0]
            if part not in content:
                break
            line, content = content.lines[part], content[part]
            key = key.removeprefix(part).removeprefix('.')
        return line

    def _to_si(self, key: str, value: float, unit: str) -> float:
        """Return a number of the file in SI."""
        if value and self.units.is_ambiguous(unit):
            raise self.error(
                key,
                f'{quote(value)} is for joints that turn and joints that slide, '
                f'in {self.units.file_unit(unit)}',
                'leave units and angles out of this file',
            )
        return float(self.units.to_si(value, unit))

    def _check_most(
        self, key: str, value: Any, numbers: Iterable[float], most: float, unit: str
    ) -> None:
        if any(abs(number) > most for number in numbers):
            name = self.units.file_unit(unit)
            raise self.error(
                key,
                f'{quote(value)} is out of bounds',
                f'write numbers of at most {self.units.to_file_unit(most, unit):g}'
                f'{name and f" [{name}]"}',
            )

    def _take_value(self, key: str, default: Any, expected: str) -> Any:
        self._taken.add(key)
        if key not in self._content:
            if default is None:
                raise self.error('', f'the key {key!r} is missing', f'add {key}: {expected}')
            return default
        return self._content[key]


def _has_decimal_comma(numbers: Sequence[float]) -> bool:
    """Return whether two numbers with commas, such as 0,040 and 0, may have been typed."""
    if not all(float(part).is_integer() for part in numbers):
        return False
    return len(numbers) > 3 or any(number == 0 < after for number, after in pairwise(numbers))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_list_of_finite(value: Any) -> bool:
    return isinstance(value, list) and all(_is_number(v) and isfinite(v) for v in value)


def _is_pair(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(map(_is_number, value))


def _as_mapping(value: Any, example: Callable[[str], str] | None) -> str:
    """Return how a mapping is written, with the names that stand there without one."""
    example = example or (lambda name: '{}' if name else '{…}')
    names = value if isinstance(value, list) else [value]
    named = names and all(isinstance(name, str) and fullmatch(r'\w+', name) for name in names)
    examples = {name: example(name) for name in names} if named else {}
    if not all(examples.values()) or not examples:
        return example('')
    return f'{{{list_names(f"{name}: {of}" for name, of in examples.items())}}}'


def _unit_text(unit: str) -> str:
    return unit and f' in [{unit}]'
