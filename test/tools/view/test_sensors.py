# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What the sensors of a scene read while a page moves its crank."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi, remainder, tau
from pathlib import Path

import linkage_ros as lr
from linkage_ros.description import load_scene, SCENE_FILE
from linkage_ros.kinematics import Closure, frames_of_links, SpaceClosure
from linkage_ros.resources import scene_names, shipped_path
from linkage_ros.tools.view import SceneFiles, Sensors
import pytest

RATE = 2.0
"""Of the crank, in [rad/s]."""


def sensors(effects: str, rate: str = '1000', text: str | None = None) -> Sensors:
    """Return the sensors of a four-bar's scene."""
    scene = f'linkage: four_bar.yaml\nrate: {rate}\npublish_input: true\neffects: {effects}\n'
    linkage = shipped_path('linkages/four_bar.yaml').read_text('utf-8')
    return Sensors(SceneFiles('scene', {SCENE_FILE: scene, 'linkage.yaml': linkage}, '.'), text)


def turned(of: Sensors, frames: int) -> Mapping[str, float]:
    """Turn the crank for so many frames of 1/60 s, and return the last reading."""
    for frame in range(frames + 1):
        t = frame / 60.0
        read: Mapping[str, float] = of.read(t, [RATE * t], [RATE])['read']
    return read


@pytest.fixture(scope='module')
def closure() -> Closure:
    return lr.load('four_bar')


def true(closure: Closure, angle: float) -> list[float]:
    return [angle, *closure.position(angle).joints]


def test_sensors_without_effects_read_the_joints(closure: Closure) -> None:
    # The last tick of a scene at 60 Hz is that of the frame.
    read = turned(sensors('{}', '60'), 30)
    assert list(read) == ['crank_joint', 'coupler_joint', 'rocker_joint']
    assert list(read.values()) == pytest.approx(true(closure, RATE * 0.5), abs=1e-9)


def test_scene_at_rate_0_ticks_once_per_frame(closure: Closure) -> None:
    read = turned(sensors('{}', '0'), 31)
    assert list(read.values()) == pytest.approx(true(closure, RATE * 31 / 60), abs=1e-9)


def test_encoder_sensor_reads_whole_steps(closure: Closure) -> None:
    step = tau / 64
    read = turned(sensors('{encoder: {joints: {rocker_joint: {counts: 64}}}}'), 30)
    assert abs(remainder(read['rocker_joint'], step)) < 1e-12
    assert abs(read['rocker_joint'] - true(closure, RATE * 0.5)[2]) <= step


def test_delay_sensor_reads_an_earlier_angle(closure: Closure) -> None:
    read = turned(sensors('{delay: {seconds: 0.1}}'), 30)
    assert list(read.values()) == pytest.approx(true(closure, RATE * 0.4), abs=1e-6)


def test_sensor_frames_follow_the_readings(closure: Closure) -> None:
    found = sensors('{}', '60').read(0.0, [1.0], [0.0])['frames']
    frames = frames_of_links(closure, closure.position(1.0))
    expected = [
        value
        for link, frame in frames.items()
        if link != 'ground'
        for value in (frame.place.real, frame.place.imag, remainder(frame.angle, tau))
    ]
    assert found == pytest.approx(expected, abs=1e-9)


def test_sensors_of_an_open_linkage_read_nothing() -> None:
    text = shipped_path('linkages/double_rocker.yaml').read_text('utf-8')
    low = lr.load('double_rocker').closing_ranges[0].lowest
    of = Sensors(
        SceneFiles('scene', {SCENE_FILE: 'linkage: x\nrate: 60\n', 'linkage.yaml': text}, '.')
    )
    assert of.read(0.0, [low - 0.2], [0.0]) == {'read': {}, 'frames': []}
    assert of.read(1 / 60, [low + 0.2], [0.0])['read']


def test_time_jump_or_long_pause_restarts_the_sensors() -> None:
    of = sensors('{delay: {seconds: 0.1}}')
    assert turned(of, 30)
    for t in (0.0, 10.0):
        # A delay line that is new has nothing to give yet.
        assert of.read(t, [1.0], [0.0])['read'] == {}


def test_sensors_read_the_edited_linkage() -> None:
    text = shipped_path('linkages/four_bar.yaml').read_text('utf-8')
    longer = text.replace('0.120', '0.125')
    assert longer != text
    assert turned(sensors('{}', '60', longer), 3) != turned(sensors('{}', '60'), 3)


@pytest.mark.sample(5)
@pytest.mark.parametrize('name', scene_names())
def test_sensors_read_every_shipped_planar_scene(name: str) -> None:
    scene = load_scene(name)
    if isinstance(scene.linkages[0].closure, SpaceClosure):
        pytest.skip('the page shows planar linkages')
    files = {part: data.decode() for part, data in scene.files.items()}
    of = Sensors(SceneFiles(name, files, scene.folder))
    closure = scene.linkages[0].closure
    low = closure.closing_ranges[0].lowest if closure.closing_ranges[0].turns == 0 else pi / 3
    read: Mapping[str, float] = {}
    for frame in range(60):
        found = of.read(frame / 60, [low + 0.1 + 1e-3 * frame] * of.count, [0.06] * of.count)
        read = found['read'] or read
    assert tuple(read) == scene.linkages[0].joint_names


def test_torque_drive_takes_its_crank_from_the_page(tmp_path: Path) -> None:
    """Loads and friction that act on the drive alone are left out with it."""
    scene = (
        'linkage: x\nrate: 1000\ndrive: {torque: {}}\neffects: {velocity: {}}\n'
        'loads: {gravity: [0, -9.81]}\n'
    )
    linkage = shipped_path('linkages/four_bar.yaml').read_text('utf-8')
    of = Sensors(SceneFiles('x', {SCENE_FILE: scene, 'linkage.yaml': linkage}, str(tmp_path)))
    assert of.read(0.0, [1.0], [0.5])['read']['crank_joint'] == 1.0
