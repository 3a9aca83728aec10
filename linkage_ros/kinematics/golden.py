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


"""The lowest value of a function between two places, by golden sections (Kiefer, 1953)."""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt

_RATIO = (sqrt(5.0) - 1.0) / 2.0


def golden(function: Callable[[float], float], low: float, high: float) -> tuple[float, float]:
    """Return the lowest value between two places, and where it is."""
    one, other = high - _RATIO * (high - low), low + _RATIO * (high - low)
    at_one, at_other = function(one), function(other)
    for _ in range(80):
        if not low < one < other < high:
            break
        if at_one <= at_other:
            high, other, at_other = other, one, at_one
            one = high - _RATIO * (high - low)
            at_one = function(one)
        else:
            low, one, at_one = one, other, at_other
            other = low + _RATIO * (high - low)
            at_other = function(other)
    return min((at_one, one), (at_other, other))
