# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""joint_states holds the linkage's pose at each message's stamp, by an independent solution."""

from cmath import exp
from math import pi, remainder, tau
import time

import pytest
from sensor_msgs.msg import JointState

from .graph import crank, NS, stamp_of, wait_for
from .loops import four_bar, inverted_slider_crank, modulo_turns, rates

OMEGA = 20.0
"""rad/s: the first test sees more than four turns."""


def publish_turning_crank(publisher, seconds, *, begin, wrap):
    """Publish a crank that turns at OMEGA from the time `begin` on; return the stamps."""
    stamps = []
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        stamp = time.time_ns()
        angle = OMEGA * ((stamp - begin) / NS)
        if wrap:
            angle = remainder(angle, tau)
        publisher.publish(crank(angle, OMEGA, stamp))
        stamps.append(stamp)
        time.sleep(0.005)
    return stamps


def drop_until_quiet(heard):
    """Wait until nothing comes any more, so that all of it is there."""
    count = -1
    while len(heard) != count:
        count = len(heard)
        time.sleep(0.3)


def test_joint_states_are_solved_at_their_own_stamp(graph, write_scene, start):
    node = start(write_scene('ticks', 'rate: 200\neffects: {velocity: {}}'))
    heard = graph.listen(JointState, '/joint_states')
    publisher = graph.publisher(JointState, '/crank_states')
    wait_for(publisher.get_subscription_count, 'the node')
    begin = time.time_ns()
    publish_turning_crank(publisher, 1.5, begin=begin, wrap=True)
    drop_until_quiet(heard)
    assert len(heard) > 100
    previous = None
    for message in heard:
        assert message.name == ['coupler_joint', 'rocker_joint']
        assert list(message.effort) == []
        theta = OMEGA * ((stamp_of(message) - begin) / NS)
        expected = four_bar(theta)
        for value, angle in zip(message.position, expected, strict=True):
            assert exp(1j * value) == modulo_turns(angle)
        assert list(message.velocity) == pytest.approx(rates(four_bar, theta, OMEGA), abs=1e-5)
        if previous is not None:
            assert stamp_of(message) > stamp_of(previous)
            steps = zip(message.position, previous.position, strict=True)
            moved = OMEGA * (stamp_of(message) - stamp_of(previous)) / NS
            assert moved > 1.0 or all(abs(now - before) < pi for now, before in steps)
        previous = message
    coupler, rocker = zip(*(message.position for message in heard), strict=True)
    # Less the crank, which turns all the way round, the coupler unwinds; the rocker swings.
    assert max(coupler) - min(coupler) > 4 * tau
    assert max(rocker) - min(rocker) < pi
    assert node.end() == 0


def test_rate_0_publishes_each_sample_with_its_stamp(graph, write_scene, start):
    text = 'rate: 0\nangles: wrapped\neffects: {velocity: {}}'
    node = start(write_scene('every_sample', text, 'inverted_slider_crank'))
    heard = graph.listen(JointState, '/joint_states')
    publisher = graph.publisher(JointState, '/crank_states')
    wait_for(publisher.get_subscription_count, 'the node')
    begin = time.time_ns()
    sent = publish_turning_crank(publisher, 0.8, begin=begin, wrap=False)
    drop_until_quiet(heard)
    stamps = [stamp_of(message) for message in heard]
    assert len(stamps) > len(sent) / 2
    assert stamps == sorted(set(stamps) & set(sent)), (
        'each once, and none of the node’s own making'
    )
    for message, stamp in zip(heard, stamps, strict=True):
        assert message.name == ['rod_joint', 'rod_slide']
        theta = OMEGA * ((stamp - begin) / NS)
        rod, slide = inverted_slider_crank(theta)
        assert exp(1j * message.position[0]) == modulo_turns(rod)
        assert -pi < message.position[0] <= pi
        assert message.position[1] == pytest.approx(slide, abs=1e-9)
        expected = rates(inverted_slider_crank, theta, OMEGA)
        assert list(message.velocity) == pytest.approx(expected, abs=1e-5)
    assert node.end() == 0


@pytest.mark.sample(1)
@pytest.mark.parametrize('rate', [0, 100])
def test_node_ignores_its_own_messages_on_a_shared_topic(graph, write_scene, start, rate):
    scene = write_scene(f'shared_{rate}', f'rate: {rate}\neffects: {{velocity: {{}}}}')
    node = start(scene, '-r', 'crank_states:=joint_states')
    heard = graph.listen(JointState, '/joint_states')
    publisher = graph.publisher(JointState, '/joint_states')
    wait_for(lambda: publisher.get_subscription_count() > 1, 'the node')
    begin, sent = time.time_ns(), []

    def received():
        return int(graph.value('crank', 'Samples received') or 0)

    def publish():
        sent.extend(publish_turning_crank(publisher, 0.5, begin=begin, wrap=False))
        return received() > 20

    # What is sent before the node knows the publisher gets lost.
    wait_for(publish, 'samples')
    drop_until_quiet(heard)
    assert any(message.name == ['coupler_joint', 'rocker_joint'] for message in heard)
    assert received() <= len(sent)
    assert graph.value('crank', 'Samples rejected') == '0'
    assert node.end() == 0
    # On a busy machine it may see that the crank has ended, or lose ticks.
    warnings = [
        line
        for line in node.log.splitlines()
        if '[WARN]' in line and 'no message on ' not in line and ' ticks lost ' not in line
    ]
    assert warnings == []
