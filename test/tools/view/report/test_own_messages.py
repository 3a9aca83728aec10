# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A report shows curves, diagnostics and samples of a run as they were recorded."""

from math import inf, nan
from pathlib import Path

from linkage_ros.description import Units
from linkage_ros.messages import JointStateWriter
from linkage_ros.tools.view.report import page_data
from linkage_ros.tools.view.report.diagnostics_summary import _COUNTED
import numpy as np
import pytest

from .runs import (
    BEGIN,
    but,
    curve,
    data_of,
    MS,
    on_lanes,
    page_of_run,
    read,
    recorded,
    Said,
    sample,
    turning,
)
from .test_own_runs import SHORT_MEMORY, without_samples
from ....support.messages import joint_state, read_joint_state
from ....support.scenes import four_bar_text

# Curves agree with the messages of a run; implausible numbers break nothing.


def test_report_shows_the_lateness_of_ticks(tmp_path):
    late = np.random.default_rng(7).integers(0, 300_000, 1000)
    late[::10] = 0
    moments = but(
        1000, lambda tick, m: m._replace(time=m.time + int(late[tick]), messages=m.messages)
    )
    found = read(recorded(tmp_path, '', moments))
    times, told = curve(found, 'tick', 'lateness')
    assert told == pytest.approx(late * 1e-6, abs=1.5e-6)
    assert times == pytest.approx((np.arange(1000) * MS + late) / MS)
    assert found.lateness.count == 1000


def test_report_curves_equal_the_recorded_joint_states(tmp_path):
    bag = recorded(tmp_path, 'effects: {velocity: {}}\n')
    found = read(bag)
    states = [
        read_joint_state(message.data)
        for message in bag.messages()
        if message.topic == '/joint_states'
    ]
    for place, name in enumerate(states[0].name):
        for quantity, field in (('position', 'position'), ('rate', 'velocity')):
            expected = [getattr(each, field)[place] for each in states]
            assert curve(found, name, quantity) == ([*range(1000)], expected)
    assert curve(found, 'crank_joint', 'position')[1] == [0.007 * tick for tick in range(1000)]


def test_report_shows_torque_commands_as_efforts(tmp_path):
    linkage = FOUR_BAR_WITH_MASSES
    command = JointStateWriter(['crank_joint']).write

    def pushed(tick, moment):
        return moment._replace(messages=(command(0, [0.0], [], [0.001 * tick]),))

    found = read(recorded(tmp_path, TORQUE, but(50, pushed), linkage))
    assert curve(found, 'crank_joint', 'effort')[1][:50] == [0.001 * tick for tick in range(50)]
    assert on_lanes(found) == {}
    assert not found.left_out


TORQUE = 'drive: {torque: {}}\nloads: {drive_inertia: 0.001}\n'
FOUR_BAR_WITH_MASSES = four_bar_text(0.04, 0.12, 0.08, 0.1, [(0.1, 0, 1e-5)] * 3)


@pytest.mark.parametrize('value', [nan, inf, -inf, 1e308])
def test_report_page_survives_infinite_and_nan_values(tmp_path, value):
    pytest.importorskip('plotly')
    moments = but(50, lambda tick, m: m)
    bag = recorded(tmp_path, 'effects: {velocity: {}}\nfaults: {n: {not_a_number: {}}}\n', moments)
    writer = JointStateWriter(['coupler_joint', 'rocker_joint'])
    messages = [
        m._replace(data=writer.write(BEGIN, [value, 1.0], [value, value]))
        if m.topic == '/joint_states' and index % 3 else m
        for index, m in enumerate(bag.messages())
    ]  # fmt: skip

    class Changed(type(bag)):
        def messages(self):
            return iter(messages)

    changed = Changed(*(getattr(bag, name) for name in bag.__slots__))
    data_of(page_of_run(read(changed)))


# The diagnostics of a run: lost ticks, dropped messages, warnings, and when it ended.


