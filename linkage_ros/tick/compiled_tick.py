# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The usual tick of a scene, compiled: the text of one Python function.

In the usual tick there is a crank state, every loop closes, the linkage and its forces follow the
compiled path, and no published angle wraps. Every other tick, the first among them, is interpreted
step by step. Both give the same bits.

A tick comes once a millisecond, to a processor whose caches hold other data. Its cost is then the
memory that it touches: frames, objects, functions. One function of local variables touches least.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import chain, islice
from math import pi
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.generated_code import define_function, Lines
from linkage_ros.kinematics import all_finite
from linkage_ros.stages.drives import compile_drive, CrankState
from linkage_ros.stages.effects import MechanismEffect, MechanismState, SensorReading
from linkage_ros.tick.interpreted_tick import InterpretedTick, Tick
from linkage_ros.tick.linkage_pipeline import LinkagePipeline
from linkage_ros.tick.linkage_state import LinkageState

if TYPE_CHECKING:
    from linkage_ros.kinematics.compiling import Compiled, TracedMotion

_CRANK_FIELDS = ', '.join(CrankState._fields)


class CompiledTick(NamedTuple):
    """The usual tick of a linkage up to its reading, as lines of Python."""

    # Lines that compute from ``now``, and the objects that they use. They define the fields of
    # `CrankState` by name, or return through ``interpret`` or ``interpret_from``.
    lines: list[str]
    bound: dict[str, Any]
    crank: str  # The crank state, as an expression
    given: str  # What gives the loads that change, likewise
    # Values of the reading, as expressions; empty where the scene does not ask for them.
    joints: list[str]
    rates: list[str]
    accelerations: list[str]
    efforts: list[str]
    reactions: list[tuple[str, ...]]  # The values of each reaction, as expressions; likewise


def compile_tick(interpreted: InterpretedTick) -> Callable[[int], Tick] | None:
    """Return a tick as a function of the time, in [ns], with the same bits, or None."""
    linkages = interpreted.linkages
    compiled = [compile_linkage(linkage) for linkage in linkages]
    if not any(compiled):
        return None
    pairs = zip(linkages, compiled, strict=True)
    whole = [program for linkage, program in pairs if program is not None and _is_whole(linkage)]
    if len(whole) == len(linkages) == 1:
        return _compile_single(interpreted, whole[0])
    if len(whole) == len(linkages) and not interpreted.extras:
        return _combine_ticks(interpreted, whole)
    computes = [
        linkage.interpret if program is None else _compile_state(linkage, program)
        for linkage, program in zip(linkages, compiled, strict=True)
    ]
    return lambda now: interpreted.make_tick(now, [compute(now) for compute in computes])


def _compile_state(
    linkage: LinkagePipeline, compiled: CompiledTick
) -> Callable[[int], LinkageState]:
    """Return the state of a linkage as a function of the time, in [ns]."""
    apply_sensors = linkage.apply_later_sensors
    lines = [f'reading = new(Reading, {_reading_text(compiled)})']
    if apply_sensors is not None:
        lines.append('reading = apply_sensors(now, reading)')
    lines.append(f'return {_state_text(compiled)}')
    return _define_function(linkage, compiled, lines, {'apply_sensors': apply_sensors})


def _is_whole(linkage: LinkagePipeline) -> bool:
    """Return whether sensors and messages of a linkage take nothing that is interpreted."""
    return (
        all(extra.writer.of_reading or extra.forces_only for extra in linkage.extras)
        and linkage.apply_later_sensors is None
    )


def _compile_single(interpreted: InterpretedTick, compiled: CompiledTick) -> Callable[[int], Tick]:
    """Return the whole tick of a scene with one linkage."""
    (linkage,) = interpreted.linkages
    packed = interpreted.make_writer((True,)).compile_write(
        'now', compiled.joints, compiled.rates, compiled.efforts
    )
    lines = [f'reading = {_reading_text(compiled)}', *packed.lines]
    writers = [extra.writer for extra in interpreted.extras]
    if writers:
        lines.append('reading = new(Reading, reading)')
    state = _values_text(compiled)
    messages = _tuple_text(
        [
            f'write{index}(now, {"None" if writer.of_reading else "state"}, reading)'
            for index, writer in enumerate(writers)
        ]
    )
    if 'state' in messages:
        lines.append(f'state = {_state_text(compiled)}')
        state = 'state'
    lines.append(f'return new(Tick, (message, {messages}, ({state},), linkages))')
    bound: dict[str, Any] = {'Tick': Tick, 'linkages': interpreted.linkages}
    bound |= {f'write{index}': writer.write for index, writer in enumerate(writers)}
    bound['interpret'] = interpreted.run
    bound['interpret_from'] = lambda now, crank: interpreted.make_tick(
        now, [linkage.interpret_from(now, crank)]
    )
    return _define_function(linkage, compiled, lines, bound | packed.bound)


