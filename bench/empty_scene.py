# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Cost of the empty scene beyond the formulas of its linkage and the encoding of its message.

The reference is hand-written code for this four-bar on a topic: extrapolate the crank, close the
loop in straight-line code, encode the bytes. The scene does the same. In addition it checks
whether the loop closes, continues angles over whole turns, and stores the result for its callers.
"""

from __future__ import annotations

from collections.abc import Callable
from math import atan2, cos, isclose, sin, sqrt

from bench import ROOT
from bench.processes import MeasurementError
from bench.report import compare, in_turn, Table
from linkage_ros.description import parse_scene
from linkage_ros.messages import JointStateReader, JointStateWriter, Rejection
from linkage_ros.tick import Pipeline

BEGIN = 1_700_000_000_000_000_000
PERIOD = 10_000
"""Simulated time between two ticks, in [ns]: a round stays within the age of its sample."""

_CRANK = 0.3, 6.0
"""Angle and rate of the only sample, in [rad] and [rad/s]."""


def measure_empty_scene(rounds: int, ticks: int) -> Table:
    """Measure ticks of the empty scene and of hand-written code in turn, and return the table."""
    empty, moving = _pipeline(''), _pipeline('effects: {velocity: {}}')
    by_hand = _by_hand(0.04, 0.12, 0.08, 0.1)
    (look,) = empty.tick(BEGIN).states
    joints = JointStateReader(empty.linkages[0].scene_linkage.joint_names).read(by_hand(BEGIN))
    if isinstance(joints, Rejection) or look.reading is None:
        raise MeasurementError('empty scene: publishes nothing')
    if not all(map(isclose, joints.angles, look.reading.joints)):
        raise MeasurementError('empty scene: publishes other angles than the hand-written code')
    times = [BEGIN + PERIOD * index for index in range(ticks)]

    def all_of(tick: Callable[[int], object]) -> Callable[[], None]:
        def run() -> None:
            for now in times:  # no result is kept, as in a node: the collector would visit it
                tick(now)

        return run

    contenders = {
        'straight line and packing': all_of(by_hand),
        'empty scene': all_of(empty.tick),
        'with velocity': all_of(moving.tick),
    }
    found = {
        name: [1e6 * seconds / ticks for seconds in each]
        for name, each in in_turn(contenders, rounds).items()
    }
    table = Table(
        'a tick, without ROS, one run, in turn', ('', 'first', 'second', 'ratio', 'target')
    )
    compare(table, 'µs a tick', 'empty scene', 'straight line and packing', found, '≤ 1.5')
    compare(table, 'µs a tick', 'with velocity', 'empty scene', found, '≤ 1.25')
    return table


def _by_hand(a: float, b: float, c: float, d: float) -> Callable[[int], bytes]:
    """Return the tick of a four-bar with crank a, coupler b, rocker c and ground d."""
    stamp, angle, rate = BEGIN, *_CRANK
    write = JointStateWriter(['coupler_joint', 'rocker_joint']).write
    apart, twice_a, root = d - a, 2.0 * a, 2.0 * sqrt(a * d)
    fold = (abs(d - a) - abs(b - c)) * (abs(d - a) + abs(b - c))
    stretch = (b + c - a - d) * (a + b + c + d)
    more = (b - c) * (b + c) + apart * apart
    less = (b - c) * (b + c) - apart * apart

    def tick(now: int) -> bytes:
        phi = angle + rate * ((now - stamp) * 1e-9)
        half_sine, half_cosine = sin(0.5 * phi), cos(0.5 * phi)
        near, far = root * half_sine, root * half_cosine
        cross = sqrt(fold + near * near) * sqrt(stretch + far * far)
        direction = atan2(
            -twice_a * half_sine * half_cosine, apart + twice_a * half_sine * half_sine
        )
        coupler = direction + atan2(cross, more + near * near)
        rocker = direction + atan2(cross, less - near * near)
        return write(now, (coupler - phi, rocker), ())

    return tick


def _pipeline(text: str) -> Pipeline:
    linkage = (ROOT / 'config' / 'linkages' / 'four_bar.yaml').read_bytes()
    files = {'scene.yaml': f'linkage: here\n{text}'.encode(), 'linkage.yaml': linkage}
    pipeline = Pipeline(parse_scene('measured', 'bench', files))
    angle, rate = _CRANK
    sample = JointStateWriter(pipeline.linkages[0].scene_linkage.input_names).write(
        BEGIN, [angle], [rate]
    )
    if pipeline.offer(sample, BEGIN) is not None:
        raise MeasurementError('empty scene: refuses its crank')
    return pipeline
