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


"""Say what a linkage is: freedom, order of solution, four-bars, ranges, toggles, transmission."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from math import isfinite, tau
from threading import Event

from linkage_ros.cli.arguments import angle_text, value_text
from linkage_ros.cli.terminal import show, Table
from linkage_ros.files.linkage_file import load
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.grashof import four_bars
from linkage_ros.kinematics.linkage import Limits
from linkage_ros.kinematics.results import InputRange
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.sweep_analysis import (
    conditionings,
    Extreme,
    InputSweep,
    MinMaxCurve,
    transmission_angles,
    worst_residual,
)
from linkage_ros.kinematics.topology import Driven, Dyad, Group, Iterated

_SINGULAR = (
    ('toggles', Status.TOGGLE),
    ('change points', Status.CHANGE_POINT),
    ('without a pose', Status.INDETERMINATE),
)
"""What singular inputs are called, by what is met there."""

_PLACES = 4
"""How many places of one extreme are named."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument('file', help='the linkage file')


def run(arguments: argparse.Namespace, _stop: Event) -> int:
    """Check the linkage; a file with an error in it has been refused when this returns."""
    closure = load(arguments.file)
    for number, table in enumerate(tables(closure, arguments.file)):
        if number:
            print()
        show(table)
    return 0


def tables(closure: Closure, title: str) -> Iterator[Table]:
    """Yield what there is to say of a linkage."""
    way = InputSweep(closure) if len(closure.linkage.inputs) == 1 else None
    yield Table(title, ('', ''), list(_facts(closure, way)))
    yield Table(
        'Solved in this order', ('>', 'group', 'links', 'how', 'assembly'), _groups(closure)
    )
    yield from _other_assemblies(closure)
    loops = [
        (
            str(bar.group + 1),
            ', '.join(bar.links),
            ', '.join(f'{length:.6g}' for length in bar.lengths),
            f'{bar.kind.margin:+.4g}' if bar.kind.margin else '0',
            bar.kind.code,
            bar.kind.name,
        )
        for bar in four_bars(closure.structure)
    ]
    if loops:
        yield Table(
            'Four-bars: input, coupler, output and the frame that they are seen from',
            ('>', 'links', 'lengths [m]', '>Grashof margin [m]', 'Barker', 'name'),
            loops,
        )
    if way is not None:
        angles = transmission_angles(way)
        if angles:
            rows = [_extremes(closure, i, ends, way.turning) for i, ends in angles.items()]
            heads = ['>', 'links', '>least', 'at', '>greatest', 'at']
            yield Table('Transmission angles over the range, acute', heads, rows)
        ratios = conditionings(way)
        if ratios:
            rows = [_conditioning(closure, i, ends, way.turning) for i, ends in ratios.items()]
            heads = ['>', 'links', '>least', 'at']
            yield Table('Conditioning over the range, of what is iterated', heads, rows)


def describe_group(closure: Closure, number: int) -> tuple[str, str, str, str]:
    """Return kind, links, way of solution and assembly of a group."""
    group: Group = closure.structure.groups[number]
    if isinstance(group, Driven):
        given = closure.linkage.inputs[group.index]
        place = f'{"pin" if group.joint.kind == "R" else "slider"} {group.joint.name}'
        return 'input', group.joint.link, f'{given.joint}, {place} on {group.joint.to}', ''
    if isinstance(group, Dyad):
        links = ', '.join(' + '.join(body) for body in group.bodies)
        return f'{group.kind} dyad', links, 'closed form', _assembly(closure, group)
    (equations,) = (
        step.equation_count
        for step, owner in zip(closure.steps, closure.step_groups, strict=True)
        if owner == number and hasattr(step, 'equation_count')
    )
    return (
        f'{len(group.links)} links',
        ', '.join(group.links),
        f"iterated: Newton's method, {equations} equations",
        'as the pose of the file',
    )


def _facts(closure: Closure, way: InputSweep | None) -> Iterator[tuple[str, str]]:
    linkage, structure = closure.linkage, closure.structure
    moving = len(structure.links) - 1
    pins = sum(joint.kind == 'R' for joint in structure.joints)
    sliders = len(structure.joints) - pins
    blocks = moving + 1 - len(linkage.links)
    beside = f' and {blocks} block(s) in slots' if blocks else ''
    yield 'moving links', f'{len(linkage.links) - 1}{beside}'
    named = [point for points in linkage.links.values() for point in points]
    shared = any(named.count(point) > 2 for point in named)
    twice = ' (one of three links counts twice)' if shared else ''
    yield 'joints', f'{pins} pins{twice}, {sliders} sliders'
    yield 'loops', str(len(structure.joints) - moving)
    yield 'degrees of freedom', f'{structure.freedom}, as many as there are inputs'
    for given in linkage.inputs:
        driven = (
            f'slide of {given.slider} [m]'
            if given.slider
            else f'angle of {given.child} to {given.parent}'
        )
        yield 'input', f'{given.joint}: {driven}'
    turning = dict(zip(linkage.joints, closure.turning, strict=True))
    turning |= {given.joint: not given.slider for given in linkage.inputs}
    for name, limits in linkage.limits.items():
        yield 'limits', f'{name}: {_limits_text(limits, turning[name])}'
    yield from _reach(closure, way)
    found = worst_residual(closure)
    if found is None:
        yield 'worst residual', 'none: the loops close nowhere on a grid over all inputs'
        return
    worst, at, count = found
    names = [not given.slider for given in linkage.inputs]
    place = ', '.join(value_text(value, turning) for value, turning in zip(at, names, strict=True))
    yield 'worst residual', f'{worst:.1e} m, of {count} positions, at {place}'


