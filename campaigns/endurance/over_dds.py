# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Minutes over DDS: a node and a crank source as processes; the node's memory and counts."""

from __future__ import annotations

from dataclasses import dataclass, field
import json
from pathlib import Path
import subprocess
import sys
from tempfile import TemporaryDirectory
import time
from typing import Any

from campaigns.campaign import progress_lines
from campaigns.endurance.accelerated import SCENES
from campaigns.endurance.memory import Counts, counts_of, shortcomings, Usage, usage
from linkage_ros.bag import read_bag
from linkage_ros.processes import Graph, MeasurementError, private_domain
from rosbags.typesys import get_typestore, Stores

_CRANK_RATE = 500
_START = 30.0
"""Time limit for the beginning of the recording [s]."""

_SAMPLES = 600
"""Number of samples of the node's memory, at most one per second."""


@dataclass(slots=True)
class DdsRun:
    """The outcome of a run of minutes: usage, counts of ticks and bag, and ``replay --json``."""

    minutes: float
    samples: list[Usage] = field(default_factory=list)
    ticks: dict[str, str] = field(default_factory=dict)
    counts: Counts = field(default_factory=dict)
    replayed: dict[str, Any] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)


def run(minutes: float) -> DdsRun:
    """
    Run the demo over DDS, on a graph of its own.

    Its bag is split once a minute, since the index of a file stays in memory until its end.
    """
    with TemporaryDirectory(prefix='linkage_ros_endurance_') as name:
        folder = Path(name)
        scene = _scene(folder, max(min(60.0, 6.0 * minutes), 1.0))
        # Below 102, so that the ports stay below the kernel's ephemeral ones.
        graph = Graph(private_domain(), folder, longest=round(60.0 * minutes) + 120)
        done = DdsRun(minutes)
        try:
            _record(graph, scene, folder / 'bag', done)
        except MeasurementError as error:
            done.faults.append(str(error))
            return done
        done.faults += shortcomings(folder / 'bag')
        done.counts = counts_of(folder / 'bag')
        done.ticks = _ticks(folder / 'bag')
        done.replayed = _replayed(folder / 'bag')
        if done.replayed.get('verdict') != 'identical':
            done.faults.append(f'the replay is {done.replayed.get("verdict")}')
        return done


def _record(graph: Graph, scene: Path, bag: Path, done: DdsRun) -> None:
    """Run node and source, sample the node's usage, and end both."""
    node_arguments = ['--ros-args', '-p', f'scene:={scene}']
    with graph.run_module('linkage_ros.node.linkage_node', node_arguments) as node:
        until = time.monotonic() + _START
        while not (bag / 'metadata.yaml').exists() and time.monotonic() < until:
            node.check_running()
            time.sleep(0.05)
        source_arguments = ['--ros-args', '-p', f'rate:={_CRANK_RATE}.0']
        with graph.run_module('linkage_ros.node.crank_source', source_arguments) as source:
            begin = time.monotonic()
            seconds = 60.0 * done.minutes
            step = max(seconds / _SAMPLES, min(1.0, seconds / 40))
            progress = progress_lines(seconds, 's over DDS')
            while (now := time.monotonic() - begin) < seconds:
                node.check_running()
                source.check_running()
                done.samples.append(usage(now, node.pid))
                progress(step)
                time.sleep(max(0.0, begin + step * len(done.samples) - time.monotonic()))
    node.check_end()
    source.check_end()


def _scene(folder: Path, split_seconds: float) -> Path:
    """Write the demo scene with a bag that is split."""
    text = (SCENES / 'demo.yaml').read_text()
    text = text.replace('../linkages', str(SCENES.parent / 'linkages'))
    record = f'record: {{directory: {folder}, name: bag, split_seconds: {split_seconds:g}}}'
    text = text.replace('record: {directory: runs}', record)
    file = folder / 'demo.yaml'
    file.write_text(text)
    return file


def _ticks(bag: Path) -> dict[str, str]:
    """Return the last diagnostics in a bag about the ticks and the crank."""
    store = get_typestore(Stores.ROS2_JAZZY)
    last = b''
    for message in read_bag(bag).messages():
        if message.topic == '/diagnostics':
            last = message.data
    if not last:
        return {}
    diagnostics: Any = store.deserialize_cdr(last, 'diagnostic_msgs/msg/DiagnosticArray')
    return {
        pair.key: pair.value
        for status in diagnostics.status
        if status.name.endswith((': tick', ': crank'))
        for pair in status.values
    }


def _replayed(bag: Path) -> dict[str, Any]:
    """Return the result of ``linkage replay --json`` for a bag."""
    command = [sys.executable, '-m', 'linkage_ros.cli.main', 'replay', str(bag), '--json']
    answer = subprocess.run(command, capture_output=True, text=True, check=False)
    try:
        result: dict[str, Any] = json.loads(answer.stdout)
    except ValueError:
        return {'verdict': f'missing: {answer.stderr.strip()}'}
    return result
