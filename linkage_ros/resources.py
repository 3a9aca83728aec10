# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Paths of the files that come with this package and with other installed packages."""

from __future__ import annotations

import os
from os import PathLike
from pathlib import Path
import sys

from linkage_ros.errors import did_you_mean, FileError, list_names, quote


def share_folders(package: str) -> list[Path]:
    """Return folders that may hold a ROS package's files: the robot's, ours, then Python's."""
    # Not Python's after pip install --user, nor in a Debian package where nothing is sourced.
    ours = os.path.normpath(os.path.join(__file__, '../../../../..'))  # noqa: PTH118
    prefixes = [*os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep), ours, sys.prefix]
    return [Path(prefix, 'share', package) for prefix in prefixes if prefix]


def shipped_path(name: str) -> Path:
    """
    Return the path of a file or folder under ``config/``; a FileError if it is not installed.

    A checkout comes first, since copies made by an editable install become outdated.
    """
    checkout = Path(__file__).parent.parent
    folders = share_folders('linkage_ros')
    if (checkout / 'package.xml').is_file():
        folders.insert(0, checkout)
    for folder in folders:
        if (folder / 'config' / name).exists():
            return folder / 'config' / name
    raise FileError(f'config/{name}', '', 'is not installed', 'install linkage_ros again')


SPATIAL = 'linkages/space'
"""Folder of the spatial linkages, under ``config/``."""


def linkage_names() -> list[str]:
    """Return the names of the planar linkages that come with the package."""
    return _yaml_names('linkages')


def spatial_linkage_names() -> list[str]:
    """Return the names of the spatial linkages that come with the package."""
    return _yaml_names(SPATIAL)


def scene_names() -> list[str]:
    """Return the names of the scenes that come with the package."""
    return _yaml_names('scenes')


def named_file(named: str | PathLike[str], *folders: str) -> Path:
    """
    Return the path of a file given by its path, or by the name of a shipped file.

    A text without folder and suffix is a name first: a file ``demo`` is ``./demo`` beside the
    shipped scene. Of several ``folders`` under ``config/`` the first that has the name decides.
    FileError if there is no such file or name; TypeError if ``named`` cannot be a path.
    """
    searched = (*folders, SPATIAL) if 'linkages' in folders else folders
    known: dict[str, str] = {}
    for folder in searched:
        known |= {name: folder for name in _yaml_names(folder) if name not in known}
    try:
        path = Path(named)
    except TypeError:
        message = f'{quote(named)} is neither a path nor a name; name a file, or one of '
        raise TypeError(message + list_names(known)) from None
    if isinstance(named, str) and named in known:
        return shipped_path(f'{known[named]}/{named}.yaml')
    exists = os.path.exists(path)  # noqa: PTH110 (Path's raises where a name is too long)
    if str(path) == path.name and path.suffix and path.stem in known and not exists:
        raise FileError(named, '', 'is not a file', f'did you mean {path.stem!r}?')
    if named and (named != path.stem or exists):
        return path
    reason = 'is neither a file nor the name of a shipped file'
    raise FileError(
        named or "''",
        '',
        'is a shipped scene, not a linkage' if named in scene_names() else reason,
        did_you_mean(str(named), known, f'name a file, or one of {list_names(known)}'),
    )


def linkage_of_scene(name: str, folder: Path) -> Path:
    """Return the path of a linkage that a scene in a folder names: a shipped one, or a file."""
    if name in spatial_linkage_names():
        return shipped_path(f'{SPATIAL}/{name}.yaml')
    return shipped_path(f'linkages/{name}.yaml') if name in linkage_names() else folder / name


def _yaml_names(folder: str) -> list[str]:
    return sorted(file.stem for file in shipped_path(folder).glob('*.yaml'))
