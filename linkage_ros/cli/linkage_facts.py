# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What `linkage check` says of a linkage in a line each, from its description as JSON holds it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import ceil, tau
from typing import Any

from linkage_ros.cli.arguments import DisplayUnits
from linkage_ros.kinematics import Status

_SINGULAR = {
    Status.TOGGLE: 'toggles',
    Status.CHANGE_POINT: 'change points',
    Status.INDETERMINATE: 'without a pose',
}
"""Names of singular inputs, by kind."""

_SAME = 1e-9
"""Largest difference of inputs that is rounding, in [rad] or [m]."""


def linkage_facts(account: Mapping[str, Any], units: DisplayUnits) -> Iterator[tuple[str, str]]:
    """Yield what each line is about, and what it says."""
    facts = _planar_facts if 'pins' in account else _spatial_facts
    yield from facts(account, units)


def _planar_facts(account: Mapping[str, Any], units: DisplayUnits) -> Iterator[tuple[str, str]]:
    blocks, inputs = account['slot_blocks'], account['inputs']
    slot_blocks = f' and {blocks} block(s) in slots' if blocks else ''
    yield 'moving links', f'{account["moving_links"]}{slot_blocks}'
    twice = ' (one of three links counts twice)' if account['shared_pins'] else ''
    yield 'joints', f'{account["pins"]} pins{twice}, {account["sliders"]} sliders'
    yield 'loops', str(account['loops'])
    yield 'degrees of freedom', f'{account["degrees_of_freedom"]}, as many as there are inputs'
    for driven_joint in inputs:
        driven = (
            f'slide of {driven_joint["slider"]} [{units.length}]'
            if driven_joint['slider']
            else f'angle of {driven_joint["child"]} to {driven_joint["parent"]}'
        )
        yield 'input', f'{driven_joint["joint"]}: {driven}'
    if account.get('plane'):
        yield 'plane', ' and '.join(account['plane'])
        yield from _correction_facts(account, units)
    yield from _reach_facts(account, units)


def _spatial_facts(account: Mapping[str, Any], units: DisplayUnits) -> Iterator[tuple[str, str]]:
    yield 'moving links', str(account['moving_links'])
    kinds = ('hinges', 'slides', 'balls', 'struts')
    counts = [(account[kind], kind) for kind in kinds if account[kind]]
    yield 'joints', ', '.join(f'{n} {kind[:-1] if n == 1 else kind}' for n, kind in counts)
    planar = sum(group['kind'] == 'planar loop' for group in account['groups'])
    yield 'loops', f'{account["loops"]}{f", {planar} solved in a plane" if planar else ""}'
    yield 'degrees of freedom', f'{account["degrees_of_freedom"]}, as many as there are inputs'
    if account['spinning_rods']:
        yield 'rods that may spin', ', '.join(account['spinning_rods'])
    if account['held_joints']:
        yield 'held still', f'{", ".join(account["held_joints"])}: turns that move nothing else'
    for driven in account['inputs']:
        turns = driven['unit'] == 'rad'
        unit = 'angle' if turns else f'length [{units.length}]'
        yield 'input', f'{driven["joint"]}: {unit}'
    if account['redundant_equations']:
        count = account['redundant_equations']
        equations = f'{count} equation{"s" * (count != 1)}'
        yield 'redundant', f'{equations}, met within the worst residual'
    yield from _correction_facts(account, units)
    yield from _reach_facts(account, units)


def _correction_facts(
    account: Mapping[str, Any], units: DisplayUnits
) -> Iterator[tuple[str, str]]:
    """Yield what was corrected in the pose of a robot or of a linkage in space."""
    if account['robot_open_by_m'] is not None:
        open_by = units.format_length(account['robot_open_by_m'], '.2g')
        if turned_by := account['robot_turned_by_rad']:
            open_by += f' and {units.convert(turned_by):.2g} {units.angle}'
        yield 'loops open by', f'{open_by} in the pose'
    if account['merged_by_m']:
        apart = units.format_length(account['merged_by_m'], '.2g')
        yield 'merged', f'places of the pose that are up to {apart} apart'
    if tilted_by := account['tilted_by_rad']:
        tilt = f'{units.convert(tilted_by):.2g} {units.angle}'
        yield 'parallel', f'axes that are up to {tilt} apart'
    if account['beside_by_m']:
        apart = units.format_length(account['beside_by_m'], '.2g')
        yield 'beside', f'ends of a pin that are up to {apart} apart along its axis'
    if account['left_out']:
        yield 'left out', ', '.join(account['left_out'])


