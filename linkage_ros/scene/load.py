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


"""A scene file, read into a `Scene`."""

from __future__ import annotations

from collections.abc import Mapping
from os.path import isfile
from pathlib import Path

from linkage_ros.drives.topic import TopicParameters
from linkage_ros.errors import quoted
from linkage_ros.scene.linkage_file import read_linkage
from linkage_ros.scene.scene import RecordParameters, Scene
from linkage_ros.scene.section import Section
from linkage_ros.scene.yaml_file import parse_yaml, read_yaml

SCENE_FILE, LINKAGE_FILE = 'scene.yaml', 'linkage.yaml'
"""Names of the files of a scene where a bag carries them."""

LOWEST_RATE, HIGHEST_RATE = 0.01, 20_000.0
"""Ticks a second, in [Hz]: of these the higher is what a core was measured to hold."""


def load_scene(file: str | Path) -> Scene:
    """
    Read a scene and the linkage that it names.

    Parameters
    ----------
    file
        The scene file; paths in it are relative to its folder.

    Raises
    ------
    FileError
        With file, line, key, value and remedy.

    """
    content, scene_bytes = read_yaml(file)
    linkage = Path(file).parent / content.text('linkage')
    if not isfile(linkage):  # noqa: PTH113 (Path's raises where a name is too long)
        raise content.error(
            'linkage', f'{quoted(str(linkage))} is not a file', 'name one, relative to the scene'
        )
    linkage_content, linkage_bytes = read_yaml(linkage)
    return _scene(Path(file).stem, content, linkage_content, scene_bytes, linkage_bytes)


def parse_scene(name: str, where: str, files: Mapping[str, bytes]) -> Scene:
    """
    Read a scene out of the files that a bag carries.

    Parameters
    ----------
    name
        Name of the scene.
    where
        Where the files come from, for messages.
    files
        As in `Scene`.

    Raises
    ------
    FileError
        As `load_scene`.

    """
    content, linkage_content = (
        parse_yaml(files[part], f'{where}: {part}') for part in (SCENE_FILE, LINKAGE_FILE)
    )
    content.text('linkage')
    return _scene(name, content, linkage_content, files[SCENE_FILE], files[LINKAGE_FILE])


def _scene(
    name: str, content: Section, linkage: Section, scene_bytes: bytes, linkage_bytes: bytes
) -> Scene:
    scene = Scene(
        name=name,
        linkage=read_linkage(linkage),
        rate=_rate(content),
        wrapped=content.choice('angles', ('continuous', 'wrapped'), 'continuous') == 'wrapped',
        drive=_drive(content.section('drive', required=False)),
        effects=content.section('effects', required=False),
        record=_record(content.section('record')) if 'record' in content else None,
        files={SCENE_FILE: scene_bytes, LINKAGE_FILE: linkage_bytes},
    )
    content.finish(('record',))
    return scene


def _rate(content: Section) -> float:
    rate = content.number('rate', 1000.0, least=0.0, most=HIGHEST_RATE, unit='Hz')
    if 0.0 < rate < LOWEST_RATE:
        raise content.error(
            'rate',
            f'{rate:g} is out of bounds',
            f'write {LOWEST_RATE:g} to {HIGHEST_RATE:g} [Hz], or 0 for once for every sample',
        )
    return rate


def _drive(content: Section) -> TopicParameters:
    topic = content.section('topic', required=False)
    content.finish()
    drive = TopicParameters(
        carry_forward=topic.flag('carry_forward', True),
        max_age=round(1e9 * topic.number('max_age', 0.2, least=1e-6, most=3600.0, unit='s')),
        max_lead=round(1e9 * topic.number('max_lead', 0.1, least=0.0, most=3600.0, unit='s')),
    )
    topic.finish()
    return drive


def _record(content: Section) -> RecordParameters:
    queue = content.number('queue', 20_000, least=100, most=10_000_000)
    if not queue.is_integer():
        raise content.error('queue', f'{queue:g} is no number of messages', 'write a whole number')
    record = RecordParameters(
        directory=content.text('directory', 'runs'),
        name=content.text('name', ''),
        queue=int(queue),
    )
    if record.name != Path(record.name).name or record.name == '..':
        raise content.error(
            'name', f'{record.name!r} is not a plain name', 'leave out the folders'
        )
    content.finish()
    return record
