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
Many states of a linkage at once.

They pass, block by block, through the paths of the linkage as numpy: what is between two passes
stays in the cache, and memory does not grow with the states beyond what is returned. Which status
a state has that leaves a path is told by the fates beside the path; where only the plain steps
can tell, at toggles and change points, they are asked.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from math import isfinite
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.kinematics.arithmetic import all_finite
from linkage_ros.kinematics.batch import Array, Batch, CODES, Codes, Mask
from linkage_ros.kinematics.compiling.linkage import Compiled
from linkage_ros.kinematics.compiling.numpy_blocks import ArrayForm, BlockFunction, Number
from linkage_ros.kinematics.compiling.real_program import Lowered, lowered
from linkage_ros.kinematics.compiling.trace import Fate, fates, Fork, joints, Wanted
from linkage_ros.kinematics.ranges import iterated
from linkage_ros.kinematics.status import Status
import numpy as np
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from linkage_ros.kinematics.results import LoopClosure

BLOCK = 8192
"""States of a block: as many as stay in the cache."""

_APART = 8
"""
Numbers between two rows of scratch.

Of rows that touch numpy 1.26 thinks that they overlap, and works number by number, which takes ten
times as long; and rows a power of two apart have the same places in the cache.
"""

_OPEN, _INDETERMINATE = CODES[Status.OPEN], CODES[Status.INDETERMINATE]
_CLOSED, _LIMITED = CODES[Status.CLOSED], CODES[Status.LIMITED]
_TOGGLE = CODES[Status.TOGGLE]

_LOST = (Status.OPEN, Status.INDETERMINATE)
"""What is told by the fates beside a path; where only the plain steps can tell, they are asked."""


class _Program(NamedTuple):
    """
    A path over arrays.

    Attributes
    ----------
    values
        What is asked for, and where the path holds.
    fates
        Of those where it does not, which are open, and which are indeterminate.

    """

    values: BlockFunction
    fates: BlockFunction


class Solver:
    """
    A linkage, asked for certain numbers at many states.

    Parameters
    ----------
    closure
        The linkage.
    width
        How many numbers it is asked for of a position, and of each derivative.
    wanted
        Which; all published joints if not given. Of these a state tells, too, that one is beyond
        its limits.

    """

    def __init__(self, closure: LoopClosure, width: int, wanted: Wanted = joints) -> None:
        self._closure = closure
        self._limited = wanted is joints
        self._driven = len(closure.linkage.inputs)
        self._width = width
        self._wanted = wanted
        self._compiled = cache(self._compile)
        self._programs = cache(self._program)

    def solve(
        self,
        inputs: Sequence[ArrayLike],
        rates: Any = None,
        accelerations: Any = None,
        derivatives: int = 2,
        out: Batch | None = None,
    ) -> Batch:
        """Solve all states, as `Closure.solve` says."""
        if derivatives not in (0, 1, 2):
            raise ValueError(f'derivatives: {derivatives!r} is none of 0, 1, 2')
        driven = self._driven
        if rates is None and derivatives and len(inputs) == driven:
            if driven > 1:
                raise ValueError(f'rates: give one for each of the {driven} driven joints')
            rates = 1.0
        if accelerations is None:
            accelerations = [0.0] * driven
        given = _numbers('inputs', list(inputs), driven, None)
        count = len(given[0])
        for name, values in (('rates', rates), ('accelerations', accelerations))[:derivatives]:
            # That of a single one may stand without a list.
            alone = np.ndim(values) < 2 if driven == 1 else not np.iterable(values)
            each = [values] if alone else list(values)
            given += _numbers(name, each, driven, count)
        batch = _room(self._width, count, derivatives, out)
        numbers: list[Any] = [value if value.ndim else float(value) for value in given]
        # Nothing is worked out of what is 0, and nothing multiplied by 1.
        kinds = [int(n) if isinstance(n, float) and n in (0.0, 1.0) else type(n) for n in numbers]
        programs = self._programs(derivatives, tuple(kinds))
        functions = [function for program in programs for function in program]
        longest = min(count, BLOCK)
        rows = np.empty((max((f.rows for f in functions), default=0), longest + _APART))
        rows = rows[:, :longest]
        masks = np.empty((max((f.masks for f in functions), default=0), longest), bool)
        with np.errstate(all='ignore'):
            for start in range(0, count, BLOCK):
                part = slice(start, start + BLOCK)
                block = _Block(
                    [n[part] if isinstance(n, np.ndarray) else n for n in numbers],
                    batch.status[part],
                    [array[:, part] for array in batch[1:] if array is not None],
                    rows,
                    masks,
                )
                self._solve(block, programs, self._compiled(derivatives))
        return batch

    def _solve(self, block: _Block, programs: Sequence[_Program], one: Compiled) -> None:
        """Solve a block: those states that no program can tell of one by one."""
        left = block.begin(self._driven)
        for program in programs:
            if left is not None and not left.size:
                break
            left = block.pass_through(program, left)
        if left is None:
            left = np.arange(len(block.status))
        for k in left.tolist():
            block.put(k, self._driven, one)
        if self._limited and (bounds := self._closure.bounds):
            beyond = bounds.beyond(block.given, block.values[0])
            block.status[beyond & (block.status < _LIMITED)] = _LIMITED
        block.clear()

    def _compile(self, derivatives: int) -> Compiled:
        return Compiled(self._closure, derivatives, self._wanted, within_limits=False)

    def _program(self, derivatives: int, kinds: tuple[Any, ...]) -> list[_Program]:
        """Return the paths over arrays; none where links are iterated: that is no line."""
        if iterated(self._closure):
            return []
        return [
            _program(lowered(path, fates(self._closure, path), by_squares=True), kinds)
            for path in self._compiled(derivatives).paths
        ]


