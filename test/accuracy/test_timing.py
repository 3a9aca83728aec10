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

"""Times are of a state, of all methods in turn, and nothing else happens meanwhile."""

from __future__ import annotations

import gc

from linkage_ros.measuring import BLOCK, Contender, FEWEST, in_turn, MOST
import pytest


class Clock:
    """A clock that only what is timed moves."""

    def __init__(self) -> None:
        self.now = 0.0
        self.log: list[str] = []
        self.collecting: list[bool] = []

    def __call__(self) -> float:
        return self.now

    def contender(self, name: str, seconds: float, states: int) -> Contender:
        def run() -> None:
            self.now += seconds
            self.log.append(name)
            self.collecting.append(gc.isenabled())

        return Contender(run, states)


def test_a_time_is_that_of_a_state() -> None:
    clock = Clock()
    contenders = [clock.contender('a', 0.25, 10), clock.contender('b', 2.0**-13, 1)]
    ten, one = in_turn(contenders, 1.0, clock=clock)
    assert ten == pytest.approx((0.025,) * 3)
    assert one == pytest.approx((2.0**-13,) * 3)


def test_blocks_follow_each_other_there_and_back() -> None:
    clock = Clock()
    in_turn([clock.contender(name, 1.0, 1) for name in 'abc'], 0.0, clock=clock)
    # Twice each to warm up and to see how long it takes; then round by round.
    assert ''.join(clock.log) == 'aabbcc' + 'abccbaabccbaabc'
    assert FEWEST == 5


def test_a_short_run_is_repeated_until_its_block_is_long_for_the_clock() -> None:
    clock = Clock()
    in_turn([clock.contender('a', BLOCK / 64, 1)], 0.0, clock=clock)
    assert len(clock.log) == 2 + 64 * FEWEST


def test_rounds_fill_the_time_and_no_more_than_is_of_use() -> None:
    for seconds, rounds in ((10.0, 10), (1e9, MOST)):
        clock = Clock()
        in_turn([clock.contender('a', 0.5, 1), clock.contender('b', 0.5, 1)], seconds, clock=clock)
        assert clock.log.count('b') == 2 + rounds


def test_no_garbage_is_collected_within_a_block_and_it_is_afterwards() -> None:
    clock = Clock()
    in_turn([clock.contender('a', 1.0, 1)], 0.0, clock=clock)
    assert clock.collecting == [True, True] + [False] * FEWEST
    assert gc.isenabled()


def test_collection_is_switched_on_again_where_a_method_raises() -> None:
    calls = iter([None, None, None])

    def run() -> None:
        next(calls)

    with pytest.raises(StopIteration):
        in_turn([Contender(run, 1)], 0.0, clock=Clock())
    assert gc.isenabled()


def test_progress_ends_at_one() -> None:
    clock, told = Clock(), []
    in_turn([clock.contender('a', 1.0, 1)], 0.0, told.append, clock=clock)
    assert told == pytest.approx([0.2, 0.4, 0.6, 0.8, 1.0])


def test_of_nothing_there_are_no_times() -> None:
    assert in_turn([], 1.0) == []