def _reach_facts(account: Mapping[str, Any], units: DisplayUnits) -> Iterator[tuple[str, str]]:
    """Yield the limits, the range, its singular places and the worst residual."""
    for limits in account['limits']:
        yield 'limits', f'{limits["joint"]}: {_limits_text(limits, units)}'
    for row in account['reached']:
        low, high = (units.value_text(row[end], row['unit'] == 'rad') for end in ('low', 'high'))
        closing = '' if row['closes'] else ', where the loops close'
        within = f'within the limits of {", ".join(row["within"])}{closing}'
        yield 'reached', f'{row["joint"]}: {low} to {high}, {within}'
    yield from _range_facts(account, units)
    worst = account['worst_residual']
    if worst is None:
        yield 'worst residual', 'none: the loops close nowhere on a grid over all inputs'
        return

    def place_text(inputs: Sequence[float]) -> str:
        return ', '.join(
            units.value_text(value, driven['unit'] == 'rad')
            for value, driven in zip(inputs, account['inputs'], strict=True)
        )

    if (nearest := account['nearest_singularity']) and nearest['group']:
        where = f'of group {nearest["group"]}, at {place_text(nearest["inputs"])}'
        yield 'nearest singularity', f'conditioning {nearest["conditioning"]:.2g} {where}'
    if stand := account['joints_stand_at']:
        yield 'joints stand', f'in one direction, though inputs move, at {place_text(stand)}'
    residual = units.format_length(worst['residual_m'], '.1e')
    yield (
        'worst residual',
        f'{residual}, of {worst["positions"]} positions, at {place_text(worst["inputs"])}',
    )


def _range_facts(account: Mapping[str, Any], units: DisplayUnits) -> Iterator[tuple[str, str]]:
    if account['ranges'] is None:
        yield 'range', 'not a single one: it depends on every input'
        if account['unwrapped']:
            yield 'turns', 'they count: send unwrapped angles, a turn leads to another assembly'
        return
    turning = account['inputs'][0]['unit'] == 'rad'
    for interval in account['ranges']:
        turns = round((interval['high'] - interval['low']) / tau)
        if not interval['whole']:
            other_poses = (
                '; each turn has different poses' if turning and not interval['turns'] else ''
            )
            followed = any(interval['limited']) or not other_poses
            ends = '' if followed else ', and was not followed farther'
            yield 'range', f'{_range_text(interval, turning, units)}{other_poses}{ends}'
        elif turns > 1:
            count = 'two' if turns == 2 else str(turns)
            yield 'range', f'every angle; the motion repeats after {count} turns'
        else:
            yield 'range', 'every angle'
    for status, name in _SINGULAR.items():
        singular = sorted(
            (
                not place['within_limits'],
                _brought_within(place['input'], account['ranges'], turning),
            )
            for place in account['singular_inputs']
            if place['status'] == status.value
        )
        places = [
            units.value_text(value, turning) + (' beyond the limits' if beyond else '')
            for beyond, value in singular
        ]
        if places or status is not Status.INDETERMINATE:
            yield name, ', '.join(places) or 'none'
    for turning_point in account['turning_points']:
        at = sorted(
            _brought_within(place, account['ranges'], turning) for place in turning_point['inputs']
        )
        places = [units.value_text(value, turning) for value in at]
        yield 'turns back', f'{turning_point["joint"]} at {", ".join(places)}'


def _brought_within(value: float, ranges: Sequence[Mapping[str, Any]], turning: bool) -> float:
    """Return an input, an angle in the turn in which it lies within a range, if it does."""
    for interval in ranges if turning else ():
        turn = tau * ceil((interval['low'] - value) / tau - _SAME)
        if value + turn <= interval['high'] + _SAME:
            return float(value + turn)
    return 0.0 if abs(value) < _SAME else value


def _limits_text(limits: Mapping[str, Any], units: DisplayUnits) -> str:
    turning = limits['unit'] == 'rad'
    texts = []
    low, high = (
        '' if limits[end] is None else units.value_text(limits[end], turning)
        for end in ('low', 'high')
    )
    if low or high:
        texts.append(
            f'{low} to {high}' if low and high else f'from {low}' if low else f'to {high}'
        )
    if limits['velocity'] is not None:
        rate = f'{limits["unit"]}/s'
        velocity = units.convert(limits['velocity'], rate)
        texts.append(f'at most {velocity:.6g} {units.name_unit(rate)}')
    if limits['effort'] is not None:
        texts.append(f'at most {limits["effort"]:.6g} {"N·m" if turning else "N"}')
    return ', '.join(texts)


def _range_text(interval: Mapping[str, Any], turning: bool, units: DisplayUnits) -> str:
    """Return a range; if limits end it, with their names."""
    low, high = (units.value_text(interval[end], turning) for end in ('low', 'high'))
    if interval['limited_by'] == [None, None]:
        return f'{low} to {high}'
    ends = [
        f'{end}, {f"limit of {by}" if by else "toggle"}'
        for end, by in zip((low, high), interval['limited_by'], strict=True)
    ]
    if all(interval['limited']):
        return f'{ends[0]}, to {ends[1]}'
    return f'{ends[0]}, and on' if interval['limited'][0] else f'up to {ends[1]}'
