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


"""A run whose solver was chosen by an accuracy, replayed."""

from __future__ import annotations

import json
from pathlib import Path

from linkage_ros.bag.reader import read_bag
from linkage_ros.replay.replay import recorded_scene, replay
from linkage_ros.resources import shipped
import pytest

from .conftest import Run

pytestmark = pytest.mark.ros


def test_a_solver_that_was_chosen_is_not_chosen_again(
    linkage: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Choosing takes times, and another machine, or another hour, has others.
    (tmp_path / 'scene.yaml').write_text(
        f'linkage: {shipped("linkages/class_3.yaml")}\ndrive: {{constant_rate: {{rate: 2.0}}}}\n'
        'accuracy: 1.0e-6\nrecord: {name: run}\n'
    )
    ran = linkage('run', 'scene.yaml', '--seconds', '1', '--plain')
    assert ran.returncode == 0, ran.stderr
    bag = read_bag(tmp_path / 'runs' / 'run')
    chosen = json.loads(bag.attachments['run.json'])['solver']
    assert list(chosen['']) == ['table'], 'of class III it is forty times as fast'

    def again(*_: object) -> None:
        pytest.fail('chosen again')

    monkeypatch.setattr('linkage_ros.solvers.choose.choose', again)
    ticks = list(replay(bag, recorded_scene(bag)))
    assert len(ticks) > 100
    assert [tick.tick.message for tick in ticks] == [tick.recorded for tick in ticks]
    answer = linkage('replay', 'runs/run')
    assert answer.returncode == 0
    assert 'identical' in answer.stdout
