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

from campaigns.accuracy.adversarial import ADVERSARIAL
from campaigns.accuracy.random_families import RANDOM
from campaigns.accuracy.reference import (
    condition_numbers,
    exact_condition_numbers,
    Outcome,
    Reference,
)
from campaigns.accuracy.run import make
import pytest

ALL = [*RANDOM, *(name for name in ADVERSARIAL if name != 'lengths × 1e±150')]


@pytest.mark.sample(5)
@pytest.mark.parametrize('family', ALL)
def test_condition_numbers_equal_exact_differences(family: str) -> None:
    for index in range(4):
        mechanism, phi, alpha = make(0, family, index)
        reference = Reference(mechanism)
        for case in range(0, len(phi), max(1, len(phi) // 2)):
            truth = reference.solve(phi[case], alpha[case])
            if truth.outcome is not Outcome.CLOSED:
                continue
            exact = exact_condition_numbers(reference, phi[case], alpha[case], independent=True)
            arguments = [truth], [phi[case]], [alpha[case]]
            assert exact is not None
            assert condition_numbers(reference, *arguments)[0] == pytest.approx(
                exact, rel=1e-3, abs=1e-15
            )
