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
from typing import Any

from linkage_ros.kinematics.compiled.python import python_function
from linkage_ros.kinematics.compiled.tape import Tape
from linkage_ros.kinematics.compiled.trace import number_of, Path


def straight(
    function: Callable[..., Sequence[float]], values: Sequence[complex]
) -> Callable[..., tuple[float, ...]]:
    """
    Return a function that does to the last bit what another does.

    Parameters
    ----------
    function
        Takes numbers and returns numbers. It decides nothing by them.
    values
        Arguments for which it is known to work, each real or complex as they all will be.

    """
    tape = Tape()
    given = [tape.given(f'x{i}', value) for i, value in enumerate(values)]
    found = function(*given)
    if tape.decisions:
        raise ValueError('the function decides by its arguments, and has no straight line')
    outputs = tuple(map(number_of, found))
    path = Path(tuple(one.operation for one in given), (), (outputs,), tape)
    line = python_function(path)

    def numbers(*arguments: Any) -> tuple[float, ...]:
        (group,) = line(*arguments) or ((),)
        return group

    return numbers
