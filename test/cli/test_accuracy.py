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
from threading import Event

from linkage_ros.accuracy.measure import PARTS
from linkage_ros.accuracy.results import Part, Results, Table
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
    assert out.startswith('What each effect costs, and what it makes of the truth\n')
    assert out.endswith(f'page      {folder / "index.html"}\n')
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
    def hidden(name, find=command.find_spec):
        return None if name == missing else find(name)

    monkeypatch.setattr(command, 'find_spec', hidden)
    monkeypatch.setattr('linkage_ros.accuracy.page.files.find_spec', hidden)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(LinkageError) as caught:
        run(DEMO)
    assert str(caught.value) == f'{missing}: is not installed; pip install linkage_ros[report]'


def test_it_can_be_stopped_and_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    stop = Event()
    stop.set()
    assert run(DEMO, stop=stop) == 1
    assert not list(tmp_path.iterdir())


# The tables of ``linkage accuracy`` on a terminal.


RESULTS = Results(
    'four_bar',
    [('cores', '2')],
    [
        Part(
            'solving',
            'Solving the loop',
            ['A text for the page.'],
            (),
            [
                Table(
                    'methods',
                    'What each takes',
                    ('method', 'time [µs]', 'error [rad]'),
                    [
                        ('closed form', Spread(0.68, 0.7, 0.75), 2.1e-16),
                        ('Newton', 12.25, None),
                        ('another', 'failed', 1e-6),
                    ],
                ),
                Table('none', 'What nobody takes', ('method', 'time [µs]'), []),
            ],
            ['For 1e-12 rad: the closed form.'],
        ),
        Part('ticking', 'Ticking', ['Nothing in numbers.']),
    ],
)


def test_tables_part_by_part_and_the_advice_at_the_end(capsys):
    print_results(RESULTS)
    assert capsys.readouterr().out == (
        'Solving the loop\n\n'
        'What each takes\n'
        'method              time [µs]  error [rad]\n'
        'closed form  0.70 (0.68–0.75)      2.1e-16\n'
        'Newton                   12.2\n'
        'another                failed         1e-6\n'
        '\n'
        'What nobody takes\n'
        'method  time [µs]\n'
        '\n'
        'Ticking\n\n'
        'Solving the loop\n'
        '  For 1e-12 rad: the closed form.\n'
    )
