# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The file of a scene with changed keys, to be written into any folder."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import os
from pathlib import Path
from typing import Any

from linkage_ros.description import (
    apply_settings,
    kind_of,
    parse_yaml,
    read_yaml,
    Scene,
    SCENE_FILE,
)
from linkage_ros.errors import FileError
from linkage_ros.resources import linkage_names, linkage_of_scene, named_file
from linkage_ros.tools.study.prices import Change, settings_of


def tune_scene(
    scene: Scene, named: str | os.PathLike[str], changes: Sequence[Change], folder: Path
) -> bytes:
    """
    Return the file of a scene with changed keys, to be written into a folder.

    The scene has what was set for it already; ``named`` is what it was loaded from: a scene file,
    a linkage file, or a name. Paths of linkages and bags lead from the folder.
    """
    content = parse_yaml(scene.files[SCENE_FILE], scene.name)
    scene_mapping: Any = content.mapping
    file = named_file(named, 'scenes', 'linkages')
    if kind_of(read_yaml(file)[0]) == 'linkage':
        scene_mapping['linkage'] = _path_from(folder, file)
    else:
        for within, key in _path_entries(scene_mapping):
            path = file.parent / within[key]
            if key == 'linkage':
                path = linkage_of_scene(within[key], file.parent)
            within[key] = _path_from(folder, path)
    return apply_settings(content, settings_of(changes))


def _path_entries(scene: Any) -> Iterator[tuple[Any, str]]:
    """Yield the mappings of a scene that hold the path of a file, with its key."""
    entries = scene.get('linkages') or []
    for entry in (scene, *(entries if isinstance(entries, list) else entries.values())):
        if 'linkage' in entry:
            yield entry, 'linkage'
        drive = entry.get('drive') or {}
        if 'bag' in drive:
            yield drive['bag'], 'file'


def _path_from(folder: Path, path: Path) -> str:
    """Return a path as a file in a folder names it; a linkage of the package by its name."""
    try:
        is_shipped = (
            path.stem in linkage_names()
            and path.resolve() == named_file(path.stem, 'linkages').resolve()
        )
    except FileError:
        is_shipped = False
    return path.stem if is_shipped else os.path.relpath(path, folder)
