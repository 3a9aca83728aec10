# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""``linkage report``: one file beside its bag, or one line; whatever the bag is like."""

from __future__ import annotations

from dataclasses import replace
import errno
import json
import os
from pathlib import Path
from threading import Event
from typing import Any

from linkage_ros.bag import BagWriter, read_bag
from linkage_ros.errors import LinkageError
from linkage_ros.signals import StoppedError
from linkage_ros.tools.view import report_command as command
import pytest

from .recorded import answer, JOINT_STATE, Recorded, rewritten, scene_file, topic
from ..support.commands import linkage

pytest.importorskip('plotly', reason='is within the page')


def crank(number: int) -> dict[str, tuple[float, float]]:
    """Return a crank that turns at 7 rad/s."""
    return {'crank_joint': (1.0 + 0.007 * number, 7.0)}


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    scene = scene_file(tmp_path, 'effects: {velocity: {}}\n')
    return Recorded(tmp_path / 'bag', scene, crank).run(300)


def refused(*typed: object) -> str:
    """Return the line for which the command is refused."""
    with pytest.raises(LinkageError) as caught:
        answer(command, *typed)
    line = str(caught.value)
    assert line.isprintable()
    return line


def data_of(page: Path) -> dict[str, Any]:
    text = page.read_text().split('id="data">')[1].split('</script>')[0]
    found: dict[str, Any] = json.loads(text, parse_constant=pytest.fail)
    return found


def warnings_of(page: Path) -> list[str]:
    """Return what a page warns of; it is handed on, so nowhere does it say where it was made."""
    text = page.read_text()
    assert str(page.parent) not in text
    _, _, rest = text.partition('<ul class="warnings" role="alert">')
    items, _, _ = rest.partition('</ul>')
    return [item.strip().removesuffix('</li>') for item in items.split('<li>')[1:]] if rest else []


