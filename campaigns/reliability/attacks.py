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

from bench.report import Table
from campaigns.campaign import Findings, Page, results_of
from campaigns.reliability import graph, hostile_bags, hostile_files, signals
from campaigns.reliability.judge import Try

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


def run(options: argparse.Namespace) -> Findings:
    """Attack."""
    seed, jobs = options.seed, options.jobs
    attacks: dict[str, Callable[[], Attacked]] = {
        'Files': partial(attack, hostile_files.tries, options.files, seed, jobs, part=50),
        'Bags': partial(attack, hostile_bags.tries, options.bags, seed, jobs),
        'Signals': partial(attack, signals.tries, options.signals, seed),
        'Graph': partial(graph.attack, options.seconds, seed),
    }
    findings = Findings([], [])
    for name, do in attacks.items():
        tried, found = do()
        title = f'{name}: {tried.total():,} tried, {len(found)} findings'
        rows = [(end, f'{count:,}') for end, count in tried.items()]
        findings.tables.append(Table(title, ('', ''), [*rows]))
        findings.faults.extend(found)
    return findings
