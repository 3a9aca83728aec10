# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""``linkage synthesize`` as its user types it: a linkage that runs, or why there is none."""

from __future__ import annotations

from cmath import phase, rect
from math import degrees, log10, radians, remainder
from pathlib import Path
import re

import pytest

from .conftest import on_terminal, Run
from ..support.four_bar import meeting_point

SOURCE_003 = ['--pair', '25', '30', '--pair', '35', '40', '--pair', '50', '60', '--ground', '1.0']
"""Freudenstein's three positions as a textbook has them; it prints a 5.598, b 0.176, c 4.88."""

# Computed to 50 digits, independently of this package, and rounded.
EXACT_003 = {'crank': 5.5965383934988620854, 'coupler': 0.16985782027961906789}
EXACT_003 |= {'rocker': 4.8786334643580194266, 'ground': 1.0}

LOG = ['--function', 'log10(x)', '--range', '1', '2']
RANGES = ['--crank-range', '45', '105', '--rocker-range', '135', '225']
POSES = ['--pose', '0', '0', '0', '--pose', '1', '0.5', '20', '--pose', '1.5', '1.2', '50']
MOVING = ['--moving-pivot', '0', '0', '--moving-pivot', '1', '0']


def rocker_angle(a: complex, b: float, c: complex, d: float, crank: float) -> float:
    """Return the rocker's angle in degrees, B on the left of A→O4: two circles that meet."""
    pin = a * rect(1.0, radians(crank))
    return remainder(degrees(phase(meeting_point(pin, d, b, abs(c)) - d) - phase(c)), 360.0)


def typed_pairs(a: complex, b: float, c: complex, d: float, cranks: list[float]) -> list[str]:
    typed = []
    for crank in cranks:
        typed += ['--pair', str(crank), repr(rocker_angle(a, b, c, d, crank))]
    return typed


def length(link: str, text: str) -> float:
    return float(re.search(rf'^{link} +(\S+)', text, re.MULTILINE).group(1))


def proof(text: str) -> list[list[str]]:
    """Return the rows of the first proof."""
    lines = text.partition('Proof')[2].splitlines()[2:]
    return [line.split() for line in lines[: lines.index('')]]


@pytest.mark.ros
def test_check_and_run_accept_a_linkage_of_three_pairs(linkage: Run) -> None:
    made = linkage('synthesize', *SOURCE_003, '-o', 'designed.yaml')
    assert made.returncode == 0, made.stderr
    for link, exact in EXACT_003.items():
        assert length(link, made.stdout) == pytest.approx(exact, rel=1e-9)
    for words in (
        '0.178681879707, -0.204975431605, 1.02722248088',
        'condition',
        'digits to trust',
        'branch defect',
        'double rocker',
    ):
        assert words in made.stdout
    assert [row[3] for row in proof(made.stdout)] == ['left', 'left', 'right']
    assert all(abs(float(row[4])) < 1e-12 for row in proof(made.stdout))
    assert made.stdout.splitlines()[-1] == 'designed.yaml  (branch defect: see above)'

    checked = linkage('check', 'designed.yaml')
    assert checked.returncode == 0, checked.stderr
    assert '5.59654, 0.169858, 4.87863, 1' in checked.stdout
    solved = linkage('solve', 'designed.yaml', '--at', '25', '--at', '35')
    assert '30.000000' in solved.stdout
    assert '40.000000' in solved.stdout
    ran = linkage('run', 'designed.yaml', '--seconds', '2', '--plain')
    assert ran.returncode == 0, ran.stderr
    assert re.search(r'published +[1-9]\d* joint states', ran.stdout)


def test_synthesize_describes_a_negative_length_as_reversed_link(
    linkage: Run, tmp_path: Path
) -> None:
    pairs = typed_pairs(-0.5 + 0j, 1.2, 0.9 + 0j, 1.0, [20.0, 50.0, 95.0])
    made = linkage('synthesize', *pairs, '-o', 'designed.yaml')
    assert made.returncode == 0, made.stderr
    assert '-0.5, reversed: it points away from its angle' in made.stdout
    assert re.search(r'A: \[-0\.(5|49999)', (tmp_path / 'designed.yaml').read_text())
    solved = linkage('solve', 'designed.yaml', '--at', '50')
    shown = float(solved.stdout.split()[-1])
    assert shown == pytest.approx(rocker_angle(-0.5 + 0j, 1.2, 0.9 + 0j, 1.0, 50.0), abs=1e-5)


