# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Random linkages of every topology.

They have every dyad on every kind of link, chains, inputs of all kinds, class III and exact change
points. They are compared with constraint equations that share nothing with the package. The
commands are run on their files: each has to do its work, or to print one line with the reason.

Each linkage has a random generator of its own, seeded by the campaign's seed, its family and its
number. So the result does not depend on how the work is shared, and any linkage can be made again.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
import random
import tempfile

from bench.report import Table
from campaigns.campaign import Findings, Page, Part, parts_of, show_results, Tallies, tallies_of
from campaigns.reliability.processes import in_process
from campaigns.tally import Judgement, QUANTITIES, Tally
from campaigns.topologies.families import FAMILIES
from campaigns.topologies.judge import closure_of, judge_states
from campaigns.topologies.judge_ranges import judge_ranges
from campaigns.topologies.topology import both_ways, Topology
from linkage_ros.description import linkage_text
from linkage_ros.kinematics import Linkage

PAGE = Page(
    Path('docs/accuracy/topologies.md'),
    'Linkages of every topology',
    """
Made by `make topologies`, and by `make accuracy`.

Each linkage is made from a pose, so that it closes there. It is solved at 16 states, one by one
and as arrays, and compared with its constraint equations: pins coincide, points lie on lines,
blocks keep angles, inputs are driven. Newton's method solves these equations in long doubles.
Intersections of circles and lines give the states that close, the closure error of the others, and
the assembly; for class III, the equations are followed from the pose. None of this code is the
package's. A single input is sampled at 2,400 values, and its limits are found by bisection; the
ranges and singular inputs of the package are compared with the result.

An error is given in units of u·κ, with u = 2⁻⁵³. For κ, all numbers of the linkage, the inputs and
every term of the equations are changed by the same relative amount with random signs. κ is the
greatest of five relative changes of a result, plus the value of the result. The terms of the
equations stand for the results that a dyad passes to the next one. The κ of a joint is at least a
thousandth of the greatest κ of the linkage. The table has the 99th percentile and the worst error.

- *refused*: the linkage closes, but is not accepted. *missed closure*: the state closes, but is
  reported as open. *false closure*: the state is open, but is reported as closed. *wrong
  assembly*: not the assembly of the file. *not closed*: the pose does not satisfy the equations.
  *gap*: a wrong closure error of an open dyad. *arrays*: arrays differ from single states.
  *points*: wrong positions of points.
- *range*: a part of the range is missing, or the range is too wide. *singular*: a toggle, a change
  point or a pair of parallel lines is not listed, or a regular input is listed.
- *error*: an error of more than 16 u·κ. *traceback*: an exception that a user would see.
""",
)

FILES = ('draw', 'urdf', 'mjcf')
"""Commands that write a file; `check` and `accuracy` are tried separately."""

_SECONDS = 600
"""Time limit of a command, in [s]; on a free machine the slowest takes some 15 s."""


def judge_command(
    command: str, linkage: Linkage, findings: Judgement, closes: bool = True
) -> None:
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

KINEMATICS, CHECK, CHECK_ALTERED, FILE, ACCURACY = TESTS = (
    'kinematics',
    'check',
    'check altered',
    'files',
    'accuracy',
)


def make(seed: int, family: str, index: int) -> tuple[Topology, random.Random]:
    """Return a linkage of a family, and the random generator of its states."""
    rng = random.Random(f'{seed}/{family}/{index}')
    return FAMILIES[family].make(rng), rng


def made_for(test: str, seed: int, family: str, index: int) -> Linkage:
    """Return the linkage for a test of commands."""
    topology, rng = make(seed, family, index)
    return altered(topology.linkage, rng) if test == CHECK_ALTERED else topology.linkage


def examine(seed: int, family: str, index: int, test: str = KINEMATICS) -> Judgement:
    """Run one test on one linkage."""
    findings = Judgement()
    if test == KINEMATICS:
        _kinematics(seed, family, index, findings)
        return findings
    linkage = made_for(test, seed, family, index)
    commands = {CHECK: ('check',), CHECK_ALTERED: ('check',), FILE: FILES, ACCURACY: ('accuracy',)}
    for command in commands[test]:
        judge_command(command, linkage, findings, closes=test != CHECK_ALTERED)
    return findings


def _kinematics(seed: int, family: str, index: int, findings: Judgement) -> None:
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
    Return the work, for a number of linkages for each test.

    For the kinematics that is the number of each family, for the other tests that of all together.
    Linkages of class III are followed step by step; so fewer are tried, by the factor ``slow``.
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


def judge_part(part: Part) -> Iterator[tuple[int, Judgement]]:
    """Run the test of a part on its linkages."""
    for number in part.numbers:
        yield number, examine(part.seed, part.family, number, part.test)


