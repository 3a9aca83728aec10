# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Read YAML files strictly.

Errors that PyYAML accepts are refused here with file, line and key: a duplicate key, an unknown
key, a value of the wrong type, an invalid number.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from pathlib import Path
import re
from typing import Any, cast, ClassVar

from linkage_ros.description.file_access import read_regular
from linkage_ros.description.file_kinds import kind_of_bytes, kind_of_folder
from linkage_ros.description.section import LinedDict, Section
from linkage_ros.errors import FileError
import yaml

MOST_VALUES = 200_000
"""Most values in a text, including keys, lists and mappings; parsing takes some ten seconds."""

DEEPEST = 100
"""Greatest number of nested levels."""

_LONGEST_INTEGER = 100

_INDENT = 'give the keys of one mapping the same number of spaces'
_IN_PLAIN_WORDS = (
    ("'\\t'", 'has a tab', 'write spaces instead of tabs'),
    ('expected <block end>', 'is not indented like the lines above it', _INDENT),
    ('mapping values are not allowed', 'has a misplaced colon', _INDENT),
    (
        "could not find expected ':'",
        'has a key without a colon',
        'write key: value',
    ),
    ("expected ',' or '}'", 'has a { that does not end, or no comma', 'close it: {x: 1, y: 2}'),
    ("expected ',' or ']'", 'has a [ that does not end, or no comma', 'close it: [1, 2]'),
)
"""A part of PyYAML's message; reason and remedy."""

_QUOTATION = re.compile(r"'(?!<)[^']{2,}'")
"""
What a message of PyYAML repeats from a file, unlike the name of a token: ``'<scalar>'``.

A file that is not YAML may be any file, and the node's log is open to the graph.
"""

LARGEST_FILE = 1_000_000
"""Most bytes of a file."""


class BoundedLoader(yaml.SafeLoader):
    """
    PyYAML's safe loader with YAML 1.2 scalars, without aliases, and with at most some values.

    Ten lines of aliases can expand to gigabytes, and PyYAML takes 50 µs per value. So aliases are
    refused, and the numbers of values and levels are limited. By YAML 1.2 ``1e-3`` is a number and
    ``off`` a string.
    """

    yaml_implicit_resolvers: dict[str, Any] = {}  # noqa: RUF012 (as in the base class)
    yaml_constructors: ClassVar[dict[Any, Any]] = {None: yaml.SafeLoader.construct_undefined}

    def __init__(self, text: str, most: int = MOST_VALUES) -> None:
        super().__init__(text)
        self._most = self._left = most
        self._depth = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """Compose a value; refuse aliases, and too many values or levels."""
        self._left -= 1
        wrong = ''
        if self.check_event(yaml.AliasEvent):
            wrong = 'aliases are not read'
        elif self._left < 0:
            wrong = f'it holds more than {self._most:,} values'
        if wrong:
            mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]
            raise yaml.composer.ComposerError(None, None, wrong, mark)
        if self._depth == DEEPEST:
            raise RecursionError
        self._depth += 1
        node = super().compose_node(parent, index)
        self._depth -= 1
        return node


def bounded_yaml(text: str, most: int = MOST_VALUES) -> Any:
    """
    Parse a YAML text with a bounded number of values.

    The text of a ValueError, one line, says whether it is not YAML, or which limit it exceeds.
    """
    try:
        loader = BoundedLoader(text, most)
        try:
            return loader.get_single_data()
        finally:
            loader.dispose()
    except yaml.MarkedYAMLError as error:
        raise ValueError(error.problem or error.context) from None
    except yaml.YAMLError as error:
        raise ValueError(str(error).splitlines()[0]) from None
    except RecursionError:
        raise ValueError('it is nested too deeply') from None


def _parse_integer(text: str) -> float:
    # Python limits the length of integers that it converts, from and to text and to float.
    return int(text) if len(text) <= _LONGEST_INTEGER else float(text)


