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


"""The instant at which something happens within a step, against functions whose zero is known."""

from __future__ import annotations

from math import cos, exp, pi

from linkage_ros.dynamics.motion import last_before
import pytest


def found(function, end, *, exists=lambda _t: True):
    """Return instant, last state, whether it is that, and how often it was looked."""
    looks = []

    def reach(t):
        looks.append(t)
        return (t, function(t)) if exists(t) else None

    at, (time, margin), known = last_before(
        reach, lambda state: state[1], (0.0, function(0.0)), end, (end, function(end))
    )
    assert margin >= 0.0
    assert time <= at
    return at, known, len(looks)


@pytest.mark.parametrize(
    ('function', 'end', 'zero'),
    [
        (lambda t: 1.0 - 3.0 * t, 1.0, 1 / 3),
        (lambda t: 2.0 - t * t, 2.0, 2.0**0.5),
        (cos, 3.0, pi / 2),
        (lambda t: exp(-20.0 * t) - 1e-3, 5.0, 0.34538776394910684),
        (lambda t: (0.7 - t) ** 3, 1.0, 0.7),
        # At the start it leaves what it comes back to: a flight between two bounces.
        (lambda t: t * (0.01 - t), 1.0, 0.01),
        (lambda t: t * (1e-9 - t), 1.0, 1e-9),
    ],
)
def test_the_zero_is_found(function, end, zero):
    at, known, looks = found(function, end)
    assert known
    assert at == pytest.approx(zero, abs=1e-5 if function(0.0) == 0.7**3 else 1e-13)
    assert looks <= 80


def test_a_smooth_one_is_found_soon():
    for function, end in ((cos, 3.0), (lambda t: 2.0 - t * t, 2.0)):
        assert found(function, end)[2] < 20


def test_where_there_is_no_state_it_ends_before_that():
    at, known, _ = found(lambda t: 1.0 - t, 2.0, exists=lambda t: t < 0.25 or t == 2.0)
    assert not known
    assert at == pytest.approx(0.25, abs=1e-13)


def test_beyond_a_gap_it_is_still_looked_for_in_front_of_it():
    at, known, _ = found(lambda t: 0.125 - t, 2.0, exists=lambda t: not 0.5 < t < 1.5)
    assert known
    assert at == pytest.approx(0.125, abs=1e-13)
