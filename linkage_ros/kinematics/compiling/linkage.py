# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A compiled linkage: a function that computes the requested numbers and nothing else."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import islice, product
from math import inf, pi, tau
from typing import NamedTuple, TYPE_CHECKING

from linkage_ros.kinematics.analysis.ranges import is_iterated
from linkage_ros.kinematics.analysis.sweep_analysis import usual_inputs
from linkage_ros.kinematics.arithmetic import UndecidedError
from linkage_ros.kinematics.compiling.python import (
    python_body,
    python_function,
    PythonBody,
    Values,
)
from linkage_ros.kinematics.compiling.trace import (
    motion_at,
    OutputSelection,
    Path,
    published_joints,
    trace_path,
)
from linkage_ros.kinematics.status import Status

if TYPE_CHECKING:
    from linkage_ros.kinematics.closure import Closure

_MOST_PATHS = 8
"""Most paths of a linkage; where none is valid, the interpreted steps answer."""

_TRIED = 64
"""Number of states at which paths are searched for."""

_TRIED_ITERATED = 2
"""The same for an iterated linkage, where one state may take a tenth of a second."""


class CompiledAnswer(NamedTuple):
    """
    The result of a compiled linkage at a state; status and gap are as in `Position`.

    The requested numbers are in groups; a group without a result is empty.
    """

    status: Status
    gap: float
    values: Values


class Compiled:
    """
    A linkage compiled for certain numbers.

    It has the arithmetic of the interpreted steps as straight-line code, and gives the same bits.
    Where that is not valid, at toggles, change points and where a loop is open, the interpreted
    steps answer.

    ``derivatives``: 0 for positions, 1 for velocities too, 2 for accelerations too. If
    ``within_limits``, a state with a joint beyond its limits has the status limited.
    ``given_count`` numbers and the motion are given to ``wanted``.
    """

    def __init__(
        self,
        closure: Closure,
        derivatives: int = 0,
        wanted: OutputSelection = published_joints,
        within_limits: bool = True,
        given_count: int = 0,
    ) -> None:
        self._closure = closure
        self._within_limits = within_limits
        self.driven = len(closure.linkage.inputs)  # Number of inputs
        self.derivatives = derivatives
        self._given_count = given_count
        self.wanted = wanted
        # The paths of the steps where the linkage is closed; several if the steps take different
        # forms in different regions.
        self.paths: list[Path] = []
        self._functions: list[Callable[..., Values | None]] = []
        self._bodies: dict[str, PythonBody] = {}
        for inputs in _trial_states(closure):
            self._add_path(inputs)
        if not self.paths and (self.driven > 1 or closure.input_ranges):
            # This starts an additional search, which takes longer.
            self._add_path(usual_inputs(closure))
        # Takes the inputs, their rates, their accelerations and the given numbers, in this order;
        # returns the values, or None if the interpreted steps must answer.
        self.fast: Callable[..., Values | None] = _first_of(self._functions)

    def _add_path(self, inputs: tuple[float, ...]) -> None:
        """Add the path that the steps take at a state, if it is closed and the path is new."""
        more = (1.25,) * (self.driven * self.derivatives + self._given_count)
        if len(self.paths) == _MOST_PATHS or any(
            function(*inputs, *more) is not None for function in self._functions
        ):
            return
        close = self._closure.position if self._within_limits else self._closure.close_unlimited
        if close(*inputs).status is Status.CLOSED:
            try:
                path = trace_path(
                    self._closure,
                    inputs,
                    self.derivatives,
                    self.wanted,
                    self._within_limits,
                    self._given_count,
                )
            except UndecidedError:
                return
            if path.outputs:
                self.paths.append(path)
                self._functions.append(python_function(path))

    def first_path_body(self, bail_out: str) -> PythonBody:
        """
        Return the first path as lines of Python, which are written once.

        ``bail_out`` is the statement that leaves the lines if the path is not valid.
        """
        if bail_out not in self._bodies:
            self._bodies[bail_out] = python_body(self.paths[0], bail_out)
        return self._bodies[bail_out]

    def __call__(self, *numbers: float) -> CompiledAnswer:
        """
        Return the answer at a state: inputs in [rad] or [m], then their rates, then accelerations.

        A rate or an acceleration that is not finite raises ValueError.
        """
        values = self.fast(*numbers)
        if values is not None:
            return CompiledAnswer(Status.CLOSED, 0.0, values)
        return self.run_interpreted(*numbers)

    def run_interpreted(self, *numbers: float) -> CompiledAnswer:
        """Return the result of the interpreted steps."""
        count = self.driven * (1 + self.derivatives)
        given = list(zip(*[iter(numbers[:count])] * self.driven, strict=True))
        motion = motion_at(self._closure, given, self._within_limits)
        status, gap = motion.position.status, motion.position.gap
        values = tuple(tuple(group) for group in self.wanted(motion, *numbers[count:]))
        groups = len(self.paths[0].outputs) if self.paths else 1 + self.derivatives
        return CompiledAnswer(status, gap, (*values, *((),) * (groups - len(values))))


def _first_of(
    functions: Sequence[Callable[..., Values | None]],
) -> Callable[..., Values | None]:
    """Return a function that tries functions in turn, until one has a result."""
    if len(functions) == 1:
        return functions[0]

    def first_result(*numbers: float) -> Values | None:
        for function in functions:
            values = function(*numbers)
            if values is not None:
                return values
        return None

    return first_result


def _trial_states(closure: Closure) -> Iterator[tuple[float, ...]]:
    """Yield inputs at which a linkage may be closed: at its pose, then in its ranges."""
    linkage = closure.linkage
    if linkage.pose is not None:
        yield linkage.pose.inputs
    count = _TRIED_ITERATED if is_iterated(closure) else _TRIED
    steps = max(2, round(count ** (1.0 / len(linkage.inputs))))
    ways = []
    for driven in linkage.inputs:
        low, high = driven.limits.low, driven.limits.high
        if driven.slider:
            far = 4.0 * closure.scale
            low, high = max(low, -far), min(high, far)
        else:
            low = low if low > -inf else (high - tau if high < inf else 0.0)
            high = high if high < inf else low + tau
        # Not at the middle or an end, where links may be collinear.
        ways.append([low + (high - low) * (i + 1.0 / pi) / steps for i in range(steps)])
    yield from islice(product(*ways), count)
