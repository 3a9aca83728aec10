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


"""What the commands that write robot models share: a linkage or scene file, and where it goes."""

from __future__ import annotations

import argparse
from pathlib import Path
import sys

from linkage_ros.files.atomic_write import write_whole
from linkage_ros.files.linkage_file import read_closure
from linkage_ros.files.yaml_file import read_yaml
from linkage_ros.robot_models.part_part import Part, PartError
from linkage_ros.scene.load import kind_of
from linkage_ros.scene.robot_model import scene_model, Write


def add_files(parser: argparse.ArgumentParser, kind: str) -> None:
    """Declare the file that is read, and ``-o``."""
    parser.add_argument('file', help='the linkage file or the scene file')
    add_output(parser, kind)


def add_output(parser: argparse.ArgumentParser, kind: str) -> None:
    """Declare ``-o``."""
    parser.add_argument(
        '-o', '--output', type=Path, metavar='FILE', help=f'{kind} to write; else it is printed'
    )


def model_of(file: str, write: Write) -> bytes:
    """
    Return the model of a linkage or scene file.

    The linkages of a scene are as the node would solve them, deviations of their parts included.
    """
    content, _ = read_yaml(file)
    if kind_of(content) == 'scene':
        from linkage_ros.pipeline.pipeline import Pipeline
        from linkage_ros.scene.load import load_scene

        scene = load_scene(file)
        return scene_model(scene, Pipeline(scene).closures, write)
    try:
        return write(Path(file).stem, [Part(read_closure(content))])
    except PartError as error:
        raise content.error(error.where, error.reason, error.remedy) from None


def put(data: bytes, output: Path | None) -> None:
    """Write a model to a file and say so, or print it."""
    if output is None:
        sys.stdout.write(data.decode())
    else:
        write_whole(output, data)
        print(output)
