# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The manifests agree with each other, and the tools that read them can."""

from configparser import ConfigParser
from pathlib import Path
import re
import subprocess
import sys
import xml.etree.ElementTree as ET

import pytest
import yaml


@pytest.fixture(scope='module')
def package_xml(root):
    return ET.parse(root / 'package.xml').getroot()


def test_module_manifest_and_changelog_have_one_version(root, package_xml):
    """setup.py reads the module's; bloom takes the manifest's, and the changes of that version."""
    text = (root / 'linkage_ros' / '__init__.py').read_text('utf-8')
    (version,) = re.findall(r"^__version__ = '(.+)'$", text, re.MULTILINE)
    assert package_xml.findtext('version') == version
    changelog = (root / 'CHANGELOG.rst').read_text('utf-8')
    dated = re.findall(r'^(\d+\.\d+\.\d+) \(\d{4}-\d\d-\d\d\)\n-', changelog, re.MULTILINE)
    assert dated[0] == version


@pytest.mark.filterwarnings('ignore::DeprecationWarning')  # catkin_pkg's use of docutils
def test_bloom_reads_each_change_of_this_version(root, package_xml):
    catkin = pytest.importorskip('catkin_pkg.changelog')
    version = package_xml.findtext('version')
    changes = catkin.get_changelog_from_path(str(root)).get_content_of_version(version)
    text = (root / 'CHANGELOG.rst').read_text('utf-8')
    section = re.split(r'^[\d.]+ \(.*\)\n-+$', text, flags=re.MULTILINE)[1]
    read, written = (
        len(re.findall(r'^\* ', part, re.MULTILINE))
        for part in ('\n'.join(map(str, changes)), section)
    )
    assert read == written > 0


def test_package_xml_is_valid(root):
    package = pytest.importorskip('catkin_pkg.package')
    warnings = []
    parsed = package.parse_package(str(root), warnings=warnings)
    parsed.validate(warnings=warnings)
    assert not warnings
    assert parsed.get_build_type() == 'ament_python'


def test_every_ros_import_is_declared(root, package_xml):
    ours = (
        r'ament_index_python|builtin_interfaces|launch|launch_ros|\w+_msgs|rcl_interfaces|rclpy|'
        'std_srvs'
    )
    imported = set()
    for folder in ('linkage_ros', 'launch'):
        for path in (root / folder).rglob('*.py'):
            text = path.read_text('utf-8')
            imported |= set(re.findall(rf'^\s*(?:from|import) ({ours})\b', text, re.MULTILINE))
    assert imported <= {depend.text for depend in package_xml.iter('exec_depend')}


ROS_PACKAGES = {
    'ament_copyright', 'ament_flake8', 'ament_index_python', 'ament_pep257', 'builtin_interfaces',
    'diagnostic_msgs', 'geometry_msgs', 'launch', 'launch_ros', 'lifecycle_msgs',
    'rcl_interfaces', 'rclpy', 'robot_state_publisher', 'rosgraph_msgs', 'sensor_msgs',
    'std_msgs', 'std_srvs', 'trajectory_msgs', 'visualization_msgs',
}  # fmt: skip
"""Released into Jazzy: rosdep takes them from ros-jazzy-…. (rosdistro, jazzy/distribution.yaml)"""

OF_UBUNTU = {
    'python3-hypothesis', 'python3-jsonschema', 'python3-numpy', 'python3-pytest',
    'python3-pytest-timeout', 'python3-yaml',
}  # fmt: skip
"""Keys that are packages of Ubuntu 24.04. (rosdistro, rosdep/python.yaml)"""


def test_every_dependency_comes_from_apt(root, package_xml):
    """Bloom would make a key of pip a Debian package that does not exist."""
    keys = {each.text for each in package_xml if each.tag.endswith('depend')}
    assert keys == ROS_PACKAGES | OF_UBUNTU
    # What has no key of apt is installed by hand, under the name that it has on PyPI.
    readme = (root / 'README.md').read_text('utf-8')
    assert re.search(r'\npython3 -m pip install .*--break-system-packages mcap\n', readme)


