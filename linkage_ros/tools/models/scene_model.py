# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The linkages of a scene as a robot model."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from linkage_ros.description import Scene
from linkage_ros.kinematics import Closure
from linkage_ros.tools.models.part import ModelPart, PartError
from linkage_ros.tools.models.urdf import urdf_model

Write = Callable[[str, Sequence[ModelPart]], bytes]
"""Writes the robot model of some linkages, with a name."""


def scene_urdf(scene: Scene, closures: Sequence[Closure]) -> bytes:
    """Return the URDF of a scene; see `make_scene_model`."""
    return make_scene_model(scene, closures, urdf_model)


def make_scene_model(scene: Scene, closures: Sequence[Closure], write: Write) -> bytes:
    """
    Return the robot model of a scene, with joint names as in its messages.

    The closures have the deviations of their parts; ``write`` is `urdf_model` or the writer of
    MJCF. A FileError with a remedy is raised if a linkage cannot be a robot model.
    """
    parts = [
        ModelPart(closure, scene_linkage.prefix, scene_linkage.loads, scene.wrapped)
        for scene_linkage, closure in zip(scene.linkages, closures, strict=True)
    ]
    try:
        return write(scene.name, parts)
    except PartError as error:
        scene_linkage = scene.linkages[error.number]
        content = scene_linkage.linkage_content if error.of_linkage else scene_linkage.content
        raise content.locate_error(error) from None
