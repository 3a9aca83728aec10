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

"""Samples of the crank: rejected for the reason of the run, and as old at a tick as they were."""

from __future__ import annotations

from math import nan

from linkage_ros.report.data import page_data
import numpy as np
import pytest

from .runs import BEGIN, but, curve, MS, on_lanes, read, recorded, sample, STORE, turning, TYPES

STATE = 'sensor_msgs/msg/JointState'


def joint_state(stamp, names, positions, rates):
    time = TYPES['builtin_interfaces/msg/Time'](*divmod(BEGIN + stamp, 10**9))
    message = TYPES[STATE](
        TYPES['std_msgs/msg/Header'](time, ''), names, np.array(positions, float),
        np.array(rates, float), np.array([]),
    )  # fmt: skip
    return bytes(STORE.serialize_cdr(message, STATE))


AT = 500 * MS
ONE = ['crank_joint']
REJECTED = {
    'malformed message': b'\0\1\0\0abc',
    'no joints or no positions': joint_state(AT, [], [], []),
    'arrays of unequal length': joint_state(AT, ONE, [1, 2], [1]),
    'crank joint missing': joint_state(AT, ['knee'], [1], [1]),
    'crank joint named twice': joint_state(AT, ONE * 2, [1, 1], [1, 1]),
    'no velocities': joint_state(AT, ONE, [1], []),
    'position or rate not finite': joint_state(AT, ONE, [nan], [1]),
    'position or rate beyond 1e10': joint_state(AT, ONE, [1e11], [1]),
    'stamp zero': joint_state(-BEGIN, ONE, [1], [1]),
    'stamp in the future': joint_state(AT + 101 * MS, ONE, [1], [1]),
    'stamp older than the last': joint_state(AT - 2 * MS, ONE, [1], [1]),
}


@pytest.mark.parametrize('reason', REJECTED)
def test_samples_are_rejected_for_the_reason_for_which_the_drive_did(tmp_path, reason):
    bad = REJECTED[reason]
    moments = but(
        1000,
        lambda tick, m: m._replace(messages=(bad, *m.messages, bad)) if tick == 500 else m,
    )
    found = read(recorded(tmp_path, '', moments))
    assert on_lanes(found) == {'rejected': [(500, 500, 2, reason)]}
    assert found.rejected == {reason: 2}


def test_what_is_rejected_is_told_apart_and_counted(tmp_path):
    bad = {
        **dict.fromkeys((100, 110, 125), REJECTED['malformed message']),
        **dict.fromkeys((126, 200), REJECTED['crank joint missing']),
    }
    moments = but(
        300, lambda tick, m: m._replace(messages=(*m.messages, bad[tick])) if tick in bad else m
    )
    found = read(recorded(tmp_path, '', moments))
    assert on_lanes(found) == {
        'rejected': [
            (100, 125, 3, 'malformed message'),
            (126, 126, 1, 'crank joint missing'),
            (200, 200, 1, 'crank joint missing'),
        ]
    }
    assert found.rejected == {'malformed message': 3, 'crank joint missing': 2}


def test_the_age_of_the_input_is_the_ticks_time_less_the_newest_stamp(tmp_path):
    # A sample every 10 ticks, 3 ms old when it comes.
    moments = but(
        100,
        lambda tick, m: m._replace(
            messages=() if tick % 10 else (sample(tick - 3, 0.007 * tick),)
        ),
    )
    found = read(recorded(tmp_path, '', moments))
    times, ages = curve(found, 'input', 'age')
    assert times == [*range(100)]
    assert ages == pytest.approx([3 + tick % 10 for tick in range(100)], abs=1e-9)
    assert (found.age.count, found.age.least, found.age.greatest) == (100, 3 * MS, 12 * MS)


def test_an_age_is_negative_where_a_stamp_is_ahead_of_the_clock(tmp_path):
    moments = but(50, lambda tick, m: m._replace(messages=(sample(tick + 2, 0.1),)))
    found = read(recorded(tmp_path, '', moments))
    assert curve(found, 'input', 'age')[1] == pytest.approx([-2.0] * 50)
    assert (found.age.count, found.age.least, found.age.greatest) == (50, -2 * MS, -2 * MS)
    # It stands in the lowest of the bins, whose percentiles are no more than it.
    spread = page_data(found, wrapped=False)['histograms']['age']
    assert (spread['counts'], spread['percentiles']['p50']) == ([50], -0.002)


def test_between_two_samples_the_crank_is_carried_forward(tmp_path):
    moments = but(100, lambda tick, m: m if tick % 10 == 0 else m._replace(messages=()))
    found = read(recorded(tmp_path, '', moments))
    crank = found.frames.values['crank_joint']
    assert crank == pytest.approx([0.007 * tick for tick in range(100)], abs=1e-12)


def test_a_run_by_samples_has_no_lateness(tmp_path):
    found = read(recorded(tmp_path, 'rate: 0\n', map(turning, range(200))))
    assert found.lateness is None
    assert curve(found, 'input', 'age')[1] == pytest.approx([0.0] * 200)
    assert on_lanes(found) == {}
