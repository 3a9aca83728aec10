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


"""Fixtures of the tests of scenes."""

from linkage_ros.pipeline.pipeline import Pipeline
from linkage_ros.scene.load import load_scene
import pytest

from .files import FOUR_BAR, SCENE


@pytest.fixture
def build(tmp_path):
    """Return a function that builds what a scene file and a linkage file call for, in full."""

    def build(scene=SCENE, linkage=FOUR_BAR):
        (tmp_path / 'scene.yaml').write_bytes(scene)
        (tmp_path / 'linkage.yaml').write_bytes(linkage)
        scene = load_scene(tmp_path / 'scene.yaml')
        return scene, Pipeline(scene)

    return build
