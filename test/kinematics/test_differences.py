# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A dyad's differences s² − (b − c)² and (b + c)² − s² start from the one that cancels least."""

from __future__ import annotations

from math import asin, sqrt
from random import Random

from linkage_ros.kinematics import crank_diagonal, LinkState, UNIT_ROUNDOFF
from mpmath import mp, mpf
import pytest


def needles(count):
    """Yield four-bars near a transmission angle of 90°, with lengths far apart."""
    random = Random(32)
    while count:
        a, d = (10.0 ** random.uniform(-1.0, 2.0) for _ in range(2))
        c = abs(d - a) * random.uniform(0.99, 1.01)
        b = abs(d - a) * 10.0 ** random.uniform(-4.0, -1.0)
        sine = (b * b + c * c - (d - a) ** 2) / (4.0 * a * d)
        if 0.0 < sine < 1.0:
            count -= 1
            x = 2.0 * asin(sqrt(sine)) * (1.0 + random.uniform(-1e-3, 1e-3))
            yield crank_diagonal(a, b, c, d), (a, b, c, d), x


@pytest.mark.parametrize(('diagonal', 'lengths', 'x'), needles(200))
def test_four_bar_differences_start_from_the_least_cancelling_term(diagonal, lengths, x):
    """In 60 digits; the bound is the rounding of the terms of the one that cancels least."""
    found = diagonal.diagonal_at(LinkState([0.0, x], []))
    with mp.workdps(60):
        a, b, c, d = map(mpf, lengths)
        near, far = (4 * a * d * f(mpf(x) / 2) ** 2 for f in (mp.sin, mp.cos))
        fold, stretch = (d - a) ** 2 + near - (b - c) ** 2, (b + c) ** 2 - (d - a) ** 2 - near
        of_fold = abs((d - a) ** 2 - (b - c) ** 2) + near
        of_stretch = abs((b + c) ** 2 - (a + d) ** 2) + far
        if diagonal.short_pair:
            of_stretch = abs((b + c) ** 2 - (d - a) ** 2) + near
        least = min(of_fold + fold, of_stretch + stretch)
        bound = UNIT_ROUNDOFF * (4 + 4 * b * c * least / (fold * stretch))
        for root, true in ((found.fold, fold), (found.stretch, stretch)):
            assert abs(mpf(root) ** 2 / true - 1) <= 2 * bound
