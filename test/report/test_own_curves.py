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

"""Curves are what the messages of a run say; numbers that no joint has break nothing."""

from __future__ import annotations

import json
from math import inf, nan

from linkage_ros.messages.joint_state import JointStateWriter
from linkage_ros.report.html import ReportHeader, run_html
import numpy as np
import pytest

from .runs import BEGIN, but, curve, MS, on_lanes, read, recorded, STORE

STATE = 'sensor_msgs/msg/JointState'


def test_ticks_are_late_by_what_they_were_late(tmp_path):
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


def test_curves_are_what_messages_say(tmp_path):
    bag = recorded(tmp_path, 'effects: {velocity: {}}\n')
    found = read(bag)
    states = [
        STORE.deserialize_cdr(message.data, STATE)
        for message in bag.messages()
        if message.topic == '/joint_states'
    ]
    for place, name in enumerate(states[0].name):
        for quantity, field in (('position', 'position'), ('rate', 'velocity')):
            expected = [getattr(each, field)[place] for each in states]
            assert curve(found, name, quantity) == ([*range(1000)], expected)
    assert curve(found, 'crank_joint', 'position')[1] == [0.007 * tick for tick in range(1000)]


def test_torque_commands_are_samples_of_efforts(tmp_path):
    linkage = FOUR_BAR_WITH_MASSES
    command = JointStateWriter(['crank_joint']).write

    def pushed(tick, moment):
        return moment._replace(messages=(command(0, [0.0], [], [0.001 * tick]),))

    found = read(recorded(tmp_path, TORQUE, but(50, pushed), linkage))
    assert curve(found, 'crank_joint', 'effort')[1][:50] == [0.001 * tick for tick in range(50)]
    assert on_lanes(found) == {}
    assert not found.left_out


TORQUE = 'drive: {torque: {}}\nloads: {drive_inertia: 0.001}\n'
FOUR_BAR_WITH_MASSES = """
links:
  ground:  {O2: [0, 0], O4: [0.100, 0]}
  crank:   {O2: [0, 0], A: [0.040, 0]}
  coupler: {A: [0, 0], B: [0.120, 0]}
  rocker:  {O4: [0, 0], B: [0.080, 0]}
input: {joint: crank_joint, parent: ground, child: crank}
assembly: {B: left}
joints: {rocker_joint: {parent: ground, child: rocker}}
masses:
  crank: {mass: 0.1, center: [0, 0], inertia: 1.0e-5}
  coupler: {mass: 0.1, center: [0, 0], inertia: 1.0e-5}
  rocker: {mass: 0.1, center: [0, 0], inertia: 1.0e-5}
"""


def page(found):
    return run_html(found, ReportHeader('t', [], [], []))


@pytest.mark.parametrize('value', [nan, inf, -inf, 1e308])
def test_numbers_that_no_joint_has_break_no_page(tmp_path, value):
    pytest.importorskip('plotly')
    moments = but(50, lambda tick, m: m)
    bag = recorded(tmp_path, 'effects: {velocity: {}}\nfaults: {n: {not_a_number: {}}}\n', moments)
    writer = JointStateWriter(['coupler_joint', 'rocker_joint'])
    messages = [
        m._replace(data=writer.write(BEGIN, [value, 1.0], [value, value]))
        if m.topic == '/joint_states' and number % 3 else m
        for number, m in enumerate(bag.messages())
    ]  # fmt: skip

    class Changed(type(bag)):
        def messages(self):
            return iter(messages)

    changed = Changed(*(getattr(bag, name) for name in bag.__slots__))
    text = page(read(changed))
    json.loads(text.split('id="data">')[1].split('</script>')[0], parse_constant=pytest.fail)
