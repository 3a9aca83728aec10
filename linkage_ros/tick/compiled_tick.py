# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Generate the usual tick of a linkage as the text of one Python function.

In the usual tick there is a crank state, every loop closes, the linkage and its forces follow the
compiled path, and no published angle wraps. Every other tick, the first among them, is interpreted
step by step. Both give the same bits.

A tick comes once a millisecond, to a processor whose caches hold other data. Its cost is then the
memory that it touches: frames, objects, functions. One function of local variables touches least.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import chain, islice
from math import pi
from typing import Any, NamedTuple, TYPE_CHECKING, TypeAlias

from linkage_ros.generated_code import define_function, Lines
from linkage_ros.stages.drives import CrankState
from linkage_ros.stages.effects import SensorReading

if TYPE_CHECKING:
    from linkage_ros.dynamics import AppliedForces
    from linkage_ros.kinematics.compiling import Compiled
    from linkage_ros.messages import JointStateWriter
    from linkage_ros.stages.drives import Drive
    from linkage_ros.stages.effects import Continuous, DriveStage, WriterStage

_CRANK_FIELDS = ', '.join(CrankState._fields)

InterpretedTick = Callable[[int, CrankState | None], Any]
"""Computes a tick at a time, in [ns], step by step from the given crank state on."""


class CompiledState(NamedTuple):
    """State of a compiled linkage at a tick: the reading, and the base of the full state."""

    crank: CrankState
    reading: SensorReading | None  # None where nothing is published
    # As in `Reaction`, in pins and sliders; empty where no message holds them.
    reactions: tuple[tuple[float, float, float], ...]
    given: tuple[float, ...]  # As in `MechanismState`


StateTuple: TypeAlias = tuple[tuple[Any, ...], tuple[Any, ...], tuple[Any, ...], tuple[Any, ...]]
"""The same as plain tuples."""


class CompiledTick(NamedTuple):
    """The usual tick up to its reading, as lines of Python."""

    # Lines that compute from ``now``, and the objects that they use. They define the fields of
    # `CrankState` by name, or return through ``interpret``.
    lines: list[str]
    bound: dict[str, Any]
    crank: str  # The crank state, as an expression
    given: str  # What gives the loads that change, likewise
    # Values of the reading, as expressions; empty where the scene does not ask for them.
    joints: list[str]
    rates: list[str]
    accelerations: list[str]
    efforts: list[str]
    reactions: list[str]  # All reaction values in sequence, as expressions; likewise


def compile_tick(
    drive: Drive,
    drive_stages: Sequence[DriveStage],
    compiled_linkage: Compiled,
    angles: Continuous | None,
    applied: AppliedForces | None,
) -> CompiledTick:
    """
    Write the usual tick of a linkage.

    The compiled linkage closes for at least one input; it returns the values of a `CompiledTick`,
    as far as the scene asks for them. ``angles`` unwraps the published angles; ``applied``
    gives the loads that change. None if not needed.
    """
    crank = drive.compile_state(compiled_linkage.driven, 'return interpret(now, None)')
    lines, bound = [*crank.lines], {**crank.bound}
    # The state of a drive that exerts an effort holds more than its fields.
    exerts = getattr(drive, 'exerts_effort', False)
    state = 'crank' if exerts else f'CrankState({_CRANK_FIELDS})'
    for index, stage in enumerate(drive_stages):
        bound[f'stage{index}'] = stage
        lines.append(f'crank = {_CRANK_FIELDS}, = stage{index}({state})')
        state = 'crank'
    leave = f'return interpret(now, {state})'
    if applied is not None:
        bound['applied'] = applied
        lines += _fall_back_unless('applied.begin >= 0', leave)
        lines.append('given = applied.given_at(now)')
    mechanism, groups = _mechanism_lines(compiled_linkage, leave)
    lines += mechanism.lines
    bound |= mechanism.bound
    joints, rates, accelerations, efforts, reactions = groups + [[]] * (5 - len(groups))
    if efforts and drive_stages:
        # Within its play, the motor moves alone and carries only itself.
        lines += _fall_back_unless("{*getattr(crank, 'free_motors', ())} <= {None}", leave)
    if efforts and exerts:
        # As `linkage_ros.stages.effects.effort` for an input at rest.
        effort = efforts[0]
        lines.append("bearing = getattr(crank, 'bearing', ())")
        lines.append(f'if bearing: {effort} = min(max({effort}, bearing[0]), bearing[1])')
    if angles is not None:
        bound['running'] = angles
        lines += _unwrap_lines(angles.places, joints, leave)
    crank_text = 'crank' if exerts else f'({_CRANK_FIELDS})'
    given = '()' if applied is None else 'given'
    groups = joints, rates, accelerations, efforts, reactions
    return CompiledTick(lines, bound, crank_text, given, *groups)


