# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What kind of file a user has named where a file of another kind is needed."""

from __future__ import annotations

from pathlib import Path
import re
from typing import NamedTuple

_ELEMENT = re.compile(r'\s*(?:<[?!][^>]*>\s*|<!--.*?-->\s*)*<([A-Za-z][\w.-]*)', re.DOTALL)
_LINKAGE_KEY = re.compile(r'^(?:links|points|four_bar|inverted_slider_crank)\s*:', re.MULTILINE)
_SCENE_KEY = re.compile(r'^(?:linkages?|drive|effects)\s*:', re.MULTILINE)
_CONTROL = re.compile(rb'[\0-\x08\x0e-\x1a\x1c-\x1f]')
_READ = 4096
"""Number of bytes that determine the kind."""


class FileKind(NamedTuple):
    """A kind of file."""

    noun: str
    remedy: str = 'name a scene or a linkage file'  # Where one of these is needed
    is_foreign: bool = True  # No linkage or scene, not even with mistakes


ROBOTS = ('.urdf', '.sdf', '.xml', '.mjcf')
"""Suffixes of robots in XML, whose root says the format."""

YAML = ('.yaml', '.yml')
"""Suffixes of a file of closings."""

CLOSINGS = 'closed_loop'
"""Key of a YAML file that closes the loops of a URDF next to it."""


_BAG = FileKind('a bag', 'linkage info, plot and report read bags')
_EMPTY = FileKind('empty', 'linkage gallery four_bar prints an example')
BINARY = FileKind('a binary file', 'name a scene or a linkage file, which is UTF-8 text')
_NOT_UTF_8 = BINARY._replace(is_foreign=False)
_UTF_16 = FileKind('text in UTF-16', 'save it as UTF-8 text')
_TEXT = FileKind('a text file', is_foreign=False)
_LINKAGE = FileKind('a linkage file', is_foreign=False)
_SCENE = FileKind('a scene file', is_foreign=False)

_BEGINNINGS = (
    (b'\x89MCAP0\r\n', _BAG),
    (b'SQLite format 3\0', FileKind('an SQLite file, as older bags are')),
    (b'#ROSBAG V', FileKind('a bag of ROS 1')),
    (b'\x89PNG', FileKind('a picture')),
    (b'\xff\xd8\xff', FileKind('a picture')),
    (b'GIF8', FileKind('a picture')),
    (b'%PDF', FileKind('a PDF')),
    (b'PK\3\4', FileKind('a ZIP file')),
    (b'\x1f\x8b', FileKind('a compressed file')),
    (b'\xff\xfe', _UTF_16),
    (b'\xfe\xff', _UTF_16),
    (b'\x28\xb5\x2f\xfd', FileKind('a compressed file')),
)
_OF_A_URDF = (
    'a scene names it by linkage: {urdf: FILE, input: [JOINT]}; linkage import makes a linkage '
    'file of a URDF'
)
_ELEMENTS = {
    'robot': FileKind('a URDF', _OF_A_URDF),
    'mujoco': FileKind('a model of MuJoCo', _OF_A_URDF),
    'sdf': FileKind('an SDF model', _OF_A_URDF),
    'html': FileKind('a web page'),
    'svg': FileKind('a picture'),
}


def kind_of_folder(folder: Path) -> FileKind:
    """Return the kind of a folder: a bag, if it holds files of one."""
    inside = any(folder.glob('*.mcap')) or (folder / 'metadata.yaml').exists()
    return _BAG if inside else FileKind('a folder')


def kind_of_bytes(data: bytes) -> FileKind:
    """Return the kind of a file by its first bytes."""
    if not data.strip():
        return _EMPTY
    for beginning, kind in _BEGINNINGS:
        if data.startswith(beginning):
            return kind
    if _CONTROL.search(data[:_READ]):
        return BINARY
    text = data[:_READ].decode('utf-8', 'replace')
    # The last letter may be cut.
    if '\N{REPLACEMENT CHARACTER}' in text[:-1]:
        return _NOT_UTF_8
    if element := _ELEMENT.match(text):
        return _ELEMENTS.get(element[1].lower(), FileKind('an XML file'))
    if _LINKAGE_KEY.search(text):
        return _LINKAGE
    return _SCENE if _SCENE_KEY.search(text) else _TEXT
