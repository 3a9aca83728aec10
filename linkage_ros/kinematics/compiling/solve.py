# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Many states of a linkage at once.

They pass, block by block, through the paths of the linkage as numpy: intermediate results stay in
the cache, and memory grows only with the returned arrays. A state that leaves a path gets its
status from the fallback statuses of the path; only the interpreted steps can solve toggles and
change points, so they are called for these.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.kinematics.arithmetic import all_finite
from linkage_ros.kinematics.batch import Array, Batch, CODES, Codes, Mask
from linkage_ros.kinematics.built_once import keep_results
from linkage_ros.kinematics.compiling.linkage import Compiled
from linkage_ros.kinematics.compiling.numpy_blocks import ArrayForm, BlockFunction, Number
from linkage_ros.kinematics.compiling.real_program import lower_path, Lowered
from linkage_ros.kinematics.compiling.trace import (
    DecisionBranch,
    fallback_statuses,
    OutputSelection,
    published_joints,
    Tree,
)
from linkage_ros.kinematics.doubles import columns_of, HUGE, SHRINK, to_doubles
from linkage_ros.kinematics.status import Status
import numpy as np
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from linkage_ros.kinematics.closure import Closure

BLOCK = 8192
"""Number of states in a block: as many as fit into the cache."""

_APART = 8
"""
Numbers between two rows of scratch.

numpy 1.26 treats adjacent rows as overlapping and computes number by number, ten times as slowly;
and rows a power of two apart share the same places in the cache.
"""

_OPEN, _INDETERMINATE = CODES[Status.OPEN], CODES[Status.INDETERMINATE]
_CLOSED, _LIMITED = CODES[Status.CLOSED], CODES[Status.LIMITED]
_TOGGLE = CODES[Status.TOGGLE]

_LOST = (Status.OPEN, Status.INDETERMINATE)
"""The statuses that a path decides as fallbacks; the interpreted steps decide all others."""


class _SolveProgram(NamedTuple):
    """A path over arrays."""

    values: BlockFunction  # The requested numbers, and where the path is valid
    # Where the path is not valid: which states are open, and which are indeterminate.
    fallbacks: BlockFunction


