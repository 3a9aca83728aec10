# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Files that the tests of scenes start from, and what every error about a file has to be."""

from pathlib import Path
import re

from linkage_ros.description import load_scene
from linkage_ros.errors import FileError
from linkage_ros.tick import Pipeline
import pytest

CONFIG = Path(__file__).parents[2] / 'config'
SCENE = b'linkage: linkage.yaml\n'
FOUR_BAR = b'four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1}\n'


def is_one_line(error: FileError) -> bool:
    """Return whether an error is one line: file, line and key where there are; a remedy."""
    text = str(error)
    place = f'{error.file}:{error.line}' if error.line else error.file
    key = ' '.join(error.key.split())
    rest = text.removeprefix(f'{place}: {key}: ' if key else f'{place}: ')
    return rest != text and text.isprintable() and re.match(r'\S.*; \S', rest) is not None


@pytest.fixture
def build(tmp_path):
    """Return a function that builds what a scene file and a linkage file call for, in full."""

    def build(scene=SCENE, linkage=FOUR_BAR):
        (tmp_path / 'scene.yaml').write_bytes(scene)
        (tmp_path / 'linkage.yaml').write_bytes(linkage)
        scene = load_scene(tmp_path / 'scene.yaml')
        return scene, Pipeline(scene)

    return build
