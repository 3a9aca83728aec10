# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Mutants: each is one change that parses, and a mistake counts as seen where a test fails."""

import ast
from random import Random

from campaigns.mutants import file_of, first_failure, mutants_of, TESTS
import pytest

from ..support.scenes import ROOT


@pytest.mark.sample(3)
@pytest.mark.parametrize('module', TESTS)
def test_each_mutant_differs_in_one_expression_and_parses(module):
    source = file_of(module).read_bytes()
    original = ast.dump(ast.parse(source))
    mutants = [*mutants_of(module)]
    assert len(mutants) > 50
    for mutant in Random(1).sample(mutants, 10):
        assert ast.dump(ast.parse(mutant.change(source))) != original
        assert mutant.cut(source)[0].count(b'\n') + 1 == mutant.line


def test_files_of_each_mutated_module_exist():
    assert [module for module in TESTS if not file_of(module).is_file()] == []
    assert all((ROOT / 'test' / name).exists() for tests in TESTS.values() for name in tests)


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ('text', 'killer'),
    [
        ('def test_sum():\n    assert 1 + 1 == 2\n', ''),
        ('def test_sum():\n    assert 1 + 1 == 3\n', 'FAILED test_sum.py::test_sum'),
        ('import nothing_of_this_name\n', 'ERROR test_sum.py'),
        ('def test_sum():\n    while True:\n        pass\n', ''),
    ],
)
def test_mutant_is_killed_by_a_failing_test(tmp_path, text, killer):
    (tmp_path / 'test_sum.py').write_text(text)
    # On a busy machine pytest itself takes seconds to start.
    longest = 2 if 'while' in text else 30
    assert first_failure(tmp_path, ['test_sum.py'], longest) == killer
