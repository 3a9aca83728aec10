# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Sweeps of one of several inputs, the others held."""

from __future__ import annotations

import csv
from pathlib import Path

from linkage_ros.cli.main import main
import numpy as np
import pytest


def rows(tmp_path: Path, *arguments: str) -> list[dict[str, str]]:
    file = tmp_path / 'table.csv'
    assert main(['solve', *arguments, '-o', str(file), '--force']) == 0
    with file.open(encoding='utf-8') as text:
        return list(csv.DictReader(text))


def places(found: list[dict[str, str]]) -> np.ndarray:
    names = [next(key for key in found[0] if key.split(' ')[0] == axis) for axis in 'xyz']
    # The ends are toggles, where nothing is certain.
    return np.array([[float(row[name]) for name in names] for row in found[1:-1]])


def test_the_arms_of_a_delta_are_swept_in_turn(tmp_path: Path) -> None:
    """Its arms stand at 120 degrees: each sweep is another one, turned about the z axis."""
    first, second = (
        rows(tmp_path, 'delta', '--over', arm, '--steps', '12') for arm in ('a1', 'a2')
    )
    held = next(key for key in second[0] if key.startswith('a1'))
    assert {float(row[held]) for row in second} == {0.0}
    cosine, sine = np.cos(2 * np.pi / 3), np.sin(2 * np.pi / 3)
    turned = places(first) @ np.array([[cosine, sine, 0], [-sine, cosine, 0], [0, 0, 1]])
    assert places(second) == pytest.approx(turned, abs=1e-9)


def test_sweep_holds_the_other_inputs_at_their_values(tmp_path: Path) -> None:
    found = rows(
        tmp_path, 'five_bar', '--at', '60', '100', '--over', 'right_crank_joint', '--from', '90',
        '--to', '110', '--steps', '2',
    )  # fmt: skip
    left, right = (
        [float(row[next(key for key in row if key.startswith(name))]) for row in found]
        for name in ('left_crank', 'right_crank')
    )
    assert left == pytest.approx(np.radians([60.0] * 4))
    assert right == pytest.approx(np.radians([100.0, 90.0, 100.0, 110.0]))
    assert found[0] == found[2]


@pytest.mark.parametrize(
    ('arguments', 'said'),
    [
        (
            ['delta'],
            '--sweep: there are 3 inputs; name one, as --over a1, or each state with --at',
        ),
        (['delta', '--over', 'b'], '--over b: is not an input; name a1, a2, a3'),
    ],
)
def test_sweep_refuses_unknown_inputs(
    capsys: pytest.CaptureFixture[str], arguments: list[str], said: str
) -> None:
    assert main(['solve', *arguments]) == 2
    assert said in capsys.readouterr().err
