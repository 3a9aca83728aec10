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
Integration of the rates: where the joints come to, if only their velocities are solved for.

From state to state the links' angles and places go in steps of equal length, by Euler's method or
the classical one of Runge and Kutta, from an exact start. Nothing closes the loops again, unless a
step of Newton's method after each step does (projection).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from linkage_ros.accuracy.solving.methods.method import Joints, Method
from linkage_ros.accuracy.solving.methods.velocity_equations import VelocityEquations
from linkage_ros.accuracy.solving.poses import Poses
import numpy as np

Slope = Callable[[Any, float], Any]
"""Takes the unknowns and the part of the step, 0 to 1; returns what they change by in a step."""

ORDERS = {'Euler': 1, 'Runge-Kutta 4': 4}

STEPS = (1, 4, 16, 64)
"""Between two states."""


def integrations(path: Poses, quick: bool) -> Iterator[Method]:
    """
    Yield the methods; their positions hold along a path, from its first state on.

    Parameters
    ----------
    path
        States that follow each other.
    quick
        Whether a few steps are to do.

    """
    for name in ORDERS:
        for projected in (False, True):
            for steps in STEPS[:2] if quick else STEPS:
                yield integration(path, name, steps, projected)


def integration(path: Poses, name: str, steps: int, projected: bool) -> Method:
    """Return one of them, with so many steps between two states."""
    rules = VelocityEquations(path.linkage)
    first = path.inputs[0]
    last, unknowns = first, rules.start(first)
    step = _euler if name == 'Euler' else _runge_kutta

    def position(*inputs: float) -> Joints:
        nonlocal last, unknowns
        if inputs == first:
            last, unknowns = first, rules.start(first)
            return rules.joints(unknowns, inputs)
        begin, span = last, [b - a for a, b in zip(last, inputs, strict=True)]
        part = [s / steps for s in span]
        for k in range(steps):

            def at(done: float, k: int = k) -> list[float]:
                return [a + s * (k + done) / steps for a, s in zip(begin, span, strict=True)]

            def slope(x: Any, done: float, at: Callable[[float], list[float]] = at) -> Any:
                return rules.rates(x, at(done), part)

            try:
                unknowns = step(slope, unknowns)
                if projected:
                    unknowns = rules.corrected(unknowns, at(1.0))
            except np.linalg.LinAlgError:
                return ()
        last = inputs
        return rules.joints(unknowns, inputs)

    named = f'{name}, projected' if projected else name
    return Method(named, f'{steps * (len(path.inputs) - 1)} steps', position, remembers=True)


def _euler(slope: Slope, x: Any) -> Any:
    return x + slope(x, 0.0)


def _runge_kutta(slope: Slope, x: Any) -> Any:
    k1 = slope(x, 0.0)
    k2 = slope(x + 0.5 * k1, 0.5)
    k3 = slope(x + 0.5 * k2, 0.5)
    k4 = slope(x + k3, 1.0)
    return x + (k1 + 2.0 * (k2 + k3) + k4) / 6.0
