# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Lengths of any size, through the commands: an answer, or a line that says what is wrong."""

from collections.abc import Mapping
import json
from pathlib import Path

from linkage_ros.cli.main import main
import pytest

SIZES = [5e-324, 1e-200, 1e-155, 1e-150, 1e-28, 1e-15, 1e9]
"""From the smallest double to the largest coordinate of a file."""

_JOINTS = {
    't3': {'parent': 'ground', 'child': 'coupler'},
    't4': {'parent': 'ground', 'child': 'rocker'},
}
_INPUT = {'joint': 'crank_joint', 'parent': 'ground', 'child': 'crank'}
Content = Mapping[str, object]


def four_bar(a: float, b: float, c: float, d: float) -> Content:
    return {
        'links': {
            'ground': {'O2': [0, 0], 'O4': [d, 0]},
            'crank': {'O2': [0, 0], 'A': [a, 0]},
            'coupler': {'A': [0, 0], 'B': [b, 0], 'P': [b / 2, b / 3]},
            'rocker': {'O4': [0, 0], 'B': [c, 0]},
        },
        'input': _INPUT,
        'assembly': {'B': 'left'},
        'joints': _JOINTS,
        'traced': ['P'],
    }


def yoke(a: float, y: float, direction: float) -> Content:
    return {
        'links': {
            'ground': {'O2': [0, 0]},
            'crank': {'O2': [0, 0], 'A': [a, 0]},
            'yoke': {'Y': [y, 0]},
        },
        'sliders': {
            'guide': {
                'point': 'Y', 'block': 'yoke', 'angle': 0, 'along': 'ground', 'through': 'O2',
                'direction': [direction, 0],
            },
            'slot': {
                'point': 'A', 'along': 'yoke', 'through': 'Y', 'direction': [0, direction],
            },
        },
        'input': _INPUT,
        'joints': {'yoke_slide': {'slider': 'guide'}, 'slot_slide': {'slider': 'slot'}},
    }  # fmt: skip


def slider_crank(a: float, b: float, e: float, direction: float) -> Content:
    return {
        'links': {
            'ground': {'O2': [0, 0], 'G': [0, e]},
            'crank': {'O2': [0, 0], 'A': [a, 0]},
            'rod': {'A': [0, 0], 'B': [b, 0]},
        },
        'sliders': {
            'guide': {
                'point': 'B', 'along': 'ground', 'through': 'G', 'direction': [direction, 0],
            },
        },
        'input': _INPUT,
        'assembly': {'guide': 'ahead'},
        'joints': {'rod_joint': {'parent': 'ground', 'child': 'rod'}, 's': {'slider': 'guide'}},
    }  # fmt: skip


KINDS = {
    'a four-bar': lambda s: four_bar(0.3 * s, s, 0.7 * s, 0.8 * s),
    'its crank': lambda s: four_bar(s, 1.2, 0.8, 1.0),
    'its crank and ground': lambda s: four_bar(s, 1.0, 1.0, 0.7 * s),
    'its coupler': lambda s: four_bar(1.0, s, 1.7, 0.7),
    'its rocker': lambda s: four_bar(1.0, 1.0, s, 1.0),
    'a yoke': lambda s: yoke(0.3 * s, s, s),
    'the crank of a yoke': lambda s: yoke(s, 3.14, 1.0),
    'the offset of a yoke': lambda s: yoke(1.0, s, 1.0),
    'a slider-crank': lambda s: slider_crank(0.3 * s, s, 0.1 * s, 1.0),
    'its crank in it': lambda s: slider_crank(s, 3.0, 0.1, 1.0),
    'its rod': lambda s: slider_crank(1.0, s, 0.0, 1.0),
    'its offset': lambda s: slider_crank(1.0, 3.0, s, 1.0),
    'a direction': lambda s: slider_crank(1.0, 3.0, 0.1, s),
    'a shorthand': lambda s: {'four_bar': {'a': s, 'b': 1.0, 'c': 1.0, 'd': 0.5}},
    'an inverted slider-crank': lambda s: {
        'inverted_slider_crank': {'a': s, 'swivel': [0.25, 0.1]}
    },
}


def check_answer(typed: list[str], capsys: pytest.CaptureFixture[str]) -> bool:
    """Check that a command answers; return whether it refused its file."""
    code = main(typed)
    told = capsys.readouterr().err.splitlines()
    faults = [line for line in told if ': note: ' not in line]
    assert (code, len(faults)) in ((0, 0), (2, 1)), (typed, told)
    return bool(faults)


@pytest.mark.sample(3)
@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('kind', KINDS)
def test_lengths_of_any_size_are_computed_or_refused(
    kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / 'sized.yaml'
    refused = []
    for size in SIZES:
        file.write_text(json.dumps(KINDS[kind](size)))
        name = str(file)
        refused.append(check_answer(['check', name], capsys))
        for typed in (
            ['mjcf', name, '-o', str(tmp_path / 'a.xml')],
            ['urdf', name, '-o', str(tmp_path / 'a.urdf')],
            ['compile', name, '-o', str(tmp_path / 'a.py')],
            ['solve', name, '--steps', '6'],
        ):
            # What is not refused may close nowhere else, for rounding.
            assert check_answer(typed, capsys) or not refused[-1], (size, typed)
    assert not all(refused)


@pytest.mark.sample(1)
@pytest.mark.parametrize('size', [1e-150, 1e-15])
@pytest.mark.parametrize('kind', ['a four-bar', 'a yoke', 'its offset'])
def test_lengths_of_any_size_are_drawn(
    kind: str, size: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / 'sized.yaml'
    file.write_text(json.dumps(KINDS[kind](size)))
    check_answer(['draw', str(file), '-o', str(tmp_path / 'a.png'), '--names'], capsys)
