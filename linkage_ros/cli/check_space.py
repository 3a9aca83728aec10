# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Describe a spatial linkage: freedom, order of solution, redundant equations, ranges, toggles."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from typing import Any

from linkage_ros.cli.arguments import DisplayUnits
from linkage_ros.cli.check import (
    examine_reach,
    examine_residual,
    limits_json,
    ORDER,
    reach_facts,
    transmission_table,
)
from linkage_ros.cli.result import Result, show_result, tables_json
from linkage_ros.cli.table import facts_table, Table
from linkage_ros.description import read_space_closure, Section
from linkage_ros.errors import LinkageError
from linkage_ros.kinematics import InputSweep, SpaceClosure


def check_space(content: Section, name: str, arguments: argparse.Namespace) -> int:
    """Check a spatial linkage; an invalid file raises."""
    if arguments.branches:
        raise LinkageError('--branches', 'is for planar linkages', 'leave it out')
    closure = read_space_closure(content, name)
    units = arguments.angles.of_file(content.units)
    described, tables = describe_space(closure)
    account = {'file': arguments.file, **described}
    facts = facts_table(arguments.file, _facts(account, units))
    parts = [facts, *(table for table in tables if table.rows)]
    show_result(Result(account, parts), arguments, units)
    return 0


def describe_space(closure: SpaceClosure) -> tuple[dict[str, Any], list[Table]]:
    """Return the description of a spatial linkage as JSON holds it, and its tables."""
    linkage, freedom = closure.linkage, closure.freedom
    sweep = InputSweep(closure) if len(linkage.inputs) == 1 else None
    rows = [(number, *group) for number, group in enumerate(closure.groups, 1)]
    tables = [
        Table('Solved in this order', ORDER, rows, 'groups'),
        transmission_table(closure, sweep),
    ]
    return {
        'moving_links': len(linkage.link_names) - 1,
        'hinges': len(linkage.hinges),
        'slides': len(linkage.slides),
        'balls': closure.ball_count,
        'struts': len(linkage.struts),
        'degrees_of_freedom': freedom.mobility,
        'redundant_equations': freedom.redundant,
        'spinning_rods': list(closure.idle),
        'unwrapped': False,
        'inputs': [{'joint': given.joint, 'unit': given.unit} for given in linkage.inputs],
        'limits': limits_json(linkage),
        **examine_reach(closure, sweep),
        **examine_residual(closure, sweep),
        **tables_json(tables),
    }, tables


def _facts(account: Mapping[str, Any], units: DisplayUnits) -> Iterator[tuple[str, str]]:
    yield 'moving links', str(account['moving_links'])
    kinds = ('hinges', 'slides', 'balls', 'struts')
    yield 'joints', ', '.join(f'{account[kind]} {kind}' for kind in kinds if account[kind])
    yield 'degrees of freedom', f'{account["degrees_of_freedom"]}, as many as there are inputs'
    if account['spinning_rods']:
        yield 'rods that may spin', ', '.join(account['spinning_rods'])
    for given in account['inputs']:
        turns = given['unit'] == 'rad'
        unit = 'angle' if turns else f'length [{units.length}]'
        yield 'input', f'{given["joint"]}: {unit}'
    if account['redundant_equations']:
        met = 'equations, met within the worst residual'
        yield 'redundant', f'{account["redundant_equations"]} {met}'
    yield from reach_facts(account, units)
