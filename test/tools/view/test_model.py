# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The model of a linkage: its program moves every link as the closure does."""

from __future__ import annotations

from cmath import rect
from collections.abc import Sequence
import json
from math import isfinite
from pathlib import Path
import shutil
import subprocess
from typing import Any

from linkage_ros.description import load
from linkage_ros.errors import FileError
from linkage_ros.kinematics import Closure, Status
from linkage_ros.resources import linkage_names, shipped_path
from linkage_ros.tools.view import build_model, model_of, ViewState
import pytest

needs_node = pytest.mark.skipif(shutil.which('node') is None, reason='needs node')
NEAR = 1e-12
RUN = """
const { readFileSync, writeFileSync } = require('node:fs');
const { program, states } = JSON.parse(readFileSync('given'));
const motion = new Function(program + '\\nreturn motion;')();
writeFileSync('told', JSON.stringify(states.map((state) => motion(...state))));
"""


def text_of(name: str) -> str:
    return shipped_path(f'linkages/{name}.yaml').read_text('utf-8')


def run(program: str, states: Sequence[Any], folder: Path) -> list[dict[str, Any]]:
    """Return what the program says of states, as the page runs it."""
    (folder / 'run.js').write_text(RUN)
    (folder / 'given').write_text(json.dumps({'program': program, 'states': states}))
    subprocess.run(['node', 'run.js'], cwd=folder, check=True, timeout=60)
    told: list[dict[str, Any]] = json.loads((folder / 'told').read_text())
    return told


def batches(flat: list[float]) -> list[list[float]]:
    return [list(batch) for batch in zip(*[iter(flat)] * 3, strict=True)]


def states_of(closure: Closure, found: dict[str, Any]) -> list[list[list[float]]]:
    """Return states over the ranges of the first input, with rates of all."""
    start = [given['value'] for given in found['inputs']]
    states = []
    for low, high in found['ranges']:
        for i in range(1, 40):
            inputs = [low + (high - low) * i / 40.0, *start[1:]]
            states.append([inputs, [0.5] * len(inputs), [0.25] * len(inputs)])
    return states


@pytest.mark.sample(3)
@needs_node
@pytest.mark.parametrize('name', sorted(linkage_names()))
def test_compiled_model_moves_every_link_as_the_closure(name: str, tmp_path: Path) -> None:
    found = build_model(text_of(name), name)
    closure = load(name)
    states = states_of(closure, found)
    for state, told in zip(states, run(found['program'], states, tmp_path), strict=True):
        position = closure.position(*state[0])
        if told['status'] != 0:  # at the ends of ranges
            assert position.status is not Status.CLOSED
            continue
        velocity = closure.velocity(position, *state[1])
        acceleration = closure.acceleration(position, velocity, *state[2])
        great = max(1.0, *map(abs, acceleration.joints))
        assert told['joints'] == pytest.approx(position.joints, abs=NEAR)
        assert told['rates'] == pytest.approx(velocity.joints, abs=NEAR * great)
        assert told['accelerations'] == pytest.approx(acceleration.joints, abs=1e3 * NEAR * great)
        frames = dict(zip(found['links'], batches(told['frames']), strict=True))
        points = closure.points(position)
        angles = closure.link_angles(position)
        for link, (x, y, angle) in frames.items():
            if link not in closure.linkage.links:
                continue  # a block, which has no points
            assert angle == pytest.approx(angles[link], abs=NEAR)
            for point, (u, v) in closure.linkage.links[link].items():
                turned = complex(u, v) * rect(1.0, angle)
                assert abs(complex(x, y) + turned - points[link, point]) < NEAR * (
                    1.0 + closure.scale
                )


@needs_node
def test_frame_rates_equal_differences_of_frames(tmp_path: Path) -> None:
    found = build_model(text_of('jansen_leg'), 'jansen_leg')
    step = 1e-6
    states = [[[0.7 + shift], [1.0], [0.0]] for shift in (-step, 0.0, step)]
    before, now, after = run(found['program'], states, tmp_path)
    differences = [
        (b - a) / (2 * step) for a, b in zip(before['frames'], after['frames'], strict=True)
    ]
    assert now['frameRates'] == pytest.approx(differences, abs=1e-8)


