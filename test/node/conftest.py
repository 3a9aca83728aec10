# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Fixtures of the tests over ROS; where there is no rclpy, none of them is collected."""

from importlib.util import find_spec
import os
from pathlib import Path

import pytest

LINKAGES = Path(__file__).parents[2] / 'config' / 'linkages'

if find_spec('rclpy') is None:
    collect_ignore_glob = ['test_*.py']
else:
    from linkage_ros.domains import held_domain

    from .graph import Graph, NodeProcess

    # Read when the middleware is loaded; without it, discovery leaves the machine.
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'


def pytest_collection_modifyitems(items):
    for item in items:
        if Path(__file__).parent in item.path.parents:
            item.add_marker(pytest.mark.ros)


@pytest.fixture(scope='module')
def domain():
    """Return a ROS domain that no other process is on."""
    with held_domain() as domain:
        yield domain


@pytest.fixture
def graph(domain):
    """Return the test's own end of the graph."""
    graph = Graph(domain)
    yield graph
    graph.end()


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    """Return where this module's scenes, logs and bags lie."""
    return tmp_path_factory.mktemp('ros')


@pytest.fixture(scope='module')
def write_scene(folder):
    """Return a function that writes a scene, with a linkage by its name or its text."""

    def write(name, text, linkage='four_bar'):
        if ':' in linkage:
            (folder / f'{name}_linkage.yaml').write_text(linkage)
            linkage = folder / f'{name}_linkage.yaml'
        else:
            linkage = LINKAGES / f'{linkage}.yaml'
        (folder / f'{name}.yaml').write_text(f'linkage: {linkage}\n{text}\n')
        return folder / f'{name}.yaml'

    return write


@pytest.fixture(scope='module')
def kept():
    """Hold the process that the tests of a module share, which is set up again for each."""
    nodes = []
    yield nodes
    kill_all(nodes)


def kill_all(nodes):
    while nodes:
        nodes.pop().kill()


@pytest.fixture(autouse=True)
def no_twin(request, kept):
    """End the shared process where a test may start a node in another way."""
    if 'start' not in request.fixturenames:
        kill_all(kept)


@pytest.fixture
def start(request, graph, folder, kept):
    """
    Return a function that starts a node; what still runs at the end is killed.

    A node without arguments is the module's own process, set up again, unless the module has
    REAL_STARTS.
    """
    nodes, shared = [], []

    def start(scene, *arguments, ready='ticking', **popen):
        is_usual = not arguments and not popen and ready == 'ticking' and not shared
        if is_usual and not getattr(request.module, 'REAL_STARTS', False):
            if kept and kept[0].process.poll() is None:
                kept[0].set_up(graph, scene)
            else:
                kept[:] = [start_process(scene)]
                kept[0].graph = graph
            kept[0].wait_for_log(ready)
            shared[:] = kept
            return kept[0]
        if not shared:
            kill_all(kept)
        node = start_process(scene, *arguments, **popen)
        nodes.append(node)
        if ready:
            node.wait_for_log(ready)
        return node

    def start_process(scene, *arguments, **popen):
        return NodeProcess(
            graph.domain,
            folder,
            *('-p', f'scene:={scene}', '-p', 'diagnostics_period:=0.2', *arguments),
            **popen,
        )

    yield start
    kill_all(nodes)
    for node in shared:
        node.clean_up()
