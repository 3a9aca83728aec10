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


"""A function of numbers, made a straight line: without its loops, lists and calls."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from linkage_ros.kinematics.compiling.python import python_function
from linkage_ros.kinematics.compiling.tape import Operation, Tape
from linkage_ros.kinematics.compiling.trace import number_of, Path


class Line(NamedTuple):
    """
    A function as a straight line.

    Attributes
    ----------
    varying
        Takes the arguments and returns those results that depend on them.
    places
        The numbers of these among all results.
    results
        All results, with 0 in the place of those that vary.

    """

    varying: Callable[..., tuple[float, ...]]
    places: tuple[int, ...]
    results: tuple[float, ...]


def straight(function: Callable[..., Sequence[float]], values: Sequence[complex]) -> Line:
    """
    Return a function as a straight line, which has the same bits.

    Parameters
    ----------
    function
        Takes numbers and returns numbers. It decides nothing by them.
    values
        Arguments for which it is known to work, each real or complex as they all will be.

    """
    tape = Tape()
    given = [tape.given(f'x{i}', value) for i, value in enumerate(values)]
    found = [number_of(number) for number in function(*given)]
    if tape.decisions:
        raise ValueError('the function decides by its arguments, and has no straight line')
    places = tuple(i for i, number in enumerate(found) if isinstance(number, Operation))
    inputs = tuple(one.operation for one in given)
    line = python_function(Path(inputs, (), (tuple(found[i] for i in places),), tape))

    def varying(*arguments: Any) -> tuple[float, ...]:
        (group,) = line(*arguments) or ((),)
        return group

    constants = tuple(0.0 if isinstance(number, Operation) else number for number in found)
    return Line(varying, places, constants)
