# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Cranks of a joint's value, their errors and their number.

On every branch of every joint of the shipped linkages of one input, at random values and at 1e-14
of its ends, the error of a crank is compared with what roundings allow. On random four-bars, and
on random linkages whose slides pass through infinity, the number of cranks of a value is compared
with the number of passes that a scan of the range finds, and each crank has to give the value.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator
from math import pi, remainder, tau
import random

from bench import ROOT
from bench.report import Table
from campaigns.accuracy.adversarial import four_bar
from campaigns.accuracy.random_families import DYADS
from campaigns.campaign import Findings, Page, progress_lines
from campaigns.topologies.topology import TopologyBuilder
from linkage_ros.description import load
from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics import Closure, CrankBranch, GROUND, is_iterated
from linkage_ros.resources import linkage_names, named_file
import numpy as np

U = 2.0**-53
_AT_ENDS = 1e-14
_SCAN = 40_000

PAGE = Page(
    ROOT / 'docs' / 'accuracy' / 'inverse.md',
    'How exact the cranks of a joint are',
    """
Made by `python -m campaigns inverse --write`, a part of `make accuracy`.

The error of a crank θ for a value y of a joint is given in units of u·(|θ| + (|y| + 2π)/|f′| + 1),
with u = 2⁻⁵³ and the joint y = f(θ); for a slide the size of the linkage stands for 2π. The limit
is 8. It is taken from the closed form at that crank, whose own errors count too. *off* is the
greatest |f(θ) − y|, in rad or m; beside a toggle of the crank no double is nearer. The values are
random, and two lie at 1e-14 of the ends of the branch.
""",
)


def linkages() -> Iterator[tuple[str, Closure]]:
    """Yield the shipped linkages of one input that are solved by dyads."""
    for name in linkage_names():
        closure = load(named_file(name, 'linkages'))
        if len(closure.input_names) == 1 and not is_iterated(closure):
            yield name, closure


def outputs_of(closure: Closure) -> Iterator[tuple[str, list[CrankBranch]]]:
    """Yield the dependent joints that move, with their branches."""
    for joint in closure.joint_names:
        if joint not in closure.input_names:
            try:
                yield joint, [*closure.branches(joint)]
            except DefinitionError:
                continue


def errors_of(
    closure: Closure, joint: str, branch: CrankBranch, count: int, rng: random.Random
) -> tuple[float, float]:
    """Return the greatest error of cranks, in units of what is allowed, and of the joint."""
    shares = [_AT_ENDS, 1.0 - _AT_ENDS, *(rng.random() for _ in range(count))]
    wanted = np.array([branch.low + share * (branch.high - branch.low) for share in shares])
    cranks = np.array([branch.find_crank(y)[0] for y in wanted.tolist()])
    batch = closure.solve(cranks, derivatives=1)
    assert batch.velocities is not None
    row = closure.joint_names.index(joint)
    off, slopes = batch.positions[row] - wanted, np.abs(batch.velocities[row])
    if branch.turning:
        off -= tau * np.round(off / tau)
    size = tau if branch.turning else closure.scale
    # Both sides times |f′|.
    errors = np.abs(off) / (U * (slopes * (np.abs(cranks) + 1.0) + np.abs(wanted) + size))
    for state, end in enumerate((branch.first, branch.last)):
        if branch.steep[state]:  # The exact crank is some 1e-28 from its end.
            errors[state] = abs(cranks[state] - end) / (U * (abs(end) + 1.0))
    errors, off = errors[np.isfinite(errors)], np.abs(off[np.isfinite(slopes)])
    assert len(errors) > 0.9 * len(wanted) - 2
    return float(errors.max()), float(off.max())


def random_four_bars(count: int, rng: random.Random) -> Iterator[Closure]:
    """Yield four-bars of all kinds."""
    while count:
        a, b, c, d = (rng.uniform(0.2, 1.0) for _ in range(4))
        closure = Closure(four_bar((a, b, c, d), rng.choice((1, -1))).linkage())
        if closure.input_ranges:
            count -= 1
            yield closure


def random_slides(count: int, rng: random.Random) -> Iterator[Closure]:
    """
    Yield linkages in which a block slides on a line of the ground and on one of the input's link.

    Where these lines are parallel, it passes through infinity, and so does what hangs on it.
    """
    while count:
        build = TopologyBuilder(rng)
        driven = build.sliding(GROUND) if rng.random() < 0.2 else build.turning(GROUND)
        known = [GROUND, driven, *build.dyad('PRP', driven, GROUND)]
        for _ in range(rng.randrange(3)):
            one, other = rng.sample(known, 2)
            known += build.dyad(rng.choice(DYADS), one, other)
        closure = Closure(build.topology().linkage)
        if closure.input_ranges:
            count -= 1
            yield closure