class SolverOutline:
    """
    Solves a linkage for certain numbers at many states.

    ``width`` is the number of values of a position, and of each derivative. ``wanted`` selects the
    values; if it selects the published joints, the status also says that a joint is beyond its
    limits.
    """

    def __init__(
        self, closure: Closure, width: int, wanted: OutputSelection = published_joints
    ) -> None:
        self._closure = closure
        self._limited = wanted is published_joints
        self._driven = len(closure.linkage.inputs)
        self._width = width
        self._wanted = wanted
        self._compiled = keep_results(self._compile)
        self._programs = keep_results(self._array_programs)

    def solve(
        self,
        inputs: Sequence[ArrayLike],
        rates: Any = None,
        accelerations: Any = None,
        derivatives: int = 2,
        out: Batch | None = None,
    ) -> Batch:
        """Solve all states, as `Closure.solve` specifies."""
        if derivatives not in (0, 1, 2):
            raise ValueError(f'derivatives: {derivatives!r} is not one of 0, 1, 2')
        driven = self._driven
        # One array (N, inputs) stands for its columns; so do then rates and accelerations.
        columns = columns_of('inputs', inputs[0]) if len(inputs) == 1 else None
        if columns is not None:
            inputs = columns
        if rates is None and derivatives and len(inputs) == driven:
            if driven > 1:
                raise ValueError(f'rates: give one for each of the {driven} driven joints')
            rates = 1.0
        if accelerations is None:
            accelerations = [0.0] * driven
        given = _broadcast_values('inputs', list(inputs), driven, None)
        count = len(given[0])
        for name, values in (('rates', rates), ('accelerations', accelerations))[:derivatives]:
            column: Any = values
            if columns is not None and isinstance(values, np.ndarray):
                column = columns_of(name, values) or values
            elif driven == 1:
                column = to_doubles(name, values)
            # The values of a single driven joint need no list.
            alone = np.ndim(column) < 2 if driven == 1 else not np.iterable(column)
            given += _broadcast_values(name, [column] if alone else list(column), driven, count)
        numbers: list[Any] = [value if value.ndim else float(value) for value in given]
        with np.errstate(all='ignore'):
            if _has_huge(numbers[driven:], driven):
                return self._solve_huge(given, derivatives, out)
            return self._solve_blocks(numbers, derivatives, out)

    def _solve_blocks(self, numbers: list[Any], derivatives: int, out: Batch | None) -> Batch:
        """Solve with usual rates, block by block."""
        driven, count = self._driven, len(numbers[0])
        batch = _result_arrays(self._width, count, derivatives, out)
        # A constant 0 or 1 is folded into the program.
        kinds = [int(n) if isinstance(n, float) and n in (0.0, 1.0) else type(n) for n in numbers]
        programs = self._programs(derivatives, tuple(kinds))
        functions = [function for program in programs for function in program]
        longest = min(count, BLOCK)
        rows = np.empty((max((f.rows for f in functions), default=0), longest + _APART))
        rows = rows[:, :longest]
        masks = np.empty((max((f.masks for f in functions), default=0), longest), bool)
        for start in range(0, count, BLOCK):
            part = slice(start, start + BLOCK)
            block = _ProgramBlock(
                # Adding 0.0 makes 0.0 of −0.0, which is the same input.
                [
                    *(n[part] + 0.0 for n in numbers[:driven]),
                    *(n[part] if isinstance(n, np.ndarray) else n for n in numbers[driven:]),
                ],
                batch.status[part],
                [array[:, part] for array in batch[1:] if array is not None],
                rows,
                masks,
            )
            self._solve_block(block, programs, self._compiled(derivatives))
        return batch

    def _solve_huge(self, columns: list[Array], derivatives: int, out: Batch | None) -> Batch:
        """Solve with scaled rates and accelerations: what overflows is infinite."""
        driven = self._driven
        inputs, moved = columns[:driven], columns[driven:]
        rates, changes = moved[:driven], moved[driven:]
        huge = [_are_huge(value, k < driven) for k, value in enumerate((*rates, *changes))]
        scale = np.where(np.any(np.broadcast_arrays(*huge), axis=0), SHRINK, 1.0)
        batch = self.solve(
            inputs,
            [rate * scale for rate in rates],
            [change * scale * scale for change in changes] or None,
            derivatives,
            out,
        )
        for values in (batch.velocities, batch.accelerations, batch.accelerations):
            if values is not None:
                np.divide(values, scale, out=values)
        return batch

    def _solve_block(
        self, block: _ProgramBlock, programs: Sequence[_SolveProgram], compiled: Compiled
    ) -> None:
        """Solve a block; states that no program covers are solved one by one."""
        left = block.mark_nonfinite(self._driven)
        for program in programs:
            if left is not None and not left.size:
                break
            left = block.pass_through(program, left)
        if left is None:
            left = np.arange(len(block.status))
        for k in left.tolist():
            block.solve_state(k, self._driven, compiled)
        if self._limited and (bounds := self._closure.bounds):
            beyond = bounds.are_beyond(block.given, block.values[0])
            block.status[beyond & (block.status < _LIMITED)] = _LIMITED
        block.clear_invalid()

    def _compile(self, derivatives: int) -> Compiled:
        return Compiled(self._closure, derivatives, self._wanted, within_limits=False)

    def _array_programs(self, derivatives: int, kinds: tuple[Any, ...]) -> list[_SolveProgram]:
        """Return the paths over arrays."""
        return [
            _array_program(
                lower_path(path, fallback_statuses(self._closure, path), by_squares=True), kinds
            )
            for path in self._compiled(derivatives).paths
        ]


