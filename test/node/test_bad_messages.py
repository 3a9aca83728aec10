# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Bad crank messages: rejected, counted by reason, warned of, and forgotten.

One node for all of them, which holds a good sample meanwhile: the state must not change.
"""

from array import array
from cmath import exp
from math import inf, nan
import re
import time

import pytest
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

from .graph import crank, Graph, NodeProcess, NS, stamp_of, wait_for
from .loops import four_bar, modulo_turns

WARNING_PERIOD = 0.5
OK, WARN = b'\0', b'\1'


def arrays(names, positions, velocities, efforts=()):
    message = crank(1.0)
    message.name = list(names)
    message.position, message.velocity, message.effort = (
        array('d', values) for values in (positions, velocities, efforts)
    )
    return message


def stamped(offset_or_stamp):
    """Return a message stamped so many ns from now, or at (seconds, nanoseconds)."""
    message = crank(1.0)
    if isinstance(offset_or_stamp, tuple):
        message.header.stamp.sec, message.header.stamp.nanosec = offset_or_stamp
        return message
    return crank(1.0, stamp=time.time_ns() + offset_or_stamp)


CRANK = 'crank_joint'
NOT_FINITE = 'position or rate not finite'
TOO_LARGE = 'position or rate beyond 1e10'
UNEQUAL = 'arrays of unequal length'
EMPTY = 'no joints or no positions'
MALFORMED = 'malformed message'
INVALID = 'stamp negative or with 1e9 ns or more'

BAD = {
    'angle NaN': (lambda: crank(nan), NOT_FINITE),
    'angle infinite': (lambda: crank(inf), NOT_FINITE),
    'rate infinite': (lambda: crank(1.0, -inf), NOT_FINITE),
    'angle too large': (lambda: crank(1.1e10), TOO_LARGE),
    'angle too small': (lambda: crank(-1e300), TOO_LARGE),
    'rate too large': (lambda: crank(1.0, 1e11), TOO_LARGE),
    'no joints': (lambda: arrays([], [], []), EMPTY),
    'no positions': (lambda: arrays([CRANK], [], []), EMPTY),
    'positions for one of two': (lambda: arrays([CRANK, 'x'], [1.0], [1.0]), UNEQUAL),
    'velocities for one of two': (lambda: arrays([CRANK, 'x'], [1.0, 1.0], [1.0]), UNEQUAL),
    'too many velocities': (lambda: arrays([CRANK], [1.0], [1.0, 1.0]), UNEQUAL),
    'too many efforts': (lambda: arrays([CRANK], [1.0], [1.0], [0.0, 0.0]), UNEQUAL),
    'crank twice': (
        lambda: arrays([CRANK, CRANK], [1.0, 1.0], [1.0, 1.0]),
        'crank joint named twice',
    ),
    'stamp zero': (lambda: stamped((0, 0)), 'stamp zero'),
    'stamp negative': (lambda: stamped((-1, 999_999_999)), INVALID),
    'stamp with 1e9 ns': (lambda: stamped((1_700_000_000, NS)), INVALID),
    'stamp a minute ahead': (lambda: stamped(60 * NS), 'stamp in the future'),
    'stamp of 2038': (lambda: stamped((2**31 - 1, 0)), 'stamp in the future'),
    'stamp a minute old': (lambda: stamped(-60 * NS), 'stamp older than the last'),
    'stamp of 1970': (lambda: stamped((1, 0)), 'stamp older than the last'),
    'cut short': (lambda: serialize_message(crank(1.0))[:-12], MALFORMED),
    'not CDR': (lambda: b'\xff' * 100, MALFORMED),
    'another message': (lambda: b'\0\1\0\0' + bytes(200), EMPTY),
}


class Rig:
    """A node under test, its crank, and what it says."""

    def __init__(self, graph, node):
        self.graph, self.node = graph, node
        self.heard = graph.listen(JointState, '/joint_states')
        self.publisher = graph.publisher(JointState, '/crank_states')
        self.begun = time.monotonic()
        # Discovery has two sides: what is sent before the node knows the publisher gets lost.
        wait_for(lambda: self.publisher.publish(crank(0.5)) or self.heard, 'the first tick')

    def rejected(self):
        """Return how many were rejected, by reason, by the newest diagnostics."""
        status = self.graph.status('crank')
        return {
            pair.key.removeprefix('Rejected: '): int(pair.value)
            for pair in (status.values if status else ())
            if pair.key.startswith('Rejected: ')
        }

    def hold(self, angle):
        """Publish a good sample, and wait until the linkage is there."""
        self.publisher.publish(crank(angle))
        wait_for(lambda: self.heard and self.stands_at(self.heard[-1], angle), f'{angle} rad')

    @staticmethod
    def stands_at(message, angle):
        coupler, rocker = four_bar(angle)
        return exp(1j * message.position[0]) == modulo_turns(coupler) and (
            exp(1j * message.position[1]) == modulo_turns(rocker)
        )


@pytest.fixture(scope='module')
def rig(domain, folder, write_scene):
    scene = write_scene('held', 'rate: 50\ndrive: {topic: {max_age: 60}}\neffects: {velocity: {}}')
    graph = Graph(domain)
    arguments = f'scene:={scene}', 'diagnostics_period:=0.2', f'warning_period:={WARNING_PERIOD}'
    node = NodeProcess(domain, folder, *(part for a in arguments for part in ('-p', a)))
    node.wait_for_log('ticking')
    yield Rig(graph, node)
    node.kill()
    graph.end()


@pytest.mark.parametrize('kind', BAD)
def test_bad_message_is_counted_and_the_state_stays(rig, kind):
    make, reason = BAD[kind]
    rig.hold(0.5)
    before = wait_for(rig.graph.diagnostics.copy, 'diagnostics') and rig.rejected()
    rig.publisher.publish(make())
    expected = before | {reason: before.get(reason, 0) + 1}
    wait_for(lambda: rig.rejected() != before, f'a rejection: {reason}')
    assert rig.rejected() == expected
    seen = time.time_ns()
    newest = wait_for(
        lambda: stamp_of(rig.heard[-1]) > seen and rig.heard[-1], 'a tick after the rejection'
    )
    assert rig.stands_at(newest, 0.5)
    rig.hold(0.6)


WITHOUT = {
    'other joints': lambda: arrays(['x'], [1.0], [1.0]),
    'crank by another case': lambda: crank(1.0, name='Crank_Joint'),
}


@pytest.mark.parametrize('kind', WITHOUT)
def test_messages_of_other_joints_are_counted_as_ignored(rig, kind):
    # A joint_states that all robots' nodes share: these are not errors.
    rig.hold(0.5)
    rig.graph.next_status('crank')
    before, ignored, warned = rig.rejected(), ignored_by(rig), len(warnings(rig))
    for _ in range(10):
        rig.publisher.publish(WITHOUT[kind]())
    wait_for(lambda: ignored_by(rig) == ignored + 10, 'ten messages without the crank')
    status = rig.graph.status('crank')
    assert (status.level, status.message) == (OK, 'Samples arriving')
    assert rig.rejected() == before
    # One of what was sent before may still come: they are throttled.
    assert not [line for line in warnings(rig)[warned:] if 'missing' in line or 'hold' in line]
    rig.hold(0.6)


def ignored_by(rig):
    return int(rig.graph.value('crank', 'Messages without the crank') or 0)


def test_node_warns_of_a_misnamed_crank(rig, write_scene, start):
    node = start(write_scene('misnamed', 'rate: 50'), '-r', 'crank_states:=misnamed')
    publisher = rig.graph.publisher(JointState, '/misnamed')
    wait_for(
        lambda: publisher.publish(crank(1.0, name='Crank')) or ' hold ' in node.log,
        'the warning',
    )
    (line, *_) = [line for line in node.log.splitlines() if ' hold ' in line]
    assert re.search(
        r"messages on /misnamed hold 'Crank'; the linkage needs 'crank_joint': name the joint so "
        'there, or remap the topic$',
        line,
    )


def test_rejection_warning_is_throttled_with_reason_and_remedy(rig):
    rig.hold(0.5)
    count = len(warnings(rig))
    for _ in range(20):
        rig.publisher.publish(crank(nan))
    wait_for(lambda: len(warnings(rig)) > count, 'the warning')
    time.sleep(3 * WARNING_PERIOD)
    lines = warnings(rig)
    assert len(lines) <= 2 + (time.monotonic() - rig.begun) / WARNING_PERIOD
    last = '\n'.join(lines[count:])
    assert '/crank_states' in last
    assert NOT_FINITE in last
    assert re.search(r'not finite \(\d+\): check the sensor', last)
    assert sum(map(int, re.findall(r'not finite \((\d+)\)', last))) == 20


def test_crank_diagnostics_warn_and_recover(rig):
    rig.hold(0.5)
    rig.publisher.publish(crank(nan))
    assert 'rejected' in rig.graph.wait_for_level('crank', WARN).message
    rig.graph.wait_for_level('crank', OK)


def test_node_works_after_all_bad_messages(rig):
    rig.hold(0.7)
    assert rig.node.end() == 0
    assert 'Traceback' not in rig.node.log


def warnings(rig):
    return [line for line in rig.node.log.splitlines() if 'samples rejected' in line]