class _Block(NamedTuple):
    """
    Some states.

    Attributes
    ----------
    given
        The inputs, their rates and their accelerations, each an array or a number.
    status
        The code of each state.
    values
        Where the numbers go that are asked for, (width, N), of positions and derivatives.
    rows, masks
        Scratch.

    """

    given: list[Any]
    status: Codes
    values: list[Array]
    rows: Array
    masks: Mask

    def begin(self, driven: int) -> Any:
        """Note which states are no numbers; return the others, None where all are."""
        self.status.fill(_CLOSED)
        for values in self.given[:driven]:
            if not np.isfinite(values.sum()):
                self.status[~np.isfinite(values)] = _INDETERMINATE
        return np.flatnonzero(self.status == _CLOSED) if self.status.any() else None

    def pass_through(self, program: _Program, states: Any) -> Any:
        """Pass states through a path, None for all; return those of which it cannot tell."""
        holds = self._write(program, states)
        if holds is None or holds.all():
            return np.empty(0, np.intp)
        on, off = np.flatnonzero(holds), np.flatnonzero(~holds)
        if states is not None:
            on, off = states[on], states[off]
        if len(on) < len(off):
            # Nothing is written: most of it would have been for nothing.
            self._write(program, on)
        lost = np.empty((len(_LOST), len(off)), bool)
        self._run(program.fates, self._of(off), list(lost))
        for status, those in zip(_LOST, lost, strict=True):
            self.status[off[those]] = CODES[status]
        return off[~lost.any(axis=0)]

    def _write(self, program: _Program, states: Any) -> Mask | None:
        """Write what is asked for of states, None for all; return where the path holds."""
        rows = [row for values in self.values for row in values]
        if states is None:
            return self._run(program.values, self.given, rows)
        into = np.empty((len(rows), len(states)))
        holds = self._run(program.values, self._of(states), list(into))
        for row, numbers in zip(rows, into, strict=True):
            row[states] = numbers
        return holds

    def put(self, k: int, driven: int, one: Compiled) -> None:
        """Solve a single state."""
        numbers = [float(n[k]) if isinstance(n, np.ndarray) else n for n in self.given]
        # A rate that is none makes none, and the pose is what it is.
        answer = one(*(number if isfinite(number) else 0.0 for number in numbers))
        self.status[k] = CODES[answer.status]
        for order, (values, found) in enumerate(zip(self.values, answer.values, strict=True)):
            if found:
                end = (1 + order) * driven
                values[:, k] = found if all_finite(numbers[:end]) else np.nan

    def _of(self, states: Any) -> list[Any]:
        return [n[states] if isinstance(n, np.ndarray) else n for n in self.given]

    def _run(self, function: BlockFunction, given: list[Any], into: list[Any]) -> Mask | None:
        count = len(into[0]) if into else len(self.status)
        return function(
            given, into, self.rows[: function.rows, :count], self.masks[: function.masks, :count]
        )

    def clear(self) -> None:
        """Write NaN where a state has no pose, or no rates."""
        if self.status.any():
            for order, values in enumerate(self.values):
                np.copyto(values, np.nan, where=self.status >= (_TOGGLE if order else _OPEN))


