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
YAML files, read strictly.

What PyYAML would let pass is refused here with file, line and key: a key that stands twice, a key
that nobody reads, a value of the wrong type, a number that is none. Scalars follow YAML 1.2, so
that ``1e-3`` is a number and ``off`` a name.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from difflib import get_close_matches
from math import inf, isfinite
from pathlib import Path
import re
from typing import Any, cast, ClassVar

from linkage_ros.errors import FileError, quoted
import yaml

_LARGEST_FILE = 1_000_000
_LONGEST_INTEGER = 100


class Section:
    """
    A mapping of a YAML file, whose keys are taken one by one.

    Every getter takes its key off the section; `finish` refuses what is left.

    Parameters
    ----------
    file
        The file, for messages.
    path
        Dotted key of the mapping within the file.
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
        if isinstance(value, bool) or not isinstance(value, int | float):
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

    def flag(self, key: str, default: bool | None = None) -> bool:
        """Return true or false."""
        value = self._take(key, default, 'true or false')
        if not isinstance(value, bool):
            raise self.error(key, f'{quoted(value)} is not a flag', 'write true or false')
        return value

    def text(self, key: str, default: str | None = None) -> str:
        """Return a text that is not empty, or the default."""
        value = self._take(key, default, 'a text')
        if value == default and default is not None:
            return default
        if not isinstance(value, str) or not value.isprintable() or not value:
            raise self.error(key, f'{quoted(value)} is not a text', 'write a name; quote numbers')
        return value

    def choice(self, key: str, choices: Sequence[str], default: str | None = None) -> str:
        """Return one of several words."""
        value = self._take(key, default, ' or '.join(choices))
        if value not in choices:
            raise self.error(key, f'{quoted(value)} is none', f'write {" or ".join(choices)}')
        return cast(str, value)

    def point(self, key: str, *, most: float = inf) -> tuple[float, float]:
        """Return two finite numbers, of which none is beyond ±most."""
        value = self._take(key, None, 'two numbers [x, y]')
        if (
            not isinstance(value, list)
            or len(value) != 2
            or any(isinstance(v, bool) or not isinstance(v, int | float) for v in value)
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

    def section(self, key: str, *, required: bool = True) -> Section:
        """Return a mapping within this one; an empty one where it is absent and not required."""
        value = self._take(key, None if required else {}, 'a mapping')
        line = self._line_of(key)
        if not isinstance(value, dict):
            raise self.error(key, f'{quoted(value)} is not a mapping', f'write {key}: {{…}}')
        path = '.'.join(filter(None, (self._path, key)))
        return Section(self.file, path, value, line)

    def finish(self, known: Sequence[str] = ()) -> None:
        """
        Refuse the keys that nobody has taken.

        Parameters
        ----------
        known
            Further keys that could have stood here, for the suggestion.

        """
        for key in self._content:
            if key not in self._taken:
                names = sorted(self._taken | set(known))
                near = get_close_matches(key, names, n=1)
                known_names = f'known: {", ".join(names)}' if names else 'leave it out'
                remedy = f'did you mean {near[0]!r}?' if near else known_names
                raise self.error(key, 'unknown key', remedy)

    def _line_of(self, key: str) -> int:
        """Return the line of a key, or of as much of a dotted one as there is."""
        line, content = self._line, self._content
        for part in (key,) if key in content else key.split('.'):
            if not isinstance(content, _LinedDict) or part not in content:
                break
            line, content = content.lines[part], content[part]
        return line

    def _take(self, key: str, default: Any, expected: str) -> Any:
        self._taken.add(key)
        if key not in self._content:
            if default is None:
                raise self.error('', f'the key {key!r} is missing', f'add {key}: {expected}')
            return default
        return self._content[key]


def read_yaml(file: str | Path) -> tuple[Section, bytes]:
    """
    Read a YAML file that holds a mapping.

    Returns
    -------
    content : Section
        The mapping.
    data : bytes
        The file as it stands.

    Raises
    ------
    FileError
        Where it cannot be read, is not UTF-8, not YAML, not a mapping, or a key stands twice.

    """
    try:
        with Path(file).open('rb') as stream:
            data = stream.read(_LARGEST_FILE + 1)
    except OSError as error:
        raise FileError(
            file, '', f'cannot be read ({error.strerror})', 'name a file that can be read'
        ) from None
    except ValueError as error:  # a NUL in the name
        raise FileError(repr(str(file)), '', str(error), 'name a file') from None
    if len(data) > _LARGEST_FILE:
        raise FileError(file, '', f'is larger than {_LARGEST_FILE} bytes', 'name a YAML file')
    return parse_yaml(data, str(file)), data


def parse_yaml(data: bytes, file: str) -> Section:
    """
    Parse YAML that holds a mapping.

    Parameters
    ----------
    data
        The text, UTF-8.
    file
        Its name, for messages.

    Raises
    ------
    FileError
        As `read_yaml`.

    """
    try:
        text = data.decode('utf-8')
    except UnicodeDecodeError as error:
        raise FileError(
            file, '', f'is not UTF-8 (byte {error.start})', 'save it as UTF-8 text'
        ) from None
    loader = None
    try:
        loader = _StrictLoader(text)
        loader.file = file
        content = loader.get_single_data()
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = mark.line + 1 if mark else 0
        reason = f'is not valid YAML ({error.problem or error.context})'
        raise FileError(file, '', reason, 'correct the line', line) from None
    except (yaml.YAMLError, ValueError) as error:
        text = str(error).splitlines()[0]
        raise FileError(file, '', f'is not valid YAML ({text})', 'correct the file') from None
    except RecursionError:
        raise FileError(file, '', 'is nested too deeply', 'write it flatter') from None
    finally:
        if loader is not None:
            loader.dispose()
    if not isinstance(content, dict):
        raise FileError(file, '', f'holds {quoted(content)}', 'write a mapping (key: value)')
    return Section(file, '', content)


class _LinedDict(dict[str, Any]):
    """A mapping that knows the line of each of its keys."""

    __slots__ = ('lines',)

    def __init__(self) -> None:
        super().__init__()
        self.lines: dict[str, int] = {}


class _StrictLoader(yaml.SafeLoader):
    """PyYAML's safe loader with the scalars of YAML 1.2 and without repeated keys."""

    yaml_implicit_resolvers: dict[str, Any] = {}  # noqa: RUF012 (as in the base class)
    yaml_constructors: ClassVar[dict[Any, Any]] = {None: yaml.SafeLoader.construct_undefined}
    file: str

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """Refuse aliases: ten lines of them stand for gigabytes."""
        if self.check_event(yaml.AliasEvent):
            mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]
            raise yaml.composer.ComposerError(None, None, 'aliases are not read', mark)
        return super().compose_node(parent, index)

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        """Build a mapping whose keys are texts, each once."""
        if not isinstance(node, yaml.MappingNode):  # one that is tagged !!map
            raise yaml.constructor.ConstructorError(
                None, None, 'expected a mapping', node.start_mark
            )
        mapping = _LinedDict()
        for key_node, value_node in node.value:
            key = self.construct_object(key_node, deep=True)
            line = key_node.start_mark.line + 1
            if not isinstance(key, str) or not key.isprintable():
                raise FileError(
                    self.file, '', f'the key {quoted(key)} is not a name', 'write a name', line
                )
            if key in mapping:
                first = mapping.lines[key]
                raise FileError(
                    self.file, key, f'stands twice (first in line {first})', 'remove one', line
                )
            mapping[key] = self.construct_object(value_node, deep=True)
            mapping.lines[key] = line
        return cast(dict[Hashable, Any], mapping)

    def construct_yaml_map(self, node: yaml.MappingNode) -> Any:
        """Build a mapping at once: nothing here refers to itself."""
        yield self.construct_mapping(node)


