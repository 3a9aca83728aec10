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
that nobody reads, a value of the wrong type, a number that is none.
"""

from __future__ import annotations

from collections.abc import Hashable
from pathlib import Path
from typing import Any, cast

from linkage_ros.bounded_yaml import BoundedLoader
from linkage_ros.errors import FileError, quoted
from linkage_ros.files.regular_file import read_regular
from linkage_ros.files.section import LinedDict, Section
import yaml

_LARGEST_FILE = 1_000_000


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
        data = read_regular(file, _LARGEST_FILE)
    except OSError as error:
        raise FileError(
            file, '', f'cannot be read ({error.strerror})', 'name a file that can be read'
        ) from None
    except ValueError as error:  # a NUL in the name
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
        Its name, for messages.

    Raises
    ------
    FileError
        As `read_yaml`.

    """
    if len(data) > _LARGEST_FILE:
        raise FileError(file, '', f'is larger than {_LARGEST_FILE} bytes', 'name a YAML file')
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


class _StrictLoader(BoundedLoader):
    """The loader of all YAML, with a line for each key, and without repeated keys."""

    file: str

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        """Build a mapping whose keys are texts, each once."""
        if not isinstance(node, yaml.MappingNode):  # one that is tagged !!map
            raise yaml.constructor.ConstructorError(
                None, None, 'expected a mapping', node.start_mark
            )
        mapping = LinedDict()
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


_StrictLoader.add_constructor('tag:yaml.org,2002:map', _StrictLoader.construct_yaml_map)
