# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What joints reach within limits, as a picture: each line has its input's value."""

from pathlib import Path

from linkage_ros.cli.main import main
from linkage_ros.description import parse_yaml, read_any_closure
from linkage_ros.kinematics import reach_boxes
from linkage_ros.tools.drawing import reach_lines
import numpy as np
import pytest

from ...kinematics.analysis.test_reached_values import ANKLE, HIGH, LOW, motor_of


def test_reach_of_an_ankle_has_lines_of_equal_motors():
    """The motors' angles are those of the rods' own equations."""
    (box,) = reach_boxes(read_any_closure(parse_yaml(ANKLE.encode(), 'ankle.yaml')))
    lines = reach_lines(box)
    assert lines.shape == (2, 11, 61, 2)
    values = np.linspace(LOW, HIGH, 11)
    for held, name in enumerate(('m1', 'm2')):
        for value, line in zip(values, lines[held], strict=True):
            motors = [motor_of(name, pitch, roll) for pitch, roll in line]
            assert motors == pytest.approx([value] * len(line), abs=1e-9)


def test_draw_names_the_limits_of_a_reach(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(['draw', 'ankle_motors', '--reach', '-o', 'x.svg']) == 0
    text = Path('x.svg').read_text('utf-8')
    for words in ('m1: -34.38 to 34.38 °', 'm2: -34.38 to 34.38 °', 'pitch [°]', 'roll [°]'):
        assert f'<!-- {words} -->' in text
    capsys.readouterr()
    assert main(['draw', 'four_bar', '--reach']) == 2
    assert capsys.readouterr().err == (
        'linkage draw: four_bar: has no two inputs with limits that move two joints; '
        'write limits of both inputs, or of two joints\n'
    )


@pytest.mark.parametrize(
    ('words', 'said'),
    [
        (['--at', '3', '4'], '--at: says nothing with --reach; leave one of them out'),
        (['--names'], '--names: says nothing with --reach; leave one of them out'),
        (['--assemblies'], '--assemblies: says nothing with --reach; leave one of them out'),
        (['--azimuth', '0'], '--azimuth: says nothing with --reach; leave one of them out'),
        (['--elevation', '9'], '--elevation: says nothing with --reach; leave one of them out'),
        (['-o', 'x.dxf'], 'x.dxf: has the outlines of parts; write -o x.svg'),
    ],
)
@pytest.mark.parametrize('name', ['ankle_motors', 'five_bar'])
def test_options_without_effect_on_reach_are_refused(
    capsys, tmp_path, monkeypatch, name, words, said
):
    monkeypatch.chdir(tmp_path)
    assert main(['draw', name, '--reach', *words]) == 2
    assert said in capsys.readouterr().err
    assert not [*tmp_path.iterdir()]
