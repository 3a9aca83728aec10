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


"""Write a linkage as MJCF, MuJoCo's format: bodies, masses, springs, and its closed loops."""

from __future__ import annotations

import argparse
from threading import Event

from linkage_ros.cli.arguments import add_files, model_of, put
from linkage_ros.robot_models.mjcf import mjcf


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_files(parser, 'MJCF')


def run(arguments: argparse.Namespace, _stop: Event) -> int:
    """Write the model."""
    put(model_of(arguments.file, mjcf), arguments.output)
    return 0