def test_report_is_one_file_beside_the_bag(bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = {*bag.parent.iterdir()}
    assert answer(command, bag) == 0
    page = bag.parent / 'bag.html'
    assert {*bag.parent.iterdir()} - before == {page}
    assert capsys.readouterr().out == f'{page}: {page.stat().st_size / 1e6:.1f} MB\n'
    assert warnings_of(page) == []
    text = page.read_text()
    assert text.startswith('<!doctype html>')
    assert '<title>Run of scene of mine</title>' in text
    for told in ('1000 a second', 'linkage_ros 9.8.7', '600', '/joint_states', '0.299000 s'):
        assert told in text
    assert data_of(page)['linkages'][0]['links']


@pytest.mark.parametrize(
    ('typed', 'written'),
    [
        (['bag/'], 'bag.html'),
        (['bag/bag_0.mcap'], 'bag/bag_0.mcap.html'),
        (['bag', '-o', 'x.HTM'], 'x.HTM'),
        (['bag/../bag'], 'bag.html'),
    ],
)
def test_report_file_is_named_after_the_bag(
    bag: Path, monkeypatch: pytest.MonkeyPatch, typed: list[str], written: str
) -> None:
    monkeypatch.chdir(bag.parent)
    assert answer(command, *typed) == 0
    assert Path(written).is_file()


@pytest.mark.parametrize('here', ['.', '../bag'])
def test_report_from_within_the_bag_lies_beside_it(
    bag: Path, monkeypatch: pytest.MonkeyPatch, here: str
) -> None:
    monkeypatch.chdir(bag)
    assert answer(command, here) == 0
    assert (bag.parent / 'bag.html').is_file()


@pytest.mark.parametrize('name', ['taken.html', f'{"x" * 300}.html'])
def test_report_refuses_a_folder_or_an_overlong_name(bag: Path, tmp_path: Path, name: str) -> None:
    (tmp_path / 'taken.html').mkdir()
    before = {*tmp_path.rglob('*')}
    reason = (
        'is a folder; name' if name == 'taken.html' else 'cannot be written (File name too long'
    )
    assert refused(bag, '-o', tmp_path / name).startswith(f'{tmp_path / name}: {reason}')
    assert {*tmp_path.rglob('*')} == before


def test_full_disk_keeps_the_old_report(
    bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = tmp_path / 'x.html'
    page.write_text('old')

    def full(_descriptor: int) -> None:
        raise OSError(errno.ENOSPC, 'No space left on device')

    monkeypatch.setattr(os, 'fsync', full)
    before = {*tmp_path.iterdir()}
    assert refused(bag, '-o', page) == (
        f'{page}: cannot be written (No space left on device); name another file'
    )
    assert {*tmp_path.iterdir()} == before
    assert page.read_text() == 'old'


def test_report_writes_through_a_symbolic_link(bag: Path, tmp_path: Path) -> None:
    there = tmp_path / 'there'
    there.mkdir()
    (tmp_path / 'x.html').symlink_to(there / 'page.html')
    assert answer(command, bag, '-o', tmp_path / 'x.html') == 0
    assert (tmp_path / 'x.html').is_symlink()
    assert (there / 'page.html').stat().st_size > 10**6


def test_report_shows_the_requested_part_of_a_run(bag: Path, tmp_path: Path) -> None:
    page = tmp_path / 'x.html'
    assert answer(command, bag, '-o', page, '--since', '0.1', '--until', '0.2') == 0
    assert '0.1 s to 0.2 s' in page.read_text()
    assert (data_of(page)['since'], data_of(page)['until']) == (0.1, 0.2)
    assert data_of(page)['curves'][0]['of'] == 101
    assert warnings_of(page) == []


def test_report_warns_of_a_part_beyond_the_run(bag: Path, tmp_path: Path) -> None:
    page = tmp_path / 'x.html'
    assert answer(command, bag, '-o', page, '--since', '5') == 0
    assert warnings_of(page) == ['The part begins after the end of the run, at 0.299 s.']
    assert data_of(page)['curves'] == []


def test_report_draws_a_spatial_linkage_at_recorded_inputs(tmp_path: Path) -> None:
    scene = tmp_path / 'ankle_scene.yaml'
    scene.write_text('linkage: ankle\ndrive: {sine: {amplitude: 0.1, frequency: 1}}\n')
    for typed in (('simulate', scene, '--seconds', '1', '-o', 'bag'), ('report', 'bag')):
        assert linkage(tmp_path, *map(str, typed)).returncode == 0
    page = tmp_path / 'bag.html'
    assert 'Not drawn' not in page.read_text()
    assert 'The links stand where' not in page.read_text()
    assert 'The loops are closed at the recorded inputs. Drag the picture' in page.read_text()
    (told,) = data_of(page)['linkages']
    names = {shape['name'] for shape in told['drawn']['shapes']}
    assert {'b1', 'c2', 'm1', 'roll', 'rod1', 'foot'} <= names


def test_report_of_a_foreign_bag_draws_curves_without_linkage(bag: Path, tmp_path: Path) -> None:
    rewritten(bag, 'foreign', attachments={})
    assert answer(command, tmp_path / 'foreign') == 0
    page = tmp_path / 'foreign.html'
    (warning,) = warnings_of(page)
    assert warning.startswith('No scene of linkage_ros, so no linkage: ')
    assert 'carries no run.json, scene.yaml' in warning
    data = data_of(page)
    assert (data['linkages'], data['frames']) == ([], None)
    assert {curves['title'] for curves in data['curves']} == {'/crank_states', '/joint_states'}
    assert '<title>Run of foreign</title>' in page.read_text()


@pytest.mark.parametrize('topics', [[], [topic('/joint_states', JOINT_STATE)]])
def test_report_of_an_empty_bag_draws_no_curves(tmp_path: Path, topics: list[Any]) -> None:
    BagWriter(tmp_path / 'empty', topics).close()
    assert answer(command, tmp_path / 'empty') == 0
    page = tmp_path / 'empty.html'
    assert warnings_of(page)[1:] == ['The bag holds no messages.']
    assert 'No joint states are in this bag.' in page.read_text()
    assert data_of(page)['curves'] == []


def test_report_describes_a_run_without_joint_states(tmp_path: Path) -> None:
    scene = scene_file(tmp_path, 'effects: {velocity: {}}\n')
    Recorded(tmp_path / 'bag', scene, lambda _: {}).run(50)
    assert answer(command, tmp_path / 'bag') == 0
    page = tmp_path / 'bag.html'
    assert warnings_of(page) == []
    assert 'no joints or no positions' in page.read_text()


def harmed(bag: Path, change: Any) -> Path:
    file = bag / 'bag_0.mcap'
    content = bytearray(file.read_bytes())
    file.write_bytes(change(content) or content)
    return bag


def flip(at: int) -> Any:
    def change(content: bytearray) -> None:
        content[at] ^= 1

    return change


@pytest.fixture
def longer(tmp_path: Path) -> Path:
    scene = scene_file(tmp_path, 'effects: {velocity: {}}\n')
    return Recorded(tmp_path / 'bag', scene, crank).run(3000)


def test_report_shows_a_truncated_bag_up_to_its_end(longer: Path) -> None:
    harmed(longer, lambda content: content[: len(content) * 2 // 3])
    assert answer(command, longer) == 0
    page = longer.parent / 'bag.html'
    (warning,) = warnings_of(page)
    assert warning.startswith(
        'Unfinished: its recording was killed, or still runs; the page shows'
    )
    assert 0 < data_of(page)['curves'][0]['of'] < 3000


def test_report_shows_a_damaged_bag_up_to_the_damage(longer: Path, tmp_path: Path) -> None:
    bag = longer
    content = (bag / 'bag_0.mcap').read_bytes()
    harmed(bag, flip(len(content) * 2 // 3))
    assert answer(command, bag) == 0
    (warning,) = warnings_of(tmp_path / 'bag.html')
    assert warning.startswith('Damaged: ')
    assert warning.endswith('; the page shows what lies before.')


def test_damaged_attachment_is_refused_in_one_line(bag: Path) -> None:
    content = (bag / 'bag_0.mcap').read_bytes()
    harmed(bag, flip(content.index(b'four_bar: {a')))
    assert 'is damaged: ' in refused(bag)
    assert not (bag.parent / 'bag.html').exists()


SCENES = {
    'a drive that there is not': b'linkage: l.yaml\ndrive: {wind: {}}\n',
    'no YAML': b'linkage: [',
    'not UTF-8': b'linkage: \xff',
    'nothing': b'',
}


@pytest.mark.parametrize('name', SCENES)
def test_report_warns_of_an_unreadable_scene_and_draws_curves(
    bag: Path, tmp_path: Path, name: str
) -> None:
    rewritten(bag, 'odd', attachments={**read_bag(bag).attachments, 'scene.yaml': SCENES[name]})
    assert answer(command, tmp_path / 'odd') == 0
    (warning,) = warnings_of(tmp_path / 'odd.html')
    assert warning.startswith('No scene of linkage_ros, so no linkage: ')
    assert 'scene.yaml' in warning
    assert data_of(tmp_path / 'odd.html')['curves']


@pytest.mark.parametrize('content', [b'', b'no bag', b'\x89MCAP1\r\n'])
def test_report_refuses_a_file_that_is_no_bag(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / 'x.mcap'
    file.write_bytes(content)
    assert refused(file).startswith(f'{file}: ')
    assert {*tmp_path.iterdir()} == {file}


def test_report_without_plotly_names_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr('linkage_ros.errors.find_spec', lambda name: None)
    line = refused(tmp_path / 'nowhere', '-o', tmp_path / 'x.html')
    assert line == "plotly: is not installed; pip install 'linkage_ros[report]'"


def test_stopped_report_writes_no_file(bag: Path) -> None:
    stop = Event()
    stop.set()
    before = {*bag.parent.iterdir()}
    with pytest.raises(StoppedError):
        answer(command, bag, stop=stop)
    assert {*bag.parent.iterdir()} == before


def test_report_escapes_html_in_names_of_a_bag(bag: Path, tmp_path: Path) -> None:
    name = '</script><script>alert(1)</script>'
    topics = read_bag(bag).topics
    odd = [replace(each, name=each.name.replace('withheld', name)) for each in topics]
    rewritten(bag, 'odd', topics=odd, scene=name, linkage_ros=name)
    assert answer(command, tmp_path / 'odd') == 0
    text = (tmp_path / 'odd.html').read_text()
    assert name not in text
    assert '&lt;/script&gt;&lt;script&gt;alert(1)' in text
