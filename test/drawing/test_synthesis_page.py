# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The page on what accuracy costs says what its script works out."""

from importlib import import_module
import re

import numpy as np
import pytest

mpmath = pytest.importorskip('mpmath')
rounding = import_module('docs.synthesis_page.rounding')
digits = import_module('docs.synthesis_page.digits')
kinds = import_module('docs.synthesis_page.kinds')
make_synthesis = import_module('docs.make_synthesis')
PAGE = make_synthesis.PAGE.read_text('utf-8')
EXACT = [kind for kind in kinds.KINDS if '--candidates' not in kind.command]
"""What is searched for may be another of equally good ones on another machine."""


@pytest.fixture(autouse=True)
def many_digits():
    with mpmath.mp.workdps(digits.PRECISION):
        yield


@pytest.mark.parametrize('name', ['introduction', 'by_hand', 'decimals', 'on_the_bench'])
def test_a_chapter_is_as_it_is_worked_out_now(name):
    chapter = '\n'.join(getattr(rounding, name)())
    assert chapter.strip() in PAGE, 'make synthesis makes it anew'


@pytest.mark.parametrize(
    'value',
    [
        '5.5965383934988620854', '0.16985782027961906789', '4.8786334643580194266',
        '0.17868187970650492505', '−0.20497543160512679448', '1.0272224808848817759',
    ],
)  # fmt: skip
def test_the_example_is_that_of_the_sources(value):
    # 50 digits, rounded; worked out for sources/README.md by somebody else.
    assert f'| {value} |' in PAGE


def test_rounding_is_that_of_a_hand():
    with mpmath.mp.workdps(50):
        cosine = mpmath.cos(mpmath.radians(35))
        assert [str(digits.round_to(cosine, n)) for n in (2, 4)] == ['0.82', '0.8192']
        # As the text has them: cos 25°, 30°, 40°, 50°, (25 − 30)°, (50 − 60)°.
        angles = {
            25: '0.9063',
            30: '0.866',
            40: '0.766',
            50: '0.6428',
            -5: '0.9962',
            -10: '0.9848',
        }
        for angle, said in angles.items():
            assert str(digits.round_to(mpmath.cos(mpmath.radians(angle)), 4)) == said


@pytest.fixture(scope='module')
def tasks():
    with mpmath.mp.workdps(digits.PRECISION):
        return list(digits.random_tasks(rounding.COUNT))


@pytest.fixture(scope='module')
def angles(tasks):
    """Crank and rocker angles of all tasks in degrees, (2, n, 3)."""
    return np.array([[[float(x) for x in getattr(task, link)] for task in tasks]
                     for link in ('crank', 'rocker')])  # fmt: skip


def by_numpy(theta, phi, decimals=None):
    """Return lengths of crank, coupler and rocker, (n, 3), nan where there are none."""
    rows = np.cos(np.radians(np.stack([phi, theta, theta - phi], -1)))
    if decimals is not None:
        rows = np.round(rows, decimals)
    matrix = np.concatenate([rows[..., :2], np.ones((*rows.shape[:-1], 1))], -1)
    k = np.linalg.solve(matrix, rows[..., 2:])[..., 0]
    a, c = 1.0 / k[:, 0], -1.0 / k[:, 1]
    with np.errstate(invalid='ignore'):
        b = np.sqrt(a * a + c * c + 1.0 - 2.0 * a * c * k[:, 2])
    return np.stack([a, b, c], -1)


def opens(lengths, theta):
    """Return whether the loop is open at one of three crank angles, (n,)."""
    a, b, c = (lengths[:, i, None] for i in range(3))
    diagonal = np.abs(a * np.exp(1j * np.radians(theta)) - 1.0)
    closes = (diagonal <= b + abs(c)) & (diagonal >= abs(b - abs(c)))
    return ~closes.all(-1)


def number(cell):
    value = float(cell.split()[0].replace(',', '').rstrip('°'))
    return value / 100.0 if '%' in cell else value


