# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Cost of rounding in three-point synthesis: Freudenstein's equation with any number of digits.

All other steps are computed with 50 digits, so that the error comes from the rounding alone. Few
digits are used for docs/synthesis.md only; the package has no such mode.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import NamedTuple

from linkage_ros.tools.design import three_pairs
from mpmath import mp, mpf
import numpy as np
from numpy.typing import NDArray

Degrees = Sequence[float]
Row = tuple[mpf, mpf, mpf]

PRECISION = 50
COUPLER = 1

# The random designs.
SEED = 5
SPAN = (20.0, 120.0)
MIDDLE = (0.25, 0.75)
LARGEST_RATIO = 20.0


class Rounded(NamedTuple):
    """A design from rounded numbers."""

    # Lengths of crank, coupler and rocker for a ground of 1; None if the coupler is imaginary.
    lengths: tuple[mpf, mpf, mpf] | None
    off: tuple[mpf, mpf, mpf]  # Their relative errors; infinite without a linkage
    # The greatest error of the rocker's angle at the pairs, each in the better assembly, in
    # degrees; infinite if the linkage is open at a pair.
    missed: mpf
    reached: tuple[bool, ...]  # Whether it closes at each of the pairs


def round_to(value: mpf, decimals: int) -> mpf:
    """Round to a number of decimals, as on paper."""
    unit = mpf(10) ** decimals
    return mp.nint(value * unit) / unit


def equations(crank: Sequence[mpf], rocker: Sequence[mpf], decimals: int | None) -> list[Row]:
    """Return cos φ, cos θ and cos(θ − φ) of pairs in degrees, rounded or not."""
    return [
        tuple(
            cosine if decimals is None else round_to(cosine, decimals)
            for cosine in (mp.cos(mp.radians(angle)) for angle in (phi, theta, theta - phi))
        )
        for theta, phi in zip(crank, rocker, strict=True)
    ]


def solve(rows: Sequence[Row]) -> tuple[mpf, mpf, mpf]:
    """Solve k1·x + k2·y + k3 = z for rows (x, y, z)."""
    (x, y, z), *others = rows
    (a, b, r), (c, d, s) = ((row[0] - x, row[1] - y, row[2] - z) for row in others)
    determinant = a * d - b * c
    if not determinant:
        return mp.inf, mp.inf, mp.inf
    k1, k2 = (r * d - b * s) / determinant, (a * s - r * c) / determinant
    return k1, k2, z - k1 * x - k2 * y


def square_of_coupler(k: Sequence[mpf]) -> mpf:
    """Return b² = a² + c² + d² − 2ac·k3, for d = 1."""
    a, c = 1 / k[0], -1 / k[1]
    return a**2 + c**2 + 1 - 2 * a * c * k[2]


def links(k: Sequence[mpf]) -> tuple[mpf, mpf, mpf] | None:
    """Return crank, coupler and rocker; None if a link does not exist."""
    if not (k[0] and k[1] and mp.isfinite(k[0])):
        return None
    square = square_of_coupler(k)
    return (1 / k[0], mp.sqrt(square), -1 / k[1]) if square > 0 else None


def errors(lengths: Sequence[mpf], crank: Sequence[mpf], rocker: Sequence[mpf]) -> tuple[mpf, ...]:
    """
    Return the error of the rocker's angle at each pair, in the better assembly, in degrees.

    The error is infinite if the linkage is open there.
    """
    a, b, c = lengths
    found = []
    for theta, phi in zip(crank, rocker, strict=True):
        # With u = A − O4: b² = |c·e^{iφ} − u|².
        u = a * mp.expjpi(theta / 180) - 1
        cosine = (abs(u) ** 2 + c**2 - b**2) / (2 * c * abs(u))
        if abs(cosine) > 1:
            found.append(mp.inf)
            continue
        swing, middle = mp.degrees(mp.acos(cosine)), mp.degrees(mp.arg(u))
        off = (middle + side * swing - phi for side in (1, -1))
        found.append(min(abs(each - 360 * mp.nint(each / 360)) for each in off))
    return tuple(found)


