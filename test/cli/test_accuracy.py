# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""``linkage accuracy``: its answer, its files, and what it refuses in one line."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from pkgutil import resolve_name
import re
from threading import Event
from typing import Any

from linkage_ros.description import load_scene
from linkage_ros.errors import LinkageError
from linkage_ros.tools.study import accuracy_command as command, Budget, PARTS
import pytest

from .recorded import Recorded, scene_file
from ..tools.study.shown_budget import BUDGET


def run(*arguments: str, stop: Event | None = None) -> int:
    """Run ``linkage accuracy`` in this process; return its exit code."""
    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    return command.run(parser.parse_args(arguments), stop or Event())


@pytest.fixture(autouse=True)
def short_prices(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let prices be measured for a moment: none is judged here."""
    prices = 'linkage_ros.tools.study.prices'
    time_ticks = resolve_name(f'{prices}:time_ticks')

    def time_briefly(scenes: Any, _seconds: float, *others: Any, **options: Any) -> Any:
        return time_ticks(scenes, 0.01, *others, **options)

    monkeypatch.setattr(f'{prices}.time_ticks', time_briefly)
    monkeypatch.setattr(f'{prices}._ROUNDS', 3)


@pytest.fixture
def by_hand(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Let the budget made by hand be what is measured; give what was asked for."""
    asked: dict[str, Any] = {}

    def measure(scene: Any, **options: Any) -> Budget:
        asked.update(options, scene=scene)
        options['progress'](1.0)
        return BUDGET

    monkeypatch.setattr(command, 'measure_budget', measure)
    return asked


def test_accuracy_prints_its_answer_in_the_first_lines(capsys: Any) -> None:
    file = 'slider_crank'
    assert run(file, '--quick', '--only', 'errors', '--horizon', '0.5', '--need', '1e-4') in (0, 1)
    answer, off, write, *table = capsys.readouterr().out.splitlines()
    assert answer.startswith('for 1e-4 rad: ')
    assert re.match(r'slider_crank: \S+ rad off at worst, by the age in use', off)
    assert 'rad' in write or ' of it: ' in write
    assert any(line.startswith('solving (closed form)') for line in table)


def test_only_effects_lists_every_effect_of_the_scene(capsys: Any) -> None:
    assert run('worn_press', '--quick', '--only', 'effects', '--horizon', '0.2') == 0
    said = capsys.readouterr().out
    assert said.startswith('on purpose: ')
    for effect in load_scene('worn_press').linkages[0].effects:
        assert f'on purpose: {effect}' in said
    assert 'the whole tick' in said


def test_accuracy_prints_the_answer_for_the_need_first(by_hand: Any, capsys: Any) -> None:
    assert run('demo', '--like', 'sine', '--need', '5e-3', '--horizon', '3') == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith('for 5e-3 rad: drive.torque.')
    assert lines[1].startswith('hil: 0.023 rad off at worst after 10 s')
    assert (by_hand['like'], by_hand['horizon'], by_hand['quick']) == ('sine', 3.0, False)
    assert [*by_hand['parts']] == [*PARTS]


def test_unreachable_need_exits_with_code_1(by_hand: Any, capsys: Any) -> None:
    assert run('demo', '--need', '1e-12') == 1
    assert 'prevents it' in capsys.readouterr().out.splitlines()[0]


def test_tuned_scene_holds_the_settings_of_the_answer(
    by_hand: Any, tmp_path: Path, capsys: Any
) -> None:
    file = tmp_path / 'tuned.yaml'
    assert run('torque_crank', '--need', '5e-3', '-o', str(file), '--json') == 0
    said = json.loads(capsys.readouterr().out)
    assert said['need']['is_met']
    tuned, own = load_scene(file), load_scene('torque_crank')
    assert tuned.linkages[0].linkage == own.linkages[0].linkage
    write = said['need']['write']
    drive = tuned.linkages[0].drive[1]
    assert drive.step == write['drive.torque.step'] != own.linkages[0].drive[1].step
    assert drive.method == write['drive.torque.method']
    assert tuned.rate == write.get('rate', own.rate)
    assert tuned.linkages[0].effects == own.linkages[0].effects


def test_accuracy_writes_a_page_and_a_picture(by_hand: Any, tmp_path: Path) -> None:
    page, picture = tmp_path / 'x.html', tmp_path / 'x.svg'
    for file in (page, picture):
        assert run('demo', '-o', str(file)) == 0
    assert page.read_text('utf-8').startswith('<!doctype html>')
    assert picture.read_text('utf-8').startswith('<svg')


def test_page_without_errors_has_no_field_for_a_need(tmp_path: Path) -> None:
    """Only prices were measured, so no need can be answered."""
    page = tmp_path / 'x.html'
    assert run('demo', '--quick', '--only', 'effects', '-o', str(page)) == 0
    text = page.read_text('utf-8')
    assert 'Accuracy of demo' in text
    assert 'id="need"' not in text


@pytest.mark.parametrize('linkage', ['five_bar', 'ankle_motors', 'torque'])
def test_effects_of_several_inputs_have_their_prices(
    linkage: str, tmp_path: Path, capsys: Any
) -> None:
    source = f'linkage: {linkage}\ndrive: {{topic: {{}}}}\neffects: {{velocity: {{}}}}\n'
    (file := tmp_path / 'scene.yaml').write_text(source)
    scene = 'torque_ankle' if linkage == 'torque' else str(file)
    assert run(scene, '--quick', '--only', 'effects', '--horizon', '0.1', '--json') == 0
    names = [each['name'] for each in json.loads(capsys.readouterr().out)['sources']]
    assert 'velocity' in names


def test_stopped_accuracy_command_writes_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    stop = Event()
    stop.set()
    assert run('slider_crank', '--quick', '-o', 'x.html', stop=stop) == 1
    assert not list(tmp_path.iterdir())


def test_accuracy_uses_motion_and_rate_of_a_bag(tmp_path: Path, capsys: Any) -> None:
    source = scene_file(tmp_path, 'rate: 100\n')
    Recorded(tmp_path / 'bag', source, lambda tick: {'crank_joint': (0.06 * tick, 6.0)}).run(200)
    bag = str(tmp_path / 'bag')
    assert run(bag, '--quick', '--only', 'errors', '--horizon', '1', '--json') == 0
    said = json.loads(capsys.readouterr().out)
    assert said['rate'] == 100.0
    (age,) = [each for each in said['sources'] if each['name'] == 'age in use']
    # The crank turns by 0.06 rad in a period; no joint of this four-bar is faster than twice that.
    assert 0.02 < age['settings'][age['chosen']]['worst'] < 0.12
    with pytest.raises(LinkageError, match='-o: the scene is in a bag'):
        run(bag, '--need', '1', '-o', str(tmp_path / 'x.yaml'))
    with pytest.raises(LinkageError, match='--like: the bag itself has the motion'):
        run(bag, '--like', 'sine')
