# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""`colcon test` on a robot: tests skip themselves where a package is missing that has no key."""

import ast
import re
import subprocess
import sys

from ..support.missing_packages import WITHOUT_KEY
from ..support.sampling import TAKES_ALL

PROGRAM = """
import sys
from importlib.machinery import PathFinder
import pytest
class WithoutSome(PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        hidden = name.partition('.')[0] in sys.argv[1].split()
        return None if hidden else super().find_spec(name, path, target)
sys.meta_path = [WithoutSome if finder is PathFinder else finder for finder in sys.meta_path]
sys.exit(pytest.main(['--collect-only', '-q', '-p', 'no:cacheprovider', *sys.argv[2:]]))
"""


def collect(root, hidden, *places):
    """Return what pytest says when it collects tests where some packages are hidden."""
    done = subprocess.run(
        [sys.executable, '-c', PROGRAM, ' '.join(hidden), *places], cwd=root, check=False,
        capture_output=True, text=True, timeout=200,
    )  # fmt: skip
    return done.returncode, done.stdout + done.stderr


LONGEST = 'kinematics', 'dynamics', 'stages', 'cli'
FOLDERS = ['test', *(f'--ignore=test/{name}' for name in LONGEST if not TAKES_ALL)]


def test_tests_without_optional_packages_are_collected(root):
    code, said = collect(root, WITHOUT_KEY, *FOLDERS)
    assert code == 0, said[-2000:]
    collected = int(re.search(r'(\d+)/\d+ tests collected', said)[1])
    skipped = {*re.findall(r'SKIPPED \[1\] (\S+\.py):0: needs', said)}
    assert len(skipped) > 10
    assert collected > 20


def test_a_missing_package_that_has_a_key_fails_the_collection(root):
    code, said = collect(root, ['yaml'], 'test/bag/test_split.py')
    assert code != 0
    assert "No module named 'yaml'" in said


def test_tests_import_what_has_a_key_or_skip_themselves_without_it(root):
    keys = re.findall(r'_depend>(?:python3-)?([\w-]+)<', (root / 'package.xml').read_text())
    present = {*sys.stdlib_module_names, *keys, 'linkage_ros', 'mcap', 'packaging'}
    imported = {
        name.partition('.')[0]
        for folder in ('test', 'linkage_ros')
        for path in (root / folder).rglob('*.py')
        # The package imports locally what a robot may lack; a test, what nobody has.
        for statement in statements_of(path, only_at_head=folder == 'test')
        for name in imported_modules(statement)
    }
    assert {'numpy', 'scipy'} < imported
    assert imported - present - WITHOUT_KEY == {'bench', 'campaigns', 'docs'}


def statements_of(path, only_at_head):
    """Return the statements of a file, or those that stand in no other."""
    tree = ast.parse(path.read_text(encoding='utf-8'))
    return tree.body if only_at_head else ast.walk(tree)


def imported_modules(statement):
    """Return the modules that a statement imports by their whole names."""
    if isinstance(statement, ast.Import):
        return [alias.name for alias in statement.names]
    absolute = isinstance(statement, ast.ImportFrom) and not statement.level
    return [statement.module] if absolute else []
