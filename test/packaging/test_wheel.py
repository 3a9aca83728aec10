# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The source distribution is whole: its wheel holds what the core needs, and ROS under share/."""

from pathlib import Path
import sys
import sysconfig
import tarfile
import venv

import pytest

# Setuptools first: once pip is imported, setuptools refuses to be (Python 3.11 and older).
pytest.importorskip('setuptools', minversion='70.1', reason='older ones build no wheel alone')
pytest.importorskip('pip', reason='a robot has no pip')

ROS = ('rclpy', 'sensor_msgs', 'std_msgs', 'std_srvs', 'diagnostic_msgs', 'lifecycle_msgs')
REPORT = ('matplotlib', 'rich')


@pytest.fixture(scope='module')
def sdist(tmp_path_factory, copy_checkout, run):
    """Return the source distribution."""
    folder = tmp_path_factory.mktemp('sdist')
    build = "from setuptools import build_meta; build_meta.build_sdist('..')"
    run(sys.executable, '-c', build, cwd=copy_checkout(folder / 'source'))
    (file,) = folder.glob('*.tar.gz')
    return file


@pytest.fixture(scope='module')
def prefix(tmp_path_factory, sdist, run):
    """Return a fresh environment that has linkage_ros from the sdist's wheel, and no extras."""
    folder = tmp_path_factory.mktemp('wheel')
    prefix = folder / 'environment'
    venv.create(prefix, with_pip=False, symlinks=True)
    pip = [sys.executable, '-m', 'pip', '--disable-pip-version-check']
    build = ['wheel', '--no-deps', '--no-build-isolation', '--no-index', '-w', folder, sdist]
    run(*pip, *build, cwd=folder)
    (wheel,) = folder.glob('*.whl')
    install = ['--python', prefix, 'install', '--no-deps', '--no-index', wheel]
    run(*pip, *install, cwd=folder)
    # numpy, mcap and PyYAML are borrowed from this environment, which saves their download.
    (site,) = prefix.glob('lib/python*/site-packages')
    (site / 'borrowed.pth').write_text(sysconfig.get_path('purelib'), encoding='utf-8')
    return prefix


def test_sdist_holds_the_package_and_no_tests(sdist, root):
    with tarfile.open(sdist) as archive:
        files = {name.partition('/')[2] for name in archive.getnames()}
    assert not [file for file in files if file.split('/')[0] in {'test', 'bench', 'campaigns'}]
    code = (file for file in (root / 'linkage_ros').rglob('*') if file.is_file())
    assert files >= {
        *('LICENSE', 'README.md', 'CHANGELOG.rst', 'policy.xml', 'package.xml', 'setup.cfg'),
        *(str(file.relative_to(root)) for file in code if file.suffix != '.pyc'),
    }


def test_core_imports_without_extras(prefix, import_core):
    file, _ = import_core(
        prefix / 'bin' / 'python',
        # The study may need its extra; the others have it only where a picture is drawn.
        skip=('node', 'cli', 'tools.study', 'tools.view.live_bridge', 'tools.view.followed_run'),
        refuse=ROS + REPORT,
        cwd=prefix,
    )
    assert file.is_relative_to(prefix)


def test_wheel_share_equals_the_checkout(prefix, root):
    share = prefix / 'share' / 'linkage_ros'
    for folder in ('config', 'launch'):
        expected, found = (
            {
                path.relative_to(base / folder)
                for path in (base / folder).rglob('*')
                if path.is_file() and path.suffix != '.pyc'
            }
            for base in (root, share)
        )
        assert found == expected
        assert found
    assert (share / 'package.xml').read_bytes() == (root / 'package.xml').read_bytes()
    index = prefix / 'share' / 'ament_index' / 'resource_index' / 'packages' / 'linkage_ros'
    assert index.is_file()


def test_files_are_found_from_another_python(prefix, run):
    """As with `pip install --user`, where Python has another prefix than the package."""
    (site,) = prefix.glob('lib/python*/site-packages')
    say = "from linkage_ros.resources import shipped_path; print(shipped_path('linkages'))"
    printed = run(sys.executable, '-c', say, cwd=prefix, PYTHONPATH=str(site))
    assert Path(printed.strip()) == prefix / 'share' / 'linkage_ros' / 'config' / 'linkages'


@pytest.mark.parametrize('room', ['study', 'view', 'view/pages', 'view/report'])
def test_wheel_holds_css_and_js_of_pages(prefix, root, room):
    packages = [folder for folder in prefix.rglob(f'linkage_ros/tools/{room}') if folder.is_dir()]
    assert len(packages) == 1
    files = [
        file
        for file in (root / 'linkage_ros/tools' / room).iterdir()
        if file.suffix in ('.css', '.js')
    ]
    assert files
    for file in files:
        assert (packages[0] / file.name).read_bytes() == file.read_bytes()


def test_wheel_is_marked_as_typed(prefix):
    (package,) = prefix.glob('lib/python*/site-packages/linkage_ros')
    assert {'py.typed', '__init__.pyi'} <= {file.name for file in package.iterdir()}


def test_wheel_holds_no_tests_or_benchmarks(prefix):
    packages = {path.name for path in prefix.glob('lib/python*/site-packages/*')}
    assert not {'test', 'bench', 'examples', 'launch'} & packages


@pytest.mark.parametrize(
    'name', ['linkage_node', 'linkage_relay', 'crank_source', 'pd_controller', 'linkage']
)
def test_executable_calls_an_existing_main(prefix, root, name):
    script = (prefix / 'bin' / name).read_text('utf-8')
    module = next(
        line.split()[1] for line in script.splitlines() if line.startswith('from linkage_ros')
    )
    path = root.joinpath(*module.split('.')).with_suffix('.py')
    assert 'def main(' in path.read_text('utf-8')
