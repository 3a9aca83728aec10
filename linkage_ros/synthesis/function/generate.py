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


"""Function generation: a four-bar whose rocker follows a function of its crank."""

from __future__ import annotations

from linkage_ros.errors import quoted, SynthesisError
from linkage_ros.synthesis.design import Design
from linkage_ros.synthesis.function.expression import Expression
from linkage_ros.synthesis.function.task import chebyshev, FunctionTask, pairs, Range
from linkage_ros.synthesis.pairs.freudenstein import exact


def generate_function(
    function: str,
    x_range: Range,
    crank_range: Range,
    rocker_range: Range,
    *,
    points: int = 3,
    ground: float = 1.0,
) -> Design:
    """
    Design a four-bar that computes a function.

    With three precision points it meets them exactly, by Freudenstein's equation; with more points
    it is the nearest four-bar, which needs scipy.

    Parameters
    ----------
    function
        Function of x, such as ``'log10(x)'``.
    x_range
        First and last x.
    crank_range, rocker_range
        Angles of crank and rocker there, in [rad].
    points
        Number of precision points, spaced by `chebyshev`.
    ground
        Length of the ground, in [m].

    Raises
    ------
    SynthesisError
        If the function or a range is invalid, or no four-bar of finite links exists.
    LinkageError
        If scipy is needed and not installed.
    TypeError
        If the function is not a string.

    """
    if not isinstance(function, str):
        raise TypeError(f"function: {quoted(function)} is not a text; write it as 'log10(x)'")
    if points < 3:
        raise SynthesisError('points', f'there are {points}', 'ask for 3 or more')
    task = FunctionTask(Expression(function), x_range, crank_range, rocker_range)
    crank, rocker = pairs(task, chebyshev(*x_range, points))
    if points > 3:
        from linkage_ros.synthesis.pairs.angle_fit import nearest  # local import: to fit only

        return nearest(crank, rocker, ground)
    design, _ = exact(crank, rocker, ground)
    return design
