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


"""What a scene says of how its loops are closed: by which solver, or how accurately."""

from __future__ import annotations

from dataclasses import MISSING
from importlib import import_module
from typing import Any

from linkage_ros.errors import did_you_mean, listed, quoted
from linkage_ros.parameters import declared
from linkage_ros.scene.read import Parts, read_parameters
from linkage_ros.scene.section import Section
from linkage_ros.solvers.registry import SOLVERS

FINEST_ACCURACY, COARSEST_ACCURACY = 1e-12, 1e-2
"""What `accuracy` may be, in [rad] or [m]."""


def read_solving(own: Section, scene: Section, parts: Parts) -> dict[str, Any]:
    """
    Return what closes the loops, or how well that is to be done, as a `Member` holds it.

    Raises
    ------
    FileError
        Where neither can be understood, or where both are named.

    """
    # What a linkage says for itself stands for both of the scene's.
    where = own if 'solver' in own or 'accuracy' in own else scene
    if 'accuracy' not in where:
        return {'solver': read_solver(where, parts) if 'solver' in where else None}
    if 'solver' in where:
        raise where.error('accuracy', 'stands beside solver', 'write one of the two')
    bounds = {'least': FINEST_ACCURACY, 'most': COARSEST_ACCURACY}
    return {'accuracy': where.number('accuracy', unit='rad or m', **bounds)}


def read_solver(where: Section, parts: Parts) -> tuple[str, Any]:
    """
    Return a solver's name and parameters; a name may stand alone.

    Raises
    ------
    FileError
        Where there is no such solver, or its parameters cannot be read.

    """
    if isinstance(where.mapping['solver'], str):
        return _named(where)
    solvers = where.section('solver')
    named = list(solvers)
    if len(named) > 1:
        raise solvers.error(named[1], 'is a second solver', f'leave it, or {named[0]}, out')
    if not named or named[0] not in SOLVERS:
        solvers.finish(tuple(SOLVERS))
        raise solvers.error('', 'names none', f'write one of {listed(SOLVERS)}')
    (name,) = named
    parameters = import_module(SOLVERS[name]).PARAMETERS
    return name, read_parameters(solvers.section(name), parameters, parts)


def _named(where: Section) -> tuple[str, Any]:
    name = where.text('solver')
    if name not in SOLVERS:
        known = f'known: {listed(SOLVERS)}'
        raise where.error(
            'solver', f'there is no {quoted(name)}', did_you_mean(name, SOLVERS, known)
        )
    parameters = import_module(SOLVERS[name]).PARAMETERS
    for entry, _ in declared(parameters):
        if entry.default is MISSING:
            raise where.error(
                'solver',
                f'{name} has no {entry.name}',
                f'write solver: {{{name}: {{{entry.name}: …}}}}',
            )
    return name, parameters()
