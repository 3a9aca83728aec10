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


"""Times to tick at, and crank messages for those who listen to a topic."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import cos, sin, tau

from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.survey import usual_inputs, Way
from linkage_ros.messages.joint_state import JointStateWriter
from linkage_ros.pipeline import Pipeline
from linkage_ros.scene.scene import Scene

_BEGIN = 1_000_000_000
_USUAL_RATE = 1000.0
_CRANK_RATE = 1.0
"""Turns, or swings, of the crank a second."""


def feed(scene: Scene, pipeline: Pipeline) -> Iterator[tuple[int, bytes]]:
    """Yield times, in [ns], each with a crank message, or b'' where nobody listens."""
    period = 1e9 / (scene.rate or _USUAL_RATE)
    names = [name for member in scene.members for name in member.inputs]
    write = JointStateWriter(names).write
    paths = [path for closure in pipeline.closures for path in _paths(closure)]
    count = 0
    while True:
        now = _BEGIN + round(count * period)
        message = b''
        if pipeline.topic:
            seconds = (now - _BEGIN) * 1e-9
            angles, rates = zip(*[path(seconds) for path in paths], strict=True)
            message = write(now, angles, rates, (0.0,) * len(names))
        yield now, message
        count += 1


Path = Callable[[float], tuple[float, float]]


def _paths(closure: Closure) -> list[Path]:
    """Return for each input where it is, and its rate, at a time in [s]: round, or to and fro."""
    centers = usual_inputs(closure)
    speed = tau * _CRANK_RATE
    if len(centers) > 1:
        sizes = [0.01 * closure.scale if i.slider else 0.01 for i in closure.linkage.inputs]
        return [_swing(c, size, speed) for c, size in zip(centers, sizes, strict=True)]
    widest = Way(closure).widest_range
    if widest is None or widest.whole:
        return [lambda seconds: (speed * seconds, speed)]
    middle, width = 0.5 * (widest.lowest + widest.highest), widest.highest - widest.lowest
    return [_swing(middle, 0.4 * width, speed)]


def _swing(center: float, amplitude: float, speed: float) -> Path:
    return lambda seconds: (
        center + amplitude * sin(speed * seconds),
        amplitude * speed * cos(speed * seconds),
    )