OUTCOMES = ('linkages', 'states closed', 'states open')


def kinematics_table(tallies: Mapping[str, Tally]) -> Table:
    """Return the states by outcome, and the errors of each family."""
    table = Table(
        'Kinematics, errors in u·κ',
        ('family', 'linkages', 'closed', 'open', *QUANTITIES, 'linkages with findings'),
    )
    total: Counter[str] = Counter()
    for tally in tallies.values():
        total += tally.counts
    for family, counts, quantities in (
        *((family, tally.counts, tally.quantities) for family, tally in tallies.items()),
        ('all', total, {}),
    ):
        errors = [quantities.get(name) for name in QUANTITIES]
        findings = counts['linkages with findings']
        table.rows.append(
            [
                family,
                *(f'{counts[name]:,}' for name in OUTCOMES),
                *(', '.join(each.texts(0.99)) if each else '' for each in errors),
                f'{findings:,}' if findings else '',
            ]
        )
    return table


def findings_table(tallies: Tallies) -> Table:
    """Return each finding with its number of linkages and families, and one example."""
    table = Table('Findings', ('finding', 'linkages', 'of', 'families', 'example'))
    for test, families in tallies.items():
        names: Counter[str] = Counter()
        for tally in families.values():
            names.update(tally.found_with)
        for name, count in names.most_common():
            where = [family for family, tally in families.items() if tally.found_with[name]]
            tried = sum(tally.counts['linkages'] for tally in families.values())
            note = families[where[0]].notes[name][0]
            text = f'--show "{where[0]}" {note.linkage}'
            if test != KINEMATICS:
                text += f' --test "{test}"'
            table.rows.append(
                [name, f'{count:,}', f'{tried:,}', f'{len(where)}', f'{text}: {_cell(note.text)}']
            )
    if not table.rows:
        table.rows.append(['none', '', '', '', ''])
    return table


def _cell(text: str) -> str:
    line = text.replace('|', '∣')
    return line if len(line) < 140 else line[:137] + '…'


def commands_table(tallies: Tallies) -> Table:
    """Return the results of the commands."""
    table = Table(
        'Commands', ('linkages', 'command', 'tried', 'done', 'refused in one line', 'other')
    )
    for test, families in tallies.items():
        if test == KINEMATICS:
            continue
        counts: Counter[str] = Counter()
        for tally in families.values():
            counts.update(tally.counts)
        kind = 'with one or two wrong numbers' if test == CHECK_ALTERED else 'that close'
        for command in sorted({name.partition(':')[0] for name in counts if ':' in name}):
            done, refused = counts[f'{command}: done'], counts[f'{command}: refused']
            ends = sum(n for name, n in counts.items() if name.startswith(f'{command}: '))
            numbers = ends, done, refused, ends - done - refused
            table.rows.append([kind, command, *(f'{number:,}' for number in numbers)])
    return table


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of this campaign."""
    parser.add_argument('--linkages', type=int, default=40, help='of each family')
    parser.add_argument('--checks', type=int, default=500, help='linkages for `check`')
    parser.add_argument(
        '--altered', type=int, default=500, help='linkages for `check`, with wrong numbers'
    )
    parser.add_argument('--files', type=int, default=90, help='linkages to draw and to export')
    parser.add_argument('--accuracy', type=int, default=3, help='`accuracy --quick`, 15 s each')
    parser.add_argument('--test', choices=TESTS, default=KINEMATICS, help='the test for --show')


def run(options: argparse.Namespace) -> Findings:
    """Compare the package with the equations, and run the commands."""
    wanted = {
        KINEMATICS: options.linkages,
        CHECK: options.checks,
        CHECK_ALTERED: options.altered,
        FILE: options.files,
        ACCURACY: options.accuracy,
    }
    work = parts(options.seed, wanted, options.only)
    tallies = tallies_of(judge_part, work, options.jobs, 'linkages')
    found = findings_table(tallies)
    tables = [found, commands_table(tallies), kinematics_table(tallies.get(KINEMATICS, {}))]
    named = [(name, FAMILIES[name].description) for name in options.only]
    tables.append(Table('Families', ('family', 'description'), [*named]))
    notes = any(tally.notes for families in tallies.values() for tally in families.values())
    faults = [' '.join(row) for row in found.rows] if notes else []
    return Findings(tables, faults, [('linkages', f'{sum(part.size for part in work):,}')])


def show(options: argparse.Namespace) -> None:
    """Print the file of a linkage and its findings."""
    seed, family, index, test = options.seed, options.show[0], int(options.show[1]), options.test
    print(linkage_text(made_for(test, seed, family, index), [f'{family} {index}, seed {seed}']))
    show_results(examine(seed, family, index, test))
