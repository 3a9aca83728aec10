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
    curve_extremes,
    examine_reach,
    examine_residual,
    extremes_tables,
    joint_unit,
    limits_text,
    list_limits,
    ORDER,
    reach_facts,
    residual_fact,
)
from linkage_ros.cli.result import Result, show_result
from linkage_ros.cli.table import facts_table, Table, table_of_rows
from linkage_ros.description import read_space_closure, Section
from linkage_ros.errors import LinkageError
from linkage_ros.kinematics import InputSweep, SpaceClosure, transmission_angles


def check_space(content: Section, name: str, arguments: argparse.Namespace) -> int:
    """Check a spatial linkage; an invalid file raises."""
    if arguments.branches:
        raise LinkageError('--branches', 'is for planar linkages', 'leave it out')
    closure = read_space_closure(content, name)
    account = {'file': arguments.file, **space_json(closure)}
    units = arguments.angles.of_file(content.units)
    show_result(Result(account, [*_tables(account, units)]), arguments, units)
    return 0


def space_json(closure: SpaceClosure) -> dict[str, Any]:
    """Return the description of a spatial linkage, as JSON holds it; in SI units."""
    linkage, freedom = closure.linkage, closure.freedom
    units = dict(zip(linkage.joints, map(joint_unit, closure.turning), strict=True))
    units |= {given.joint: given.unit for given in linkage.inputs}
    sweep = InputSweep(closure) if len(linkage.inputs) == 1 else None
    angles = transmission_angles(sweep) if sweep is not None else {}
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
        'limits': list(list_limits(linkage, units)),
        'groups': [group._asdict() for group in closure.groups],
        **examine_reach(closure, sweep),
        **examine_residual(closure, sweep),
        'transmission_angles': curve_extremes(closure.links_of_group, angles, 'angle_rad'),
        'conditioning': [],
    }


def _tables(account: Mapping[str, Any], units: DisplayUnits) -> Iterator[Table]:
    yield facts_table(account['file'], _facts(account, units))
    groups = [{'number': number, **one} for number, one in enumerate(account['groups'], 1)]
    yield table_of_rows('Solved in this order', 'groups', ORDER, groups)
    yield from (table for table in extremes_tables(account) if table.rows)


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
    for limits in account['limits']:
        yield 'limits', f'{limits["joint"]}: {limits_text(limits, units)}'
    yield from reach_facts(account, units)
    if account['redundant_equations']:
        yield (
            'redundant',
            f'{account["redundant_equations"]} equations, met within the worst residual',
        )
    yield residual_fact(account, units)
