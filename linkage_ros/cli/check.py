# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Describe a linkage: mobility, order of solution, four-bars, ranges, toggles, transmission."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict
from math import tau
import sys
from threading import Event
from typing import Any

from linkage_ros.cli.arguments import (
    add_at,
    add_file,
    add_over,
    add_radians,
    add_robot,
    DisplayUnits,
    finite_or_none,
    input_over,
    read_inputs,
    robot_of,
)
from linkage_ros.cli.linkage_facts import linkage_facts
from linkage_ros.cli.result import add_result, Result, show_result, tables_json
from linkage_ros.cli.table import Column, facts_table, Quantity, Table, UNIT
from linkage_ros.cli.terminal import ProgressCallback, show_progress
from linkage_ros.description import linkage_content, linkage_notes, read_any_closure
from linkage_ros.errors import DefinitionError, LinkageError, list_names
from linkage_ros.kinematics import (
    branches_over,
    closes_in_two_ways,
    closing_name,
    Closure,
    conditioning_curves,
    Driven,
    Dyad,
    find_reached_values,
    find_standing_state,
    find_worst_states,
    four_bars,
    GearedLinks,
    Group,
    GroupDescription,
    InputSweep,
    is_iterated,
    Iterated,
    Linkage,
    links_of,
    PlanarClosure,
    sides_at,
    SpaceClosure,
    SpaceLinkage,
    SweptCurve,
    transmission_angles,
    turning_points,
    usual_inputs,
)
from linkage_ros.resources import named_file

_STARTS = 64
"""Starts from which other assemblies of a spatial linkage are sought."""

_PLACES = 4
"""Maximum number of places shown for one extreme value."""

EXAMPLE = 'linkage check jansen_leg'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_file(parser)
    add_robot(parser)
    add_result(parser)
    parser.add_argument(
        '--branches',
        action='store_true',
        help='add the branches of each dependent joint: crank intervals in which it moves one way',
    )
    add_over(parser, 'with --branches, the input that moves, of several')
    add_at(parser, 'with --branches, where the inputs are that --over does not name')
    add_radians(parser)


def run(arguments: argparse.Namespace, _stop: Event) -> int:
    """Check the linkage; an invalid file raises before this returns."""
    file = named_file(arguments.file, 'linkages')
    content = linkage_content(file, robot_of(arguments))
    closure = read_any_closure(content, file.stem)
    for note in linkage_notes(closure.linkage, content):
        print(f'linkage check: note: {content.locate_error(note)}', file=sys.stderr)
    units = arguments.angles = arguments.angles.of_file(content.units)
    sweep = _branches_sweep(closure, arguments)
    with show_progress('parts examined') as advance:
        described, tables = _describe_linkage(closure, advance)
        if sweep:
            tables = [*tables, _branches_table(sweep, units)]
            described |= tables_json(tables[-1:])
    account = {'file': arguments.file, **described}
    show_result(Result(account, [*_linkage_tables(account, tables, units)]), arguments, units)
    return 0


def _branches_sweep(closure: Closure, arguments: argparse.Namespace) -> InputSweep | None:
    """Return the way of the input over which branches are asked for; None if they are not."""
    states = [read_inputs(closure.linkage, at, '--at', arguments.angles) for at in arguments.at]
    if not arguments.branches:
        for option, typed in (('--over', arguments.over), ('--at', states)):
            if typed:
                raise LinkageError(option, 'says where branches are', 'write --branches too')
        return None
    number = input_over(closure, arguments.over, '--branches', 'leave it out')
    held = states[-1] if states else usual_inputs(closure)
    sweep = InputSweep(closure, held, number)
    if not sweep.ranges:
        reason = 'closes nowhere while the other inputs are held'
        raise LinkageError(sweep.input.joint, reason, 'hold them elsewhere, by --at')
    return sweep


# The description of a linkage as JSON holds it: values are in SI units, and their keys say so, or
# the 'unit' next to them.