def _integer(text: str) -> float:
    # Python refuses to convert integers without end, to and from text as well as to a float.
    return int(text) if len(text) <= _LONGEST_INTEGER else float(text)


_CONSTRUCTORS: dict[str, Callable[[Any, Any], Any]] = {
    'map': _StrictLoader.construct_yaml_map,
    'seq': _StrictLoader.construct_yaml_seq,
    'str': _StrictLoader.construct_yaml_str,
    'null': _StrictLoader.construct_yaml_null,
    'bool': lambda self, node: self.construct_scalar(node).lower() == 'true',
    'int': lambda self, node: _integer(self.construct_scalar(node)),
    'float': lambda self, node: float(
        self.construct_scalar(node).replace('.inf', 'inf').replace('.nan', 'nan')
    ),
}
for _tag, _construct in _CONSTRUCTORS.items():
    _StrictLoader.add_constructor(f'tag:yaml.org,2002:{_tag}', _construct)
for _tag, _pattern, _first in (
    ('bool', r'true|True|TRUE|false|False|FALSE', 'tTfF'),
    ('int', r'[-+]?[0-9]+', '-+0123456789'),
    (
        'float',
        r'[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?|[-+]?\.inf|\.nan',
        '-+.0123456789',
    ),
    ('null', r'~|null|Null|NULL|', '~nN'),
):
    _StrictLoader.add_implicit_resolver(
        f'tag:yaml.org,2002:{_tag}', re.compile(f'(?:{_pattern})$'), [*_first, '']
    )
