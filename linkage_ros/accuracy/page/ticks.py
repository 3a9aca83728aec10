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


"""Where an axis has its ticks, and what they say."""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil, floor, log10

from linkage_ros.accuracy.page.places import Range

_MOST = 8
_SLACK = 1e-9
"""Of a step: what rounding may take from an end of the axis."""

_SUPERSCRIPT = str.maketrans('-0123456789', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹')
_PLAIN = (-2, 4)
"""Powers of ten that are written out."""


def ticks(shown: Range) -> list[tuple[float, str]]:
    """Return the ticks of an axis: where, and the text."""
    if not shown.axis.logarithmic:
        return list(_even(shown.low, shown.high))
    first, last = ceil(log10(shown.low) - _SLACK), floor(log10(shown.high) + _SLACK)
    if last - first >= 3:
        step = ceil((last - first) / _MOST)
        # Multiples of the step, so that 1 is among them where it is in the range.
        return [(10.0**n, _power(n)) for n in range(ceil(first / step) * step, last + 1, step)]
    digits = ((1, 2, 5), (1, 2, 3, 5, 7))[last - first < 1]
    values = [digit * 10.0**n for n in range(first - 1, last + 1) for digit in digits]
    within = [value for value in values if shown.low <= value <= shown.high]
    if len(within) >= 2:
        return [(value, _text(value)) for value in within]
    return list(_even(shown.low, shown.high))


def _even(low: float, high: float) -> Iterator[tuple[float, str]]:
    """Yield ticks at equal distances, each one of 1, 2 or 5 times a power of ten."""
    rough = (high - low) / _MOST
    scale = 10.0 ** floor(log10(rough))
    step = next(factor * scale for factor in (1, 2, 5, 10) if factor * scale >= rough)
    decimals = max(0, -floor(log10(step)))
    for number in range(ceil(low / step - _SLACK), floor(high / step + _SLACK) + 1):
        value = number * step
        plain = decimals <= 6 and abs(value) < 1e6
        yield value, f'{value + 0.0:.{decimals}f}' if plain else f'{value:.4g}'


def _power(exponent: int) -> str:
    low, high = _PLAIN
    if low <= exponent <= high:
        return f'{10.0**exponent:g}'
    return f'10{str(exponent).translate(_SUPERSCRIPT)}'


def _text(value: float) -> str:
    exponent = floor(log10(value) + _SLACK)
    low, high = _PLAIN
    if low <= exponent <= high:
        return f'{value:g}'
    digit = round(value / 10.0**exponent)
    return _power(exponent) if digit == 1 else f'{digit}·{_power(exponent)}'