def _mechanism_lines(compiled_linkage: Compiled, leave: str) -> tuple[Lines, list[list[str]]]:
    """Write the motion of a compiled linkage; also return the names of its values, in groups."""
    path, *more_paths = compiled_linkage.paths
    inputs = [one.name for one in path.inputs]
    names = iter(inputs)
    lines = [
        f'{", ".join(islice(names, compiled_linkage.driven))}, = {field}'
        for field in CrankState._fields[: 1 + compiled_linkage.derivatives]
    ]
    if beside := [*names]:
        lines.append(f'{", ".join(beside)}, = given')
    groups = [
        [f'{letter}{i}' for i in range(len(group))]
        for letter, group in zip('xyzef', path.outputs, strict=False)
    ]
    numbers = [*chain(*groups)]
    if more_paths:
        bound = {'solve': compiled_linkage.fast, 'chain': chain}
        lines.append(f'values = solve({", ".join(inputs)})')
        lines += _fall_back_unless('values is not None', leave)
        lines.append(f'{", ".join(numbers)}, = chain(*values)')
        return Lines(lines, bound), groups
    body = compiled_linkage.first_path_body(leave)
    outputs = chain(*body.outputs)
    lines += body.lines
    lines += [f'{name} = {output}' for name, output in zip(numbers, outputs, strict=True)]
    return Lines(lines, body.bound), groups


def _unwrap_lines(places: Sequence[int], joints: Sequence[str], leave: str) -> list[str]:
    """Write the unwrapping of the published angles, of which none may have wrapped."""
    lasts = [f'l{i}' for i in range(len(joints))]
    turns = [f'n{i}' for i in range(len(joints))]
    near = [f'{-pi!r} < {lasts[i]} - {joints[i]} < {pi!r}' for i in places]
    return [
        'last = running.raw',
        *_fall_back_unless('last', leave),
        f'{", ".join(lasts)}, = last',
        *(_fall_back_unless(' and '.join(near), leave) if near else ()),
        f'running.raw = {_tuple_text(joints)}',
        f'{", ".join(turns)}, = running.added',
        *[f'{joint} += {turn}' for joint, turn in zip(joints, turns, strict=True)],
    ]


def _fall_back_unless(condition: str, leave: str) -> tuple[str, str]:
    return f'if not ({condition}):', f'    {leave}'


def compile_linkage_state(
    compiled: CompiledTick,
    apply_sensors: Callable[[int, SensorReading], SensorReading | None] | None,
    interpret: InterpretedTick,
) -> Callable[[int], Any]:
    """
    Return the state of a linkage as a function of the time, in [ns].

    ``apply_sensors`` applies further sensor stages; ``interpret`` computes the ticks that
    ``compiled`` does not.
    """
    lines = [f'reading = new(Reading, {_reading_text(compiled)})']
    if apply_sensors is not None:
        lines.append('reading = apply_sensors(now, reading)')
    crank = compiled.crank if compiled.crank == 'crank' else f'new(CrankState, {compiled.crank})'
    lines.append(f'return new(CompiledState, {_state_text(compiled, crank)})')
    return _define_function(
        compiled, lines, {'apply_sensors': apply_sensors, 'interpret': interpret}
    )