@pytest.mark.sample(3)
@pytest.mark.parametrize('name', linkage_names())
def test_model_names_joints_pins_and_lengths_of_the_file(name: str) -> None:
    found = build_model(text_of(name), name)
    json.dumps(found, allow_nan=False)
    closure = load(name)
    linkage = closure.linkage
    assert found['program']
    assert [each['name'] for each in found['joints']] == list(linkage.joints)
    assert {pin['name'] for pin in found['pins']} == {
        p for at in linkage.links.values() for p in at
    }
    assert {shape['link'] for shape in found['drawn']['shapes']} <= {'ground', *found['links']}
    start = [given['value'] for given in found['inputs']]
    assert closure.position(*start).status is Status.CLOSED
    for length in found['lengths']:
        (x, y), (u, v) = (linkage.links[length['link']][length[key]] for key in ('from', 'to'))
        assert length['value'] == pytest.approx(abs(complex(u - x, v - y)))
    for low, high in found['ranges']:
        middle = [0.5 * (low + high), *start[1:]]
        assert closure.position(*middle).joints
    known = [angle for angle in found['quality']['transmission_angle'] if angle is not None]
    assert all(isfinite(angle) for angle in known)


def test_model_lists_the_other_assemblies() -> None:
    found = build_model(text_of('four_bar'), 'four_bar')
    assert found['choices'] == {'B': {'now': 'left', 'sides': ['left', 'right']}}
    assert [other['text'] for other in found['others']] == ['assembly: {B: right}']
    assert len(build_model(text_of('jansen_leg'), 'jansen_leg')['others']) == 7


def test_quick_model_omits_ranges_and_quality() -> None:
    found = build_model(text_of('four_bar'), 'four_bar', whole=False)
    assert {'others', 'ranges', 'quality', 'warnings'}.isdisjoint(found)


@pytest.mark.sample(2)
@pytest.mark.parametrize('name', linkage_names())
def test_quick_model_equals_the_whole_model_otherwise(name: str) -> None:
    found = build_model(text_of(name), name)
    start = tuple(given['value'] for given in found['inputs'])
    shown = ViewState(start, found['drawn']['size'])
    quick = build_model(text_of(name), name, whole=False, shown=shown)
    drawn, wanted = quick.pop('drawn'), found['drawn']
    assert quick == {key: found[key] for key in quick}
    assert drawn['traced'] == wanted['traced']
    for one, other in zip(drawn['shapes'], wanted['shapes'], strict=True):
        assert (one['link'], one['role'], one['name']) == (
            other['link'], other['role'], other['name']
        )  # fmt: skip
        assert one['points'] == pytest.approx(other['points'], abs=1e-3 * wanted['size'])


def test_drag_to_an_open_linkage_is_refused() -> None:
    text = text_of('four_bar').replace('B: [0.120, 0]', 'B: [1.2, 0]')
    with pytest.raises(FileError, match='the loops close at no value of the input'):
        build_model(text, 'x', whole=False, shown=ViewState((0.7,), 0.005))


def test_model_of_a_closure_equals_that_of_its_file() -> None:
    found = build_model(text_of('four_bar'), 'four_bar')
    bare = model_of(load('four_bar'))
    assert bare == {**found, 'text': '', 'others': []}


def test_model_names_the_unit_of_the_file() -> None:
    text = 'units: mm\nfour_bar: {a: 40, b: 120, c: 80, d: 100}\n'
    found = build_model(text, 'mine')
    assert found['unit'] == {'length': 'mm', 'factor': 0.001}
    assert {length['key']: length['value'] for length in found['lengths']} == pytest.approx(
        {'ground O2–O4': 0.1, 'crank O2–A': 0.04, 'coupler A–B': 0.12, 'rocker O4–B': 0.08}
    )


def test_model_warns_of_a_poor_transmission_angle() -> None:
    # From the law of cosines at the crank angle 0: cos µ = (b² + c² - (d - a)²) / 2bc.
    assert build_model(text_of('four_bar'), 'x')['warnings'] == [
        'transmission angle down to 26.38°'
    ]
    assert 'change point at 2 inputs' in build_model(text_of('parallelogram'), 'x')['warnings']


def test_model_refuses_a_text_that_is_no_linkage() -> None:
    with pytest.raises(FileError, match=r'^mine:1: '):
        build_model('links: 3\n', 'mine')
