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


"""
The cost of accuracy in time, measured on a scene, part by part.

Each part is a module, imported only if the part is requested. It has a function

``measure_PART(scene, quick, progress) -> Part | None``
    Measure; None if the scene has no such part. ``quick``: take a few seconds only. ``progress``
    is called now and then with the fraction that is done, 0 to 1; an exception from it ends the
    measurement, and no file is left behind. Recording also takes a folder, after the scene.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import datetime
from importlib import import_module
from pathlib import Path

from linkage_ros.accuracy.results import Part, Results
from linkage_ros.measuring import describe_machine
from linkage_ros.scene.scene import Scene

PARTS = ('solving', 'ticking', 'effects', 'dynamics', 'recording')
"""The parts, in the order of the page."""

ProgressCallback = Callable[[str, float], None]
"""Takes the name of a part, and the fraction of it that is done, 0 to 1."""


def measure_accuracy(
    scene: Scene, parts: Sequence[str], quick: bool, folder: Path, progress: ProgressCallback
) -> Results:
    """
    Measure a scene.

    Parameters
    ----------
    scene
        The scene.
    parts
        The parts to measure, of `PARTS`.
    quick
        Whether to take only a few seconds for each.
    folder
        Folder on the disk to be measured.
    progress
        Called with the progress of each part.

    Raises
    ------
    LinkageError
        If parts of the scene cannot be combined, or a package is not installed.

    """
    measured: list[Part] = []
    for name in PARTS:
        if name not in parts:
            continue
        progress(name, 0.0)
        measure = getattr(import_module(f'linkage_ros.accuracy.{name}'), f'measure_{name}')
        where = (folder,) if name == 'recording' else ()
        part = measure(scene, *where, quick, lambda share, name=name: progress(name, share))
        if part is not None:
            measured.append(part)
        progress(name, 1.0)
    today = ('measured', datetime.now().astimezone().date().isoformat())
    return Results(scene.name, [today, *describe_machine()], measured)