def test_synthesize_fits_seven_pairs_and_draws_the_error(linkage: Run, tmp_path: Path) -> None:
    # Seven pairs of a crank-rocker, two of them moved by 1°.
    pairs = typed_pairs(0.4 + 0j, 1.2, 0.8 + 0j, 1.0, [10.0, 30.0, 50.0, 70.0, 90.0, 110.0, 130.0])
    pairs[5] = str(float(pairs[5]) + 1.0)
    pairs[14] = str(float(pairs[14]) - 1.0)
    made = linkage('synthesize', *pairs, '--draw', 'fit.svg')
    assert made.returncode == 0, made.stderr
    by_equation, fitted = (
        float(re.search(rf'rocker off, {how} +(\S+)°', made.stdout).group(1))
        for how in ('by the equation', 'fitted')
    )
    assert fitted <= by_equation
    assert fitted < 0.53  # the true linkage's: two of seven are off by 1°
    assert (tmp_path / 'fit.svg').read_text().startswith('<?xml')


def test_synthesize_reads_pairs_from_a_file(linkage: Run, tmp_path: Path) -> None:
    (tmp_path / 'pairs.csv').write_text('crank,rocker\n25,30\n35,40\n# the last\n50,60\n')
    from_file = linkage('synthesize', '--pairs', 'pairs.csv')
    assert from_file.returncode == 0, from_file.stderr
    assert from_file.stdout == linkage('synthesize', *SOURCE_003).stdout


@pytest.mark.parametrize('count', [4, 5])
def test_free_zeros_find_the_linkage_of_the_pairs(linkage: Run, count: int) -> None:
    zero = 0.0 if count == 4 else 0.3
    crank, rocker = rect(0.45, zero), rect(0.9, 0.5)
    angles = [15.0, 40.0, 70.0, 105.0, 150.0][:count]
    pairs = typed_pairs(crank, 1.1, rocker, 1.0, angles)
    made = linkage('synthesize', *pairs, '--free-zeros')
    assert made.returncode == 0, made.stderr
    assert re.search(r'found +\d solution', made.stdout)
    found = re.findall(
        r'^crank +(\S+).*\ncoupler +(\S+).*\nrocker +(\S+)', made.stdout, re.MULTILINE
    )
    assert [
        lengths
        for lengths in found
        if [float(one) for one in lengths] == pytest.approx([0.45, 1.1, 0.9], abs=1e-6)
    ]


def test_synthesize_searches_free_zeros_that_meet_the_needs(linkage: Run) -> None:
    typed = ['--pair', '0', '0', '--pair', '30', '20', '--pair', '60', '45', '--free-zeros']
    needs = ['--min-transmission', '60', '--max-link-ratio', '4']
    made = linkage('synthesize', *typed, *needs, '--candidates', '50000', '--best', '1')
    assert made.returncode == 0, made.stderr
    assert float(re.search(r'transmission +(\S+)°', made.stdout).group(1)) >= 60.0
    assert float(re.search(r'link ratio +([\d.]+)', made.stdout).group(1)) <= 4.0
    assert 'none: order, branch and circuit are right' in made.stdout


def test_synthesize_prints_the_structural_error_of_a_function(
    linkage: Run, tmp_path: Path
) -> None:
    made = linkage('synthesize', *LOG, *RANGES, '--draw', 'log.svg', '-o', 'log.yaml')
    assert made.returncode == 0, made.stderr
    # P. L. Chebyshev's points of three: 1.5 ∓ 0.5·cos 30°, and the crank's angles there.
    cranks = [45.0 + 60.0 * (x - 1.0) for x in (1.0669873, 1.5, 1.9330127)]
    rockers = [135.0 + 90.0 * log10(1.0 + (crank - 45.0) / 60.0) / log10(2.0) for crank in cranks]
    for row, crank, rocker in zip(proof(made.stdout), cranks, rockers, strict=True):
        assert float(row[1].rstrip('°')) == pytest.approx(crank, abs=1e-3)
        assert float(row[2].rstrip('°')) == pytest.approx(rocker, abs=1e-3)
    assert 'structural error' in made.stdout
    assert (tmp_path / 'log.svg').exists()


