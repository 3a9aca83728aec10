# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Names in the package say what they mean: functions by a verb or a noun, classes one thing."""

import ast
from collections import defaultdict

import pytest

# Prepositions and irregular participles: alone they do not say what a function does.
VAGUE = {
    *('at', 'of', 'in', 'on', 'to', 'by', 'for', 'from', 'with', 'within', 'beyond', 'between'),
    *('behind', 'before', 'after', 'over', 'under', 'near', 'off', 'up', 'down'),
    *('found', 'told', 'known', 'given', 'shown', 'drawn', 'taken', 'held', 'said', 'made', 'met'),
    *('left', 'kept', 'sent', 'built', 'lost', 'put', 'whole', 'one', 'other', 'each', 'own'),
    *('brought', 'thought', 'caught', 'split', 'cut', 'heard', 'seen', 'gone', 'done', 'fit'),
    *('worn', 'begun'),
}
# Verbs and nouns that end like a participle.
NO_PARTICIPLES = {'listen', 'shorten'}


@pytest.fixture(scope='module')
def definitions(root):
    """Return the places of each function and of each class of the package, by its name."""
    functions, classes = defaultdict(list), defaultdict(list)
    for path in sorted((root / 'linkage_ros').rglob('*.py')):
        for node in ast.walk(ast.parse(path.read_text('utf-8'))):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                if node.name.startswith('__'):
                    continue  # Python's own names
                functions[node.name.strip('_')].append(f'{path}:{node.lineno}')
            elif isinstance(node, ast.ClassDef):
                classes[node.name.strip('_')].append(f'{path}:{node.lineno}')
    return functions, classes


def test_function_names_contain_a_verb_or_a_noun(definitions):
    functions, _ = definitions
    vague = {
        name: places
        for name, places in functions.items()
        if name in VAGUE or (name.endswith(('ed', 'en')) and '_' not in name)
        if name not in NO_PARTICIPLES
    }
    assert vague == {}


def test_class_names_are_unique(definitions):
    _, classes = definitions
    assert {name: places for name, places in classes.items() if len(places) > 1} == {}
