# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A bag names no folder of its user, and replays in another place."""

from pathlib import Path
import shutil

from linkage_ros.bag import read_bag, RUN_FILE
import pytest

from ..support.commands import linkage

LINKAGE = 'four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1}\n'
TURNING = 'linkage: four.yaml\nrate: 100\ndrive: {constant_rate: {rate: 6.0}}\n'
PLAYED = 'linkage: four.yaml\nrate: 100\ndrive: {bag: {file: ../source, topic: /joint_states}}\n'


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    scenes = tmp_path / 'home' / 'scenes'
    scenes.mkdir(parents=True)
    for name, text in (('four', LINKAGE), ('turning', TURNING), ('played', PLAYED)):
        (scenes / f'{name}.yaml').write_text(text)
    velocity = 'effects: {velocity: {}}\n'
    (scenes / 'source.yaml').write_text(TURNING + velocity)
    (scenes / 'heard.yaml').write_text(f'linkage: four.yaml\nrate: 100\n{velocity}')
    return tmp_path / 'home'


def run(folder: Path, *words: str) -> None:
    done = linkage(folder, *words)
    assert done.returncode == 0, done.stderr


def test_bags_name_no_folder_and_replay_after_a_move(folder, tmp_path):
    run(folder, 'simulate', str(folder / 'scenes/source.yaml'), '--seconds', '1', '-o', 'source')
    scene = str(folder / 'scenes/played.yaml')
    run(folder, 'simulate', scene, '--seconds', '0.5', '-o', 'played')
    heard = ['--scene', str(folder / 'scenes/heard.yaml'), '--crank-topic', '/joint_states']
    run(folder, 'replay', 'source', *heard, '-o', 'remade')
    run(folder, 'recover', 'played', '-o', 'saved')
    there = shutil.copytree(folder, tmp_path / 'there')
    shutil.rmtree(folder)
    for name in ('source', 'played', 'remade', 'saved'):
        bag = there / name
        for content in (read_bag(bag).attachments[RUN_FILE], (bag / 'metadata.yaml').read_bytes()):
            assert str(tmp_path).encode() not in content
        run(there, 'replay', name)
