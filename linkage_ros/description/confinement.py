# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What a scene may name that another process asks for."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from linkage_ros.description.parameters import declared_fields, File
from linkage_ros.description.scene import Scene
from linkage_ros.description.section import Section
from linkage_ros.errors import FileError, quote
from linkage_ros.resources import shipped_path


@dataclass(frozen=True)
class Confinement:
    """
    Files, folders and code that a scene may name.

    Any process of a ROS graph can set a node's parameters. What it names must not read the files
    of the machine, import its modules, or write into its folders.
    """

    folder: Path  # Files below it may be read
    own_file: str  # A scene that may be read, wherever it is
    runs: Path | None  # Bags may be recorded below it; None where the scene names no folder
    trusts_effects: bool  # Whether user-defined effects are imported

    def refuse_file(self, file: str | PathLike[str], content: Section | None, key: str) -> None:
        """
        Refuse a file that is neither below the folder nor shipped, before it is opened.

        ``content`` and ``key`` name it; without a content it is the scene itself.
        """
        if content is None and str(file) == self.own_file:
            return
        if not any(_is_below(file, folder) for folder in (self.folder, shipped_path(''))):
            reason = f'is not below {self.folder}, and was named after the start of the node'
            remedy = 'start the node with it, or with the parameter scene_directory'
            raise (
                FileError(file, '', reason, remedy)
                if content is None
                else content.error(key, f'{quote(str(file))} {reason}', remedy)
            )

    def refuse_drive(self, content: Section, drive: tuple[str, object]) -> None:
        """Refuse a file that is among the parameters of a drive."""
        name, parameters = drive
        for entry, kind in declared_fields(type(parameters)):
            if isinstance(kind, File):
                key = f'drive.{name}.{entry.name}'
                self.refuse_file(getattr(parameters, entry.name), content, key)

    def refuse_scene(self, scene: Scene, content: Section) -> None:
        """Refuse user-defined effects, and a recording elsewhere."""
        for scene_linkage in scene.linkages:
            for name in scene_linkage.not_imported:
                raise content.error(
                    f'effects.{name}',
                    'is a module, and was named after the start of the node',
                    'start the node with it, or with trust_effects:=true',
                )
        record, runs = scene.record, self.runs
        if record is not None and runs is not None and not _is_below(record.directory, runs):
            raise content.error(
                'record.directory',
                f'{quote(record.directory)} is not below {runs}, and was named after the start of '
                'the node',
                'leave it out, or start the node with the parameter runs_directory',
            )


def _is_below(file: str | PathLike[str], folder: Path) -> bool:
    """Return whether a file is below a folder, at the end of all symbolic links."""
    try:
        return Path(file).resolve().is_relative_to(folder.resolve())
    except (OSError, ValueError, RuntimeError):  # a NUL, a name too long, a circle of links
        return False
