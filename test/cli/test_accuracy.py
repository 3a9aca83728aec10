# Copyright 2026 The linkage_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""``linkage accuracy``: its output, its files and its errors."""

from __future__ import annotations

import argparse
from importlib.util import find_spec
import json
from threading import Event

from linkage_ros.accuracy import PARTS
from linkage_ros.accuracy.results import Choice, Part, Rate, Results
from linkage_ros.cli import accuracy as command
from linkage_ros.cli.accuracy import print_results
from linkage_ros.errors import LinkageError
from linkage_ros.measuring import Spread
from linkage_ros.resources import shipped
import pytest

DEMO = str(shipped('scenes/demo.yaml'))


def run(*arguments, stop=None):
    """Run ``linkage accuracy`` in this process; return its exit code."""
    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    return command.run(parser.parse_args(arguments), stop or Event())


def test_a_part_is_measured_printed_and_written(tmp_path, capfd):
    folder = tmp_path / 'page'
    assert run(DEMO, '--quick', '--only', 'effects', '-o', str(folder)) == 0
    out = capfd.readouterr().out
    headline, cost, page = out.splitlines()
    assert headline == 'demo: measured.'
    assert cost.startswith('A tick takes ')
    assert page == f'page      {folder / "index.html"}'
    assert {file.name for file in folder.iterdir()} == {'index.html', 'effects.csv'}
    assert 'velocity' in (folder / 'effects.csv').read_text('utf-8')


def test_a_linkage_file_will_do(tmp_path):
    folder = tmp_path / 'page'
    file = str(shipped('linkages/slider_crank.yaml'))
    assert run(file, '--quick', '--only', 'effects', '-o', str(folder)) == 0
    assert (folder / 'index.html').is_file()


@pytest.mark.parametrize(
    ('arguments', 'said'),
    [
        (['--only', 'solvin'], "--only solvin: there is no such part; did you mean 'solving'?"),
        (['--only', 'x'], f'--only x: there is no such part; known: {", ".join(PARTS)}'),
        (['-o', '.'], '.: exists already; name a new folder; nothing is overwritten'),
    ],
)
def test_what_is_refused(tmp_path, monkeypatch, arguments, said):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(LinkageError) as caught:
        run(DEMO, *arguments)
    assert str(caught.value) == said
    assert not list(tmp_path.iterdir())


def test_no_scene_is_one_line(linkage):
    answer = linkage('accuracy', 'nowhere.yaml')
    assert (answer.returncode, answer.stdout) == (2, '')
    assert answer.stderr.startswith('linkage accuracy: nowhere.yaml: ')
    assert answer.stderr.count('\n') == 1


@pytest.mark.parametrize('missing', ['mpmath', 'plotly', 'matplotlib'])
def test_what_is_not_installed_is_said_before_anything_is_measured(tmp_path, monkeypatch, missing):
    def hidden(name, find=find_spec):
        return None if name == missing else find(name)

    monkeypatch.setattr('linkage_ros.errors.find_spec', hidden)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(LinkageError) as caught:
        run(DEMO)
    assert str(caught.value) == f"{missing}: is not installed; pip install 'linkage_ros[report]'"


def test_it_can_be_stopped_and_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    stop = Event()
    stop.set()
    assert run(DEMO, stop=stop) == 1
    assert not list(tmp_path.iterdir())


def test_json_has_the_same_answer(tmp_path, capfd):
    folder = tmp_path / 'page'
    assert run(DEMO, '--quick', '--only', 'effects', '--json', '-o', str(folder)) == 0
    said = json.loads(capfd.readouterr().out)
    assert said['scene'] == 'demo'
    assert said['headline'] == 'demo: measured.'
    assert said['answers'] == []
    assert [part['key'] for part in said['parts']] == ['effects']
    assert said['parts'][0]['headline'].startswith('A tick takes ')
    assert said['page'] == str(folder / 'index.html')


# The lines of ``linkage accuracy`` on a terminal.


def test_the_answer_is_at_most_twelve_lines_of_eighty_columns(capsys):
    closed = Spread(0.5, 0.53, 0.55)
    print_results(
        Results(
            'torque_crank',
            [('cores', '2')],
            [
                Part(
                    'solving', 'Solving the loop', 'Exact to 6e-16 rad in 0.53 µs.',
                    clause='exact to 6e-16 rad in 0.53 µs; '
                    'nothing cheaper is within 9 digits of it',
                    choices=[Choice(6e-16, 'solver: closed_form # the default', closed, closed)],
                ),
                Part('ticking', 'Ticking', 'A headline.', rates=[
                    Rate(2000.0, 5e-3, 'held'), Rate(2000.0, 2e-4, 'carried forward'),
                ]),
                Part('effects', 'Effects', 'A tick takes 53.2 µs; effort adds 52 µs.'),
                Part('dynamics', 'Steps', 'rk4, 1 ms a step: 6e-08 rad off after 10 s.'),
                Part('recording', 'Recording', 'Recording costs 6 µs a message.',
                     clause='recording costs 6 µs a message and may lose 0.91 s in a crash'),
            ],
        )
    )  # fmt: skip
    lines = capsys.readouterr().out.splitlines()
    assert lines == [
        'torque_crank: exact to 6e-16 rad in 0.53 µs; nothing cheaper is within 9 digits',
        '  of it; recording costs 6 µs a message and may lose 0.91 s in a crash.',
        '0.01 rad: 0.53 µs (0.53 µs to solve) a tick; 2000 Hz carried forward, 2000 Hz',
        '  held; solver: closed_form # the default',
        '1e-4 rad: 0.53 µs (0.53 µs to solve) a tick; none: at 2000 Hz a state is 0.0002',
        '  rad off when used; solver: closed_form # the default',
        '1e-8 rad: 0.53 µs (0.53 µs to solve) a tick; none: at 2000 Hz a state is 0.0002',
        '  rad off when used; solver: closed_form # the default',
        'A tick takes 53.2 µs; effort adds 52 µs.',
        'rk4, 1 ms a step: 6e-08 rad off after 10 s.',
    ]
    # The path of the page is one more.
    assert len(lines) < 12
    assert max(map(len, lines)) <= 80
