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

"""A sample of the accuracy campaign: every family within its limits, no status wrong."""

from __future__ import annotations

from campaigns.accuracy.adversarial import ADVERSARIAL
from campaigns.accuracy.judge import AT_TOGGLE, QUANTITIES
from campaigns.accuracy.random_families import RANDOM
from campaigns.accuracy.report import FAULTS
from campaigns.accuracy.run import parts, run
from campaigns.accuracy.tally import Tally
import pytest

RANDOM_CASES, HARD_CASES = 100_000, 20_000
SEED = 20261121
"""Not the campaign's own: its findings went into the code."""

LIMIT = 4.0
"""In u·κ, for position, velocity and acceleration."""

TOGGLE = 32.0
"""
For positions at a toggle.

What is within 16 u of a limit position is reported as lying there. With δ the distance, the
position is off by √δ and κ is 1/(2·√δ), which makes 32 of it.
"""


@pytest.fixture(scope='module')
def tallies() -> dict[str, Tally]:
    return run(parts(RANDOM_CASES, HARD_CASES, SEED), jobs=2)


@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.parametrize('family', [*RANDOM, *ADVERSARIAL])
def test_errors_stay_within_their_limits(tallies: dict[str, Tally], family: str) -> None:
    quantities = tallies[family].quantities
    assert {*quantities} - {AT_TOGGLE} == {*QUANTITIES}
    beyond = []
    for quantity, found in quantities.items():
        limit = TOGGLE if quantity == AT_TOGGLE else LIMIT
        if not found.greatest() <= limit:
            worst = found.worst[0]
            beyond.append(
                f'{quantity}: {found.greatest():.3g} u·κ, see python -m campaigns.accuracy '
                f"--seed {SEED} --show '{family}' {worst.linkage}:{worst.case}"
            )
    assert not beyond, '\n'.join(beyond)


@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.parametrize('family', [*RANDOM, *ADVERSARIAL])
def test_no_status_is_wrong(tallies: dict[str, Tally], family: str) -> None:
    tally = tallies[family]
    assert not {name: tally.counts[name] for name in FAULTS if tally.counts[name]}, tally.notes


@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.parametrize('family', [*RANDOM, *ADVERSARIAL])
def test_every_case_is_accounted_for(tallies: dict[str, Tally], family: str) -> None:
    counts = tallies[family].counts
    assert counts['closed'] > 0.2 * counts['cases']
    told = sum(counts[name] for name in ('closed', 'open', 'at limit', *FAULTS))
    assert told == counts['cases']


def test_the_campaign_does_not_depend_on_how_it_is_shared() -> None:
    work = [part for part in parts(1500, 800, SEED) if part.family in {'RRR', 'wound crank'}]
    alone, shared = run(work, jobs=1), run(work[::-1], jobs=2)
    assert alone.keys() == shared.keys()
    for family, tally in alone.items():
        other = shared[family]
        assert (tally.counts, tally.notes) == (other.counts, other.notes)
        for quantity, found in tally.quantities.items():
            assert found.worst == other.quantities[quantity].worst
            assert (found.histogram == other.quantities[quantity].histogram).all()