def _combine_ticks(
    interpreted: InterpretedTick, compiled_ticks: Sequence[CompiledTick]
) -> Callable[[int], Tick]:
    """Return the whole tick of a scene with several linkages and one message."""
    linkages = interpreted.linkages
    adders = [*map(_compile_adder, linkages, compiled_ticks)]
    write = interpreted.make_writer((True,) * len(linkages)).write
    numbers = [
        sum(len(getattr(compiled, group)) for compiled in compiled_ticks)
        for group in ('joints', 'rates', 'efforts')
    ]
    count, *_ = numbers
    all_rates, all_efforts = (number == count for number in numbers[1:])

    def tick(now: int) -> Tick:
        positions: list[float] = []
        rates: list[float] = []
        efforts: list[float] = []
        states = [add(now, positions, rates, efforts) for add in adders]
        if len(positions) < count:
            named = Tick(b'', (), states, linkages).states
            return interpreted.make_tick(now, named)
        message = write(now, positions, rates if all_rates else [], efforts if all_efforts else [])
        return Tick(message, (), states, linkages)

    return tick


def _compile_adder(linkage: LinkagePipeline, compiled: CompiledTick) -> Callable[..., Any]:
    """
    Return a function that adds one linkage to a message of several, and returns its state.

    The function takes the time, in [ns], and the lists of positions, rates and efforts, which it
    extends by the reading of ``compiled``. A tick that is interpreted extends none of the lists.
    """
    groups = {'positions': compiled.joints, 'rates': compiled.rates, 'efforts': compiled.efforts}
    lines = [
        f'_, own_positions, own_rates, _, own_efforts = reading = {_reading_text(compiled)}',
        *[f'all_{name} += own_{name}' for name, group in groups.items() if group],
        f'return {_values_text(compiled)}',
    ]
    return _define_function(
        linkage, compiled, lines, {}, ['now', *(f'all_{name}' for name in groups)]
    )


@dataclass(frozen=True)
class _OutputSelection:
    """Picks the values that a scene publishes from the motion of a compiled linkage."""

    # Two objects with equal keys pick the same values.
    key: list[Any]
    linkage: LinkagePipeline = field(compare=False)

    def __call__(self, motion: TracedMotion, *loads: float) -> Sequence[Sequence[float]]:
        """Return the ideal reading of a symbolic motion, and the joint forces."""
        acceleration = motion.acceleration
        if acceleration is None or not all_finite(acceleration.joints):
            return []
        moved = MechanismState(CrankState((), (), (), 0), *motion, (), (), (), loads)
        _velocity, _acceleration, *stages = self.linkage.mechanism_stages
        for stage in stages:
            moved = stage(moved)
        reactions = [*chain(*moved.reactions)] if self.linkage.writes_forces else []
        return [*self.linkage.observe(0, moved)[1:], reactions]