def _program(path: Lowered, kinds: Sequence[Any]) -> _Program:
    """Return a path over arrays; kinds are the types of its inputs, or what they are."""
    (inputs, decisions, outputs, _), ends = path
    names = [given.name for given in inputs]
    each = list(zip(names, kinds, strict=True))
    form = ArrayForm({name: kind for name, kind in each if isinstance(kind, int)})
    arrays = [name for name, kind in each if kind is np.ndarray]
    holds: Number = True
    lost: list[Number] = [False] * len(_LOST)
    for (condition, held), fate in zip(decisions, ends, strict=True):
        if condition.name != 'finite':
            found = form.number(condition)
            falls = found if held else form.opposite(found)
            leaves = form.both(holds, form.opposite(falls))
            holds = form.both(holds, falls)
            for k, status in enumerate(_LOST):
                lost[k] = form.either(lost[k], form.both(leaves, _comes_to(form, fate, status)))
    roots = [form.number(number) for group in outputs for number in group]
    return _Program(BlockFunction(names, arrays, roots, holds), BlockFunction(names, arrays, lost))


def _comes_to(form: ArrayForm, fate: Fate, status: Status) -> Number:
    """Return the condition that a fate comes to a status."""
    if not isinstance(fate, Fork):
        return fate is status
    condition = form.number(fate.condition)
    return form.either(
        form.both(condition, _comes_to(form, fate.held, status)),
        form.both(form.opposite(condition), _comes_to(form, fate.failed, status)),
    )


def _numbers(name: str, values: list[Any], driven: int, count: int | None) -> list[Array]:
    """Return an array for each driven joint, as long as the states; of one number, if may be."""
    if len(values) != driven:
        raise ValueError(f'{name}: {len(values)} given; give {driven}, one for each driven joint')
    try:
        arrays = [np.asarray(value, np.float64) for value in values]
    except (TypeError, ValueError) as error:
        raise ValueError(f'{name}: not an array of numbers: {error}') from None
    shapes = [array.shape for array in arrays]
    try:
        shape = np.broadcast_shapes(*shapes, () if count is None else (count,))
    except ValueError:
        shape = ()
    if len(shape) != 1 or shape[0] != (shape[0] if count is None else count):
        wanted = 'one (N,)' if count is None else f'({count},)'
        raise ValueError(
            f'{name}: shapes {", ".join(map(str, shapes))} do not broadcast to {wanted}'
        )
    return [
        np.broadcast_to(array, shape) if array.ndim or count is None else array for array in arrays
    ]


def _room(width: int, count: int, derivatives: int, out: Batch | None) -> Batch:
    """Return the arrays that the results go to: those given, as far as they are."""
    arrays: list[Any] = []
    given = out or (None,) * 4
    for k, (name, array) in enumerate(zip(Batch._fields, given, strict=True)):
        kind: Any = np.float64 if k else np.uint8
        shape = (width, count) if k else (count,)
        if k > 1 + derivatives:
            arrays.append(None)
        elif array is None:
            arrays.append(np.empty(shape, kind))
        elif array.shape != shape or array.dtype != kind:
            raise ValueError(
                f'out.{name}: is {array.dtype} {array.shape}, not {np.dtype(kind)} {shape}'
            )
        else:
            arrays.append(array)
    return Batch(*arrays)
