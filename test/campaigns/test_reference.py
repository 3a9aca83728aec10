# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Condition numbers of the campaign's reference are those by differences of balls.

`test/tools/study/test_enclosure.py` compares its solutions with the constraints.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

from campaigns.accuracy.adversarial import ADVERSARIAL
from campaigns.accuracy.random_families import RANDOM
from campaigns.accuracy.reference import Outcome, Reference, Truth
from campaigns.accuracy.run import make
from campaigns.series import FACTORIALS, ORDER, Series, Tape
from flint import acb, acb_series, arb
import numpy as np
import pytest

ALL = [*RANDOM, *(name for name in ADVERSARIAL if name != 'lengths × 1e±150')]
PRECISION = 1024
STEP = 2.0**-300


def closed(family: str, index: int, precision: int = 256):
    """Yield some closed cases of a linkage: reference, truth, angle, acceleration."""
    mechanism, phi, alpha = make(0, family, index)
    reference = Reference(mechanism)
    for case in range(0, len(phi), max(1, len(phi) // 2)):
        truth = reference.solve(phi[case], alpha[case], precision)
        if truth.outcome is Outcome.CLOSED:
            yield reference, truth, phi[case], alpha[case]


def difference(one: Truth, other: Truth) -> np.ndarray:
    """Return the absolute slopes of all joints in each order, by a difference."""
    return np.array(
        [
            [abs(float((b[k] - a[k]) / STEP)) * FACTORIALS[k] for k in range(ORDER)]
            for a, b in zip(one.joints, other.joints, strict=True)
        ]
    )


@pytest.mark.sample(5)
@pytest.mark.parametrize('family', ALL)
def test_condition_numbers_equal_exact_differences(family: str) -> None:
    for index in range(4):
        for reference, truth, phi, alpha in closed(family, index):
            exact = reference.solve(phi, alpha, PRECISION)
            total = 0.0
            for key, value in reference.numbers.items():
                if value:
                    varied = reference.numbers | {key: arb(value) * (1 + arb(STEP))}
                    changed = Reference(reference.mechanism, varied)
                    total += difference(exact, changed.solve(phi, alpha, PRECISION))
            numbers = {at for at, _ in truth.motion.numbers.values()}
            widths = {at: w for at, w in truth.motion.tape.widths.items() if at in numbers}
            found = [joint.changes(widths) for joint, _ in truth.made]
            assert found == pytest.approx(np.asarray(total), rel=1e-3, abs=1e-15)


CHAINS = ['RRR-RRR-RRR', 'any three', 'chain of needles', 'chain at a toggle']


@pytest.mark.sample(2)
@pytest.mark.parametrize('family', CHAINS)
def test_passed_results_change_joints_as_their_slopes_say(
    family: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[tuple[int, int]] = []  # Index on the tape of each rounding, and its directions
    changed: dict[int, acb_series] = {}

    def change(tape: Tape, widths: Sequence[complex]) -> Series:
        series = tape.constant(0)
        series.value = changed.get(len(made), series.value)
        made.append((series.index, 2 if isinstance(widths[0], complex) else 1))
        return series

    monkeypatch.setattr(Tape, 'change', change)
    for reference, exact, phi, alpha in closed(family, 0, PRECISION):
        made.clear()
        reference.solve(phi, alpha, PRECISION)
        for place, (index, ways) in enumerate(made.copy()):
            for order, way in product(range(ORDER), (1, 1j)[:ways]):
                changed[place] = acb_series([0] * order + [acb(way) * arb(STEP)])
                made.clear()
                moved = difference(exact, reference.solve(phi, alpha, PRECISION))
                changed.clear()
                width = [0.0] * order + [FACTORIALS[order] * way]
                found = [joint.changes({index: width}) for joint, _ in exact.made]
                assert found == pytest.approx(moved, rel=1e-3, abs=1e-15)