class _ProgramBlock(NamedTuple):
    """A block of states."""

    given: list[Any]  # The inputs, their rates and their accelerations, each an array or a number
    status: Codes  # The code of each state
    values: list[Array]  # The requested numbers, (width, N), of positions and derivatives
    # Scratch.
    rows: Array
    masks: Mask

    def mark_nonfinite(self, driven: int) -> Any:
        """Mark the states that are not finite; return the others, or None if all are finite."""
        self.status.fill(_CLOSED)
        for values in self.given[:driven]:
            # The sum of the squares is finite if all are, unless one is above 1e150.
            if not np.isfinite(np.dot(values, values)):
                self.status[~np.isfinite(values)] = _INDETERMINATE
        return np.flatnonzero(self.status == _CLOSED) if self.status.any() else None

    def pass_through(self, program: _SolveProgram, states: Any) -> Any:
        """Pass states (None: all) through a path; return those that it does not cover."""
        holds = self._write_results(program, states)
        if holds is None or holds.all():
            return np.empty(0, np.intp)
        on, off = np.flatnonzero(holds), np.flatnonzero(~holds)
        if states is not None:
            on, off = states[on], states[off]
        if len(on) < len(off):
            # Nothing was written, since most of it would be invalid.
            self._write_results(program, on)
        lost = np.empty((len(_LOST), len(off)), bool)
        self._run_function(program.fallbacks, self._select_states(off), list(lost))
        for status, those in zip(_LOST, lost, strict=True):
            self.status[off[those]] = CODES[status]
        return off[~lost.any(axis=0)]

    def _write_results(self, program: _SolveProgram, states: Any) -> Mask | None:
        """Write the requested numbers of states (None: all); return where the path is valid."""
        rows = [row for values in self.values for row in values]
        if states is None:
            return self._run_function(program.values, self.given, rows)
        into = np.empty((len(rows), len(states)))
        holds = self._run_function(program.values, self._select_states(states), list(into))
        for row, numbers in zip(rows, into, strict=True):
            row[states] = numbers
        return holds

    def solve_state(self, k: int, driven: int, compiled: Compiled) -> None:
        """Solve a single state."""
        numbers = [float(n[k]) if isinstance(n, np.ndarray) else n for n in self.given]
        # A rate that is not finite has no result, but the pose is valid.
        answer = compiled(*(number if isfinite(number) else 0.0 for number in numbers))
        self.status[k] = CODES[answer.status]
        for order, (values, solved) in enumerate(zip(self.values, answer.values, strict=True)):
            if solved:
                end = (1 + order) * driven
                values[:, k] = solved if all_finite(numbers[:end]) else np.nan

    def _select_states(self, states: Any) -> list[Any]:
        return [n[states] if isinstance(n, np.ndarray) else n for n in self.given]

    def _run_function(
        self, function: BlockFunction, numbers: list[Any], into: list[Any]
    ) -> Mask | None:
        count = len(into[0]) if into else len(self.status)
        return function(
            numbers, into, self.rows[: function.rows, :count], self.masks[: function.masks, :count]
        )

    def clear_invalid(self) -> None:
        """Write NaN for states without a pose, or without rates."""
        if self.status.any():
            for order, values in enumerate(self.values):
                np.copyto(values, np.nan, where=self.status >= (_TOGGLE if order else _OPEN))


def _array_program(path: Lowered, kinds: Sequence[Any]) -> _SolveProgram:
    """Return a path over arrays; kinds are the types of its inputs, or their constants."""
    (inputs, decisions, outputs, _), ends = path
    names = [driven.name for driven in inputs]
    named_kinds = list(zip(names, kinds, strict=True))
    form = ArrayForm({name: kind for name, kind in named_kinds if isinstance(kind, int)})
    arrays = [name for name, kind in named_kinds if kind is np.ndarray]
    holds: Number = True
    lost: list[Number] = [False] * len(_LOST)
    for (condition, held), fate in zip(decisions, ends, strict=True):
        if condition.name != 'finite':
            truth = form.rewrite_number(condition)
            falls = truth if held else form.logical_not(truth)
            leaves = form.logical_and(holds, form.logical_not(falls))
            holds = form.logical_and(holds, falls)
            for k, status in enumerate(_LOST):
                lost[k] = form.logical_or(
                    lost[k], form.logical_and(leaves, _leads_to_status(form, fate, status))
                )
    roots = [form.rewrite_number(number) for group in outputs for number in group]
    return _SolveProgram(
        BlockFunction(names, arrays, roots, holds), BlockFunction(names, arrays, lost)
    )


def _leads_to_status(form: ArrayForm, fallback: Tree, status: Status) -> Number:
    """Return the condition that a fallback leads to a status."""
    if not isinstance(fallback, DecisionBranch):
        return fallback is status
    condition = form.rewrite_number(fallback.condition)
    return form.logical_or(
        form.logical_and(condition, _leads_to_status(form, fallback.held, status)),
        form.logical_and(
            form.logical_not(condition), _leads_to_status(form, fallback.failed, status)
        ),
    )


def _has_huge(numbers: Sequence[Any], driven: int) -> bool:
    """Return whether a finite rate, or an acceleration after the rates, is huge."""
    for k, number in enumerate(numbers):
        values = np.atleast_1d(number)
        if values.strides == (0,):  # one number for all states
            values = values[:1]
        for start in range(0, len(values), BLOCK):
            part = values[start:][:BLOCK]
            # The sum of the squares is usually small: then it is the only pass over the memory.
            if not np.dot(part, part) < HUGE * HUGE and np.any(
                _are_huge(part, k < driven) & np.isfinite(part)
            ):
                return True
    return False


def _are_huge(values: Any, rates: bool) -> Any:
    return np.abs(values) >= (HUGE if rates else HUGE * HUGE)


def _broadcast_values(name: str, values: list[Any], driven: int, count: int | None) -> list[Array]:
    """Return an array for each driven joint; a scalar stays one if the count is known."""
    if len(values) != driven:
        raise ValueError(f'{name}: {len(values)} given; give {driven}, one for each driven joint')
    arrays = [to_doubles(name, value) for value in values]
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


def _result_arrays(width: int, count: int, derivatives: int, out: Batch | None) -> Batch:
    """Return the arrays for the results, from ``out`` where it has them, else new ones."""
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
