# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A scene as the files that a bag of its run carries, with the run's account of itself."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
import json
import os
from pathlib import Path
import platform

from linkage_ros import __version__
from linkage_ros.bag import BEGUN, RUN_FILE, SEED, USER_EFFECTS
from linkage_ros.description import Scene
from linkage_ros.tick import name_topics

_MEDIA = {'.json': 'json', '.urdf': 'xml'}
"""Media types by suffix; others are YAML."""


def scene_files(
    scene: Scene,
    topics: Iterable[tuple[str, str]],
    begun: str,
    bag: Path | None = None,
) -> dict[str, bytes]:
    """
    Return a scene as files: its own, and the run's account of itself.

    ``topics`` are the keys of the topics in the account and their names, ``begun`` is the
    beginning of the bag, and ``bag`` is the folder of the bag that gets the files, if any.
    """
    run = {
        'scene': scene.name,
        **_scene_folder(scene, bag),
        **name_topics(topics),
        BEGUN: begun,
        SEED: scene.seed,
        **({USER_EFFECTS: own} if (own := user_effects_here(scene)) else {}),
        'linkage_ros': __version__,
        'python': platform.python_version(),
        'machine': platform.machine(),
    }
    return {**scene.files, RUN_FILE: json.dumps(run).encode()}


def _scene_folder(scene: Scene, bag: Path | None) -> dict[str, str]:
    """Return the folder for the paths in a scene, relative to the bag: bags are passed on."""
    if not any(scene_linkage.drive[1].reads_bag for scene_linkage in scene.linkages):
        return {}
    folder = Path(scene.folder).resolve()
    return {'scene_folder': str(folder if bag is None else os.path.relpath(folder, bag.resolve()))}


def to_attachments(files: Mapping[str, bytes]) -> dict[str, tuple[str, bytes]]:
    """Return such files as attachments of a bag, each with its media type."""
    return {
        name: (f'application/{_MEDIA.get(Path(name).suffix, "yaml")}', data)
        for name, data in files.items()
    }


def user_effects_here(scene: Scene) -> dict[str, str]:
    """Return the modules of the user-defined effects of a scene."""
    names = {
        name for scene_linkage in scene.linkages for name in scene_linkage.effects if '.' in name
    }
    if not names:
        return {}
    from linkage_ros.stages.effects import effect_version  # local import: few scenes name one

    return {name: effect_version(name) for name in sorted(names)}
