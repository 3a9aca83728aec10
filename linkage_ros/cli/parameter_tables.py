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


"""Drives, effects, faults and solvers as tables: parameters, units, defaults and bounds."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module

from linkage_ros.cli.terminal import Table
from linkage_ros.drives.drive import DRIVES
from linkage_ros.effects.stage import EFFECTS, module_of
from linkage_ros.faults.fault import FAULTS
from linkage_ros.files.parameters import parameter_rows, summary
from linkage_ros.solvers.registry import SOLVERS

REGISTRIES: Mapping[str, Mapping[str, str]] = {
    'drive': DRIVES,
    'effect': EFFECTS,
    'fault': FAULTS,
    'solver': SOLVERS,
}
"""All that a scene can name, by what it is."""

_HEADS = ('parameter', 'unit', 'default', 'values', 'meaning')


def table_of(what: str, name: str) -> Table:
    """Return the table of what a scene can name: ``what`` is a key of `REGISTRIES`."""
    module = module_of(name) if what == 'effect' else import_module(REGISTRIES[what][name])
    parameters = module.PARAMETERS
    title = f'{what} {name}: {summary(parameters)}'
    rows = list(parameter_rows(parameters))
    return Table(title, _HEADS, rows) if rows else Table(title, ('',), [('no parameters',)])
