# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""``linkage compare``: two runs, whose joints differ by a bias, by a rate, by nothing at all."""

import json
from math import pi, sin

from linkage_ros.bag import BagWriter, read_bag, Topic
from linkage_ros.errors import LinkageError
from linkage_ros.tools.view import compare_command as compare
import numpy as np
import pytest

from .recorded import answer, JOINT_STATE
from ..support.messages import joint_state

SECOND = 1_000_000_000


def bag(folder, values, *, rate=100, begin=5, seconds=2.0, topic='/joint_states'):
    """Write a bag of joint states, made by functions of the time in [s]; without a scene."""
    writer = BagWriter(folder, [Topic(topic, JOINT_STATE, '', '')])
    for index in range(round(seconds * rate) + 1):
        time = index / rate
        stamp = begin * SECOND + round(time * SECOND)
        data = joint_state(
            values,
            positions=[value(time) for value in values.values()],
            stamp=divmod(stamp, SECOND),
        )
        writer.write(0, stamp, stamp, data)
    writer.close()
    return folder


def told(capsys, *typed):
    capsys.readouterr()
    assert answer(compare, *typed, '--json') == 0
    account = json.loads(capsys.readouterr().out)
    return account, {row['joint']: row for row in account['joints']}


def swing(time):
    return 0.5 * sin(3.0 * time)


def ramp(time):
    return time


def test_compare_finds_a_bias_between_different_rates_and_times(tmp_path, capsys):
    first = bag(tmp_path / 'a', {'p': swing, 'q': ramp})
    second = bag(
        tmp_path / 'b', {'q': lambda t: ramp(t) + 0.25, 'p': swing}, rate=40, begin=90, seconds=1.5
    )
    account, rows = told(capsys, first, second)
    assert (account['compared'], account['seconds']) == (151, 1.5)
    assert rows['q']['greatest'] == pytest.approx(0.25)
    assert rows['q']['rms'] == pytest.approx(0.25)
    # Between samples a line stands for the sine: h² · max|p″| / 8.
    assert rows['p']['greatest'] <= (1 / 40) ** 2 * 4.5 / 8
    assert rows['p']['greatest'] > 0.5 * (1 / 40) ** 2 * 4.5 / 8


def test_run_compared_with_itself_shows_no_difference(tmp_path, capsys):
    first = bag(tmp_path / 'a', {'p': swing})
    _, rows = told(capsys, first, first)
    assert (rows['p']['different'], rows['p']['greatest_at']) == (0, None)


def test_compare_names_tick_and_time_of_the_greatest_difference(tmp_path, capsys):
    def kicked(time):
        return swing(time) + (0.5 if abs(time - 1.2) < 0.001 else 0.0)

    _, rows = told(capsys, bag(tmp_path / 'a', {'p': swing}), bag(tmp_path / 'b', {'p': kicked}))
    assert rows['p']['greatest_at'] == {'tick': 121, 'time_ns': 1_200_000_000}
    assert rows['p']['different'] == 1


def test_wrapped_angles_differ_by_the_shorter_arc(tmp_path, capsys):
    def wrapped(offset):
        return lambda t: (3.0 * t + offset + pi) % (2.0 * pi) - pi

    first = bag(tmp_path / 'a', {'p': wrapped(0.0)})
    second = bag(tmp_path / 'b', {'p': wrapped(0.1)}, rate=70)
    _, rows = told(capsys, first, second)
    assert rows['p']['greatest'] == pytest.approx(0.1)


@pytest.mark.parametrize('name', ['x.png', 'x.svg'])
def test_compare_draws_a_png_or_an_svg(tmp_path, name):
    first = bag(tmp_path / 'a', {'$p$': swing, 'q': ramp})
    second = bag(tmp_path / 'b', {'$p$': ramp, 'q': ramp})
    assert answer(compare, first, second, '-o', tmp_path / name) == 0
    assert (tmp_path / name).stat().st_size > 1000


@pytest.mark.parametrize(
    ('values', 'topic', 'reason'),
    [
        ({'other': swing}, '/joint_states', 'has no joint in common'),
        ({'p': swing}, '/elsewhere', 'holds no /joint_states'),
    ],
)
def test_compare_refuses_bags_without_joints_in_common(tmp_path, values, topic, reason):
    first = bag(tmp_path / 'a', {'p': swing})
    second = bag(tmp_path / 'b', values, topic=topic)
    with pytest.raises(LinkageError, match=reason):
        answer(compare, first, second)


@pytest.mark.parametrize('gap_first', [True, False])
def test_missing_joint_states_of_either_run_are_not_compared(
    tmp_path, monkeypatch, capsys, gap_first
):
    pytest.importorskip('matplotlib')
    first = bag(tmp_path / 'a', {'p': swing}, seconds=1.0)
    more = bag(tmp_path / 'c', {'p': lambda t: swing(t + 3.0)}, begin=8, seconds=1.0)
    messages = [*read_bag(first).messages(), *read_bag(more).messages()]
    writer = BagWriter(tmp_path / 'gap', [Topic('/joint_states', JOINT_STATE, '', '')])
    for _, log_time, publish_time, data in messages:
        writer.write(0, log_time, publish_time, data)
    writer.close()
    second = bag(tmp_path / 'b', {'p': lambda t: swing(t) + 0.25}, seconds=4.0)
    runs = (tmp_path / 'gap', second) if gap_first else (second, tmp_path / 'gap')
    account, rows = told(capsys, *runs)
    assert account['compared'] == pytest.approx(2 * 101, abs=1)
    assert rows['p']['greatest'] == pytest.approx(0.25)
    figures = []
    monkeypatch.setattr(compare, 'save_picture', lambda figure, _: figures.append(figure))
    assert answer(compare, *runs, '-o', tmp_path / 'x.png') == 0
    ((axes,),) = [figure.axes for figure in figures]
    assert axes.get_ylabel() == 'difference of joint angle [°]'
    (line,) = axes.get_lines()
    x, y = line.get_data()
    (break_at,) = np.flatnonzero(np.isnan(y))
    assert x[break_at - 1] == pytest.approx(1.0, abs=0.02)
    assert x[break_at + 1] == pytest.approx(3.0, abs=0.02)
    # Its name stands at the end of the line, as in the other pictures.
    assert axes.get_legend() is None
    assert [text.get_text() for text in axes.texts] == ['p']
