# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The work of the campaign, in parts that any number of processes share.

Each linkage has a random generator of its own, seeded by the campaign's seed, its family and its
number. So the result does not depend on how the work is shared, and any linkage can be made again.

The commands of ``linkage`` are run on the files of the linkages. Each command has to do its work,
or to print one line with the reason.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
import random
import tempfile
import traceback
from typing import NamedTuple

from campaigns.campaign import Part, parts_of, tallies_of
from campaigns.reliability.processes import in_process
from campaigns.topologies.families import FAMILIES
from campaigns.topologies.judge import closure_of, Findings, judge_states
from campaigns.topologies.judge_ranges import judge_ranges
from campaigns.topologies.topology import both_ways, Topology
from linkage_ros.description import linkage_text
from linkage_ros.kinematics import Linkage

FILES = ('draw', 'urdf', 'mjcf')
"""Commands that write a file; `check` and `accuracy` are tried separately."""

_SECONDS = 600
"""Time limit of a command, in [s]; on a free machine the slowest takes some 15 s."""


def judge_command(command: str, linkage: Linkage, findings: Findings, closes: bool = True) -> None:
    """Run a command on a linkage; if it closes, the command has no reason to refuse it."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / 'linkage.yaml'
        file.write_text(linkage_text(linkage), encoding='utf-8')
        output = {'draw': 'png', 'urdf': 'urdf', 'mjcf': 'xml'}.get(command)
        arguments = [command, str(file)]
        if command == 'accuracy':
            arguments.append('--quick')
            arguments += ['-o', str(Path(folder) / 'page.html')]
        if output:
            arguments += ['-o', str(Path(folder) / f'out.{output}')]
        code, errors, _ = in_process(arguments, _SECONDS)
    lines = errors.replace(folder, '').strip().splitlines()
    if code == 0:
        findings.counts[f'{command}: done'] += 1
    elif code == 2 and len(lines) == 1:
        findings.counts[f'{command}: refused'] += 1
        if closes:
            findings.find(f'{command} refuses', lines[0])
    else:
        findings.find(f'{command}: {code}', lines[-1] if lines else '')


def altered(linkage: Linkage, rng: random.Random) -> Linkage:
    """Return a linkage with one or two numbers replaced, as by a typing error, or worse."""
    for _ in range(rng.choice((1, 1, 2))):
        link = rng.choice(list(linkage.links))
        point = rng.choice(list(linkage.links[link]))
        place = list(linkage.links[link][point])
        k = rng.choice((0, 1))
        others = [part for points in linkage.links.values() for p in points.values() for part in p]
        place[k] = rng.choice(
            (
                0.0,
                -place[k],
                place[k] * 10.0 ** rng.choice((-9, -3, -1, 1, 3, 9)),
                rng.choice(others),
                place[k] + rng.gauss(0.0, 1.0),
            )
        )
        links = {name: dict(points) for name, points in linkage.links.items()}
        links[link][point] = (place[0], place[1])
        linkage = replace(linkage, links=links)
    return linkage


_PART = 5
_KEPT = 3

KINEMATICS, CHECK, CHECK_ALTERED, FILE, ACCURACY = TESTS = (
    'kinematics',
    'check',
    'check altered',
    'files',
    'accuracy',
)


class Note(NamedTuple):
    """A finding and its linkage."""

    finding: str
    linkage: int
    text: str


@dataclass
class Tally:
    """The findings for a family, independent of the order of its parts."""

    counts: Counter[str] = field(default_factory=Counter)
    found_with: Counter[str] = field(default_factory=Counter)
    worst: dict[str, tuple[float, int]] = field(default_factory=dict)
    errors: dict[str, list[float]] = field(default_factory=dict)
    notes: dict[str, list[Note]] = field(default_factory=dict)

    def add(self, linkage: int, findings: Findings) -> None:
        """Add the findings of one linkage."""
        self.counts += findings.counts
        self.counts['linkages'] += 1
        self.counts['linkages with findings'] += bool(findings.notes)
        for name, text in findings.notes:
            self.found_with[name] += 1
            self._keep(name, [Note(name, linkage, text)])
        for name, errors in findings.errors.items():
            self._note_errors(name, errors, (max(errors), linkage))

    def merge(self, other: Tally) -> None:
        """Add the findings of another part."""
        self.counts += other.counts
        self.found_with += other.found_with
        for name, notes in other.notes.items():
            self._keep(name, notes)
        for name, errors in other.errors.items():
            self._note_errors(name, errors, other.worst[name])

    def _keep(self, name: str, notes: Iterable[Note]) -> None:
        self.notes[name] = sorted([*self.notes.get(name, []), *notes])[:_KEPT]

    def _note_errors(self, name: str, errors: list[float], worst: tuple[float, int]) -> None:
        self.errors.setdefault(name, []).extend(errors)
        self.worst[name] = max(self.worst.get(name, (0.0, 0)), worst)


def make(seed: int, family: str, index: int) -> tuple[Topology, random.Random]:
    """Return a linkage of a family, and the random generator of its states."""
    rng = random.Random(f'{seed}/{family}/{index}')
    return FAMILIES[family].make(rng), rng


def made_for(test: str, seed: int, family: str, index: int) -> Linkage:
    """Return the linkage for a test of commands."""
    topology, rng = make(seed, family, index)
    return altered(topology.linkage, rng) if test == CHECK_ALTERED else topology.linkage


def examine(seed: int, family: str, index: int, test: str = KINEMATICS) -> Findings:
    """Run one test on one linkage."""
    findings = Findings()
    if test == KINEMATICS:
        _kinematics(seed, family, index, findings)
        return findings
    linkage = made_for(test, seed, family, index)
    commands = {CHECK: ('check',), CHECK_ALTERED: ('check',), FILE: FILES, ACCURACY: ('accuracy',)}
    for command in commands[test]:
        judge_command(command, linkage, findings, closes=test != CHECK_ALTERED)
    return findings


def _kinematics(seed: int, family: str, index: int, findings: Findings) -> None:
    topology, rng = make(seed, family, index)
    closure = closure_of(topology, findings)
    if closure is None:
        return
    single = len(topology.start) == 1
    walks = both_ways(topology) if single and topology.groups is None else None
    judge_states(topology, closure, rng, findings, walks)
    if single:
        judge_ranges(topology, closure, findings, walks)


def parts(
    seed: int, wanted: dict[str, int], families: Iterable[str] = FAMILIES, slow: int = 4
) -> list[Part]:
    """
    Return the work.

    Parameters
    ----------
    seed
        The campaign's seed.
    wanted
        Number of linkages for each test: of each family for the kinematics, of all families
        together for the other tests.
    families
        Names of the families.
    slow
        Factor by which fewer linkages of class III are tried, which are followed step by step.

    """
    weights = {family: 1 if family.startswith('class III') else slow for family in families}
    work = []
    for test, count in wanted.items():
        done, passed = 0, 0
        shares = {}
        for family, weight in weights.items():
            passed += weight
            shares[family] = -(-count * weight // slow)
            if test != KINEMATICS:
                # The shares have to add up to the count.
                shares[family] = count * passed // sum(weights.values()) - done
            done += shares[family]
        work += parts_of(seed, shares, _PART, test)
    return work


def do(part: Part) -> tuple[Part, Tally]:
    """Do one part."""
    tally = Tally()
    for index in part.numbers:
        try:
            findings = examine(part.seed, part.family, index, part.test)
        except Exception as error:
            raise RuntimeError(
                f'{part.test} of {part.family} {index}: {traceback.format_exc()}'
            ) from error
        tally.add(index, findings)
    return part, tally


def run(
    work: list[Part], jobs: int, progress: Callable[[int], None] = lambda _: None
) -> dict[str, dict[str, Tally]]:
    """Run all parts as `tallies_of` does; return the tallies by test and by family."""
    tallies: dict[str, dict[str, Tally]] = {}
    for (test, family), tally in tallies_of(do, work, jobs, Tally, progress).items():
        tallies.setdefault(test, {})[family] = tally
    return tallies
