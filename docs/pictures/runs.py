# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Runs of a scene at simulated times: the real pipeline, without a node."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import deepcopy
import json
from math import nan
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from linkage_ros.bag import BagWriter, Topic
from linkage_ros.description import load_scene
from linkage_ros.messages import JointStateWriter
from linkage_ros.stages.effects import SensorReading
from linkage_ros.tick import LinkageState, Pipeline
import numpy as np
from numpy.typing import NDArray

Scene = dict[str, Any]
"""The content of a scene file."""

Sample = tuple[float, float, float]
"""Time since the first tick, in [s], and angle and rate of the crank."""

Values = NDArray[np.float64]

START = 1_700_000_000_000_000_000
"""Time of the first tick, in [ns]."""

CRANK = 'crank_joint'
"""The input of the linkages in the pictures."""

_LINKAGES = Path(__file__).resolve().parents[2] / 'config' / 'linkages'


class Run(NamedTuple):
    """A run of a scene: the pipeline after its last tick, and times in [s] since the first one."""

    pipeline: Pipeline
    times: Values
    states: list[LinkageState]

    def position(self, joint: str) -> Values:
        """Return the published positions of a joint, in [rad] or [m]; nan without a message."""
        return self._read(joint, lambda reading: reading.joints)

    def rate(self, joint: str) -> Values:
        """Return the published rate of a joint, in [rad/s] or [m/s]."""
        return self._read(joint, lambda reading: reading.rates)

    def acceleration(self, joint: str) -> Values:
        """Return the published acceleration of a joint, in [rad/s²] or [m/s²]."""
        return self._read(joint, lambda reading: reading.accelerations)

    def effort(self, joint: str) -> Values:
        """Return the published effort of a joint, in [N·m] or [N]."""
        return self._read(joint, lambda reading: reading.efforts)

    def stamps(self) -> Values:
        """Return the stamps of the published messages, in [s] since the first tick."""
        return np.array(
            [nan if state.reading is None else (state.reading.stamp - START) * 1e-9
             for state in self.states]
        )  # fmt: skip

    def crank(self) -> Values:
        """Return the crank by the drive: rows of angles, rates and accelerations."""
        return np.array(
            [
                (nan, nan, nan) if state.crank is None else
                (state.crank.angles[0], state.crank.rates[0], state.crank.accelerations[0])
                for state in self.states
            ]
        ).T  # fmt: skip

    def force(self, pin: str) -> Values:
        """Return the force in a pin, in [N]: a row of x and a row of y."""
        names = self.pipeline.linkages[0].context.reactions.names
        place = names.index(pin)
        motions = [state.motion for state in self.states]
        return np.array([m.reactions[place][:2] for m in motions if m is not None]).T

    def energy(self) -> Values:
        """Return the energy of the linkage, in [J]."""
        energy = self.pipeline.linkages[0].context.mechanics.total_energy
        return np.array(
            [
                energy(state.position, *state.crank.rates)
                for state in self.states
                if state.crank is not None and state.position is not None
            ]
        )

    def _read(self, joint: str, values: Callable[[SensorReading], Sequence[float]]) -> Values:
        place = self.pipeline.linkages[0].scene_linkage.joint_names.index(joint)
        read = [state.reading and values(state.reading) for state in self.states]
        return np.array([each[place] if each else nan for each in read])


def run(
    scene: Scene,
    seconds: float,
    samples: Sequence[Sample] = (),
    commands: Sequence[tuple[float, float]] = (),
) -> Run:
    """
    Run a scene for some seconds.

    The samples are on the topic, or in the bag, of its drive. Commands of a torque drive have a
    time, in [s], and a value.
    """
    with TemporaryDirectory() as folder:
        pipeline, reset = _built(Path(folder), scene, samples)
        listens = bool(pipeline.topic)
        due = [*messages(samples), *_commands(commands)] if listens else []
        times = ticks(scene, seconds)
        states = []
        last = START
        for time in times:
            now = START + time
            if pipeline.injection is not None:
                pipeline.injection.advance(now)
                now = pipeline.injection.tick_time(now)
            if now < last:
                pipeline = reset(pipeline)
            last = now
            while due and due[0][0] <= START + time:
                pipeline.offer(due.pop(0)[1], now)
            states.append(pipeline.tick(now).states[0])
    return Run(pipeline, np.array(times) * 1e-9, states)


def extra_messages(scene: Scene, message_type: str, seconds: float) -> list[bytes]:
    """Return the messages of an extra topic in a run of a scene without a topic drive."""
    with TemporaryDirectory() as folder:
        pipeline, _ = _built(Path(folder), scene, ())
    place = next(n for n, extra in enumerate(pipeline.extras) if extra.message == message_type)
    made = [pipeline.tick(START + time).extras for time in ticks(scene, seconds)]
    return [extras[place] for extras in made if extras and extras[place]]


def ticks(scene: Scene, seconds: float) -> list[int]:
    """Return the times of the ticks, in [ns] since the first."""
    rate = scene.get('rate', 1000)
    return [round(index * 1e9 / rate) for index in range(round(seconds * rate) + 1)]


def messages(samples: Sequence[Sample]) -> list[tuple[int, bytes]]:
    """Return crank messages, each with its time of arrival, in [ns]."""
    write = JointStateWriter([CRANK]).write
    times = [START + round(time * 1e9) for time, _, _ in samples]
    return [
        (time, write(time, (angle,), (rate,)))
        for time, (_, angle, rate) in zip(times, samples, strict=True)
    ]


def _commands(commands: Sequence[tuple[float, float]]) -> list[tuple[int, bytes]]:
    write = JointStateWriter([CRANK]).write
    times = [START + round(time * 1e9) for time, _ in commands]
    return [
        (time, write(time, (0.0,), (0.0,), (value,)))
        for time, (_, value) in zip(times, commands, strict=True)
    ]


def changed(scene: Scene, *changes: tuple[str, Any]) -> Scene:
    """Return a scene with other values for dotted keys; None removes a key."""
    scene = deepcopy(scene)
    for key, value in changes:
        *outer, last = key.split('.')
        within = scene
        for name in outer:
            within = within[name]
        if value is None:
            del within[last]
        else:
            within[last] = value
    return scene


def _built(
    folder: Path, scene: Scene, samples: Sequence[Sample]
) -> tuple[Pipeline, Callable[[Pipeline], Pipeline]]:
    """Build the pipeline of a scene; return it, and a function that builds it again."""
    file = folder / 'config' / 'scenes' / 'scene.yaml'
    file.parent.mkdir(parents=True)
    (folder / 'config' / 'linkages').symlink_to(_LINKAGES)
    file.write_text(json.dumps(scene), 'utf-8')
    bag = scene.get('drive', {}).get('bag')
    if bag is not None:
        _write_bag((file.parent / bag['file']).resolve(), samples)
    loaded = load_scene(file)

    def reset(old: Pipeline) -> Pipeline:
        return Pipeline(loaded, old.closures, old.injection)

    return Pipeline(loaded), reset


def _write_bag(folder: Path, samples: Sequence[Sample]) -> None:
    folder.parent.mkdir()
    writer = BagWriter(folder, [Topic('/crank_states', 'sensor_msgs/msg/JointState', '', '')])
    for time, data in messages(samples):
        writer.write(0, time, time, data)
    writer.close()
