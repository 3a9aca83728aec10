# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Attack a running node with everything that a ROS graph can send.

The node must not end, every joint state has to be the pose of a crank angle that was sent, and the
node has to account for every message. `campaigns.reliability.attacker` is the attacking node;
`attack` starts both nodes as processes on a graph of their own.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path
import re
from tempfile import TemporaryDirectory

from linkage_ros.processes import Graph, MeasurementError, private_domain
from linkage_ros.resources import shipped_path

_PATIENCE = 20.0  # for each answer of the node [s]
_SCENE = """
linkage: {linkage}
rate: 200
drive: {{topic: {{carry_forward: false, max_age: 5.0}}}}
faults: {{mute: {{silence: {{}}}}}}
record: {{snapshot_seconds: 1, snapshot_bytes: 10000000, directory: runs}}
"""

_CLOSING = re.compile(
    r'/crank_states: (?P<received>\d+) received, (?P<used>\d+) used, '
    r'(?P<superseded>\d+) superseded, (?P<rejected>\d+) rejected'
    r'(?:, (?P<ignored>\d+) without the crank)?(?:; (?P<lost>\d+) lost before)?'
)


def attack(seconds: float, seed: int) -> tuple[Counter[str], list[str]]:
    """Attack a node for some seconds; return the tries by kind, and a line per violation."""
    with TemporaryDirectory(prefix='linkage_ros_attack_') as name:
        folder = Path(name)
        linkage = shipped_path('linkages/four_bar.yaml')
        scene = folder / 'attacked.yaml'
        scene.write_text(_SCENE.format(linkage=linkage))
        # Below 102, so that the ports stay below the kernel's ephemeral ones.
        graph = Graph(private_domain(), folder, longest=round(seconds) + 200)
        node_arguments = (
            *('--ros-args', '-p', f'scene:={scene}'),
            *('-p', f'runs_directory:={folder}', '-p', 'diagnostics_period:=0.5'),
        )
        try:
            with graph.run_module('linkage_ros.node.linkage_node', node_arguments) as node:
                with graph.run_module(
                    'campaigns.reliability.attacker', (str(seconds), str(seed), str(scene))
                ) as attacker:
                    outcome = attacker.read_answer(patience=seconds + 8 * _PATIENCE)
                node.check_running()
            # 1: the snapshot memory overflowed in a flood, which the node reports.
            node.check_end(1)
        except MeasurementError as error:
            return Counter(), [str(error)]
        log = (folder / 'linkage_node.log').read_text(errors='replace')
    tried = Counter[str](outcome['tried'])
    return tried, outcome['findings'] + _faults_in(log, tried)


def _faults_in(log: str, tried: Counter[str]) -> list[str]:
    """Return the faults in the node's log."""
    closings = [
        {key: int(value or 0) for key, value in match.groupdict().items()}
        for match in _CLOSING.finditer(log)
    ]
    findings = [
        f'counts do not add up: {counts}'
        for counts in closings
        if counts['received']
        != sum(counts[of] for of in ('used', 'superseded', 'rejected', 'ignored'))
    ]
    if not closings:
        return ['the node has not logged its counts of messages']
    # Only the first messages may have been sent before the subscription existed.
    sent = tried['messages of the floods']
    missing = sent - closings[0]['received'] - closings[0]['lost']
    if not 0 <= missing <= tried['first messages']:
        findings.append(f'{missing} of {sent} messages are not accounted for: {closings[0]}')
    tried.update({f'of these {name}': number for name, number in closings[0].items()})
    findings += [line for line in log.splitlines() if 'Traceback' in line or 'has stopped' in line]
    return findings
