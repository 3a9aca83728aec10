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


"""Where a command puts what it makes of a bag: beside it, from wherever the bag is named."""

from __future__ import annotations

from pathlib import Path

from linkage_ros.cli.bag_reading import beside
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
def test_a_bag_by_its_name(named: str, file: str) -> None:
    assert beside(Path(named), '.png') == Path(file)


@pytest.mark.parametrize(('here', 'file'), [('.', 'runs/first.png'), ('..', 'runs.png')])
def test_a_folder_without_a_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, here: str, file: str
) -> None:
    folder = tmp_path / 'runs' / 'first'
    folder.mkdir(parents=True)
    monkeypatch.chdir(folder)
    assert beside(Path(here), '.png') == tmp_path / file
