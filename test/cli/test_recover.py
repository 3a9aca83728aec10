# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""``linkage recover``, on the bag of a run that was cut, and on what is none."""

from __future__ import annotations

from pathlib import Path

from linkage_ros.bag import read_bag
from linkage_ros.replay import recorded_scene, replay_ticks
import pytest
from rosbags.highlevel import AnyReader

from .conftest import Run

pytestmark = pytest.mark.ros

SCENE = 'linkage: four.yaml\ndrive: {constant_rate: {rate: 3.0}}\nrecord: {name: run}\n'


@pytest.fixture
def bag(linkage: Run, tmp_path: Path) -> Path:
    """Return the folder of a bag of two seconds."""
    (tmp_path / 'four.yaml').write_text('four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1}\n')
    (tmp_path / 'scene.yaml').write_text(SCENE)
    answer = linkage('run', 'scene.yaml', '--seconds', '2', '--plain')
    assert answer.returncode == 0, answer.stderr
    return tmp_path / 'runs' / 'run'


def test_recovered_part_of_a_run_replays_to_same_bytes(
    linkage: Run, tmp_path: Path, bag: Path
) -> None:
    file = next(bag.glob('*.mcap'))
    content = file.read_bytes()
    file.write_bytes(content[: len(content) // 2])
    answer = linkage('recover', 'runs/run')
    assert answer.returncode == 3, answer.stderr
    assert answer.stderr == ''
    lines = answer.stdout.splitlines()
    assert lines[0].split() == ['topic', 'saved', 'of']
    assert 'attachments  scene.yaml, linkage.yaml, run.json' in lines
    assert any(line.startswith(f'LOST         {file.name} at byte ') for line in lines)
    assert lines[-1] == f'bag          {bag}_recovered'
    recovered = read_bag(tmp_path / 'runs' / 'run_recovered')
    ticks = [
        (t.recorded, t.tick.message) for t in replay_ticks(recovered, recorded_scene(recovered))
    ]
    assert len(ticks) > 100
    assert [then for then, _ in ticks] == [now for _, now in ticks]
    for place in (recovered.path, recovered.files[0]):
        with AnyReader([place]) as reader:
            assert sum(1 for _ in reader.messages()) == sum(1 for _ in recovered.messages())
    assert file.read_bytes() == content[: len(content) // 2]


def test_recovery_of_a_whole_bag_loses_no_message(linkage: Run, bag: Path) -> None:
    answer = linkage('recover', str(bag), '-o', 'whole')
    assert answer.returncode == 0, answer.stdout + answer.stderr
    assert answer.stdout.splitlines()[-2:] == ['nothing lost', 'bag          whole']
    answer = linkage('recover', str(bag), '-o', 'whole')
    assert answer.returncode == 2
    assert answer.stderr == (
        'linkage recover: whole: exists already; name another, or add --force to overwrite it\n'
    )
