# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""`colcon build` and `colcon test` work, in a workspace with nothing else in it."""

import os
from pathlib import Path
import re
import sys

import pytest

# Set for tests that colcon runs here: they must not start colcon themselves.
INSIDE = 'LINKAGE_ROS_INSIDE_COLCON'
COLCON = Path(sys.executable).with_name('colcon')

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(INSIDE in os.environ, reason='started by colcon itself'),
    pytest.mark.sample(1),
    pytest.mark.skipif(not COLCON.exists(), reason='no colcon beside this Python'),
]


@pytest.fixture(scope='module', params=['copied', 'linked'])
def workspace(request, tmp_path_factory, copy_checkout, run):
    """Return a workspace in which colcon has built linkage_ros."""
    workspace = tmp_path_factory.mktemp(request.param)
    copy_checkout(workspace / 'src' / 'linkage_ros')
    options = ['--symlink-install'] if request.param == 'linked' else []
    run(COLCON, 'build', *options, cwd=workspace)
    return workspace


@pytest.fixture
def installed(workspace):
    return workspace / 'install' / 'linkage_ros'


@pytest.mark.parametrize(
    'name', ['linkage_node', 'linkage_relay', 'crank_source', 'pd_controller', 'linkage']
)
def test_ros2_run_finds_the_executables(installed, name):
    assert os.access(installed / 'lib' / 'linkage_ros' / name, os.X_OK)


def test_share_folder_holds_config_launch_and_manifest(installed, root):
    share = installed / 'share'
    assert (share / 'ament_index/resource_index/packages/linkage_ros').is_file()
    assert (share / 'linkage_ros/package.xml').is_file()
    for folder in ('config', 'launch'):
        for path in (root / folder).rglob('*'):
            if path.is_file() and path.suffix != '.pyc':
                there = share / 'linkage_ros' / path.relative_to(root)
                assert there.read_bytes() == path.read_bytes()


def test_installed_package_is_the_imported_one(workspace, installed, run):
    say = f'{sys.executable} -c "import linkage_ros; print(linkage_ros.__file__)"'
    printed = run('bash', '-c', f'source install/setup.bash && {say}', cwd=workspace)
    place = Path(printed.strip().splitlines()[-1])
    assert place.is_relative_to(installed) or place.is_relative_to(workspace / 'build')


@pytest.mark.sample(0)
def test_colcon_test_passes_without_errors(workspace, run):
    # A few only: `make test` runs them all, and colcon adds nothing but its own doing.
    subset = ['test/packaging/test_launch.py', 'test/packaging/test_layering.py']
    run(
        COLCON,
        'test',
        '--packages-select',
        'linkage_ros',
        '--return-code-on-test-failure',
        '--pytest-args',
        *subset,
        cwd=workspace,
        **{INSIDE: '1'},
    )
    summary = run(COLCON, 'test-result', '--all', cwd=workspace).splitlines()[-1]
    count = re.fullmatch(r'Summary: (\d+) tests, 0 errors, 0 failures, \d+ skipped', summary)
    assert count, summary
    assert int(count[1]) > 0
