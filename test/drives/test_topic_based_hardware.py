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


"""
The system of docs/how_to/stand_in.md, with what ros2_control's topic-based hardware makes of it.

`Hardware` does what read() and write() of joint_state_topic_hardware_interface do in the versions
1.0.0 and 1.1.0 (joint_state_topic_hardware_interface.cpp), of get_state() and set_state() what
hardware_component_interface.hpp of Jazzy does: they throw where there is no such interface.
"""

from __future__ import annotations

from math import nan
from pathlib import Path
import re
from xml.etree import ElementTree as ET

from linkage_ros.messages.joint_state import Rejection
from linkage_ros.pipeline import Pipeline
from linkage_ros.scene.load import parse_scene
import pytest

from ..support.messages import joint_state as serialized
from ..support.messages import read_joint_state

PAGE = (Path(__file__).parents[2] / 'docs' / 'how_to' / 'stand_in.md').read_text('utf-8')
SYSTEM = re.search(r'```xml\n(.*?)```', PAGE, re.DOTALL)[1]
SCENE, LINKAGE = (
    re.search(rf'```yaml\n# {name}\n(.*?)```', PAGE, re.DOTALL)[1]
    for name in ('under_torque.yaml', 'press.yaml')
)
ALWAYS = '<param name="trigger_joint_command_threshold">-1</param>'
MS = 1_000_000
INTERFACES = ('position', 'velocity', 'effort')


class Hardware:
    """A system of ros2_control, as its XML says it."""

    def __init__(self, text, version):
        system = ET.fromstring(text)
        given = {each.get('name'): each.text for each in system.iter('param')}
        self._threshold = float(given.get('trigger_joint_command_threshold', 1e-5))
        self._compared = (
            ('position',) if version == '1.0.0' else ('position', 'velocity', 'effort')
        )
        self._joints = {
            joint.get('name'): [each.get('name') for each in joint.iter('command_interface')]
            for joint in system.findall('joint')
        }
        self.states = {
            (joint.get('name'), each.get('name')): nan
            for joint in system.findall('joint')
            for each in joint.iter('state_interface')
        }
        self.effort = nan

    def read(self, message):
        state = read_joint_state(message)
        for place, name in enumerate(state.name):
            if name in self._joints:
                for interface in INTERFACES:
                    values = getattr(state, interface)
                    if len(values):
                        assert (name, interface) in self.states, 'set_state() throws'
                        self.states[name, interface] = values[place]

    def write(self):
        """Return a message of the commands, or nothing where none is sent."""
        off = 0.0
        for name, commands in self._joints.items():
            for interface in commands:
                if interface in self._compared:
                    off += abs(self.states[name, interface] - self.effort)
        if off <= self._threshold:
            return None
        efforts = [self.effort for commands in self._joints.values() for _ in commands]
        return serialized(list(self._joints), efforts=efforts)


def pipeline():
    scene = SCENE.replace('press.yaml', 'linkage.yaml')
    files = {'scene.yaml': scene.encode(), 'linkage.yaml': LINKAGE.encode()}
    return Pipeline(parse_scene('under_torque', '', files))


@pytest.mark.parametrize('version', ['1.0.0', '1.1.0'])
def test_every_command_of_an_active_controller_is_taken(version):
    """For 2 s at 500 Hz; the crank moves by it."""
    hardware, linkage = Hardware(SYSTEM, version), pipeline()
    hardware.read(linkage.tick(0).message)
    assert linkage.offer(hardware.write(), 0) is Rejection.EFFORT_NOT_FINITE, 'none is active'
    begun = hardware.states['crank_joint', 'position']
    hardware.effort = 0.12
    for now in range(2 * MS, 2000 * MS, 2 * MS):
        assert linkage.offer(hardware.write(), now) is None
        hardware.read(linkage.tick(now).message)
    assert abs(hardware.states['crank_joint', 'position'] - begun) > 0.5


@pytest.mark.parametrize('version', ['1.0.0', '1.1.0'])
def test_with_the_default_threshold_what_acts_already_is_not_sent(version):
    hardware = Hardware(SYSTEM.replace(ALWAYS, ''), version)
    assert hardware.write() is None or version == '1.1.0'
    hardware.states['crank_joint', 'effort'] = hardware.effort = 0.12
    assert hardware.write() is None
    always = Hardware(SYSTEM, version)
    always.states, always.effort = hardware.states, hardware.effort
    assert always.write() is not None


@pytest.mark.parametrize('interface', INTERFACES)
def test_all_that_the_scene_publishes_is_a_state(interface):
    without = SYSTEM.replace(f'<state_interface name="{interface}"/>', '')
    with pytest.raises(AssertionError, match='set_state'):
        Hardware(without, '1.1.0').read(pipeline().tick(0).message)