def test_report_shows_diagnostic_counts_since_the_last_message(tmp_path):
    said = [
        Said(100.3, 'tick', {'Lost ticks': 2}),
        Said(200.3, 'tick', {'Lost ticks': 2}),
        Said(300.3, 'tick', {'Lost ticks': 7}, level=1, message='5 ticks lost'),
        Said(
            300.4, 'loop closure', {'Ticks open': 4, 'Ticks at a toggle': 1}, level=2, message='m'
        ),
        Said(
            400.3,
            'loop closure',
            {'Ticks open': 4, 'Ticks indeterminate': 6, 'Ticks beyond limits': 3},
        ),
        Said(500.3, 'recording', {'Dropped: /joint_states': 3, 'Dropped: /crank': 0}),
        Said(600.3, 'motor', {'Lost ticks': 99}, level=2, message='of somebody else'),
        Said(900.3, 'tick', {'Lost ticks': 1}),  # the node was started anew
    ]
    found = read(recorded(tmp_path, said=said))
    assert on_lanes(found) == {
        'lost': [(0, 100.3, 2, ''), (200.3, 300.3, 5, ''), (500.3, 900.3, 1, '')],
        'told_open': [(300.3, 300.4, 4, 'open'), (300.4, 400.3, 6, 'indeterminate')],
        'told_toggle': [(300.3, 300.4, 1, '')],
        'told_limited': [(300.4, 400.3, 3, '')],
        'dropped': [(400.3, 500.3, 3, 'messages of /joint_states')],
        'health': [
            (200.3, 300.3, 1, 'warning, tick: 5 ticks lost'),
            (300.3, 300.4, 1, 'error, loop closure: m'),
        ],
    }
    assert found.last_values['tick', 'Lost ticks'] == '1'
    assert ('motor', 'Lost ticks') not in found.last_values


def test_report_shows_silence_up_to_the_last_diagnostics(tmp_path):
    moments = but(1000, without_samples(300, 999))
    said = [Said(ms, 'crank', {}, 3, 'No crank') for ms in (1000.0, 2000.0, 3000.0)]
    found = read(recorded(tmp_path, SHORT_MEMORY, moments, said=said))
    assert found.end == 3000 * MS
    assert on_lanes(found) == {
        'stale': [(299, 3000, 1, '')],
        'silent': [(499, 3000, 1, '')],
        'health': [(0, 3000, 3, 'stale, crank: No crank')],
    }


def test_report_of_a_mid_run_bag_omits_earlier_losses(tmp_path):
    bag = recorded(tmp_path, said=[Said(100, 'tick', {'Lost ticks': 50}),
                                   Said(200, 'tick', {'Lost ticks': 53})])  # fmt: skip
    begun = bag.attachments['run.json'].replace(b'{', b'{"begun": "mid-run", ', 1)
    bag.attachments['run.json'] = begun
    assert on_lanes(read(bag)) == {'lost': [(100, 200, 3, '')]}


def test_diagnostics_with_new_keys_take_bounded_space(tmp_path):
    said = [
        Said(ms, 'tick', {f'{ms} {n}': 'x' * 1000 for n in range(100)}, 1, f'{ms}' * 200)
        for ms in range(100)
    ]
    found = read(recorded(tmp_path, said=said))
    assert len(found.last_values) == 500
    assert all(len(value) <= 80 for value in found.last_values.values())
    assert sum(span[2] for span in on_lanes(found)['health']) == 100


def test_report_follows_counts_that_the_node_publishes():
    pytest.importorskip('diagnostic_msgs')
    from linkage_ros.node import diagnostics  # local import: needs rclpy

    source = Path(diagnostics.__file__).read_text()
    for key in _COUNTED:
        assert f"'{key}':" in source
    assert "f'Dropped: {topic.name}'" in source


def test_report_without_diagnostics_has_no_track_of_losses(tmp_path):
    assert {*read(recorded(tmp_path)).event_tracks} == {
        'silent',
        'jump',
        'rejected',
        'open',
        'stale',
        'reset',
    }


# Samples of the crank: rejected for the reason of the run, with the same age at each tick.


def sent(names, positions, rates, at=0):
    """Return a sample, stamped so many [ms] after tick 500; None for a stamp of zero."""
    stamp = (0, 0) if at is None else divmod(BEGIN + (500 + at) * MS, 10**9)
    return joint_state(names, positions, rates, stamp=stamp)


