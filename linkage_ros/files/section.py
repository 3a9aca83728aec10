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


"""Section of a YAML file: a mapping whose keys are taken one by one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import inf, isfinite, isnan
from re import fullmatch
from typing import Any, cast

from linkage_ros.errors import did_you_mean, FileError, listed, quoted


class LinedDict(dict[str, Any]):
    """A mapping with the line of each of its keys."""

    __slots__ = ('lines',)

    def __init__(self) -> None:
        super().__init__()
        self.lines: dict[str, int] = {}


class Section:
    """
    A mapping of a YAML file, whose keys are taken one by one.

    Every getter removes its key from the section; `finish` refuses the remaining keys.

    Parameters
    ----------
    file
        Name of the file, for error messages.
    path
        Dotted key of the mapping in the file.
    content
        The mapping.
    line
        Line of the mapping.

    """

    def __init__(self, file: str, path: str, content: Mapping[str, Any], line: int = 0) -> None:
        self.file = file
        self._path = path
        self._content = content
        self._line = line
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
        value = self._take(key, default, f'a number{unit and f" in [{unit}]"}')
        if not _is_number(value):
            raise self.error(key, f'{quoted(value)} is not a number', 'write a number')
        if not isfinite(value) or not least <= value <= most or value <= above:
            bounds = ' and '.join(
                text
                for text in (
                    f'more than {above:g}' if above > -inf else '',
                    f'at least {least:g}' if least > -inf else '',
                    f'at most {most:g}' if most < inf else '',
                )
                if text
            )
            raise self.error(
                key,
                f'{quoted(value)} is out of bounds',
                f'write a finite number{bounds and f", {bounds}"}{unit and f" [{unit}]"}',
            )
        return float(value)

    def whole(
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
        value = self._take(key, default, 'true or false')
        if not isinstance(value, bool):
            raise self.error(key, f'{quoted(value)} is not a flag', 'write true or false')
        return value

    def text(self, key: str, default: str | None = None) -> str:
        """Return a string that is not empty, or the default."""
        value = self._take(key, default, 'a text')
        if value == default and default is not None:
            return default
        if not isinstance(value, str) or not value.isprintable() or not value:
            raise self.error(key, f'{quoted(value)} is not a text', 'write a name; quote numbers')
        return value

    def ros_name(self, name: str) -> str:
        """Return a key of this section, or a value in it, that will be part of a topic name."""
        if not fullmatch('[A-Za-z][A-Za-z0-9_]*', name):
            raise self.error(
                name if name in self._content else '',
                f'{quoted(name)} is no ROS name',
                'use letters, digits and _, a letter first',
            )
        return name

    def choice(self, key: str, choices: Sequence[str], default: str | None = None) -> str:
        """Return one of a set of words."""
        value = self._take(key, default, listed(choices, ' or '))
        if value not in choices:
            raise self.error(key, f'{quoted(value)} is none', f'write {listed(choices, " or ")}')
        return cast(str, value)

    def point(self, key: str, *, most: float = inf) -> tuple[float, float]:
        """Return two finite numbers, each within ±most."""
        value = self._take(key, None, 'two numbers [x, y]')
        if (
            not isinstance(value, list)
            or len(value) != 2
            or any(not _is_number(v) for v in value)
            or not all(map(isfinite, value))
        ):
            raise self.error(
                key, f'{quoted(value)} is not a point', 'write two finite numbers: [x, y]'
            )
        if max(map(abs, value)) > most:
            raise self.error(
                key, f'{quoted(value)} is out of bounds', f'write numbers of at most {most:g}'
            )
        return float(value[0]), float(value[1])

    def interval(self, key: str, *, most: float = inf) -> tuple[float, float]:
        """
        Return two numbers [low, high]; infinite for no limit, and if the key is absent.

        The caller checks their order.
        """
        value = self._take(key, [-inf, inf], 'two numbers [low, high]')
        if (
            not isinstance(value, list)
            or len(value) != 2
            or any(not _is_number(v) for v in value)
            or any(map(isnan, value))
        ):
            raise self.error(
                key,
                f'{quoted(value)} is not two numbers',
                'write [low, high]; -.inf or .inf for none on a side',
            )
        if any(most < abs(v) < inf for v in value):
            raise self.error(
                key, f'{quoted(value)} is out of bounds', f'write numbers of at most {most:g}'
            )
        return float(value[0]), float(value[1])

    def section(self, key: str, *, required: bool = True) -> Section:
        """Return a nested mapping; an empty one if it is absent and not required."""
        value = self._take(key, None if required else {}, 'a mapping')
        line = self._line_of(key)
        if not isinstance(value, dict):
            raise self.error(key, f'{quoted(value)} is not a mapping', f'write {key}: {{…}}')
        path = '.'.join(filter(None, (self._path, key)))
        return Section(self.file, path, value, line)

    def sections(self, key: str) -> list[Section]:
        """Return one mapping, or a list of them."""
        value = self._take(key, None, 'a mapping')
        if not isinstance(value, list):
            return [self.section(key)]
        found = []
        for i, item in enumerate(value, 1):
            path = '.'.join(filter(None, (self._path, f'{key}[{i}]')))
            if not isinstance(item, dict):
                raise self.error(key, f'{quoted(item)} is not a mapping', 'write {…}')
            found.append(Section(self.file, path, item, self._line_of(key)))
        if not found:
            raise self.error(key, 'the list is empty', 'name one at least')
        return found

    def numbers(self, key: str, *, most: float = inf) -> list[float]:
        """Return a list of finite numbers, each within ±most."""
        value = self._take(key, None, 'a list of numbers')
        if not isinstance(value, list) or any(
            not _is_number(v) or not abs(v) <= most for v in value
        ):
            raise self.error(
                key, f'{quoted(value)} is no list of finite numbers', 'write [0.1, 0.2]'
            )
        return [float(v) for v in value]

    def rows(
        self, key: str, columns: Sequence[str], *, most: float = inf
    ) -> tuple[tuple[float, ...], ...]:
        """Return a list of rows of finite numbers, each within ±most."""
        value = self._take(key, None, 'a list of rows of numbers')
        row = f'[{", ".join(columns)}]'
        if not isinstance(value, list) or not value:
            raise self.error(key, f'{quoted(value)} is no list of rows', f'write [{row}, …]')
        for number, found in enumerate(value, 1):
            if (
                not isinstance(found, list)
                or len(found) != len(columns)
                or any(not _is_number(v) or not abs(v) <= most for v in found)
            ):
                raise self.error(
                    key, f'row {number}, {quoted(found)}, is not {row}', 'write finite numbers'
                )
        return tuple(tuple(map(float, found)) for found in value)

    def texts(self, key: str) -> list[str]:
        """Return a list of names; empty if the key is absent."""
        value = self._take(key, [], 'a list of names')
        if not isinstance(value, list) or any(not isinstance(v, str) or not v for v in value):
            raise self.error(key, f'{quoted(value)} is no list of names', 'write [one, other]')
        return list(value)

    def taken(self, key: str) -> None:
        """Remove a key that another section uses."""
        self._taken.add(key)

    def finish(self, known: Sequence[str] = ()) -> None:
        """
        Refuse the remaining keys.

        Parameters
        ----------
        known
            Further keys that could have been here, for the suggestion.

        """
        for key in self._content:
            if key not in self._taken:
                names = sorted(self._taken | set(known))
                known_names = f'known: {listed(names)}' if names else 'leave it out'
                remedy = did_you_mean(key, names, known_names)
                raise self.error(key, 'unknown key', remedy)

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

    def _take(self, key: str, default: Any, expected: str) -> Any:
        self._taken.add(key)
        if key not in self._content:
            if default is None:
                raise self.error('', f'the key {key!r} is missing', f'add {key}: {expected}')
            return default
        return self._content[key]


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
