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


"""What a run came to, in a few lines."""

from __future__ import annotations

from pathlib import Path

from linkage_ros.bag.reader import read_bag
from linkage_ros.cli.bag_reading import gaps
from linkage_ros.errors import LinkageError
from linkage_ros.kinematics.status import Status
from linkage_ros.node.node import LinkageNode
from linkage_ros.pipeline.pipeline import Pipeline
from linkage_ros.replay.replay import recorded_scene, ReplayedTick
from linkage_ros.replay.verify import beginning_text, DIFFERENT, prove, UNTOLD


def summary(node: LinkageNode) -> str:
    """Return the summary of a node's last run."""
    loop = node.loop
    if loop is None:
        return 'nothing ran'
    counts = loop.counts
    per_second = counts.ticks / loop.seconds
    rows = [('ticks', f'{counts.ticks} in {loop.seconds:.2f} s, {per_second:.1f} a second')]
    if counts.lateness.count:
        p50, p99 = (counts.lateness.percentile(p) / 1e3 for p in (50, 99))
        longest = counts.lateness.longest / 1e3
        rows += [
            ('', f'{counts.late} late by more than a period, {counts.lost} lost'),
            ('lateness', f'p50 {p50:.0f} µs, p99 {p99:.0f} µs, max {longest:.0f} µs'),
        ]
    rows += [
        ('published', f'{counts.published} joint states; {counts.silent} ticks without a crank'),
    ]
    if counts.withheld:
        rows.append(('withheld', f'{counts.withheld} readings, by what the scene does to sensors'))
    if node.crank_topic:
        rows.append(('samples', loop.samples))
    rows += [
        (status.value, f'{counts.unclosed[status]} ticks')
        for status in Status
        if counts.unclosed[status]
    ]
    for memory in node.recording.memories:
        rows += [
            (
                'memory',
                f'{t.name}: {t.received} received, {t.kept} in it at the end, {t.let_go} let go'
                + (f', {t.dropped} dropped' if t.dropped else ''),
            )
            for t in memory.topics
        ]
        rows.append(('snapshots', memory.snapshots))
    for recording in node.recording.ended:
        rows += [
            (
                'recorded',
                f'{t.name}: {t.recorded} of {t.received}, {t.dropped} dropped'
                + (f', {t.let_go} let go with the oldest files' if t.let_go else ''),
            )
            for t in recording.topics
        ]
        rows += [('bag', str(recording.folder)), ('proof', _proof(recording.folder))]
    if node.recording.failure:
        rows.append(('FAILED', node.recording.failure))
    return '\n'.join(f'{name:<14}{text}' for name, text in rows)


def _proof(folder: Path) -> str:
    """Replay a bag: whether it gives the same bytes, and how well its loop closed."""
    worst = 0.0

    def look(replayed: ReplayedTick) -> None:
        nonlocal worst
        for closure, seen in zip(closures, replayed.tick.looks, strict=True):
            if seen.position is not None and seen.position.joints:
                worst = max(worst, closure.residual(seen.position))

    try:
        bag = read_bag(folder)
        # The run was the user's own, and has imported them.
        scene = recorded_scene(bag, trust_effects=True)
        pipeline = Pipeline(scene)
        closures = pipeline.closures
        proof = prove(bag, scene, bag.messages(), look)
    except LinkageError as error:
        return str(error)
    if proof.verdict == UNTOLD:
        return f'{UNTOLD}: {beginning_text(proof)}'
    names = ['joint states', *(extra.topic.removeprefix('~/') for extra in pipeline.extras)]
    same = ' and '.join(
        f'{topic.same} of {topic.recorded} {name}'
        for name, topic in zip(names, proof.comparison.topics, strict=True)
    )
    notes = [beginning_text(proof)] if proof.beginning else []
    if proof.verdict == DIFFERENT:
        notes += gaps(bag)
    notes.append(f'worst loop residual {worst:.1e} m')
    return f'{same} replay to the same bytes; {"; ".join(notes)}'