def _reach(closure: Closure, way: InputSweep | None) -> Iterator[tuple[str, str]]:
    if way is None:
        yield 'range', 'no single one: it depends on every input'
        return
    for interval in way.ranges:
        turns = round((interval.highest - interval.lowest) / tau)
        if not interval.whole:
            each = '; each turn has poses of its own' if way.turning and not interval.turns else ''
            ends = '' if any(interval.limited) or not each else ', and was not followed farther'
            yield 'range', f'{_range_text(interval)}{each}{ends}'
        elif turns > 1:
            count = 'two' if turns == 2 else str(turns)
            yield 'range', f'every angle; the motion repeats after {count} turns'
        else:
            yield 'range', 'every angle'
    places: dict[Status, list[str]] = {status: [] for _, status in _SINGULAR}
    for singular in closure.singular_inputs:
        said = value_text(singular.value, way.turning)
        beyond = '' if _is_reached(way, singular.value) else ' beyond the limits'
        places[singular.status].append(said + beyond)
    for name, status in _SINGULAR:
        if places[status] or status is not Status.INDETERMINATE:
            yield name, ', '.join(places[status]) or 'none'


def _is_reached(way: InputSweep, value: float) -> bool:
    """Return whether a value of the input, in one of its turns, is within the limits."""
    turns = (0.0, -tau, tau) if way.turning else (0.0,)
    return not way.closure.bounds or any(way.range_about(value + turn) for turn in turns)


def _limits_text(limits: Limits, turning: bool) -> str:
    said = []
    if limits.bounded:
        low, high = (
            value_text(end, turning) if isfinite(end) else '' for end in (limits.low, limits.high)
        )
        said.append(f'{low} to {high}' if low and high else f'from {low}' if low else f'to {high}')
    if isfinite(limits.velocity):
        said.append(f'at most {limits.velocity:.6g} {"rad" if turning else "m"}/s')
    if isfinite(limits.effort):
        said.append(f'at most {limits.effort:.6g} {"N·m" if turning else "N"}')
    return ', '.join(said)


def _range_text(interval: InputRange) -> str:
    """Return a range; where limits end it, with what ends it."""
    low, high = (value_text(value, interval.turning) for value in interval[:2])
    if interval.by == ('', ''):
        return f'{low} to {high}'
    ends = []
    for end, by in zip((low, high), interval.by, strict=True):
        ends.append(f'{end}, {f"limit of {by}" if by else "toggle"}')
    if interval.limited == (True, True):
        return f'{ends[0]}, to {ends[1]}'
    return f'{ends[0]}, and on' if interval.limited[0] else f'up to {ends[1]}'


def _groups(closure: Closure) -> list[tuple[str, ...]]:
    count = len(closure.structure.groups)
    return [(str(number + 1), *describe_group(closure, number)) for number in range(count)]


def _assembly(closure: Closure, dyad: Dyad) -> str:
    first, second = dyad.outer
    closing = dyad.inner.name
    if dyad.kind == 'RRR':
        side = closure.linkage.assembly[closing]
        return f'pin {closing} {side} of {first.name}→{second.name}'
    if dyad.kind == 'RPR':
        side = closure.linkage.assembly[closing]
        return f'slider {closing}: pin {second.name} {side} of {first.name}'
    if dyad.kind == 'RRP':
        side = closure.linkage.assembly[second.name]
        return f'slider {second.name}: pin {closing} {side} of {first.name}'
    return 'the only one'


def _other_assemblies(closure: Closure) -> Iterator[Table]:
    """Yield for each group that is iterated what else a pose could name at the same inputs."""
    pose = closure.linkage.pose
    for number, group in enumerate(closure.structure.groups):
        if not isinstance(group, Iterated) or pose is None:
            continue
        # local import: it loads numpy
        from linkage_ros.kinematics.assembly_modes import other_assemblies, STARTS

        others = other_assemblies(closure, number)
        inputs = ', '.join(f'{value + 0.0:.9g}' for value in pose.inputs)
        rows = [
            (f'{{inputs: [{inputs}], points: {{{_points(one.points)}}}}}', _turns(one.turns))
            for one in others
        ]
        yield Table(
            f'Other assemblies of group {number + 1} at the inputs of the pose: '
            f'{len(others)} found from {STARTS} starts',
            ('pose', "on the pose's branch") if rows else ('',),
            rows or [('none',)],
        )


def _points(points: Mapping[str, complex]) -> str:
    return ', '.join(
        f'{name}: [{place.real + 0.0:.7g}, {place.imag + 0.0:.7g}]'
        for name, place in points.items()
    )


def _turns(turns: int) -> str:
    if not turns:
        return 'no'
    return f'{abs(turns)} turn{"s" if abs(turns) > 1 else ""} {"on" if turns > 0 else "back"}'


def _links(closure: Closure, number: int) -> str:
    return describe_group(closure, number)[1]


def _extremes(closure: Closure, number: int, found: MinMaxCurve, turning: bool) -> tuple[str, ...]:
    lowest, highest = found
    return (
        str(number + 1),
        _links(closure, number),
        angle_text(lowest.value, 2),
        _places(lowest, turning),
        angle_text(highest.value, 2),
        _places(highest, turning),
    )


def _conditioning(
    closure: Closure, number: int, found: MinMaxCurve, turning: bool
) -> tuple[str, ...]:
    lowest = found.lowest
    links = _links(closure, number)
    return str(number + 1), links, f'{lowest.value:.4f}', _places(lowest, turning)


def _places(extreme: Extreme, turning: bool) -> str:
    if not extreme.at:
        return 'everywhere'
    said = [angle_text(at, 2) if turning else f'{at + 0.0:.6g} m' for at in extreme.at[:_PLACES]]
    more = len(extreme.at) - _PLACES
    return ', '.join(said) + (f' and {more} more' if more > 0 else '')
