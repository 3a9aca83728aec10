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


"""Where the linkage does not close, or has no rate: said, and nothing invented."""

from math import acos, pi
import re
import time

import pytest
from sensor_msgs.msg import JointState

from .graph import crank, wait_for

OK, WARN, ERROR = b'\0', b'\1', b'\2'

# Crank and ground span 1 to 3, coupler and rocker at most 2: s² = a² + d² − 2ad·cos φ = (b + c)².
LIMIT = acos(0.25)
ROCKER_ROCKER = 'four_bar: {a: 1.0, b: 1.0, c: 1.0, d: 2.0, assembly: left}'
# Stretched where the crank lies on the ground, and open everywhere else.
ONE_ANGLE = 'four_bar: {a: 1.0, b: 1.0, c: 1.0, d: 3.0}'
# A straight rod on its swivel: where the crank's pin passes it, the rod has no direction.
THROUGH_SWIVEL = 'inverted_slider_crank: {a: 0.25, swivel: [0.25, 0]}'


@pytest.fixture
def hold(graph):
    """Return a function that publishes a crank angle until a condition holds."""
    publisher = graph.publisher(JointState, '/crank_states')

    def hold(angle, condition, what):
        def publish_and_look():
            publisher.publish(crank(angle, 1.0))
            time.sleep(0.01)
            return condition()

        return wait_for(publish_and_look, what)

    return hold


def level(graph, wanted):
    def reached():
        status = graph.status('loop closure')
        return status if status is not None and status.level == wanted else None

    return reached


SCENE = 'rate: 100\ndrive: {topic: {carry_forward: false}}\neffects: {velocity: {}}'


def test_an_angle_out_of_reach(graph, write_scene, start, hold):
    node = start(write_scene('reach', SCENE, ROCKER_ROCKER))
    heard = graph.listen(JointState, '/joint_states')
    hold(1.0, lambda: len(heard) > 5, 'joint states within reach')

    status = hold(pi, level(graph, ERROR), 'ERROR')
    # At π crank pin and rocker pivot are 3 m apart, which two links of 1 m miss by 1 m.
    assert 'Open by 1 m' in status.message
    low, high = map(float, re.search(r'reachable: (\S+) to (\S+) rad', status.message).groups())
    assert high == pytest.approx(LIMIT, abs=1e-5)
    assert low == -high
    heard.clear()
    graph.diagnostics.clear()
    hold(pi, lambda: len(graph.diagnostics) > 2, 'diagnostics')
    assert heard == []
    assert 'open by 1 m, nothing published; reachable: -1.31812 to 1.31812 rad' in node.log

    hold(1.0, lambda: len(heard) > 5, 'joint states again')
    hold(1.0, level(graph, OK), 'OK')
    assert node.end() == 0


def test_at_a_toggle(graph, write_scene, start, hold):
    node = start(write_scene('toggle', SCENE, ONE_ANGLE))
    heard = graph.listen(JointState, '/joint_states')
    status = hold(0.0, level(graph, WARN), 'WARN')
    assert 'toggle' in status.message
    for message in heard:
        # All four links lie on one line.
        assert list(message.position) == pytest.approx([0.0, pi], abs=1e-7) or list(
            message.position
        ) == pytest.approx([0.0, -pi], abs=1e-7)
        assert list(message.velocity) == []
    assert 'at a toggle: positions published, velocities not' in node.log


def test_where_two_pins_coincide_no_pose_is_invented(graph, write_scene, start, hold):
    start(write_scene('swivel', SCENE, THROUGH_SWIVEL))
    heard = graph.listen(JointState, '/joint_states')
    hold(0.0, level(graph, ERROR), 'ERROR')
    assert heard == []