def compile_linkage(linkage: LinkagePipeline) -> CompiledTick | None:
    """Compile the tick of a linkage up to the reading; None where a part has no such form."""
    wanted = linkage.wanted
    acting = wanted.of_kind(MechanismEffect).values()
    derivatives = [effect.derivative for effect in acting if effect.derivative]
    if linkage.mechanism_faults:
        return None
    if not all(effect.is_compiled for effect in acting):
        return None
    loads = linkage.changing_loads if any(effect.computes_forces for effect in acting) else None
    efforts_taken = len(linkage.drive.efforts) if linkage.context.takes_efforts else 0
    outputs = None
    if 2 in derivatives:
        of = [*acting, linkage.published_fields, linkage.writes_forces]
        of += [linkage.context.loads, linkage.context.friction]
        outputs = _OutputSelection(of, linkage)
    compiled = linkage.closure.compile_linkage(
        len(derivatives), outputs, (loads.given_count if loads else 0) + efforts_taken
    )
    # Where the forces have no solution, a compiled path has fewer values.
    if len({tuple(map(len, path.outputs)) for path in compiled.paths}) != 1:
        return None
    # The state of a drive that exerts an effort holds more than its fields.
    exerts = linkage.drive.exerts_effort
    lines, bound = compile_drive(
        linkage.drive, compiled.driven, 'return interpret(now)', 'return interpret_from(now, None)'
    )
    state = 'crank' if exerts else f'CrankState({_CRANK_FIELDS})'
    for index, stage in enumerate(linkage.drive_stages):
        bound[f'stage{index}'] = stage
        lines.append(f'crank = {_CRANK_FIELDS}, = stage{index}({state})')
        state = 'crank'
    leave = f'return interpret_from(now, {state})'
    if loads is not None:
        bound['loads'] = loads
        lines += [*_fall_back_unless('loads.begin >= 0', leave), 'given = loads.given_at(now)']
    if efforts_taken:
        bound['sampled'] = linkage.drive
        lines.append(f'given = {"" if loads is None else "given + "}sampled.efforts')
    mechanism, groups = _mechanism_lines(compiled, leave)
    lines += mechanism.lines
    bound |= mechanism.bound
    joints, rates, accelerations, efforts, reactions = groups + [[]] * (5 - len(groups))
    if efforts and linkage.drive_stages:
        # Within its play, the motor moves alone and carries only itself.
        lines += _fall_back_unless("{*getattr(crank, 'free_motors', ())} <= {None}", leave)
    if efforts and exerts:
        # As `linkage_ros.stages.effects.forces` for an input at rest.
        lines.append("bearing = getattr(crank, 'bearing', ())")
        for k, effort in enumerate(efforts[: compiled.driven]):
            ends = f'bearing[{2 * k}]), bearing[{2 * k + 1}]'
            lines.append(f'if bearing: {effort} = min(max({effort}, {ends})')
    if linkage.running is not None:
        bound['running'] = linkage.running
        lines += _unwrap_lines(linkage.running.places, joints, leave)
    crank = 'crank' if exerts else f'({_CRANK_FIELDS})'
    load_values = '()' if loads is None and not efforts_taken else 'given'
    reading = joints, rates, accelerations, efforts
    components = len(reactions) // len(linkage.context.reactions.joints) if reactions else 1
    wrenches = [*zip(*[iter(reactions)] * components, strict=True)]
    return CompiledTick(lines, bound, crank, load_values, *reading, wrenches)


def _mechanism_lines(compiled_linkage: Compiled, leave: str) -> tuple[Lines, list[list[str]]]:
    """Write the motion of a compiled linkage; also return the names of its values, in groups."""
    path, *more_paths = compiled_linkage.paths
    inputs = [value.name for value in path.inputs]
    names = iter(inputs)
    lines = [
        f'{", ".join(islice(names, compiled_linkage.driven))}, = {field}'
        for field in CrankState._fields[: 1 + compiled_linkage.derivatives]
    ]
    if load_names := [*names]:
        lines.append(f'{", ".join(load_names)}, = given')
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


def _define_function(
    linkage: LinkagePipeline,
    compiled: CompiledTick,
    lines: Sequence[str],
    bound: dict[str, Any],
    parameters: Sequence[str] = ('now',),
) -> Callable[..., Any]:
    known = {
        # The constructor of a named tuple is a Python function; `tuple.__new__` is a C function.
        'new': tuple.__new__,
        'CrankState': CrankState,
        'Reading': SensorReading,
        'LinkageState': LinkageState,
        'complete': linkage.solve_mechanism,
        'interpret': linkage.interpret,
        'interpret_from': linkage.interpret_from,
    }
    source = '\n    '.join([f'def tick({", ".join(parameters)}):', *compiled.lines, *lines])
    function: Callable[..., Any] = define_function(source, 'tick', compiled.bound | known | bound)
    return function


def _reading_text(compiled: CompiledTick) -> str:
    groups = compiled.joints, compiled.rates, compiled.accelerations, compiled.efforts
    return f'(now, {", ".join(map(_tuple_text, groups))})'


def _state_text(compiled: CompiledTick) -> str:
    """Write the state of a linkage, whose reading is an object."""
    crank = compiled.crank if compiled.crank == 'crank' else f'new(CrankState, {compiled.crank})'
    return f'LinkageState(complete, {crank}, {_tail_text(compiled)})'


def _values_text(compiled: CompiledTick) -> str:
    """Write the same as plain tuples, as in `Tick`."""
    return f'({compiled.crank}, {_tail_text(compiled)})'


def _tail_text(compiled: CompiledTick) -> str:
    reactions = [_tuple_text(numbers) for numbers in compiled.reactions]
    return f'reading, {_tuple_text(reactions)}, {compiled.given}'


def _tuple_text(parts: Sequence[str]) -> str:
    return f'({", ".join(parts)},)' if parts else '()'
