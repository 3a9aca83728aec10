# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The crank state of a drive as lines of a compiled tick: its formula, run on symbols."""

from __future__ import annotations

from itertools import chain, count
from typing import Any

from linkage_ros.generated_code import Lines
from linkage_ros.kinematics.compiling import (
    count_uses,
    number_of,
    Path,
    python_body,
    Tape,
)
from linkage_ros.stages.drives.drive import Crank, CrankState, FormulaCrank


def compile_drive(drive: Crank, inputs: int, leave: str, leave_without_crank: str) -> Lines:
    """
    Return lines that compute the fields of `CrankState` from ``now``.

    ``inputs`` is the number of inputs of the linkage. ``leave`` is the statement where a formula
    decides otherwise than usually, and ``leave_without_crank`` where another drive has no state.
    """
    if not isinstance(drive, FormulaCrank):
        fields = ', '.join(CrankState._fields)
        lines = ['crank = drive_state(now)', 'if crank is None:', f'    {leave_without_crank}']
        return Lines([*lines, f'{fields} = crank'], {'drive_state': drive.state})
    now, held = drive.usual(inputs)
    tape, numbers = Tape(), count()
    time: Any = tape.add_input('now', now)
    # Of each held part its symbols, and how it is written: as its number, or as a whole tuple.
    parts: list[tuple[Any, ...]] = []
    names: list[str] = []
    for part in held if isinstance(held, tuple) else (held,):
        several = part if isinstance(part, tuple) else (part,)
        parts.append(tuple([tape.add_input(f'h{next(numbers)}', number) for number in several]))
        names.append(f'p{len(names)}' if isinstance(part, tuple) else parts[-1][0].operation.name)
    whole = [part if name[0] == 'p' else part[0] for part, name in zip(parts, names, strict=True)]
    crank = drive.crank_state(time, tuple(whole) if isinstance(held, tuple) else whole[0])
    assert crank is not None
    kept = {id(part): name for part, name in zip(parts, names, strict=True)}
    made = {
        field: part if isinstance(part, tuple) else (part,)
        for field, part in zip(CrankState._fields, crank, strict=True)
        if id(part) not in kept
    }
    outputs = tuple(tuple(map(number_of, group)) for group in made.values())
    symbols = (time.operation, *(symbol.operation for part in parts for symbol in part))
    path = Path(symbols, tuple(tape.decisions), outputs, tape)
    body = python_body(path, leave, 'd')
    used = count_uses([*(decision.condition for decision in path.decisions), *chain(*outputs)])
    lines = [f'held = drive.{drive.HELD}', 'if held is None:', f'    {leave}']
    lines.append(f'{", ".join(names)} = held')
    for part, name in zip(parts, names, strict=True):
        if name[0] == 'p' and any(symbol.operation in used for symbol in part):
            lines.append(f'{", ".join(symbol.operation.name for symbol in part)}, = {name}')
    lines += body.lines
    texts = dict(zip(made, body.outputs, strict=True))
    for field, part in zip(CrankState._fields, crank, strict=True):
        text = kept.get(id(part)) or ', '.join(texts[field])
        of_several = isinstance(part, tuple) and id(part) not in kept
        lines.append(f'{field} = {f"({text},)" if of_several else text}')
    return Lines(lines, {'drive': drive, **body.bound})