ONE = ['crank_joint']
REJECTED = {
    'malformed message': b'\0\1\0\0abc',
    'no joints or no positions': sent([], [], []),
    'arrays of unequal length': sent(ONE, [1, 2], [1]),
    'crank joint named twice': sent(ONE * 2, [1, 1], [1, 1]),
    'position or rate not finite': sent(ONE, [nan], [1]),
    'position or rate beyond 1e10': sent(ONE, [1e11], [1]),
    'stamp zero': sent(ONE, [1], [1], None),
    'stamp in the future': sent(ONE, [1], [1], 101),
    'stamp older than the last': sent(ONE, [1], [1], -2),
}


@pytest.mark.sample(2)
@pytest.mark.parametrize('reason', REJECTED)
def test_report_names_the_reason_of_rejected_samples(tmp_path, reason):
    bad = REJECTED[reason]
    moments = but(
        1000,
        lambda tick, m: m._replace(messages=(bad, *m.messages, bad)) if tick == 500 else m,
    )
    found = read(recorded(tmp_path, '', moments))
    assert on_lanes(found) == {'rejected': [(500, 500, 2, reason)]}
    assert found.rejected == {reason: 2}


OTHERS = {
    'another joint': sent(['knee'], [1], [1]),
    'another joint, without positions': sent(['knee'], [], [1]),
    'other joints, arrays of unequal length': sent(['knee', 'hip'], [1], [1, 2]),
}


@pytest.mark.parametrize('kind', OTHERS)
def test_report_does_not_count_other_joints_as_rejected(tmp_path, kind):
    moments = but(100, lambda tick, m: m._replace(messages=(OTHERS[kind], *m.messages)))
    found = read(recorded(tmp_path, '', moments))
    assert on_lanes(found) == {}
    assert found.rejected == {}
    assert found.left_out['samples', 'of other joints'] == 100


def test_rejected_samples_are_shown_by_reason_and_counted(tmp_path):
    bad = {
        **dict.fromkeys((100, 110, 125), REJECTED['malformed message']),
        **dict.fromkeys((126, 200), REJECTED['crank joint named twice']),
    }
    moments = but(
        300, lambda tick, m: m._replace(messages=(*m.messages, bad[tick])) if tick in bad else m
    )
    found = read(recorded(tmp_path, '', moments))
    assert on_lanes(found) == {
        'rejected': [
            (100, 125, 3, 'malformed message'),
            (126, 126, 1, 'crank joint named twice'),
            (200, 200, 1, 'crank joint named twice'),
        ]
    }
    assert found.rejected == {'malformed message': 3, 'crank joint named twice': 2}


def test_input_age_is_tick_time_minus_newest_stamp(tmp_path):
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


def test_input_age_of_a_future_stamp_is_negative(tmp_path):
    moments = but(50, lambda tick, m: m._replace(messages=(sample(tick + 2, 0.1),)))
    found = read(recorded(tmp_path, '', moments))
    assert curve(found, 'input', 'age')[1] == pytest.approx([-2.0] * 50)
    assert (found.age.count, found.age.least, found.age.greatest) == (50, -2 * MS, -2 * MS)
    # It stands in the lowest of the bins, whose percentiles are no more than it.
    spread = page_data(found, wrapped=False, units=Units())['histograms']['age']
    assert (spread['counts'], spread['percentiles']['p50']) == ([50], -0.002)


def test_report_carries_the_crank_forward_between_samples(tmp_path):
    moments = but(100, lambda tick, m: m if tick % 10 == 0 else m._replace(messages=()))
    found = read(recorded(tmp_path, '', moments))
    crank = found.frames.values['crank_joint']
    assert crank == pytest.approx([0.007 * tick for tick in range(100)], abs=1e-12)


def test_run_at_rate_0_has_no_lateness(tmp_path):
    found = read(recorded(tmp_path, 'rate: 0\n', map(turning, range(200))))
    assert found.lateness is None
    assert curve(found, 'input', 'age')[1] == pytest.approx([0.0] * 200)
    assert on_lanes(found) == {}