def test_synthesize_finds_the_linkage_of_a_curve(linkage: Run, tmp_path: Path) -> None:
    # The coupler point of a crank-rocker, by two circles that meet.
    lines = ['x,y']
    for step in range(12):
        crank = 30.0 * step
        pin = rect(0.3, radians(crank))
        rocker = radians(rocker_angle(0.3 + 0j, 1.0, 0.9 + 0j, 1.0, crank))
        coupler = 1.0 + rect(0.9, rocker) - pin
        point = pin + coupler * (0.5 + 0.4j)
        lines.append(f'{point.real!r},{point.imag!r}')
    (tmp_path / 'curve.csv').write_text('\n'.join(lines))
    made = linkage(
        *('synthesize', '--path', 'curve.csv', '--closed', '--candidates', '30000'),
        *('--best', '1', '--need', 'crank-rocker', '-o', 'found.yaml'),
    )
    assert made.returncode == 0, made.stderr
    assert float(re.search(r'points off +(\S+) m rms', made.stdout).group(1)) < 1e-3
    assert linkage('check', 'found.yaml').returncode == 0


def test_synthesized_linkage_meets_three_poses_exactly(linkage: Run, tmp_path: Path) -> None:
    made = linkage('synthesize', *POSES, *MOVING, '-o', 'poses.yaml', '--draw', 'poses.svg')
    assert made.returncode == 0, made.stderr
    for row in proof(made.stdout):
        assert abs(float(row[-1])) < 1e-10
        assert abs(float(row[-2])) < 1e-12
    assert (tmp_path / 'poses.yaml').exists()


IN_DEGREES = {
    'pairs': SOURCE_003,
    'pairs with free zeros': [
        *('--pair', '0', '0', '--pair', '30', '20', '--pair', '60', '45', '--pair', '80', '70'),
        '--free-zeros',
    ],
    'more pairs': [*SOURCE_003, '--pair', '70', '75'],
    'a function': [*LOG, *RANGES],
    'a timed curve': [
        *('--point', '0.1', '0.1', '--point', '0.13', '0.12', '--point', '0.15', '0.1'),
        *('--timing', '10', '40', '75', '--candidates', '2000', '--best', '1'),
    ],
    'poses': [*POSES, *MOVING],
    'what is not met': [*SOURCE_003, '--min-transmission', '30'],
}
ANGLES = {
    '--pair': slice(0, 2),
    '--crank-range': slice(0, 2),
    '--rocker-range': slice(0, 2),
    '--timing': slice(0, 3),
    '--min-transmission': slice(0, 1),
    '--pose': slice(2, 3),
}
"""Which values after an option are angles."""


def in_radians(typed: list[str]) -> list[str]:
    words = list(typed)
    for place, word in enumerate(typed):
        if word in ANGLES:
            values = range(place + 1, len(typed))[ANGLES[word]]
            for value in values:
                words[value] = repr(radians(float(typed[value])))
    return [*words, '--radians']


@pytest.mark.sample(2)
@pytest.mark.parametrize('kind', IN_DEGREES)
def test_synthesis_in_radians_designs_the_same_linkage(linkage: Run, kind: str) -> None:
    typed = IN_DEGREES[kind]
    degrees_, radians_ = linkage('synthesize', *typed), linkage('synthesize', *in_radians(typed))
    assert radians_.returncode == degrees_.returncode
    for link in ('crank', 'coupler', 'rocker', 'ground'):
        assert length(link, radians_.stdout) == length(link, degrees_.stdout)
    assert '°' in degrees_.stdout
    assert '°' not in radians_.stdout
    first = float(proof(radians_.stdout)[0][1])
    assert degrees(first) == pytest.approx(float(proof(degrees_.stdout)[0][1][:-1]), abs=1e-3)
    assert 'off [rad]' in radians_.stdout or kind == 'a timed curve'


def test_search_prints_its_progress(tmp_path: Path) -> None:
    pytest.importorskip('rich')
    typed = ['--pair', '0', '0', '--pair', '30', '20', '--pair', '60', '45', '--free-zeros']
    typed += ['--candidates', '20000', '--best', '1']
    shown = on_terminal(tmp_path, 'synthesize', *typed, progress=True)
    shown = re.sub('\x1b\\[[0-9;]*m', '', shown)  # colours
    counts = [int(count) for count in re.findall(r'candidates.*? (\d+)/20000', shown)]
    assert counts == sorted(counts)
    assert counts[-1] == 20000
