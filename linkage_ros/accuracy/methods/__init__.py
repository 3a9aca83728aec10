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
A method of closing the loops of a linkage, in the form in which it is measured.

All methods have the same signatures, so a loop over states costs the same for each.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

Joints = Sequence[Any]
"""Values of the published joints; empty if the method has no answer."""

Motion = tuple[Joints, Joints, Joints]
"""Joints, rates and accelerations."""

RATE, ACCELERATION = 1.0, 0.5
"""Rate of each driven joint where motions are compared, [rad/s] or [m/s], and acceleration."""

NOTHING: Motion = ((), (), ())


class Method(NamedTuple):
    """A method with a setting, for one linkage."""

    name: str  # Name of the method
    setting: str = ''  # The setting, as text; '' for none
    # Takes the inputs of one state; None if single states are never solved.
    position: Callable[..., Joints] | None = None
    # The same with rates and accelerations, at `RATE` and `ACCELERATION` of the inputs.
    motion: Callable[..., Motion] | None = None
    # Takes an array for each input and the number of derivatives; returns arrays of joints and
    # their derivatives, each of shape (joints, states).
    batch: Callable[[Sequence[Any], int], Sequence[Any]] | None = None
    memory: int | None = None  # Memory that it needs, in [bytes]; None if negligible
    build: float | None = None  # Time to build it, in [s]; None if negligible
    remembers: bool = False  # Whether an answer depends on the previous states
    # Whether a position comes with its rates and accelerations, in one call.
    together: bool = False