_CONSTRUCTORS: dict[str, Callable[[Any, Any], Any]] = {
    'map': yaml.SafeLoader.construct_yaml_map,
    'seq': yaml.SafeLoader.construct_yaml_seq,
    'str': yaml.SafeLoader.construct_yaml_str,
    'null': yaml.SafeLoader.construct_yaml_null,
    'bool': lambda self, node: self.construct_scalar(node).lower() == 'true',
    'int': lambda self, node: _parse_integer(self.construct_scalar(node)),
    'float': lambda self, node: float(
        self.construct_scalar(node).replace('.inf', 'inf').replace('.nan', 'nan')
    ),
}
for _tag, _construct in _CONSTRUCTORS.items():
    BoundedLoader.add_constructor(f'tag:yaml.org,2002:{_tag}', _construct)
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
    BoundedLoader.add_implicit_resolver(
        f'tag:yaml.org,2002:{_tag}', re.compile(f'(?:{_pattern})$'), [*_first, '']
    )


def read_yaml(file: str | Path) -> tuple[Section, bytes]:
    """
    Read a YAML file that holds a mapping.

    Returns
    -------
    content : Section
        The mapping.
    data : bytes
        The content of the file.

    Raises
    ------
    FileError
        It cannot be read, is not UTF-8, not YAML, not a mapping, or has a duplicate key.

    """
    try:
        data = read_regular(file, LARGEST_FILE)
    except IsADirectoryError:
        kind = kind_of_folder(Path(file))
        raise FileError(file, '', f'is {kind.noun}, not a YAML file', kind.remedy) from None
    except OSError as error:
        raise FileError(
            file, '', f'cannot be read ({error.strerror})', 'name a file that can be read'
        ) from None
    except ValueError as error:  # the name contains a NUL
        raise FileError(repr(str(file)), '', str(error), 'name a file') from None
    return parse_yaml(data, str(file)), data


def parse_yaml(data: bytes, file: str) -> Section:
    """
    Parse YAML that holds a mapping.

    Parameters
    ----------
    data
        The text, UTF-8.
    file
        Its name, for error messages.

    Raises
    ------
    FileError
        As in `read_yaml`.

    """
    kind = kind_of_bytes(data)
    if kind.is_foreign:
        raise FileError(file, '', f'is {kind.noun}, not a YAML file', kind.remedy)
    if len(data) > LARGEST_FILE:
        raise FileError(file, '', f'is larger than {LARGEST_FILE} bytes', 'name a YAML file')
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
        problem = str(error.problem or error.context)
        unquoted = _QUOTATION.sub('…', problem)
        reason, remedy = next(
            (words for part, *words in _IN_PLAIN_WORDS if part in problem),
            (f'is not valid YAML ({unquoted})', 'correct the line'),
        )
        raise FileError(file, '', reason, remedy, line) from None
    except (yaml.YAMLError, ValueError) as error:
        text = str(error).splitlines()[0]
        raise FileError(file, '', f'is not valid YAML ({text})', 'correct the file') from None
    except RecursionError:
        raise FileError(file, '', 'is nested too deeply', 'use fewer levels') from None
    finally:
        if loader is not None:
            loader.dispose()
    if not isinstance(content, dict):
        raise FileError(file, '', 'is not a mapping', 'write key: value')
    return Section(file, '', content)


class _StrictLoader(BoundedLoader):
    """Loader of all YAML files, with a line for each key, and without duplicate keys."""

    file: str

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        """Build a mapping whose keys are strings without duplicates."""
        if not isinstance(node, yaml.MappingNode):  # another node that is tagged !!map
            raise yaml.constructor.ConstructorError(
                None, None, 'expected a mapping', node.start_mark
            )
        mapping = LinedDict()
        for key_node, value_node in node.value:
            key = self.construct_object(key_node, deep=True)
            line = key_node.start_mark.line + 1
            if not isinstance(key, str) or not key.isprintable():
                raise FileError(
                    self.file, '', 'has a key that is not a name', 'write a name', line
                )
            if key in mapping:
                first = mapping.lines[key]
                raise FileError(
                    self.file, '', f'has the key of line {first} again', 'remove one', line
                )
            mapping[key] = self.construct_object(value_node, deep=True)
            mapping.lines[key] = line
        return cast(dict[Hashable, Any], mapping)

    def construct_yaml_map(self, node: yaml.MappingNode) -> Any:
        """Build a mapping in one step: without aliases it cannot refer to itself."""
        yield self.construct_mapping(node)


_StrictLoader.add_constructor('tag:yaml.org,2002:map', _StrictLoader.construct_yaml_map)
