# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Units of the lengths and angles of a file: ``units: mm``, ``angles: degrees``.

Values are converted to SI once, when they are read. The number that the file shows, a decimal, is
multiplied exactly and rounded once: 40 mm is the same double as 0.040 m.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Context, Decimal
from math import isfinite
import re

LENGTHS = {
    'm': Decimal(1),
    'cm': Decimal('0.01'),
    'mm': Decimal('0.001'),
    'in': Decimal('0.0254'),
}
"""The units of length that a file can name, in [m]."""

ANGLES = ('radians', 'degrees')
"""The units of angle that a file can name."""

_DEGREE = Decimal('0.017453292519943295769236907684886127134428718885417')
"""π/180."""

_EXACT = Context(prec=80)
"""No product of a double's shortest text and a factor above is longer."""

_CONVERTED = re.compile(r'(rad|m)(/s²|/s|/√s|)')
_NUMBER = r'-?(?:inf|\d[\d.]*(?:e[-+]?\d+)?)'
_QUANTITY = re.compile(
    rf'({_NUMBER}(?: to {_NUMBER})?|\[[^][]*\]) ((?:rad|m)(?:/s²|/s)?)(?![\w·/²])'
)


def unit_of(column: str) -> str:
    """Return the unit in the heading of a column: 's' for 'time [s]'."""
    return column.partition('[')[2].rstrip(']')


@dataclass(frozen=True, slots=True)
class Units:
    """
    The units of a file.

    Units of parameters are named in SI. Converted are m and rad, and these by time: m/s, m/s²,
    m/√s. All others (N·m/rad, kg·m²) stay as they are.
    """

    # A key of `LENGTHS`, and one of `ANGLES`.
    length: str = 'm'
    angle: str = 'radians'
    # Whether a value for a joint ('rad or m') is for a slide; None if it is for joints of both
    # kinds.
    slides: bool | None = None

    @property
    def is_si(self) -> bool:
        """Whether nothing is converted."""
        return (self.length, self.angle) == ('m', 'radians')

    def file_unit(self, unit: str) -> str:
        """Return the file's unit for a unit in SI: 'mm/s' for 'm/s'."""
        if self.is_si:
            return unit
        return ' or '.join(map(self._converted_unit, self._unit_alternatives(unit)))

    def is_ambiguous(self, unit: str) -> bool:
        """Return whether the same number would be two quantities, of an angle and of a slide."""
        return len({self._si_factor(name) for name in self._unit_alternatives(unit)}) > 1

    def to_si(self, value: float, unit: str) -> float:
        """Return a value of the file in SI, correctly rounded."""
        factor = self._si_factor(self._unit_alternatives(unit)[0])
        if factor == 1 or not isfinite(value):
            return value
        return float(_EXACT.multiply(Decimal(repr(value)), factor))

    def to_file_unit(self, value: float, unit: str) -> float:
        """Return a value in SI in the file's unit, for messages and tables."""
        return value / self.si_per_unit(unit) if isfinite(value) else value

    def si_per_unit(self, unit: str) -> float:
        """Return how many of a unit in SI are one of the file's unit."""
        return float(self._si_factor(self._unit_alternatives(unit)[0]))

    def convert_quantities(self, text: str) -> str:
        """
        Return a text whose quantities in SI have these units.

        Quantities are ``1.5 rad``, ``0 to 2 m`` and ``[0, 2] m``; a unit in brackets stays.
        """
        return text if self.is_si else _QUANTITY.sub(self._converted_quantity, text)

    def _converted_quantity(self, match: re.Match[str]) -> str:
        numbers, unit = match.groups()
        if self.si_per_unit(unit) == 1.0:
            return match[0]
        # One digit less than the text has: 1.5708 rad are 90 deg.
        values = re.sub(
            _NUMBER, lambda number: f'{self.to_file_unit(float(number[0]), unit):.5g}', numbers
        )
        return f'{values} {self.file_unit(unit)}'

    def _unit_alternatives(self, unit: str) -> Sequence[str]:
        """Return the alternatives of a unit that a value can have: of an angle, and of a slide."""
        both = unit.split(' or ')
        if self.slides is None or not all(map(_CONVERTED.fullmatch, both)):
            return both
        return both[-1:] if self.slides else both[:1]

    def _si_factor(self, unit: str) -> Decimal:
        match = _CONVERTED.fullmatch(unit)
        if match is None:
            return Decimal(1)
        if match[1] == 'm':
            return LENGTHS[self.length]
        return _DEGREE if self.angle == 'degrees' else Decimal(1)

    def _converted_unit(self, unit: str) -> str:
        match = _CONVERTED.fullmatch(unit)
        if match is None:
            return unit
        angle = 'deg' if self.angle == 'degrees' else 'rad'
        return (self.length if match[1] == 'm' else angle) + match[2]


_SMALLEST = Units('mm', 'degrees')


def most_in_one(unit: str) -> float:
    """Return how many of the smallest units that a file can name make one unit in SI."""
    return max(_SMALLEST.to_file_unit(1.0, alternative) for alternative in unit.split(' or '))
