# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Power series in time on a tape, which has their derivatives by all that was given: the reference.

A number is a power series in balls (FLINT's Arb): velocity and acceleration are read from its
second and third coefficients, and a ball encloses its exact value, so the number of correct digits
is proven. A tape keeps what each was made of, δy(t) = Re Σ slope(t)·δx(t), with slopes that are
power series as well. So one way back from a result has its derivatives by all that is given, and
with them its condition number κ = Σ|xᵢ ∂y/∂xᵢ| + |y|. Nothing is differentiated by hand.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from flint import acb, acb_series, arb, arb_series, ctx

ORDER = 3
FACTORIALS = (1.0, 1.0, 2.0)
UNIT_ROUNDOFF = 2.0**-53
PRECISIONS = (256, 512, 1024, 2048, 4096)
"""In bits. The next precision is used if a result has fewer than 50 proven digits."""

CORRECT = 2.0**-163
"""Maximum width of a result's enclosure, relative to κ, with u = 2⁻⁵³: fifty digits."""

_I = acb(0, 1)


def conjugate(series: Any) -> Any:
    """Return the complex conjugate at every time."""
    return acb_series([c.conjugate() for c in series.coeffs()])


def real(series: Any) -> Any:
    """Return the real part at every time, as a complex series."""
    return acb_series([c.real for c in series.coeffs()])


def real_series(series: Any) -> Any:
    """Return the real part at every time, as a real series."""
    return arb_series([c.real for c in series.coeffs()])


class Tape:
    """All series of a case, in the order in which they are made."""

    def __init__(self, precision: int = PRECISIONS[0]) -> None:
        ctx.prec, ctx.cap = precision, ORDER
        # Of each series: index, slope, and whether the slope is that of the conjugate.
        self.sources: list[tuple[tuple[int, Any, bool], ...]] = []
        # By which κ varies what is given, in each order; of a complex number both its parts.
        self.widths: dict[int, Sequence[complex]] = {}
        self.real: set[int] = set()  # Those of the complex series that are real

    def number(self, *motion: Any) -> Series:
        """Return a given number, or value, rate and acceleration of a given motion."""
        orders = [arb(part) / factor for part, factor in zip(motion, FACTORIALS, strict=False)]
        series = Series(self, arb_series(orders))
        self.widths[series.index] = [abs(float(part)) for part in motion]
        return series

    def change(self, widths: Sequence[complex]) -> Series:
        """Return a 0 by whose changes a passed result is rounded, in each order."""
        series = self.constant(0)
        self.widths[series.index] = widths
        return series

    def constant(self, value: Any) -> Series:
        """Return a complex number that is exact."""
        return Series(self, acb_series([value]))

    def point(self, x: Any, y: Any) -> Series:
        """Return a given place in the plane, as a complex number."""
        series = self.constant(acb(x, y))
        self.widths[series.index] = [complex(abs(float(x)), abs(float(y)))]
        return series

    def row(self, *motion: Sequence[Any]) -> Row:
        """Return a given vector, or a moving point."""
        return [self.number(*parts) for parts in zip(*motion, strict=True)]

    def distance(self, one: Sequence[float], other: Sequence[float]) -> Series:
        """Return the exact distance of two places, as a number of its own."""
        squares = ((arb(a) - arb(b)) ** 2 for a, b in zip(one, other, strict=True))
        return self.number(sum(squares, arb(0)).sqrt())


class Series:
    """A power series in time on a tape, made of others."""

    __slots__ = ('index', 'tape', 'value')

    def __init__(
        self,
        tape: Tape,
        value: Any,
        *sources: tuple[Series, Any],
        is_real: bool = False,
        conjugated: bool = False,
    ) -> None:
        self.tape, self.value, self.index = tape, value, len(tape.sources)
        tape.sources.append(tuple([(one.index, slope, conjugated) for one, slope in sources]))
        if is_real:
            tape.real.add(self.index)

    def __add__(self, other: Series | Any) -> Series:
        if not isinstance(other, Series):
            return Series(self.tape, self.value + other, (self, 1))
        return Series(self.tape, self.value + other.value, (self, 1), (other, 1))

    def __sub__(self, other: Series) -> Series:
        return Series(self.tape, self.value - other.value, (self, 1), (other, -1))

    def __mul__(self, other: Series | Any) -> Series:
        if not isinstance(other, Series):
            return Series(self.tape, self.value * other, (self, other))
        a, b = self.value, other.value
        return Series(self.tape, a * b, (self, b), (other, a))

    def __truediv__(self, other: Series) -> Series:
        part = other.value.inv()
        value = self.value * part
        return Series(self.tape, value, (self, part), (other, -value * part))

    def __neg__(self) -> Series:
        return Series(self.tape, -self.value, (self, -1))

    def sqrt(self) -> Series:
        """Return the root."""
        value = self.value.sqrt()
        return Series(self.tape, value, (self, 0.5 * value.inv()))

    def cos_sin(self) -> tuple[Series, Series]:
        """Return cosine and sine."""
        s, c = self.value.sin_cos()
        return Series(self.tape, c, (self, -s)), Series(self.tape, s, (self, c))

    def direction(self) -> Series:
        """Return e^iθ of a given angle θ."""
        s, c = self.value.sin_cos()
        value = acb_series(s) * _I + c
        return Series(self.tape, value, (self, value * _I))

    def conjugate(self) -> Series:
        """Return the complex conjugate."""
        return Series(self.tape, conjugate(self.value), (self, acb(1)), conjugated=True)

    def norm(self) -> Series:
        """Return the square of the modulus."""
        conjugated = conjugate(self.value)
        product = real(self.value * conjugated)
        return Series(self.tape, product, (self, 2 * conjugated), is_real=True)

    def part(self, way: Any = 1) -> Series:
        """Return the real part; with a ``way``, that of its product with it."""
        return Series(self.tape, real(self.value * way), (self, way), is_real=True)

    def imag(self) -> Series:
        """Return the imaginary part."""
        return self.part(-_I)

    def turning(self) -> Series:
        """Return the angle of a unit vector in time."""
        # The branch cut of the logarithm is turned away from the direction.
        if self.value[0].real < 0:
            angle = real(-_I * (-self.value).log()) + arb.pi()
        else:
            angle = real(-_I * self.value.log())
        return Series(self.tape, angle, (self, -_I * conjugate(self.value)), is_real=True)

    def slopes(self) -> list[Any]:
        """Return the derivative by each series of the tape up to this one; None if it is 0."""
        found: list[Any] = [None] * (self.index + 1)
        found[-1] = 1 + 0 * self.value
        for index in range(self.index, -1, -1):
            slope = found[index]
            if slope is None:
                continue
            if index in self.tape.real:
                slope = found[index] = real(slope)
            for source, factor, conjugated in self.tape.sources[index]:
                more, before = slope * factor, found[source]
                if conjugated:
                    more = conjugate(more)
                found[source] = more if before is None else before + more
        return found

    def orders(self) -> list[Any]:
        """Return value, rate and acceleration; of a complex number their real parts."""
        return [self.value[k].real * factor for k, factor in enumerate(FACTORIALS)]

    def changes(
        self,
        widths: Mapping[int, Sequence[complex]],
        ties: Sequence[Mapping[int, complex]] = (),
    ) -> list[float]:
        """
        Return for each order the sum of its changes, as each given one changes by a width.

        ``ties`` are changes of several given numbers at once.
        """
        slopes, sums = self.slopes(), [0.0] * ORDER
        for index, motion in widths.items():
            slope = slopes[index] if index <= self.index else None
            if slope is None:
                continue
            parts = [complex(slope[k]) for k in range(ORDER)]
            for m, width in enumerate(motion):
                x, y = width.real, width.imag
                for k in range(m, ORDER) if width else ():
                    change = abs(parts[k - m].real) * x + abs(parts[k - m].imag) * y
                    sums[k] += FACTORIALS[k] / FACTORIALS[m] * change
        for tie in ties:
            known = [(slopes[at], size) for at, size in tie.items() if at <= self.index]
            tied = [(slope, acb(size)) for slope, size in known if slope is not None]
            for k in range(ORDER):
                sums[k] += FACTORIALS[k] * abs(float(sum((s[k] * n).real for s, n in tied)))
        return sums

    def sizes(self, widths: Mapping[int, Sequence[complex]]) -> list[float]:
        """Return for each order its size and its changes, as each given one changes by a width."""
        pairs = zip(self.orders(), self.changes(widths), strict=True)
        return [abs(float(order)) + change for order, change in pairs]


Row = list[Series]