def _describe_linkage(
    closure: Any, advance: ProgressCallback
) -> tuple[dict[str, Any], list[Table]]:
    """Return the description of a linkage as JSON holds it, and tables of it in their order."""
    sweep = InputSweep(closure) if len(closure.linkage.inputs) == 1 else None
    parts: list[Callable[..., dict[str, Any] | Table]] = []
    assemblies: Callable[..., dict[str, Any] | Table] = _other_poses_table
    if isinstance(closure, PlanarClosure):
        groups, account = [*describe_groups(closure)], _structure_json(closure)
        parts, assemblies = [_four_bars_table], _other_assemblies
    else:
        groups, account = closure.groups, _space_json(closure)
    account['groups'] = [group._asdict() for group in groups]
    rows = [(number, *group) for number, group in enumerate(groups, 1)]
    tables = [Table('Solved in this order', _ORDER, rows, 'groups')]
    # Most of the time goes by here.
    parts += [_examine_reach, _map_limits, _examine_states, _examine_joints, assemblies]
    parts += [_transmission_table, _conditioning_table]
    for index, part in enumerate(parts):
        advance(index, len(parts))
        content = part(closure, sweep)
        if isinstance(content, Table):
            tables.append(content)
            content = tables_json([content])
        account |= content
    return account, tables


def _structure_json(closure: PlanarClosure) -> dict[str, Any]:
    """Return what a planar linkage consists of."""
    linkage, structure = closure.linkage, closure.structure
    moving = len(structure.links) - 1
    pins = sum(joint.kind == 'R' for joint in structure.joints)
    named = [point for points in linkage.links.values() for point in points]
    return {
        'moving_links': len(linkage.links) - 1,
        'slot_blocks': moving + 1 - len(linkage.links),
        'pins': pins,
        'shared_pins': any(named.count(point) > 2 for point in named),
        'sliders': len(structure.joints) - pins,
        'loops': len(structure.joints) - moving,
        'degrees_of_freedom': structure.mobility,
        'inputs': [
            {'joint': driven.joint, 'unit': driven.unit}
            | {key: getattr(driven, key) or None for key in ('slider', 'parent', 'child')}
            for driven in linkage.inputs
        ],
        'limits': _limits_json(linkage),
        'unwrapped': _counts_turns(closure),
        **_corrections_json(linkage),
    }


def _corrections_json(linkage: Linkage | SpaceLinkage) -> dict[str, Any]:
    """Return what was corrected in the pose of a linkage that is drawn in space."""
    corrections = linkage.corrections
    if corrections is None:
        return {}
    plane = {'plane': list(linkage.axes)} if len(linkage.axes) == 2 else {}
    return plane | {
        'robot_open_by_m': corrections.open_by,
        'robot_turned_by_rad': corrections.turned_by,
        'merged_by_m': corrections.merged_by,
        'tilted_by_rad': corrections.tilted_by,
        'beside_by_m': corrections.beside_by,
        'left_out': list(linkage.left_out),
    }


def _limits_json(linkage: Linkage | SpaceLinkage) -> list[dict[str, Any]]:
    """Return the limits of the joints that have any, in SI units."""
    joints = linkage.named_joints
    return [
        {'joint': name, 'unit': joints[name].unit}
        | {key: finite_or_none(value) for key, value in asdict(limits).items()}
        for name, limits in linkage.limits.items()
    ]


def _list_branches(sweep: InputSweep) -> Iterator[tuple[Any, ...]]:
    """Yield the branches of each joint that moves, and of each coordinate of a traced point."""
    closure, linkage = sweep.closure, sweep.closure.linkage
    names = [joint for joint in linkage.joints if joint not in closure.input_names]
    names += [f'{point}.{axis}' for point in linkage.traced for axis in linkage.axes]
    for name in names:
        with suppress(DefinitionError):  # It does not move.
            for branch in branches_over(sweep, name):
                unit = 'rad' if branch.turning else 'm'
                yield (
                    *(name, branch.number, branch.least, branch.most, unit),
                    *(Quantity(end, unit) for end in (branch.low, branch.high)),
                    *(list(branch.turns_back), branch.rises, [by or None for by in branch.by]),
                    sweep.held_inputs,
                )


