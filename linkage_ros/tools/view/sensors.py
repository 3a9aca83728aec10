# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
What the sensors of a scene read while a page moves its linkage.

The scene is ticked as its node does it, at the scene's rate; but the crank is the page's, and the
drive of the scene is left out. Between two requests the crank moves evenly.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import floor
from typing import Any, NamedTuple

from linkage_ros.description import parse_scene, SCENE_FILE, SceneLinkage
from linkage_ros.kinematics import Closure, PlanarClosure
from linkage_ros.stages.drives import SampledCrank, SampledInputs, TopicDrive
from linkage_ros.stages.effects import ForceEffect, SensorReading
from linkage_ros.tick import LinkagePipeline
from linkage_ros.tools.view.report import link_poses
import numpy as np

_NANOSECONDS = 1_000_000_000

_LONGEST = 0.5
"""After a longer pause between two requests, in [s], the run begins again."""

_FASTEST = 2000.0
"""A scene with a higher rate, in [Hz], is ticked at this one: a page needs no more."""


class SceneFiles(NamedTuple):
    """A scene as it goes to another process: texts as in `Scene.files`, folder of its paths."""

    name: str
    files: Mapping[str, str]
    folder: str


class Sensors:
    """
    The first linkage of a scene, ticked for one page; the page may have changed its text.

    A FileError says that the changed linkage does not fit the scene.
    """

    def __init__(self, files: SceneFiles, text: str | None = None) -> None:
        data = {name: content.encode() for name, content in files.files.items()}
        if text is not None:
            data[next(name for name in data if name != SCENE_FILE)] = text.encode()
        # The user names this scene to be shown: its own effects are imported, as in a run of it.
        scene = parse_scene(files.name, files.name, data, files.folder, trust_effects=True)
        self.text = text
        self._scene_linkage = _driven_by_hand(scene.linkages[0])
        self._scene = replace(scene, linkages=(self._scene_linkage,), faults={})
        self._rate = min(scene.rate, _FASTEST)
        self.count = len(self._scene_linkage.linkage.inputs)
        self._closure: Closure | None = None
        self._linkage: LinkagePipeline | None = None
        self._last: tuple[float, Sequence[float]] = 0.0, ()
        self._reading: SensorReading | None = None

    def read(self, t: float, inputs: Sequence[float], rates: Sequence[float]) -> dict[str, Any]:
        """
        Return what the sensors read at a time of the page, in [s]; a step back restarts the run.

        Inputs and rates are in [rad] and [rad/s], or [m] and [m/s]. The result has ``read``: the
        value of each published joint, in [rad] or [m], empty where nothing is published; and
        ``frames``: x, y and angle of each link where these values put it, as the program of a
        model gives them, empty where they put it nowhere, and in space.
        """
        since, before = self._last
        line = self._linkage
        if line is None or not since <= t <= since + _LONGEST:
            line = self._linkage = LinkagePipeline(
                self._scene, self._scene_linkage, self._closure, None
            )
            self._closure = line.closure
            self._reading = None
            since, before = t, inputs
            times: Sequence[float] = [t]
        else:
            times = list(self._tick_times(since, t))
        self._last = t, inputs
        for time in times:
            share = (time - since) / (t - since) if t > since else 1.0
            angles = tuple(a + share * (b - a) for a, b in zip(before, inputs, strict=True))
            now = round(time * _NANOSECONDS)
            assert isinstance(line.drive, SampledCrank | SampledInputs)
            line.drive.hold(now, angles, tuple(rates))
            self._reading = line.interpret(now).reading
        return self._readings_content(inputs)

    def _tick_times(self, since: float, until: float) -> Iterator[float]:
        """Yield the times of the ticks after one time and up to another, in [s]."""
        if self._rate == 0.0:  # a tick for each sample
            yield until
            return
        for index in range(floor(since * self._rate) + 1, floor(until * self._rate) + 1):
            yield index / self._rate

    def _readings_content(self, inputs: Sequence[float]) -> dict[str, Any]:
        if self._reading is None:
            return {'read': {}, 'frames': []}
        scene_linkage = self._scene_linkage
        read = dict(zip(scene_linkage.joint_names, self._reading.joints, strict=True))
        closure, frames = scene_linkage.closure, np.zeros(0)
        if isinstance(closure, PlanarClosure):
            values = dict(zip(scene_linkage.input_names, inputs, strict=True)) | read
            arrays = {name: np.array([value]) for name, value in values.items()}
            frames = link_poses(
                closure, scene_linkage.prefix, arrays, scene_linkage.input_names
            ).frames[0]
        finite = bool(np.isfinite(frames).all())
        # A fault of a sensor may publish NaN, which JSON does not hold.
        read = {name: value for name, value in read.items() if np.isfinite(value)}
        return {'read': read, 'frames': frames.ravel().tolist() if finite else []}


def _driven_by_hand(scene_linkage: SceneLinkage) -> SceneLinkage:
    """Return a linkage whose crank is moved from outside."""
    effects, loads = scene_linkage.effects, scene_linkage.loads
    if not any(effect.computes_forces for effect in effects.values()):
        # They acted on the drive alone.
        effects = {
            name: effect for name, effect in effects.items() if not isinstance(effect, ForceEffect)
        }
        loads = None
    drive = 'topic', TopicDrive()
    return replace(scene_linkage, drive=drive, effects=effects, loads=loads)