def test_readme_robot_section_uses_ros2_run(root):
    """After colcon, executables lie in lib/linkage_ros, which is on no path."""
    readme = (root / 'README.md').read_text('utf-8')
    on_a_robot = readme.partition('## On a robot')[2].partition('## ')[0]
    assert 'ros2 run linkage_ros linkage ' in on_a_robot
    (block,) = re.findall(r'```sh.*?\n(.*?)```', on_a_robot, re.DOTALL)
    assert not re.findall(r'^(?:linkage|linkage_node|crank_source)\b', block, re.MULTILINE)


def test_executables_are_installed_to_lib_linkage_ros(root):
    config = ConfigParser()
    config.read(root / 'setup.cfg')
    assert config['develop']['script_dir'] == '$base/lib/linkage_ros'
    assert config['install']['install_scripts'] == '$base/lib/linkage_ros'


def test_changelog_names_the_package(root):
    # catkin_prepare_release takes the heading literally.
    changelog = (root / 'CHANGELOG.rst').read_text('utf-8')
    assert 'Changelog for package linkage_ros\n^^^' in changelog


def test_parameter_file_has_the_shape_that_rcl_reads(root):
    parameters = yaml.safe_load((root / 'config' / 'linkage_node.yaml').read_text('utf-8'))
    assert list(parameters) == ['/**']
    assert list(parameters['/**']) == ['ros__parameters']
    assert parameters['/**']['ros__parameters'] == {
        'scene': '',
        'autostart': True,
        'diagnostics_period': 1.0,
        'warning_period': 5.0,
        'warn': {'transmission_angle': 0.0, 'conditioning': 1e-6, 'toggle_distance': 1e-3},
        'runs_directory': '',
        'thread_priority': 0,
        'lock_memory': False,
    }


# As those that Jazzy's launch_testing and launch_testing_ros have, by their names there.
PLUGINS = {
    'launch_testing': 'def pytest_pycollect_makemodule(path, parent):\n    pass\n',
    'launch_ros': 'def pytest_launch_collect_makemodule(path, parent):\n    pass\n',
}


def test_launch_plugins_do_not_break_pytest(root, environment, tmp_path):
    """On a robot they load into every pytest; a newer one than Jazzy's refuses them."""
    for name, text in PLUGINS.items():
        (tmp_path / f'plugin_of_{name}.py').write_text(text)
        about = tmp_path / f'{name}-3.4.dist-info'
        about.mkdir()
        (about / 'METADATA').write_text(f'Metadata-Version: 2.1\nName: {name}\nVersion: 3.4\n')
        (about / 'entry_points.txt').write_text(f'[pytest11]\n{name} = plugin_of_{name}\n')
    here = Path(__file__).relative_to(root)
    done = subprocess.run(
        [sys.executable, '-m', 'pytest', '--collect-only', '-q', str(here)],
        cwd=root,
        env=environment | {'PYTHONPATH': str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_policy_uses_a_wildcard_for_wrenches_only(root):
    policy = ET.parse(root / 'policy.xml').getroot()
    assert (policy.tag, policy.get('version')) == ('policy', '0.2.0')
    names = [name.text for kind in ('topic', 'service') for name in policy.iter(kind)]
    assert len(names) == len(set(names))
    # Of the links only the scene knows the names.
    assert all(re.fullmatch(r'(~?/)?[a-z_]+|wrenches/\*', name) for name in names)


def test_readme_installs_the_view_extra(root):
    """A user who has not the `view` extra would be told of a command that does not start."""
    text = (root / 'README.md').read_text('utf-8')
    lines = re.findall(r'^pip install (.*)$', text, re.MULTILINE)
    assert lines
    for line in lines:
        found = re.findall(r"'([^'\[]*)\[([^\]]*)\]'", line)
        # What is seen without scrolling works in a checkout: nothing is on an index yet.
        assert found[0][0] == '.'
        assert all({*extras.split(',')} >= {'ros', 'report', 'view'} for _, extras in found)
