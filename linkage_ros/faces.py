# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The face of a folder: the names that the other folders use, each imported when it is first used.

The list is the folder's stub, `__init__.pyi`, which type checkers read as well.
"""

from __future__ import annotations

import ast
from collections.abc import Callable
from importlib import import_module
from pkgutil import get_data
import sys
from typing import Any


def home_modules(stub: str) -> dict[str, str]:
    """Return the module of each name that a stub exports."""
    return {
        alias.name: statement.module
        for statement in ast.parse(stub).body
        if isinstance(statement, ast.ImportFrom) and statement.module
        for alias in statement.names
    }


def lazy_names(package: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Return `__getattr__`, `__dir__` and `__all__` of a package, as its stub lists its names."""
    stub = get_data(package, '__init__.pyi')
    assert stub is not None
    homes = home_modules(stub.decode())
    module = sys.modules[package]

    def import_name(name: str) -> Any:
        if name not in homes:
            message = f'module {package!r} has no attribute {name!r}'
            raise AttributeError(message, name=name, obj=module)
        value = getattr(import_module(homes[name]), name)
        setattr(module, name, value)
        return value

    def list_names() -> list[str]:
        return sorted({*vars(module), *homes})

    return import_name, list_names, [*homes]
