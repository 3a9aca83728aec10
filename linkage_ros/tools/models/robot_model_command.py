# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Write a linkage or a scene as a robot model.

URDF is a tree of the published joints, with frames where loops are cut. MJCF, MuJoCo's format, has
bodies, masses, springs and the closed loops.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
import sys
from threading import Event
from typing import Any

from linkage_ros.cli import add_output, add_robot, robot_of, SCENE_HELP
from linkage_ros.description import (
    atomic_write,
    kind_of,
    read_any_closure,
    read_content,
)
from linkage_ros.resources import named_file
from linkage_ros.tools.models.mjcf import mujoco_model
from linkage_ros.tools.models.part import make_scene_model, ModelPart, PartError, Write
from linkage_ros.tools.models.urdf import urdf_model

WRITERS: dict[str, Write] = {'urdf': urdf_model, 'mjcf': mujoco_model}
"""Writers of models, by the command's name."""

SUFFIXES = {'urdf': ('.urdf', '.xml'), 'mjcf': ('.xml', '.mjcf')}
"""Suffixes of the models, by the command's name."""

EXAMPLE = {
    'urdf': 'linkage urdf jansen_leg -o jansen_leg.urdf',
    'mjcf': 'linkage mjcf worn_press -o worn_press.xml',
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument('file', metavar='SCENE', help=SCENE_HELP)
    add_robot(parser)
    add_output(parser, SUFFIXES[parser.get_default('command')], 'the model is printed')


def run(arguments: argparse.Namespace, _stop: Event) -> int:
    """Write the model."""
    write, robot = WRITERS[arguments.command], robot_of(arguments)
    write_or_print(model_of(arguments.file, write, robot), arguments.output)
    return 0


def model_of(named: str, write: Write, robot: Mapping[str, Any] | None = None) -> bytes:
    """
    Return the model of a linkage, robot or scene, given by its file or its shipped name.

    Linkages of a scene are those that the node would solve, with the deviations of their parts.
    """
    file = named_file(named, 'linkages', 'scenes')
    content, _ = read_content(file, robot)
    if kind_of(content) == 'scene':
        from linkage_ros.description import load_scene
        from linkage_ros.tick import Pipeline

        scene = load_scene(file)
        return make_scene_model(scene, Pipeline(scene).closures, write)
    is_urdf = write is urdf_model
    closure: Any = read_any_closure(content, file.stem, publish_model_joints=is_urdf)
    try:
        return write(file.stem, [ModelPart(closure)])
    except PartError as error:
        raise content.error(error.where, error.reason, error.remedy) from None


def write_or_print(data: bytes, output: Path | None) -> None:
    """Write a model to a file and say so, or print it."""
    if output is None:
        sys.stdout.write(data.decode())
    else:
        atomic_write(output, data)
        print(output)
