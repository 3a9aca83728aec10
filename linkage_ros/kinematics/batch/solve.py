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

The steps are those of the closure, each made over into one that takes arrays. They are walked
block by block, so that what is between them stays in the cache, and memory does not grow with the
states beyond what is returned.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import Any, NamedTuple

from linkage_ros.kinematics.batch.arrays import (
    Array,
    BLOCK,
    Block,
    CLOSED,
    Codes,
    INDETERMINATE,
    OPEN,
    TOGGLE,
)
from linkage_ros.kinematics.batch.crank_rrr import ROWS
from linkage_ros.kinematics.batch.steps import over_arrays
from linkage_ros.kinematics.step import State, Step
import numpy as np
from numpy.typing import ArrayLike

Term = tuple[int, int, float, float]
"""A published joint as factor·(x[i] − x[j]) + constant."""


class Batch(NamedTuple):
    """
    Many states of a linkage.

    Attributes
    ----------
    status
        The status of each, as `arrays.CODES` has it: 0 is closed.
    positions
        Of the published joints, a row for each, in [rad] or [m]; NaN in a state that is open or
        indeterminate.
    velocities, accelerations
        Likewise, in [rad/s] or [m/s], [rad/s²] or [m/s²]; NaN at a toggle, too. None where they
        were not asked for.

    """

    status: Codes
    positions: Array
    velocities: Array | None = None
    accelerations: Array | None = None


class Solver:
    """
    The steps of a closure over arrays.

    Parameters
    ----------
    steps
        The closure's.
    terms
        The published joints.
    factors
        What makes the value of each driven joint a coordinate.

    """

    def __init__(
        self, steps: Sequence[Step], terms: Sequence[Term], factors: Sequence[float]
    ) -> None:
        self._steps = [over_arrays(step) for step in steps]
        self._terms = terms
        self._factors = factors
        used = [i for term in terms for i in term[:2]]
        self._own = [(k, i) for k, (i, *_) in enumerate(terms) if used.count(i) == 1]

    def solve(
        self,
        inputs: Sequence[ArrayLike],
        rates: Any,
        accelerations: Any,
        derivatives: int,
        out: Batch | None,
    ) -> Batch:
        """Solve all states, as `Closure.solve` says."""
        if derivatives not in (0, 1, 2):
            raise ValueError(f'derivatives: {derivatives!r} is none of 0, 1, 2')
        driven = len(self._factors)
        if rates is None and derivatives and len(inputs) == driven:
            if driven > 1:
                raise ValueError(f'rates: give one for each of the {driven} driven joints')
            rates = 1.0
        if accelerations is None:
            accelerations = [0.0] * driven
        motion = [_numbers('inputs', list(inputs), driven, None)]
        count = len(motion[0][0])
        for name, values in (('rates', rates), ('accelerations', accelerations))[:derivatives]:
            # That of a single one may stand without a list.
            alone = np.ndim(values) < 2 if driven == 1 else not np.iterable(values)
            each = [values] if alone else list(values)
            motion.append(_numbers(name, each, driven, count))
        batch = _room(len(self._terms), count, derivatives, out)
        scratch = np.empty((ROWS, min(count, BLOCK)))
        with np.errstate(all='ignore'):
            for start in range(0, count, BLOCK):
                self._solve(motion, batch, slice(start, min(start + BLOCK, count)), scratch)
        return batch

    def _solve(self, motion: list[list[Array]], batch: Batch, part: slice, scratch: Array) -> None:
        """Solve one block."""
        states = []
        for values in motion:
            numbers: list[Any] = [0.0]
            for value, factor in zip(values, self._factors, strict=True):
                number = value[part] if value.ndim else float(value)
                numbers.append(number if factor == 1.0 else number * factor)
            states.append(State(numbers, []))
        known: Any
        known, speeds, changes, *_ = *states, None, None
        status = batch.status[part]
        status.fill(CLOSED)
        for given in known.coordinates[1:]:
            if not isfinite(given.sum()):
                status[~np.isfinite(given)] = INDETERMINATE
        # A row is the place of its coordinate where no other joint needs that.
        rows = [array[:, part] for array in batch[1:] if array is not None]
        places = [{i: array[k] for k, i in self._own} for array in rows]
        block = Block(known, speeds, changes, status, scratch, places)
        for step in self._steps:
            step.solve(block)
        failed = status.any()
        for order, (state, array, own) in enumerate(zip(states, rows, places, strict=True)):
            x: list[Any] = state.coordinates
            for row, (i, j, factor, constant) in zip(array, self._terms, strict=True):
                into = own.get(i, row)
                if j or x[i] is not into:
                    np.subtract(x[i], x[j], out=into)
                if factor != 1.0:
                    np.multiply(into, factor, out=into)
                if constant and not order:
                    np.add(into, constant, out=into)
                if failed:
                    np.copyto(into, np.nan, where=status >= (TOGGLE if order else OPEN))


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


def _room(joints: int, count: int, derivatives: int, out: Batch | None) -> Batch:
    """Return the arrays that the results go to: those given, as far as they are."""
    arrays: list[Any] = []
    given = out or (None,) * 4
    for k, (name, array) in enumerate(zip(Batch._fields, given, strict=True)):
        kind: Any = np.float64 if k else np.uint8
        shape = (joints, count) if k else (count,)
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
