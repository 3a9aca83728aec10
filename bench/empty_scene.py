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
What the empty scene costs beyond its bare closure and the packing of its message.

The yardstick is what one would write by hand for a four-bar on a topic: the crank carried forward,
the loop closed, the bytes packed. The scene does the same, and beside it keeps angles running on
over whole turns and says for whoever asks what it came to.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from bench.in_turn import compare, in_turn
from bench.processes import BenchError, ROOT
from bench.report import Table
from linkage_ros.joint_state import JointStateWriter
from linkage_ros.pipeline import Pipeline
from linkage_ros.scene.load import parse_scene

BEGIN = 1_700_000_000_000_000_000
PERIOD = 10_000
"""Simulated time between two ticks, in [ns]: a round stays within the age of its sample."""


@dataclass(frozen=True, slots=True)
class EmptyPlan:
    """
    How much is measured.

    Attributes
    ----------
    rounds
        How often each is measured, in turn.
    ticks
        Ticks in a round.

    """

    rounds: int
    ticks: int


def measure_empty_scene(plan: EmptyPlan) -> Table:
    """Measure a tick of the empty scene against the same by hand, and return the table."""
    empty, moving = _pipeline(''), _pipeline('effects: {velocity: {}}')
    (line,) = empty.lines
    state, close = line.drive.state, line.closure.position
    write = JointStateWriter(line.member.joints).write

    def by_hand(now: int) -> bytes:
        crank = state(now)
        return b'' if crank is None else write(now, close(*crank[0])[2], ())

    if by_hand(BEGIN) != empty.tick(BEGIN).message:
        raise BenchError('empty scene: publishes something else than its closure')
    times = [BEGIN + PERIOD * number for number in range(plan.ticks)]

    def all_of(tick: Callable[[int], object]) -> Callable[[], None]:
        def run() -> None:
            for now in times:  # nothing is kept, as in a node: garbage would be looked through
                tick(now)

        return run

    contenders = {
        'bare closure and packing': all_of(by_hand),
        'empty scene': all_of(empty.tick),
        'with velocity': all_of(moving.tick),
    }
    found = {
        name: [1e6 * seconds / plan.ticks for seconds in each]
        for name, each in in_turn(contenders, plan.rounds).items()
    }
    table = Table(
        'a tick, without ROS, one run, in turn', ('', 'first', 'second', 'ratio', 'target')
    )
    compare(table, 'µs a tick', 'empty scene', 'bare closure and packing', found, '≤ 1.05')
    compare(table, 'µs a tick', 'with velocity', 'empty scene', found, '')
    return table


def _pipeline(text: str) -> Pipeline:
    linkage = (ROOT / 'config' / 'linkages' / 'four_bar.yaml').read_bytes()
    files = {'scene.yaml': f'linkage: here\n{text}'.encode(), 'linkage.yaml': linkage}
    pipeline = Pipeline(parse_scene('measured', 'bench', files))
    sample = JointStateWriter(pipeline.lines[0].member.inputs).write(BEGIN, [0.3], [6.0])
    if pipeline.offer(sample, BEGIN) is not None:
        raise BenchError('empty scene: refuses its crank')
    return pipeline