def moving_joints(closure: Closure) -> list[str]:
    """Return the dependent joints that move over the first range of the input."""
    found = closure.solve(np.linspace(*closure.input_ranges[0][:2], 50), derivatives=0).positions
    return [
        joint
        for joint, values in zip(closure.joint_names, found, strict=True)
        if joint not in closure.input_names and np.nanmax(values) - np.nanmin(values) > 1e-6
    ]


def is_wrong(closure: Closure, joint: str, value: float, crank: float) -> bool:
    """Return whether a joint does not have a value at a crank, within what roundings allow."""
    position = closure.position(crank)
    row = closure.joint_names.index(joint)
    if not position.status.has_rates:
        return False  # Its errors there have no bound, and its rate is infinite.
    off = position.joints[row] - value
    slope = closure.velocity(position, 1.0).joints[row]
    if closure.turning[row]:
        off = remainder(off, tau)
    # A crank beside a place where the joint turns back is no better than the root of a rounding.
    size = tau if closure.turning[row] else closure.scale
    bound = 1e3 * U * (abs(slope) * (abs(crank) + 1.0) + abs(value) + size)
    return not abs(off) <= bound


def passes_of(closure: Closure, joint: str, value: float, count: int = _SCAN) -> int:
    """Return how often a joint passes a value while the crank goes through its ranges."""
    passed = 0
    row = closure.joint_names.index(joint)
    for interval in closure.input_ranges:
        low, high = interval.lowest, interval.highest
        # Denser towards the ends, as the joint is.
        cranks = low + (high - low) * (0.5 - 0.5 * np.cos(np.linspace(0.0, pi, count)))
        off = closure.solve(np.clip(cranks, low, high), derivatives=0).positions[row] - value
        if closure.turning[row]:
            off -= tau * np.round(off / tau)
        signs = np.signbit(off)
        passed += int(np.sum((signs[1:] != signs[:-1]) & (np.abs(np.diff(off)) < 1.0)))
    return passed


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of this campaign; it runs in one process."""
    parser.set_defaults(jobs=1)
    parser.add_argument('--states', type=int, default=6000, help='random values on each branch')
    parser.add_argument(
        '--linkages', type=int, default=10_000, help='random linkages of each family to scan'
    )


def run(options: argparse.Namespace) -> Findings:
    """Compare cranks with closed forms and with scans."""
    rng = random.Random(options.seed)
    table = Table('Errors', ('joint', 'branches', 'values', 'error', 'off'))
    greatest, values = 0.0, 0
    for name, closure in linkages():
        for joint, branches in outputs_of(closure):
            found = [errors_of(closure, joint, one, options.states, rng) for one in branches]
            error, off = (max(each) for each in zip(*found, strict=True))
            count = len(branches) * (options.states + 2)
            greatest, values = max(greatest, error), values + count
            cells = str(len(branches)), f'{count:,}', f'{error:.2f}', f'{off:.1e}'
            table.rows.append((f'{name} {joint}', *cells))
    table.rows.append(('all', '', f'{values:,}', f'{greatest:.2f}', ''))
    scans = Table(
        'Cranks of a value, on random linkages',
        ('', 'linkages', 'fewer than a scan passes', 'more, since the scan is coarser', 'wrong'),
    )
    faults = 0
    for kind, family in (('four-bars', random_four_bars), ('with poles of slides', random_slides)):
        missed, more, wrong = _compare(family(options.linkages, rng), options.linkages, rng)
        scans.rows.append((kind, f'{options.linkages:,}', str(missed), str(more), str(wrong)))
        faults += missed + wrong
    lines = [f'an error of {greatest:.2f}'] if greatest > 8.0 else []
    lines += [f'{faults} linkages with missed or wrong cranks'] if faults else []
    return Findings([table, scans], lines, [('values', f'{values:,}')])


def _compare(closures: Iterable[Closure], count: int, rng: random.Random) -> tuple[int, int, int]:
    """Return on how many linkages cranks are missed, the scan misses some, and one is wrong."""
    missed = more = wrong = 0
    advance = progress_lines(count, 'linkages')
    for closure in closures:
        joint = rng.choice(moving_joints(closure))
        low, high = closure.input_ranges[0][:2]
        position = closure.position(rng.uniform(low, high))
        if position.joints:
            value = position[joint]
            cranks, passed = closure.cranks(joint, value), passes_of(closure, joint, value)
            missed += len(cranks) < passed
            more += len(cranks) > passed
            wrong += any(is_wrong(closure, joint, value, crank) for _, crank in cranks)
        advance(1)
    return missed, more, wrong
