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


"""A bag, read once from end to end for its page; memory does not grow with it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from linkage_ros.bag.reader import Bag
from linkage_ros.bag.run_events import run_account
from linkage_ros.errors import LinkageError
from linkage_ros.replay import recorded_scene
from linkage_ros.report.blocks import Blocks, Progress
from linkage_ros.report.foreign_run import ForeignRun
from linkage_ros.report.own_run import OwnRun
from linkage_ros.report.run import Run, Window
from linkage_ros.scene.scene import Scene


def read_run(
    bag: Bag,
    window: Window,
    progress: Progress,
    scene_of: Callable[[Bag], Scene] = recorded_scene,
) -> tuple[Run, Scene | None, str]:
    """
    Read a bag for its page.

    Parameters
    ----------
    bag
        The bag. Where it is damaged, what lies before the damage is told.
    window
        Which part of the run is told.
    progress
        Whom to tell how far it is, and whether to stop.
    scene_of
        Gives the scene that a bag carries.

    Returns
    -------
    run
        What it holds.
    scene
        Its scene, if it carries one.
    missing
        Why there is none, or it cannot be built here; '' where all is there.

    """
    scene, missing = None, ''
    reader: OwnRun | ForeignRun
    try:
        scene = scene_of(bag)
        reader = OwnRun(bag, run_account(bag), scene, window)
    except LinkageError as error:
        # A page is handed on, and does not say where its bag lay.
        missing = f'{Path(error.where).name}: {error.reason}'
        reader = ForeignRun(bag, window)
    blocks = Blocks(bag, reader.topics, progress)
    for block in blocks:
        reader.take(block)
    return reader.end(blocks.contents()), scene, missing
