# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What recording costs and loses, measured on a real disk, and disks that fail."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from linkage_ros.bag import BagWriter
from linkage_ros.description import load_scene
from linkage_ros.errors import RecordingError
from linkage_ros.tools.study import measure_recording
import pytest

SCENE = load_scene('demo', ['record={directory: runs, flush_period: 0.1}'])


def test_crash_loss_equals_about_the_flush_period(tmp_path: Path) -> None:
    (own,) = measure_recording(SCENE, tmp_path, quick=True)
    assert own.instruction == 'record.flush_period: 0.1'
    assert 0.08 < own.seconds < 2.0
    assert own.price.tick.middle > 0.0
    assert own.price.rate == 1000.0
    assert not list(tmp_path.iterdir())


def test_recording_rows_compare_other_flush_periods(tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.setattr('linkage_ros.tools.study.recording._ROUNDS', 1)
    shares: list[float] = []
    own, *others = measure_recording(SCENE, tmp_path, progress=shares.append)
    # A fifth of it would be less than a scene may ask for.
    assert [each.instruction for each in others] == ['record.flush_period: 0.2']
    assert others[0].seconds > own.seconds
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


@pytest.mark.parametrize('settings', [['record={snapshot_seconds: 5}'], []])
def test_scene_without_a_bag_has_no_row(tmp_path: Path, settings: list[str]) -> None:
    scene = load_scene('demo' if settings else 'bare', settings)
    assert measure_recording(scene, tmp_path) == []


def test_failing_disk_is_reported_in_one_line(tmp_path: Path, monkeypatch: Any) -> None:
    def fail(_writer: BagWriter) -> None:
        raise RecordingError(tmp_path, 'no space left', 'free some')

    monkeypatch.setattr(BagWriter, 'flush', fail)
    with pytest.raises(RecordingError, match=r'cannot be measured: .*; name another folder'):
        measure_recording(SCENE, tmp_path, quick=True)
    assert not list(tmp_path.iterdir())
