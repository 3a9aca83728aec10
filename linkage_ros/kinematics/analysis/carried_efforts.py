# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Efforts at some joints as those at others that do the same work, without masses and friction.

The rates of joints are J·q̇ of the inputs. By virtual work efforts τ at joints are Jᵀ·τ at the
inputs; and those at as many joints as there are inputs follow from Jᵀ·τ, solved for τ (J. J.
Craig, Introduction to Robotics, 4th ed., 2017, ch. 5). Power is the same on both sides.

Where a joint stands though inputs move, or moves though these stand, an effort there would be any.
None is given where it could be more than a million times what it comes from, with lengths in units
of the linkage's size: long before, play and elasticity decide in every machine.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from math import sin
from operator import mul
from typing import Any, TYPE_CHECKING

from linkage_ros.errors import DefinitionError, did_you_mean, list_names
from linkage_ros.kinematics.arithmetic import all_finite, call, has_result
from linkage_ros.kinematics.iterated.elimination import Elimination

if TYPE_CHECKING:
    from linkage_ros.kinematics.closure import Closure
    from linkage_ros.kinematics.results import Position

_MOST = 1e6
"""Greatest effort that an effort of 1 may come to."""


class CarriedEfforts:
    """
    Efforts at some joints of a closure as those at others, inputs among them.

    Parameters
    ----------
    closure
        The closure, with all of these joints.
    given
        Names of the joints at which efforts are given.
    wanted
        Names of as many joints as there are inputs.

    Raises
    ------
    DefinitionError
        If a name is not among the joints, or there are too few or too many of them.

    """

    def __init__(self, closure: Closure, measured: Sequence[str], wanted: Sequence[str]) -> None:
        self._closure = closure
        inputs = closure.linkage.inputs
        turning = dict(zip(closure.joint_names, closure.turning, strict=True))
        turning |= {driven.joint: not driven.slider for driven in inputs}
        units = {name: 1.0 if turns else closure.scale for name, turns in turning.items()}
        for name in (*measured, *wanted):
            if name not in units:
                remedy = did_you_mean(name, units, f'it has {list_names(units)}')
                raise DefinitionError(name, 'is not a joint of the linkage', remedy)
        if len({*wanted}) != len(inputs) or len(wanted) != len(inputs):
            count = f'{len(inputs)} input{"s" * (len(inputs) != 1)}'
            names = list_names(wanted) or 'no joint'
            raise DefinitionError(names, f'for {count}', f'name {len(inputs)} different joints')
        self._inputs = [(driven.joint, units[driven.joint]) for driven in inputs]
        self._given = [(name, units[name]) for name in measured]
        self._wanted = [(name, units[name]) for name in wanted]
        self._solve = None if self._wanted == self._inputs else _compile_inverse(len(inputs))

    def carry_from(self, position: Position, efforts: Sequence[float]) -> tuple[float, ...]:
        """Return the wanted efforts, in [N·m] or [N]; empty where they are not determined."""
        if not (position.status.has_rates and all_finite(efforts)):
            return ()
        of_inputs = [self._slopes(position, k) for k in range(len(self._inputs))]
        numbers = [*efforts, *chain.from_iterable(of_inputs)]
        found: Any = call(self._carry, *numbers) if all_finite(numbers) else None
        if not has_result(found):
            return ()
        return tuple([found[k] for k in range(len(self._wanted))])

    def _slopes(self, position: Position, number: int) -> list[float]:
        """Return the slopes of the given joints, then of the wanted ones, by an input."""
        closure = self._closure
        rates = [unit if k == number else 0.0 for k, (_, unit) in enumerate(self._inputs)]
        moved = closure.velocity(position, *rates).joints
        known = dict(zip(closure.joint_names, moved, strict=True))
        known |= {name: rate for (name, _), rate in zip(self._inputs, rates, strict=True)}
        joints = self._given if self._solve is None else self._given + self._wanted
        return [known[name] / unit for name, unit in joints]

    def _carry(self, *numbers: float) -> tuple[float, ...] | None:
        """Return the wanted efforts of the given ones and the slopes; None if undetermined."""
        count = len(self._given)
        efforts = [of * unit for of, (_, unit) in zip(numbers, self._given, strict=False)]
        width = (len(numbers) - count) // len(self._inputs)
        rows = [*zip(*[iter(numbers[count:])] * width, strict=True)]
        slopes = [row[:count] for row in rows]
        if max(map(abs, chain.from_iterable(slopes))) > _MOST:
            return None
        carried = [
            sum(of * slope for of, slope in zip(efforts, row, strict=True)) for row in slopes
        ]
        if self._solve is not None:
            try:
                inverse = self._solve(*chain.from_iterable(row[count:] for row in rows))
            except ArithmeticError:
                return None
            if inverse is None or not all(abs(entry) <= _MOST for entry in inverse[0]):
                return None
            n = len(rows)
            carried = [sum(map(mul, carried, inverse[0][k::n])) for k in range(n)]
        return tuple(of / unit for of, (_, unit) in zip(carried, self._wanted, strict=True))


def _compile_inverse(count: int) -> Any:
    """Return the inverse of a matrix (count, count) as straight-line code, column by column."""
    from linkage_ros.kinematics.compiling import compile_line  # local import: it traces

    def invert(*entries: Any) -> list[Any]:
        matrix = Elimination([*zip(*[iter(entries)] * count, strict=True)], ())
        units = ([float(i == k) for i in range(count)] for k in range(count))
        return [*chain.from_iterable(map(matrix.solve, units))]

    # Numbers without a pattern, so that no decision is made by chance.
    return compile_line(invert, [sin(1.0 + 1.7 * i * i) for i in range(count * count)])
