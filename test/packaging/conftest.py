# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What the packaging tests share: where the checkout is, and clean copies of it."""

import os
from pathlib import Path
import shutil
import subprocess
import sys

import pytest

ROOT = Path(__file__).resolve().parents[2]

# Variables by which a sourced workspace or an editable install would affect a build.
LENT = (
    'AMENT_PREFIX_PATH',
    'CMAKE_PREFIX_PATH',
    'COLCON_PREFIX_PATH',
    'PYTHONPATH',
    'PYTEST_ADDOPTS',
    'PYTEST_CURRENT_TEST',
    'VIRTUAL_ENV',
)


@pytest.fixture(scope='session')
def root():
    """Return the root of the checkout."""
    return ROOT


@pytest.fixture(scope='session')
def environment():
    """Return an environment in which nothing is sourced and this Python comes first."""
    clean = {name: value for name, value in os.environ.items() if name not in LENT}
    clean['PATH'] = os.pathsep.join([str(Path(sys.executable).parent), clean.get('PATH', '')])
    return clean


@pytest.fixture(scope='session')
def copy_checkout():
    """Return a function that copies the checkout, without what git ignores."""

    def copy(target):
        listed = subprocess.run(
            ['git', 'ls-files', '-z', '--cached', '--others', '--exclude-standard'],
            cwd=ROOT,
            capture_output=True,
            text=True,
            check=False,
        )
        if listed.returncode:
            pytest.skip('not a git checkout: which files belong to it is unknown')
        for name in filter(None, listed.stdout.split('\0')):
            # Deleted, but not yet committed so: listed all the same.
            if (ROOT / name).is_file():
                (target / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / name, target / name)
        return target

    return copy


@pytest.fixture(scope='session')
def run(environment):
    """Return a function that runs a command, and fails the test with its output if it fails."""

    def run(*command, cwd, **extra):
        done = subprocess.run(
            [str(word) for word in command],
            cwd=cwd,
            env=environment | extra,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )
        if done.returncode:
            pytest.fail(f'{command} ended with {done.returncode}:\n{done.stdout}', pytrace=False)
        return done.stdout

    return run


@pytest.fixture(scope='session')
def import_core(run):
    """Return a function that imports modules in a fresh Python that refuses some packages."""
    program = """
import importlib
import importlib.abc
import pkgutil
import sys

skipped, refused = (set(names.split(',')) for names in sys.argv[1:])


class Refuse(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.split('.')[0] in refused:
            raise ModuleNotFoundError(f'{name} is refused here', name=name)


sys.meta_path.insert(0, Refuse())
import linkage_ros



def walk(path, prefix):
    for module in pkgutil.iter_modules(path, prefix):
        if module.name.removeprefix('linkage_ros.') in skipped:
            continue
        yield module.name
        if module.ispkg:
            yield from walk(importlib.import_module(module.name).__path__, module.name + '.')


names = ['linkage_ros', *walk(linkage_ros.__path__, 'linkage_ros.')]
for name in names:
    importlib.import_module(name)
print(linkage_ros.__file__, len(names))
"""

    def import_core(python, *, skip, refuse, cwd):
        """Return the file that linkage_ros came from and the number of modules."""
        printed = run(python, '-c', program, ','.join(skip), ','.join(refuse), cwd=cwd)
        file, count = printed.split()
        return Path(file), int(count)

    return import_core
