# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Functions that are generated as source text and compiled when they are first bound."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any, NamedTuple

_MOST = 128
"""Number of texts that are kept compiled."""


class Lines(NamedTuple):
    """A part of a function: lines of Python, and the objects that they refer to by name."""

    lines: list[str]
    bound: dict[str, Any]


def define_function(source: str, name: str, bound: Mapping[str, Any]) -> Any:
    """
    Return the function of that name that a source text defines.

    Names in ``bound`` become local variables of an enclosing function, which are faster than
    globals. A text is compiled once, even if it is bound again when a running node is reset.
    """
    return _compile_binding(source, name, tuple(bound))(**bound)


@lru_cache(maxsize=_MOST)
def _compile_binding(source: str, name: str, names: tuple[str, ...]) -> Callable[..., Any]:
    body = ''.join(f'    {line}\n' for line in source.splitlines())
    namespace: dict[str, Any] = {}
    exec(f'def bind({", ".join(names)}):\n{body}    return {name}\n', namespace)
    bind: Callable[..., Any] = namespace['bind']
    return bind
