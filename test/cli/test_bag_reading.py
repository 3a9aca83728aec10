# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Where a command puts what it makes of a bag: beside it, from wherever the bag is named."""

from __future__ import annotations

from pathlib import Path
from threading import Event

from linkage_ros.bag import BagWriter
from linkage_ros.cli import open_bag, path_beside
import pytest


@pytest.mark.parametrize(
    ('named', 'file'),
    [
        ('runs/first', 'runs/first.png'),
        ('runs/first/', 'runs/first.png'),
        ('runs/first/first_0.mcap', 'runs/first/first_0.mcap.png'),
        ('runs/v1.5', 'runs/v1.5.png'),
    ],
)
def test_output_file_lies_beside_the_named_bag(named: str, file: str) -> None:
    assert path_beside(Path(named), '.png') == Path(file)


@pytest.mark.parametrize(('here', 'file'), [('.', 'runs/first.png'), ('..', 'runs.png')])
def test_output_file_takes_the_name_of_the_current_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, here: str, file: str
) -> None:
    folder = tmp_path / 'runs' / 'first'
    folder.mkdir(parents=True)
    monkeypatch.chdir(folder)
    assert path_beside(Path(here), '.png') == tmp_path / file


def test_warning_names_attachments_beyond_64_mib(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = {'note': ('', b'a'), 'huge\n': ('', bytes(64 * 2**20)), 'scene.yaml': ('', b'b: 1')}
    BagWriter(tmp_path / 'bag', [], files).close()
    bag = open_bag(tmp_path / 'bag', Event())
    assert bag.attachments == {'note': b'a', 'scene.yaml': b'b: 1'}
    assert capsys.readouterr().err == (
        f'linkage: {tmp_path}/bag: attachments beyond 64 MiB are not read: huge\\n\n'
    )


def test_bag_with_small_attachments_prints_no_warning(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    BagWriter(tmp_path / 'bag', [], {'note': ('', b'a')}).close()
    open_bag(tmp_path / 'bag', Event())
    assert capsys.readouterr().err == ''