def compile_contribution(compiled: CompiledTick, interpret: InterpretedTick) -> Callable[..., Any]:
    """
    Return a function that adds one linkage to a message of several, and returns its state.

    The function takes the time, in [ns], and the lists of positions, rates and efforts, which it
    extends by the reading of ``compiled``. A tick computed by ``interpret`` extends none of the
    lists.
    """
    groups = {'positions': compiled.joints, 'rates': compiled.rates, 'efforts': compiled.efforts}
    lines = [
        f'_, own_positions, own_rates, _, own_efforts = reading = {_reading_text(compiled)}',
        *[f'all_{name} += own_{name}' for name, group in groups.items() if group],
        f'return {_state_text(compiled, compiled.crank)}',
    ]
    return _define_function(
        compiled, lines, {'interpret': interpret}, ['now', *(f'all_{name}' for name in groups)]
    )


def compile_scene_tick(
    compiled: CompiledTick,
    writer: JointStateWriter,
    extras: Sequence[WriterStage],
    tick_type: type[Any],
    linkages: Sequence[Any],
    interpret: InterpretedTick,
) -> Callable[[int], Any]:
    """
    Return the whole tick of a scene with one linkage, as a function of the time, in [ns].

    ``writer`` serializes the joint states, and ``extras`` the other messages, from the reading
    alone or from a `CompiledState`. ``interpret`` computes the ticks that ``compiled`` does not.
    ``tick_type`` and ``linkages`` are the type of the result, and the linkages that it refers to.
    """
    bound: dict[str, Any] = {'Tick': tick_type, 'linkages': linkages, 'interpret': interpret}
    bound |= {f'write{index}': extra.write for index, extra in enumerate(extras)}
    packed = writer.compile_write('now', compiled.joints, compiled.rates, compiled.efforts)
    lines = [f'reading = {_reading_text(compiled)}', *packed.lines]
    if extras:
        lines.append('reading = new(Reading, reading)')
    state = _state_text(compiled, compiled.crank)
    messages = _tuple_text(
        [
            f'write{index}(now, {"None" if extra.of_reading else "state"}, reading)'
            for index, extra in enumerate(extras)
        ]
    )
    if 'state' in messages:
        lines.append(f'state = new(CompiledState, {state})')
        state = 'state'
    lines.append(f'return new(Tick, (message, {messages}, ({state},), linkages))')
    return _define_function(compiled, lines, bound | packed.bound)


def _define_function(
    compiled: CompiledTick,
    lines: Sequence[str],
    bound: dict[str, Any],
    parameters: Sequence[str] = ('now',),
) -> Callable[..., Any]:
    # The constructor of a named tuple is a Python function; `tuple.__new__` is a C function.

    new = tuple.__new__
    types = {
        'new': new,
        'CrankState': CrankState,
        'Reading': SensorReading,
        'CompiledState': CompiledState,
    }
    source = '\n    '.join([f'def tick({", ".join(parameters)}):', *compiled.lines, *lines])
    function: Callable[..., Any] = define_function(source, 'tick', compiled.bound | types | bound)
    return function


def _reading_text(compiled: CompiledTick) -> str:
    groups = compiled.joints, compiled.rates, compiled.accelerations, compiled.efforts
    return f'(now, {", ".join(map(_tuple_text, groups))})'


def _state_text(compiled: CompiledTick, crank: str) -> str:
    numbers = iter(compiled.reactions)
    reactions = [_tuple_text(three) for three in zip(numbers, numbers, numbers, strict=True)]
    return f'({crank}, reading, {_tuple_text(reactions)}, {compiled.given})'


def _tuple_text(parts: Sequence[str]) -> str:
    return f'({", ".join(parts)},)' if parts else '()'
