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


"""The reference of drives, effects, faults and solvers, from what each declares."""

from __future__ import annotations

from collections.abc import Iterator

from linkage_ros.cli.parameter_tables import REGISTRIES, table_of

from docs.website.markdown import code, plain, table


def parameters(what: str) -> str:
    """Return all drives, effects, faults or solvers with their parameters."""
    return '\n'.join(part for name in REGISTRIES[what] for part in _one(what, name))


def _one(what: str, name: str) -> Iterator[str]:
    found = table_of(what, name)
    yield f'### {plain(name)}\n'
    yield f'{plain(found.title.removeprefix(f"{what} {name}: "))}\n'
    if len(found.columns) == 1:
        yield 'No parameters.\n'
        return
    rows = [(code(row[0]), *map(plain, row[1:])) for row in found.rows]
    yield table(found.columns, rows)
