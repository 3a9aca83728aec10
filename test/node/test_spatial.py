# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A node moves spatial linkages: its rods keep their lengths, and its bags replay."""

from array import array
from functools import partial
import time

from linkage_ros.cli.main import main
import numpy as np
import pytest
from sensor_msgs.msg import JointState

from .graph import crank, NS, stamp_of, wait_for

X, Y, Z = np.eye(3)


def turned(point, at, axis, angle):
    """Return a point turned about an axis through a point."""
    arm, unit = np.subtract(point, at), np.array(axis) / np.linalg.norm(axis)
    across, along = np.cross(unit, arm), unit * (unit @ arm)
    return at + along + np.cos(angle) * (arm - along) + np.sin(angle) * across


def rod_gap(one, other, one_turns, other_turns, values):
    """Return by how much a rod has another length than in the pose; hinges turn its ends."""
    ends = []
    for point, turns in ((one, one_turns), (other, other_turns)):
        now = np.array(point)
        for name, at, axis in turns:
            now = turned(now, at, axis, values[name])
        ends.append(now)
    return np.linalg.norm(ends[0] - ends[1]) - np.linalg.norm(np.subtract(one, other))


FOOT = (('roll', (0, 0, -0.018), X), ('pitch', (0, 0, 0), Y))
RODS = {
    'ankle': [
        partial(rod_gap, (0.035, 0.0165, 0.146), (0.022, 0.015, -0.010),
                [('m1', (0.035, 0, 0.150), X)], FOOT),
        partial(rod_gap, (0.040, -0.0165, 0.211), (0.022, -0.015, -0.010),
                [('m2', (0.040, 0, 0.215), X)], FOOT),
    ],
    'rssr': [
        partial(rod_gap, (0.04, 0, 0), (0.1, 0.02, 0.12), [('crank_joint', (0, 0, 0), Z)],
                [('rocker_joint', (0.15, 0.05, 0.03), (0, 1, 0.3))])
    ],
}  # fmt: skip
RODS['ankle_motors'] = RODS['ankle']
MOTIONS = {
    'ankle_motors': {'m2': (0.1, -0.04), 'm1': (-0.2, 0.05)},
    'ankle': {'roll': (-0.1, 0.05), 'unknown': (0.0, 7.0), 'pitch': (0.05, 0.1)},
    'rssr': {'crank_joint': (0.5, 2.0)},
}
"""For each input its start and its rate."""


@pytest.mark.sample(1)
@pytest.mark.parametrize('linkage', RODS)
def test_rods_of_a_spatial_linkage_keep_their_lengths(
    graph, write_scene, start, folder, capsys, linkage
):
    record = f'record: {{directory: {folder}, name: {linkage}_bag}}'
    text = f'rate: 200\neffects: {{velocity: {{}}}}\ndrive: {{topic: {{max_age: 60}}}}\n{record}'
    node = start(write_scene(f'spatial_{linkage}', text, f'space/{linkage}'))
    states = graph.listen(JointState, '/joint_states')
    publisher = graph.publisher(JointState, '/crank_states')
    begin, motion = time.time_ns(), MOTIONS[linkage]

    def publish():
        seconds = (time.time_ns() - begin) / NS
        message = crank(0.0, stamp=begin + round(seconds * NS))
        message.name = list(motion)
        message.position = array('d', [p + v * seconds for p, v in motion.values()])
        message.velocity = array('d', [v for _, v in motion.values()])
        publisher.publish(message)
        return len(states) > 60

    wait_for(publish, 'joint states')
    assert node.end() == 0
    for message in states:
        seconds = (stamp_of(message) - begin) / NS
        given = {name: (p + v * seconds, v) for name, (p, v) in motion.items()}
        found = zip(message.position, message.velocity, strict=True)
        given |= dict(zip(message.name, found, strict=True))
        for gap in RODS[linkage]:
            assert abs(gap({name: value for name, (value, _) in given.items()})) < 1e-9
            before, after = (
                gap({name: value + t * rate for name, (value, rate) in given.items()})
                for t in (-1e-5, 1e-5)
            )
            assert abs(after - before) / 2e-5 < 1e-6
    assert main(['replay', str(folder / f'{linkage}_bag')]) == 0
    assert 'identical' in capsys.readouterr().out