def _counts_turns(closure: PlanarClosure) -> bool:
    """Return whether whole turns of several inputs against each other lead to another pose."""
    if len(closure.linkage.inputs) == 1:
        return False
    return is_iterated(closure) or any(sum(step.crosses) == 1 for step in closure.steps)


def _examine_reach(closure: Closure, sweep: InputSweep | None) -> dict[str, Any]:
    """Return ranges and singular inputs; None if they depend on several inputs."""
    if sweep is None:
        return {'ranges': None, 'singular_inputs': None}
    return {
        'ranges': [
            {
                'low': interval.lowest,
                'high': interval.highest,
                'whole': interval.is_whole,
                'turns': interval.turns,
                'limited': list(interval.limited),
                'limited_by': [by or None for by in interval.by],
            }
            for interval in sweep.ranges
        ],
        'singular_inputs': [
            {
                'status': singular.status.value,
                'input': singular.value,
                'within_limits': _is_reached(sweep, singular.value),
            }
            for singular in closure.singular_inputs
        ],
    }


def _map_limits(closure: Closure, _sweep: InputSweep | None) -> dict[str, Any]:
    """Return what is reached within limits of other joints."""
    joints = closure.linkage.named_joints
    reached = find_reached_values(closure)
    return {'reached': [span._asdict() | {'unit': joints[span.joint].unit} for span in reached]}


def _is_reached(sweep: InputSweep, value: float) -> bool:
    """Return whether a value of the input, up to full turns, is within the limits."""
    turns = (0.0, -tau, tau) if sweep.turning else (0.0,)
    return not sweep.closure.bounds or any(sweep.range_about(value + turn) for turn in turns)


def _examine_states(closure: Closure, _sweep: InputSweep | None) -> dict[str, Any]:
    """Return the worst residual, and of several inputs the nearest singularity; None if open."""
    worst = find_worst_states(closure)
    if worst is None:
        return {'worst_residual': None, 'nearest_singularity': None}
    return {
        'worst_residual': {
            'residual_m': worst.residual,
            'inputs': list(worst.inputs),
            'positions': worst.positions,
        },
        'nearest_singularity': worst.margin
        and {
            'conditioning': worst.margin.conditioning,
            'group': worst.margin.group + 1,
            'inputs': list(worst.nearest),
        },
    }


def _examine_joints(closure: Closure, _sweep: InputSweep | None) -> dict[str, Any]:
    """Return where joints turn back, or of several inputs where they stand together."""
    if len(closure.linkage.inputs) > 1:
        return {'turning_points': None, 'joints_stand_at': find_standing_state(closure)}
    turns = [{'joint': name, 'inputs': at} for name, at in turning_points(closure).items()]
    return {'turning_points': turns, 'joints_stand_at': None}


def _other_assemblies(closure: PlanarClosure, _way: InputSweep | None) -> dict[str, Any]:
    """Return for each iterated group the other assemblies that a pose could name."""
    pose = closure.linkage.pose
    groups = []
    for index, group in enumerate(closure.structure.groups):
        if not isinstance(group, Iterated) or pose is None:
            continue
        # local import: it loads numpy
        from linkage_ros.kinematics import other_assemblies, STARTS

        assemblies = [
            {
                'points_m': {
                    name: [place.real + 0.0, place.imag + 0.0]
                    for name, place in assembly.points.items()
                },
                'turns': assembly.turns,
            }
            for assembly in other_assemblies(closure, index)
        ]
        head = {'group': index + 1, 'starts': STARTS, 'inputs': list(pose.inputs)}
        groups.append(head | {'assemblies': assemblies})
    return {'other_assemblies': groups}


