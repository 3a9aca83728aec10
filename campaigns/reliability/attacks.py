# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Random hostile input to everything that takes input.

No input may cause a traceback, a hang, unlimited memory, or more than a screen of output.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
import re
from tempfile import TemporaryDirectory

from bench.processes import Graph, MeasurementError
from bench.report import Table
from campaigns.campaign import Findings, Page, results_of
from campaigns.reliability import hostile_bags, hostile_files, signals
from campaigns.reliability.judge import Try
from linkage_ros.domains import private_domain
from linkage_ros.resources import shipped_path

PAGE = Page(
    Path('docs/recordings/attacks.md'),
    'Attacks',
    """
Made by `make attacks`. The linkages and scenes that come with the package, URDFs made from them,
and tables are changed at random. Numbers are replaced by zeros, by the smallest and greatest
floats, and by texts that are no numbers; keys and values by other keys and values, by other types
and by words with a special meaning. Lines are removed, doubled and moved, bits are flipped, and
files are truncated and encoded otherwise. Each file goes to a command that takes such a file. The
command has to end within a time limit and 4 GiB of address space: with its result, or with exit
code 2 and one line of at most 1,000 characters, and without a warning from a library. `linkage
scene` may report several errors, one in a line. In bags, bits are flipped, records are removed,
doubled and moved, and lengths and texts are replaced; the commands that read bags are run on them,
with the same requirements. Signals are sent to commands at random instants: the command has to
end with exit code 1 and one line, and to leave no file but its result. A node gets floods of valid
and invalid messages, small ones and megabytes, and many calls at once: it has to go on, and to
account for every message. Any other outcome is a finding.
""",
)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of this campaign."""
    parser.add_argument('--files', type=int, default=3000, help='changed files')
    parser.add_argument('--signals', type=int, default=60, help='commands that get a signal')
    parser.add_argument('--bags', type=int, default=300, help='hostile bags')
    parser.add_argument('--seconds', type=float, default=60.0, help='duration on the graph')


Tries = Callable[[int, range], Iterable[Try]]
"""Tries the inputs of a seed and of some numbers."""

Attacked = tuple[Counter[str], list[str]]
"""The number of tries by how each ended, and the violations."""


def attack(tries: Tries, count: int, seed: int, jobs: int = 1, part: int = 10) -> Attacked:
    """Try a number of random inputs in several processes, ``part`` of them at a time."""
    parts = [range(begin, min(begin + part, count)) for begin in range(0, count, part)]
    tried, findings = Counter[str](), []
    for some in results_of(partial(_attack_part, tries, seed), parts, jobs):
        tried.update(outcome for outcome, _ in some)
        findings += [finding for _, finding in some if finding]
    return Counter(dict(sorted(tried.items()))), findings


def _attack_part(tries: Tries, seed: int, numbers: range) -> list[Try]:
    return [*tries(seed, numbers)]


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


def attack_node(seconds: float, seed: int) -> Attacked:
    """
    Attack a running node for some seconds with everything that a ROS graph can send.

    It must not end, every joint state has to be the pose of a crank angle that was sent, and the
    node has to account for every message. `campaigns.reliability.attacker` is the other node.
    """
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


def run(options: argparse.Namespace) -> Findings:
    """Attack."""
    seed, jobs = options.seed, options.jobs
    attacks: dict[str, Callable[[], Attacked]] = {
        'Files': partial(attack, hostile_files.tries, options.files, seed, jobs, part=50),
        'Bags': partial(attack, hostile_bags.tries, options.bags, seed, jobs),
        'Signals': partial(attack, signals.tries, options.signals, seed),
        'Graph': partial(attack_node, options.seconds, seed),
    }
    findings = Findings([], [])
    for name, do in attacks.items():
        tried, found = do()
        title = f'{name}: {tried.total():,} tried, {len(found)} findings'
        rows = [(end, f'{count:,}') for end, count in tried.items()]
        findings.tables.append(Table(title, ('', ''), [*rows]))
        findings.faults.extend(found)
    return findings
