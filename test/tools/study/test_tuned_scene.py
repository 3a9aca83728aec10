# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A tuned scene is the scene with its new keys, wherever its file is written."""

from __future__ import annotations

from pathlib import Path

from linkage_ros.description import load_scene
from linkage_ros.resources import shipped_path
from linkage_ros.tools.study import tune_scene
import pytest

from ...cli.recorded import Recorded, scene_file

NAMED = {
    'a name': 'demo',
    'several linkages': 'two_fingers',
    'a linkage by name': 'four_bar',
    'a file of the package': str(shipped_path('scenes/torque_crank.yaml')),
    'a file with a linkage beside it': 'mine/scene.yaml',
    'a linkage file': 'mine/odd.yaml',
}


@pytest.mark.parametrize('what', NAMED)
def test_tuned_scene_loads_from_another_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    mine, other = tmp_path / 'mine', tmp_path / 'other' / 'deep'
    mine.mkdir()
    other.mkdir(parents=True)
    (mine / 'odd.yaml').write_bytes(shipped_path('linkages/slider_crank.yaml').read_bytes())
    (mine / 'scene.yaml').write_text('linkage: odd.yaml\nrate: 100\neffects: {velocity: {}}\n')
    monkeypatch.chdir(tmp_path)
    scene = load_scene(NAMED[what])
    (other / 'tuned.yaml').write_bytes(
        tune_scene(scene, NAMED[what], [('rate', 250.0), ('seed', 7)], other)
    )
    tuned = load_scene(other / 'tuned.yaml')
    assert (tuned.rate, tuned.seed) == (250.0, 7)
    for one, before in zip(tuned.linkages, scene.linkages, strict=True):
        assert one.linkage == before.linkage
        assert one.drive == before.drive
        assert one.effects == before.effects


def test_tuned_scene_finds_the_drive_bag(tmp_path: Path) -> None:
    source = scene_file(tmp_path, 'rate: 100\n')
    Recorded(tmp_path / 'bag', source, lambda tick: {'crank_joint': (0.06 * tick, 6.0)}).run(50)
    (tmp_path / 'play.yaml').write_text('linkage: four_bar\ndrive: {bag: {file: bag}}\nrate: 50\n')
    scene = load_scene(tmp_path / 'play.yaml')
    deep = tmp_path / 'deep'
    deep.mkdir()
    (deep / 'x.yaml').write_bytes(
        tune_scene(scene, tmp_path / 'play.yaml', [('rate', 25.0)], deep)
    )
    file = Path(load_scene(deep / 'x.yaml').linkages[0].drive[1].file)
    assert file.resolve() == (tmp_path / 'bag').resolve()