class Task:
    """Three pairs in degrees, and their design in 50 digits."""

    def __init__(self, crank: Degrees, rocker: Degrees) -> None:
        self.crank, self.rocker = tuple(map(mpf, crank)), tuple(map(mpf, rocker))
        self.k = solve(equations(self.crank, self.rocker, None))
        self.lengths = links(self.k)

    def judged(self, lengths: tuple[mpf, mpf, mpf] | None) -> Rounded:
        """Return the errors of other lengths."""
        if lengths is None or self.lengths is None:
            return Rounded(None, (mp.inf,) * 3, mp.inf, (False,) * 3)
        off = tuple(abs(x / y - 1) for x, y in zip(lengths, self.lengths, strict=True))
        met = errors(lengths, self.crank, self.rocker)
        return Rounded(lengths, off, max(met), tuple(map(mp.isfinite, met)))

    def by_cosines(self, decimals: int) -> Rounded:
        """Return the design from cosines with a number of decimals."""
        return self.judged(links(solve(equations(self.crank, self.rocker, decimals))))

    def by_coefficients(self, decimals: int) -> Rounded:
        """Return the design from exact k1, k2 and k3, rounded to a number of decimals."""
        return self.judged(links([round_to(k, decimals) for k in self.k]))

    def by_angles(self, decimals: int) -> Rounded:
        """Return the design from angles rounded to a number of decimals of a degree."""
        rounded = [[round_to(x, decimals) for x in each] for each in (self.crank, self.rocker)]
        return self.judged(links(solve(equations(*rounded, None))))

    def by_worst_angles(self, decimals: int) -> Rounded:
        """Return the worst design with angle errors of half a unit in the last decimal."""
        half = mpf(10) ** -decimals / 2
        found = []
        for signs in product((-half, half), repeat=6):
            crank = [x + y for x, y in zip(self.crank, signs[:3], strict=True)]
            rocker = [x + y for x, y in zip(self.rocker, signs[3:], strict=True)]
            found.append(self.judged(links(solve(equations(crank, rocker, None)))))
        worst = tuple(max(each.off[i] for each in found) for i in range(3))
        reached = tuple(all(each.reached[i] for each in found) for i in range(3))
        return Rounded(None, worst, max(each.missed for each in found), reached)


def random_tasks(count: int) -> Iterator[Task]:
    """
    Yield random three-point designs.

    Crank and rocker start at any angle and turn by `SPAN` degrees in either direction; the middle
    pair lies at a share `MIDDLE` of each turn. A design with a link longer than `LARGEST_RATIO`
    grounds, or shorter than a ground divided by that, is drawn again.
    """
    generator = np.random.default_rng(SEED)
    while count:
        start = generator.uniform(-180.0, 180.0, 2)
        span = generator.uniform(*SPAN, 2) * generator.choice((-1.0, 1.0), 2)
        middle = generator.uniform(*MIDDLE, 2)
        crank, rocker = (
            (s, s + m * by, s + by) for s, m, by in zip(start, middle, span, strict=True)
        )
        task = Task(crank, rocker)
        if task.lengths and all(
            1 / LARGEST_RATIO < abs(length) < LARGEST_RATIO for length in task.lengths
        ):
            yield task
            count -= 1


def by_package(tasks: Sequence[Task]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the condition numbers, and the largest relative error of the package's lengths."""
    crank, rocker = (
        np.radians([[float(x) for x in getattr(task, link)] for task in tasks])
        for link in ('crank', 'rocker')
    )
    found = three_pairs(crank, rocker)
    worst = []
    for theta, phi, lengths in zip(crank, rocker, found.lengths, strict=True):
        # The reference uses the same doubles: rounding to radians is no error of the package.
        angles_ = [[mp.degrees(mpf(float(x))) for x in angles] for angles in (theta, phi)]
        exact = links(solve(equations(*angles_, None)))
        assert exact is not None, 'the doubles give a linkage too'
        off = (abs(mpf(float(x)) / y - 1) for x, y in zip(lengths, exact, strict=True))
        worst.append(float(max(off)))
    return found.condition, np.array(worst)
