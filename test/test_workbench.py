# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Tools are found by name; one that is not installed is told in one line."""

from linkage_ros import workbench
from linkage_ros.cli import COMMANDS
from linkage_ros.errors import LinkageError
from linkage_ros.workbench import find_tool, TOOLS
import pytest


def test_tools_are_commands_or_names_for_the_core():
    assert set(TOOLS) - set(COMMANDS) == {'arrays', 'robot_description', 'spread'}
    assert find_tool('robot_description').scene_urdf


@pytest.mark.parametrize('module', ['linkage_ros.nowhere', 'linkage_ros.nowhere.tool'])
def test_missing_tool_is_reported_in_one_line(module, monkeypatch):
    monkeypatch.setitem(TOOLS, 'plot', module)
    with pytest.raises(LinkageError) as caught:
        find_tool('plot')
    assert str(caught.value) == (
        'linkage_ros.nowhere: is not installed; install the whole of linkage_ros'
    )


def test_missing_dependency_of_a_tool_is_not_hidden(monkeypatch):
    def lacking(_name):
        raise ModuleNotFoundError("No module named 'scipy'", name='scipy')

    monkeypatch.setattr(workbench, 'import_module', lacking)
    with pytest.raises(ModuleNotFoundError, match='scipy'):
        find_tool('plot')
