# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A crank that a hand turns: angle and rate agree, it comes to rest, and it is let go."""

from __future__ import annotations

from math import pi, tau

from linkage_ros.tools.view import HandCrank, HELD
import pytest

STEP = 1e-4


def followed(crank: HandCrank, now: float) -> tuple[float, float]:
    found = crank.advance_to(now)
    assert found is not None
    (value,), (rate,) = found
    return value, rate


def test_crank_rate_is_the_derivative_of_the_angle() -> None:
    crank = HandCrank([True])
    crank.set_target(0, 1.0, [0.2], 0.0)
    states = [followed(crank, STEP * k) for k in range(3000)]
    for (before, _), (_, rate), (after, _) in zip(states, states[1:], states[2:], strict=False):
        assert rate == pytest.approx((after - before) / (2 * STEP), abs=5e-4)


def test_hand_crank_reaches_its_target_without_overshoot() -> None:
    crank = HandCrank([True])
    crank.set_target(0, 1.0, [0.2], 0.0)
    values = [followed(crank, 0.01 * k)[0] for k in range(100)]
    assert values == sorted(values)
    assert values[0] == pytest.approx(0.2)
    assert followed(crank, 1.0) == (pytest.approx(1.0, abs=1e-12), pytest.approx(0.0, abs=1e-12))


def test_hand_crank_motion_is_independent_of_the_step() -> None:
    one, other = HandCrank([True]), HandCrank([True])
    for crank in (one, other):
        crank.set_target(0, 1.0, [0.0], 0.0)
    for k in range(31):
        last = followed(one, 0.001 * k)
    assert followed(other, 0.03) == pytest.approx(last, rel=1e-12)


def test_unbounded_crank_crosses_whole_turns() -> None:
    hand = [3.0 * k / 10 for k in range(60)]  # three turns, as angles within one
    for whole, end in ((True, hand[-1]), (False, hand[-1] % tau)):
        crank = HandCrank([whole])
        for k, angle in enumerate(hand):
            crank.set_target(0, angle % tau, [0.0], 0.01 * k)
            crank.advance_to(0.01 * k)
        value, _ = followed(crank, 0.59 + 0.9)
        assert value == pytest.approx(end, abs=1e-9)


def test_hand_crank_starts_from_its_many_turn_angle() -> None:
    crank = HandCrank([True])
    crank.set_target(0, pi / 2, [100 * tau], 0.0)
    assert followed(crank, 0.9)[0] == pytest.approx(100 * tau + pi / 2, abs=1e-9)


def test_hand_crank_is_released_after_its_timeout() -> None:
    crank = HandCrank([True, False])
    assert crank.advance_to(0.0) is None
    crank.set_target(1, 0.3, [1.0, 0.0], 5.0)
    assert crank.advance_to(5.0 + HELD) is not None
    assert crank.advance_to(5.0 + HELD + 0.01) is None
    crank.set_target(0, 2.0, [2.0, 0.1], 60.0)  # held again: from where it is now
    assert crank.advance_to(60.0) == ([2.0, 0.1], [0.0, 0.0])
