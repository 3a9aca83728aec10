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


"""
The usual tick of a linkage as one function, written as text: nothing between its formulas.

In the usual tick there is a crank, every loop closes, the linkage is on the path that it was
compiled for, no published angle jumps, and no effect changes anything. All else, the first tick
among it, is left to the plain tick. Both have the same bits.

A tick comes once a millisecond, to a processor that has done other things since. What it costs
then is the memory that it touches: frames, objects, functions. A straight function of local
variables touches least.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import chain, islice
from math import pi
from typing import Any, NamedTuple, TYPE_CHECKING, TypeAlias

from linkage_ros.drives.drive import CrankState
from linkage_ros.effects.stage import Reading
from linkage_ros.written import written

if TYPE_CHECKING:
    from linkage_ros.drives.drive import Drive
    from linkage_ros.effects.stage import DriveStage
    from linkage_ros.effects.turns import Continuous
    from linkage_ros.kinematics.compiled.linkage import Compiled
    from linkage_ros.messages.joint_state import JointStateWriter

_CRANK = ', '.join(CrankState._fields)
_LEAVE = f'return plain(now, CrankState({_CRANK}))'
"""Leaves a tick that is not the usual one."""

Plain = Callable[[int, CrankState | None], Any]
"""Does a tick at a time, in [ns], from the crank on, step by step."""


class Seen(NamedTuple):
    """
    What a compiled linkage comes to at a tick: what is published, and what the rest follows from.

    Attributes
    ----------
    crank
        The crank.
    reading
        What is published; None where nothing is.

    """

    crank: CrankState
    reading: Reading | None


Numbers: TypeAlias = tuple[tuple[Any, ...], tuple[Any, ...]]
"""The same as plain tuples."""


class Straight(NamedTuple):
    """
    A usual tick up to its reading, in lines of Python.

    Attributes
    ----------
    lines, bound
        They make what follows of ``now``, the fields of a `CrankState` by their names among it, or
        leave by ``plain``.
    joints, rates, accelerations
        Of the reading, as expressions; none where they are not called for.

    """

    lines: list[str]
    bound: dict[str, Any]
    joints: list[str]
    rates: list[str]
    accelerations: list[str]


def straight(
    drive: Drive,
    drive_stages: Sequence[DriveStage],
    compiled: Compiled,
    angles: Continuous | None,
) -> Straight:
    """
    Write the usual tick of a linkage.

    Parameters
    ----------
    drive
        Where the crank comes from.
    drive_stages
        What is between the drive and the crank.
    compiled
        The linkage; it is closed somewhere.
    angles
        Lets the published angles run on; None where they need not.

    """
    crank = drive.straight(compiled.driven, 'return plain(now, None)')
    lines, bound = [*crank.lines], {**crank.bound}

    def leave_unless(condition: str) -> None:
        lines.extend((f'if not ({condition}):', f'    {_LEAVE}'))

    for number, stage in enumerate(drive_stages):
        bound[f'stage{number}'] = stage
        lines.append(f'{_CRANK} = stage{number}(CrankState({_CRANK}))')
    path, *more_paths = compiled.paths
    inputs = [one.name for one in path.inputs]
    given = iter(inputs)
    lines += [
        f'{", ".join(islice(given, compiled.driven))}, = {field}'
        for field in CrankState._fields[: 1 + compiled.derivatives]
    ]
    groups = [
        [f'{letter}{i}' for i in range(len(group))]
        for letter, group in zip('xyz', path.outputs, strict=False)
    ]
    numbers = [*chain(*groups)]
    if more_paths:
        bound |= {'solve': compiled.fast, 'chain': chain}
        lines.append(f'values = solve({", ".join(inputs)})')
        leave_unless('values is not None')
        lines.append(f'{", ".join(numbers)}, = chain(*values)')
    else:
        body = compiled.body(_LEAVE)
        bound |= body.bound
        lines += body.lines
        outputs = chain(*body.outputs)
        lines += [f'{name} = {output}' for name, output in zip(numbers, outputs, strict=True)]
    joints, rates, accelerations = groups + [[]] * (3 - len(groups))
    if accelerations:
        # Towards a toggle they may overflow alone.
        lines.append(f'total = {" + ".join(accelerations)}')
        leave_unless('total - total == 0.0')

    if angles is not None:
        bound['running'] = angles
        lines.append('last = running.raw')
        leave_unless('last')
        for i in angles.places:
            leave_unless(f'{-pi!r} < last[{i}] - {joints[i]} < {pi!r}')
        lines.append(f'running.raw = {_tuple(joints)}')
        turns = [f'n{i}' for i in range(len(joints))]
        lines.append(f'{", ".join(turns)}, = running.added')
        lines += [f'{joint} += {turn}' for joint, turn in zip(joints, turns, strict=True)]
    return Straight(lines, bound, joints, rates, accelerations)


def straight_look(
    usual: Straight, read: Callable[[int, Reading], Reading | None] | None, plain: Plain
) -> Callable[[int], Any]:
    """
    Return what a linkage comes to, as a function of the time, in [ns].

    Parameters
    ----------
    usual
        Its usual tick.
    read
        What further sensors read; None where there are none.
    plain
        What does the other ticks.

    """
    lines = [f'crank = new(CrankState, ({_CRANK}))', f'reading = new(Reading, {_reading(usual)})']
    if read is not None:
        lines.append('reading = read(now, reading)')
    lines.append('return new(Seen, (crank, reading))')
    return _function(usual, lines, {'read': read, 'plain': plain})


def straight_tick(
    usual: Straight,
    writer: JointStateWriter,
    extras: Sequence[Callable[[int, Any, Reading], bytes]],
    tick: type[Any],
    linkages: Sequence[Any],
    plain: Plain,
) -> Callable[[int], Any]:
    """
    Return the whole tick of a scene with one linkage, as a function of the time, in [ns].

    Parameters
    ----------
    usual
        The linkage's usual tick; its reading is what is published.
    writer
        Of the joint states.
    extras
        What writes the other messages; they are made of the reading alone.
    tick, linkages
        The type of what a tick comes to, and the linkages that it names.
    plain
        What does the other ticks.

    """
    bound: dict[str, Any] = {'Tick': tick, 'linkages': linkages, 'plain': plain}
    bound |= {f'write{number}': write for number, write in enumerate(extras)}
    packed = writer.straight('now', usual.joints, usual.rates)
    lines = [f'reading = {_reading(usual)}', *packed.lines]
    if extras:
        lines.append('reading = new(Reading, reading)')
    messages = _tuple([f'write{number}(now, None, reading)' for number in range(len(extras))])
    seen = f'((({_CRANK}), reading),)'
    lines.append(f'return new(Tick, (message, {messages}, {seen}, linkages))')
    return _function(usual, lines, bound | packed.bound)


def _function(
    usual: Straight, lines: Sequence[str], bound: dict[str, Any]
) -> Callable[[int], Any]:
    # The constructor of a named tuple is a function of Python's; this is one of C's.
    new = tuple.__new__
    types = {'new': new, 'CrankState': CrankState, 'Reading': Reading, 'Seen': Seen}
    source = '\n    '.join(['def tick(now):', *usual.lines, *lines])
    function: Callable[[int], Any] = written(source, 'tick', usual.bound | types | bound)
    return function


def _reading(usual: Straight) -> str:
    parts = ', '.join(map(_tuple, (usual.joints, usual.rates, usual.accelerations)))
    return f'(now, {parts}, ())'


def _tuple(parts: Sequence[str]) -> str:
    return f'({", ".join(parts)},)' if parts else '()'
