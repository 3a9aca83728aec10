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


"""How two runs are held against each other: message by message, and to the last place."""

from __future__ import annotations

from itertools import repeat
from math import inf, nan, nextafter, sqrt, tau, ulp

from hypothesis import assume, example, given
from hypothesis import strategies as st
from linkage_ros.cli.replay_comparison import At, Comparison, ulps
from linkage_ros.messages.joint_state import JointStateWriter
import pytest

from .recorded import JOINT_STATE

NAMES = ['crank', 'slide']
WRITE = JointStateWriter(NAMES).write
AT = At(7, 70)
NUMBERS = st.floats(allow_nan=False, allow_infinity=False)


def compared(recorded: bytes, now: bytes, turning: tuple[str, ...] = ()) -> Comparison:
    found = Comparison([('/s', JOINT_STATE)], dict.fromkeys(turning, True))
    found.add(AT, [recorded], [now])
    found.settle()
    return found


@given(NUMBERS, st.integers(0, 50), st.sampled_from([-inf, inf]))
@example(0.0, 3, inf)
@example(-5e-324, 2, inf)
@example(1.0, 3, -inf)
@example(2.0**-1022, 5, -inf)
def test_ulps_are_the_steps_from_one_double_to_the_other(value, steps, towards):
    other = value
    for _ in repeat(None, steps):
        other = nextafter(other, towards)
    assume(abs(other) != inf)
    assert ulps(value, other) == ulps(other, value) == steps


def test_the_zeros_are_none_apart():
    assert ulps(-0.0, 0.0) == 0


@given(st.floats(-3.141, 3.141), st.integers(-10_000, 10_000), st.integers(-10_000, 10_000))
@example(0.1, -3, 5)
def test_whole_turns_are_no_difference_where_turns_do_not_count(angle, then, now):
    recorded = WRITE(1, [angle + then * tau, 0.5], [1.0, 2.0])
    again = WRITE(1, [angle + now * tau, 0.5], [1.0, 2.0])
    assert compared(recorded, again, ('crank',)).differing == 0
    assert compared(recorded, again).differing == (recorded != again)


@pytest.mark.parametrize(
    ('then', 'now'),
    [
        # Beyond what rounding makes of an angle and of its turns.
        (([1.0 + tau, 0.5], []), ([1.0 - 8 * ulp(1.0 + tau), 0.5], [])),
        (([1.0 + 3.0, 0.5], []), ([1.0, 0.5], [])),
        # A slide of 2π m has not turned.
        (([1.0, tau], []), ([1.0, 0.0], [])),
        # Nor has a rate.
        (([1.0, 0.5], [tau, 0.0]), ([1.0, 0.5], [0.0, 0.0])),
    ],
)
def test_what_is_no_whole_turn_is_a_difference(then, now):
    found = compared(WRITE(1, *then), WRITE(1, *now), ('crank',))
    assert found.differing == 1


DIFFERENCES = {
    # recorded, now, what is told, of which joint
    'a position': (WRITE(1, [1.0, 2.0], []), WRITE(1, [1.0, 2.5], []), 'position', 'slide'),
    'a rate': (WRITE(1, [1, 2], [3, 4]), WRITE(1, [1, 2], [5, 4]), 'rate', 'crank'),
    'an effort': (WRITE(1, [1, 2], [], [3, 4]), WRITE(1, [1, 2], [], [3, 5]), 'effort', 'slide'),
    'not a number': (WRITE(1, [1, 2], []), WRITE(1, [1, nan], []), 'position', 'slide'),
    'the sign of a zero': (WRITE(1, [0.0, 2], []), WRITE(1, [-0.0, 2], []), 'position', 'crank'),
    'a stamp': (WRITE(1, [1, 2], []), WRITE(9, [1, 2], []), 'stamp: 1 ns then, 9 ns now', ''),
    'no rates': (
        WRITE(1, [1, 2], [3, 4]), WRITE(1, [1, 2], []),
        'positions, rates then, positions now', '',
    ),
    'other joints': (
        WRITE(1, [1, 2], []), JointStateWriter(['slide', 'crank']).write(1, [2, 1], []),
        'joints: crank, slide then, slide, crank now', '',
    ),
    'none': (WRITE(1, [1, 2], []), b'', 'published then, nothing now', ''),
    'too many': (b'', WRITE(1, [1, 2], []), 'withheld then, published now', ''),
    'padding': (
        WRITE(1, [1, 2], []), WRITE(1, [1, 2], []) + b'\0',
        'bytes that are no number of a joint', '',
    ),
    'nonsense': (b'\0\1\0\0', WRITE(1, [1, 2], []), 'a message that cannot be read', ''),
}  # fmt: skip


@pytest.mark.parametrize('name', DIFFERENCES)
def test_the_first_difference_is_told(name):
    recorded, now, what, joint = DIFFERENCES[name]
    found = compared(recorded, now)
    assert (found.ticks, found.differing) == (1, 1)
    assert found.first.at == found.last == AT
    assert found.first.what.startswith(what)
    assert found.first.joint == joint


def test_deviations_are_those_of_all_messages():
    found = Comparison([('/s', JOINT_STATE)])
    positions = [(0.0, 0.0), (0.0, 3.0), (1.0, 1.0), (2.0, -2.0)]
    for number, (then, now) in enumerate(positions, 1):
        found.add(At(number, number), [WRITE(1, [then, 1], [])], [WRITE(1, [now, 1], [])])
    found.settle()
    crank = found.topics[0].deviations['crank', 'position']
    assert (crank.compared, crank.differing, crank.greatest) == (4, 2, 4.0)
    assert crank.rms == sqrt((9.0 + 16.0) / 4)
    assert crank.at == At(4, 4)
    slide = found.topics[0].deviations['slide', 'position']
    assert (slide.compared, slide.differing, slide.rms) == (4, 0, 0.0)
