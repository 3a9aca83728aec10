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
YAML from anywhere, within limits.

Ten lines of aliases stand for gigabytes, and PyYAML takes a twentieth of a millisecond for each
value. So aliases are not read, and of values and of levels there is a most. Scalars follow YAML
1.2, so that ``1e-3`` is a number and ``off`` a name.
"""

from __future__ import annotations

from collections.abc import Callable
import re
from typing import Any, ClassVar

import yaml

MOST_VALUES = 200_000
"""How many values a text may hold, keys, lists and mappings among them: some ten seconds."""

DEEPEST = 100
"""How many levels it may have."""

_LONGEST_INTEGER = 100


class BoundedLoader(yaml.SafeLoader):
    """
    PyYAML's safe loader with the scalars of YAML 1.2, without aliases, and with limits.

    Parameters
    ----------
    text
        What is read.
    most
        How many values it may hold.

    """

    yaml_implicit_resolvers: dict[str, Any] = {}  # noqa: RUF012 (as in the base class)
    yaml_constructors: ClassVar[dict[Any, Any]] = {None: yaml.SafeLoader.construct_undefined}

    def __init__(self, text: str, most: int = MOST_VALUES) -> None:
        super().__init__(text)
        self._most = self._left = most
        self._depth = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """Compose a value; refuse aliases, and what is too much or too deep."""
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
    Return what a YAML text says.

    Parameters
    ----------
    text
        The text.
    most
        How many values it may hold.

    Raises
    ------
    ValueError
        It is not YAML, or beyond a limit; the text of the error says which, on one line.

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


def _integer(text: str) -> float:
    # Python refuses to convert integers without end, to and from text as well as to a float.
    return int(text) if len(text) <= _LONGEST_INTEGER else float(text)


_CONSTRUCTORS: dict[str, Callable[[Any, Any], Any]] = {
    'map': yaml.SafeLoader.construct_yaml_map,
    'seq': yaml.SafeLoader.construct_yaml_seq,
    'str': yaml.SafeLoader.construct_yaml_str,
    'null': yaml.SafeLoader.construct_yaml_null,
    'bool': lambda self, node: self.construct_scalar(node).lower() == 'true',
    'int': lambda self, node: _integer(self.construct_scalar(node)),
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
