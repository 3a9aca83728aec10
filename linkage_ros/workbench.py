# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

r"""
The tools of the workbench, found by name where they are asked for.

What runs on a robot imports no tool; a command, or a key of a scene, finds its own here.
"""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from linkage_ros.errors import LinkageError

TOOLS = {
    # Commands; linkage_ros.cli has the commands of the other half, each by its name.
    'accuracy': 'linkage_ros.tools.study.accuracy_command',
    'view': 'linkage_ros.tools.view.view_command',
    'report': 'linkage_ros.tools.view.report_command',
    'compare': 'linkage_ros.tools.view.compare_command',
    'plot': 'linkage_ros.tools.drawing.plot_command',
    'draw': 'linkage_ros.tools.drawing.draw_command',
    'animate': 'linkage_ros.tools.view.animate_command',
    'synthesize': 'linkage_ros.tools.design.synthesize_command',
    'compile': 'linkage_ros.tools.models.compile_command',
    'fmu': 'linkage_ros.tools.models.fmu_command',
    'urdf': 'linkage_ros.tools.models.robot_model_command',
    'mjcf': 'linkage_ros.tools.models.robot_model_command',
    'import': 'linkage_ros.tools.models.import_command',
    # What commands, scenes and closures ask for.
    'arrays': 'linkage_ros.tools.models.array_functions',
    'robot_description': 'linkage_ros.tools.models.urdf',
    'spread': 'linkage_ros.tools.drawing.spread',
}
"""The module of each tool, by its name."""


def find_tool(name: str) -> ModuleType:
    """Return the module of a tool; a LinkageError says that it is not installed."""
    try:
        return import_module(TOOLS[name])
    except ModuleNotFoundError as error:
        absent = error.name or ''
        if not absent or not TOOLS[name].startswith(absent):
            raise  # a package that the tool needs
        raise LinkageError(
            absent, 'is not installed', 'install the whole of linkage_ros'
        ) from None