def describe_groups(closure: PlanarClosure) -> Iterator[GroupDescription]:
    """Yield the groups of a planar linkage in words, with the sides on which they are."""
    sides = sides_at(closure, closure.close_unlimited(*usual_inputs(closure)))
    for number in range(len(closure.structure.groups)):
        yield _describe_group(closure, number, sides)


def _describe_group(
    closure: PlanarClosure, number: int, sides: Mapping[str, str]
) -> GroupDescription:
    """Return a group in words; sides as `sides_at`."""
    group: Group = closure.structure.groups[number]
    if isinstance(group, Driven):
        driven = closure.linkage.driven_joints[group.index]
        place = f'{"pin" if group.joint.kind == "R" else "slider"} {group.joint.name}'
        ratio = closure.linkage.ratios.get(driven.joint)
        follows = f' follows {ratio.text}' if ratio else ''
        kind = 'ratio' if ratio else 'input'
        method = f'{driven.joint}{follows}, {place} on {group.joint.to}'
        return GroupDescription(kind, [group.joint.link], method, '')
    steps = [
        step
        for step, owner in zip(closure.steps, closure.step_groups, strict=True)
        if owner == number
    ]
    if isinstance(group, Dyad):
        links = [' + '.join(body) for body in group.bodies]
        assembly = 'the only one'
        if closes_in_two_ways(group):
            assembly = _assembly_text(group, sides.get(closing_name(group), 'in line with'))
            if any(any(step.crosses) for step in steps):
                assembly += ' as drawn, changing at change points'
        return GroupDescription(f'{group.kind} dyad', links, 'closed form', assembly)
    if isinstance(group, GearedLinks):
        ratios = ((name, closure.linkage.ratios[name]) for name in group.ratios)
        followed = [f'{name} follows {ratio.text}' for name, ratio in ratios]
        return GroupDescription('ratio', list(group.links), list_names(followed), '')
    (equations,) = (step.equation_count for step in steps if step.iterates)
    method = f"iterated: Newton's method, {equations} equations"
    links = list(group.links)
    return GroupDescription(f'{len(links)} links', links, method, 'as the pose of the file')


def _assembly_text(dyad: Dyad, side: str) -> str:
    first, second = dyad.outer
    if dyad.kind == 'RRR':
        return f'pin {dyad.inner.name} {side} of {first.name}→{second.name}'
    pin = dyad.inner.name if dyad.kind == 'RRP' else second.name
    return f'slider {closing_name(dyad)}: pin {pin} {side} of {first.name}'


def _space_json(closure: SpaceClosure) -> dict[str, Any]:
    """Return what a spatial linkage consists of."""
    linkage, freedom = closure.linkage, closure.freedom
    moving = len(linkage.link_names) - 1
    # Two balls between two links are one hinge.
    joined = {frozenset((joint.parent, joint.child)) for joint in linkage.pair_joints.values()}
    for point in linkage.points:
        first, *others = [link for link, points in linkage.links.items() if point in points]
        joined |= {frozenset((first, link)) for link in others}
    return {
        'moving_links': moving,
        'loops': len(joined) + len(linkage.struts) - moving,
        'hinges': len(linkage.hinges),
        'slides': len(linkage.slides),
        'balls': closure.ball_count,
        'struts': len(linkage.struts),
        'degrees_of_freedom': freedom.mobility,
        'redundant_equations': freedom.redundant,
        'spinning_rods': list(closure.idle),
        'held_joints': list(closure.held),
        'unwrapped': False,
        'inputs': [{'joint': driven.joint, 'unit': driven.unit} for driven in linkage.inputs],
        'limits': _limits_json(linkage),
        **_corrections_json(linkage),
    }


# The same as tables.


def _join(values: Sequence[Any], _units: DisplayUnits) -> str:
    return ', '.join(map(str, values))


