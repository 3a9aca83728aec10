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


"""Medians, quartiles and percentiles, and how they are written."""

from __future__ import annotations

from collections.abc import Sequence
from math import nan


def percentile(values: Sequence[float], percent: float) -> float:
    """Return a percentile, interpolated between neighbours; NaN of nothing."""
    if not values:
        return nan
    ordered = sorted(values)
    place = (len(ordered) - 1) * percent / 100.0
    below = int(place)
    above = min(below + 1, len(ordered) - 1)
    return ordered[below] + (place - below) * (ordered[above] - ordered[below])


def spread(values: Sequence[float], digits: int = 1) -> str:
    """Return median and quartiles as text."""
    low, middle, high = (percentile(values, p) for p in (25.0, 50.0, 75.0))
    if len(values) == 1:
        return f'{middle:.{digits}f}'
    return f'{middle:.{digits}f} ({low:.{digits}f}–{high:.{digits}f})'


def ratios(over: Sequence[float], under: Sequence[float]) -> list[float]:
    """Return the ratios of what was measured in turn; the quotient of medians would mix turns."""
    return [a / b for a, b in zip(over, under, strict=True)]
