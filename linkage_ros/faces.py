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

from collections.abc import Callable
from importlib import import_module
import sys


def home_modules(stub: str) -> dict[str, str]:
    """Return the module of each name that a stub exports."""
    import ast  # local import: a program starts sooner without it

    return {
        alias.name: statement.module
        for statement in ast.parse(stub).body
        if isinstance(statement, ast.ImportFrom) and statement.module
        for alias in statement.names
    }


def lazy_names(package: str) -> tuple[Callable[[str], object], Callable[[], list[str]]]:
    """Return `__getattr__`, with `__all__`, and `__dir__` of a package: the names of its stub."""
    module = sys.modules[package]
    homes: dict[str, str] = {}

    def find_homes() -> dict[str, str]:
        if not homes:
            from pkgutil import get_data  # local import: as above

            stub = get_data(package, '__init__.pyi')
            assert stub is not None
            homes.update(home_modules(stub.decode()))
        return homes

    def import_name(name: str) -> object:
        if name == '__all__':
            return [*find_homes()]
        # Python asks a package for names of its own, as __path__, which no stub has.
        home = None if name.startswith('__') else find_homes().get(name)
        if home is None:
            message = f'module {package!r} has no attribute {name!r}'
            raise AttributeError(message, name=name, obj=module)
        value: object = getattr(import_module(home), name)
        setattr(module, name, value)
        return value

    def list_names() -> list[str]:
        return sorted({*vars(module), *find_homes()})

    return import_name, list_names