def _lengths_text(lengths: Sequence[float], units: DisplayUnits, form: str = '.6g') -> str:
    return ', '.join(f'{units.convert(length, "m"):{form}}' for length in lengths)


def _margin_text(margin: float, units: DisplayUnits) -> str:
    return f'{units.convert(margin, "m"):+.4g}' if margin else '0'


_GROUP, _LINKS = Column('>', 'group'), Column('links', 'links', form=_join)
_ORDER = (
    Column('>', 'number'),
    Column('group', 'kind'),
    _LINKS,
    Column('how', 'method'),
    Column('assembly', 'assembly'),
)
_FOUR_BAR = (
    _GROUP,
    _LINKS,
    Column('lengths []', 'lengths_m', 'm', _lengths_text),
    Column('>Grashof margin []', 'grashof_margin_m', 'm', _margin_text),
    Column('Barker', 'barker'),
    Column('name', 'name'),
)


def _linkage_tables(
    account: Mapping[str, Any], tables: Sequence[Table], units: DisplayUnits
) -> Iterator[Table]:
    """Yield the tables that describe a linkage."""
    yield facts_table(account['file'], linkage_facts(account, units))
    yield tables[0]
    input_units = [driven['unit'] for driven in account['inputs']]
    for group in account['other_assemblies'] if 'pins' in account else ():
        yield _assemblies_table(group, input_units, units)
    yield from (table for table in tables[1:] if table.rows or table.key == 'branches')


def _four_bars_table(closure: PlanarClosure, _sweep: InputSweep | None) -> Table:
    rows = [
        (
            *(bar.group + 1, list(bar.links), list(bar.lengths)),
            *(bar.kind.margin, bar.kind.code, bar.kind.name),
        )
        for bar in four_bars(closure.structure)
    ]
    title = 'Four-bars: input, coupler, output and the frame that they are seen from'
    return Table(title, _FOUR_BAR, rows, 'four_bars')


def _transmission_table(closure: Closure, sweep: InputSweep | None) -> Table:
    """Return the extreme transmission angles over the range, by group."""

    def angle(value: float | None, units: DisplayUnits) -> str:
        return '' if value is None else units.format_angle(value, 2)

    ends = [Column(f'>{end}', f'{end}.angle_rad', 'rad', angle) for end in ('least', 'greatest')]
    curves = {} if sweep is None else transmission_angles(sweep)
    title = 'Transmission angles over the range, acute'
    return _extremes_table(title, 'transmission_angles', closure, curves, ends)


def _conditioning_table(closure: Closure, sweep: InputSweep | None) -> Table:
    least = Column('>least', 'least.conditioning', form='.4f')
    ends = [least, Column(None, 'greatest.conditioning')]
    curves = {} if sweep is None else conditioning_curves(sweep)
    title = 'Conditioning over the range, of iterated links'
    return _extremes_table(title, 'conditioning', closure, curves, ends)


def _extremes_table(
    title: str,
    key: str,
    closure: Closure,
    curves: Mapping[int, SweptCurve],
    ends: Sequence[Column],
) -> Table:
    """Return the extreme values by group, and the inputs where they occur; none if constant."""
    unit = closure.linkage.inputs[0].unit

    def places(inputs: Sequence[float], units: DisplayUnits) -> str:
        return _inputs_text(inputs, unit == 'rad', units)

    columns = [_GROUP, _LINKS]
    for end in ends:
        where = end.key.partition('.')[0]
        columns += [end, Column(end.heading and 'at', f'{where}.inputs', unit, places)]
    rows = [
        (
            *(number + 1, _links_of(closure, number)),
            *(finite_or_none(curve.lowest.value), list(curve.lowest.at)),
            *(finite_or_none(curve.highest.value), list(curve.highest.at)),
        )
        for number, curve in curves.items()
    ]
    return Table(title, columns, rows, key)


def _links_of(closure: Closure, number: int) -> list[str]:
    if isinstance(closure, PlanarClosure):
        return [*links_of(closure.structure.groups[number])]
    return closure.links_of_group(number)