def row(name):
    (found,) = re.findall(rf'^\| {re.escape(name)} \| (.*) \|$', PAGE, re.MULTILINE)
    return found.split(' | ')


@pytest.mark.parametrize(
    ('name', 'decimals', 'place'),
    [
        *((f'{n} decimals', n, None) for n in (3, 4, 5, 6, 8)),
        ('whole degrees', None, 0),
        ('1 decimal of a degree', None, 1),
        *((f'{n} decimals of a degree', None, n) for n in (2, 3, 4, 6)),
    ],
)
def test_the_designs_at_random_lose_what_doubles_say_too(angles, name, decimals, place):
    # By another route: in doubles, which leave room for rounding as coarse as this.
    theta, phi = angles
    exact = by_numpy(theta, phi)[:, 1]
    used = angles if place is None else np.round(angles, place)
    lengths = by_numpy(*used, decimals)
    off = np.nan_to_num(np.abs(lengths[:, 1] / exact - 1.0), nan=np.inf)
    expected = [*(np.quantile(off, part, method='higher') for part in (0.5, 0.95)), off.max()]
    *cells, share = row(name)
    for cell, value in zip(cells, expected, strict=True):
        assert number(cell) == pytest.approx(value, rel=0.06)
    assert number(share) == pytest.approx(opens(lengths, theta).mean(), abs=0.0006)


def test_the_condition_numbers_are_those_of_the_equations(angles):
    theta, phi = np.radians(angles)
    condition = np.linalg.cond(np.stack([np.cos(phi), np.cos(theta), np.ones_like(phi)], -1))
    said = re.search(
        r'its median is (\S+), its 95th\s+percentile (\S+), the\s+greatest (\S+)\.', PAGE
    )
    expected = np.median(condition), np.quantile(condition, 0.95), condition.max()
    for cell, value in zip(said.groups(), expected, strict=True):
        assert number(cell) == pytest.approx(value, rel=0.06)
    span = np.abs(angles[..., 2] - angles[..., 0]).min(0)
    for low, high in zip(rounding.SPANS, rounding.SPANS[1:], strict=False):
        part = condition[(span >= low) & (span < high)]
        count, median, most = row(f'{low} to {high}°')
        assert int(count) == len(part)
        assert number(median) == pytest.approx(np.median(part), rel=0.01)
        assert number(most) == pytest.approx(np.quantile(part, 0.95), rel=0.01)


def test_the_package_is_as_exact_as_the_page_says(tasks):
    bound = float(re.search(r'have\s+relative\s+errors\s+below\s+([^\s:]+)', PAGE).group(1))
    _, errors = digits.by_package(tasks[:300])
    assert errors.max() <= 2.0 * bound


@pytest.mark.parametrize('kind', EXACT, ids=lambda kind: kind.name)
def test_a_kind_of_task_has_the_answer_of_today(kind):
    section = '\n'.join(kinds.section(kind, kinds.answer_to(kind)))
    assert section.strip() in PAGE, 'make synthesis makes it anew'


def test_every_kind_is_shown_with_what_is_typed():
    for kind in kinds.KINDS:
        text = PAGE.split(f'\n### {kind.name}\n')[1].split('\n### ')[0]
        typed = text.split('```sh\n')[1].split('```')[0].replace('\\\n', ' ').split()
        assert typed == ['linkage', 'synthesize', *kind.command.split()]


def test_all_pictures_are_there_and_no_others():
    shown = set(re.findall(r'\]\(synthesis/(\w+\.svg)\)', PAGE))
    assert shown == {'digits.svg', 'example.svg', *(f'{kind.picture}.svg' for kind in kinds.KINDS)}
    files = {file.name: file for file in make_synthesis.PICTURES.iterdir()}
    assert set(files) == shown
    for file in files.values():
        assert file.stat().st_size <= make_synthesis.LARGEST
        assert '<svg' in file.read_text('utf-8')[:1000]