def _branches_table(sweep: InputSweep, units: DisplayUnits) -> Table:
    driven = sweep.input

    def input_text(value: float, units: DisplayUnits) -> str:
        return units.value_text(value, driven.unit == 'rad')

    def limits_text(by: Sequence[str | None], _units: DisplayUnits) -> str:
        return ', '.join(sorted({name for name in by if name}))

    columns = (
        Column('joint', 'joint'),
        Column('>branch', 'branch'),
        Column(f'>{driven.joint} from', 'input_low', driven.unit, input_text),
        Column('>to', 'input_high', driven.unit, input_text),
        Column(None, UNIT),
        Column('>joint from', 'low'),
        Column('>to', 'high'),
        Column(None, 'turns_back'),
        Column('', 'rises', form=lambda rises, _: 'rises' if rises else 'falls'),
        Column('limits of', 'limited_by', form=limits_text),
        Column(None, 'held'),
    )
    turning = {held.joint: held.unit == 'rad' for held in sweep.closure.linkage.inputs}
    at = [
        f'{name} at {units.value_text(x, turning[name])}' for name, x in sweep.held_inputs.items()
    ]
    where = f', {list_names(at, " and ")}' if at else ''
    title = f'Branches{where}: between their ends a joint moves one way'
    return Table(title, columns, [*_list_branches(sweep)], 'branches')


def _assemblies_table(
    group: Mapping[str, Any], input_units: Sequence[str], units: DisplayUnits
) -> Table:
    """Return the other assemblies of a group, each as a pose to paste into the file."""
    inputs = ', '.join(
        f'{units.file.to_file_unit(value, unit) + 0.0:.9g}'
        for value, unit in zip(group['inputs'], input_units, strict=True)
    )
    rows = [
        (
            f'{{inputs: [{inputs}], points: {{{_points_text(assembly["points_m"], units)}}}}}',
            _turns_text(assembly['turns']),
        )
        for assembly in group['assemblies']
    ]
    return Table(
        f'Other assemblies of group {group["group"]} at the inputs of the pose: '
        f'{len(rows)} found from {group["starts"]} starts',
        (Column('pose', 'pose'), Column("on the pose's branch", 'turns')) if rows else ('',),
        rows or [('none',)],
        'other_assemblies' if rows else '',
    )


def _other_poses_table(closure: SpaceClosure, _sweep: InputSweep | None) -> Table:
    """Return the other assemblies of what closes only together, at the inputs of the pose."""
    rows = [
        (number + 1, joints)
        for number, assemblies in closure.other_assemblies(_STARTS).items()
        for joints in assemblies
    ]

    def joints_text(joints: Mapping[str, float], units: DisplayUnits) -> str:
        hinges = closure.linkage.hinges
        return ', '.join(
            f'{name} {units.value_text(value, name in hinges)}' for name, value in joints.items()
        )

    title = f'Other assemblies at the inputs of the pose, from {_STARTS} starts each'
    return Table(title, (_GROUP, Column('joints', 'joints', form=joints_text)), rows,
                 'other_assemblies')  # fmt: skip


def _points_text(points: Mapping[str, Sequence[float]], units: DisplayUnits) -> str:
    return ', '.join(
        f'{name}: [{_lengths_text(place, units, ".7g")}]' for name, place in points.items()
    )


def _turns_text(turns: int) -> str:
    if not turns:
        return 'no'
    return f'{abs(turns)} turn{"s" if abs(turns) > 1 else ""} {"on" if turns > 0 else "back"}'


def _inputs_text(inputs: Sequence[float], turning: bool, units: DisplayUnits) -> str:
    if not inputs:
        return 'everywhere'
    places = [
        units.format_angle(at, 2) if turning else units.format_length(at)
        for at in inputs[:_PLACES]
    ]
    more = len(inputs) - _PLACES
    return ', '.join(places) + (f' and {more} more' if more > 0 else '')
