# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Errors: each can go from one process to another, and says no more than can be read."""

from importlib import import_module
import pickle
from pkgutil import walk_packages

import linkage_ros
from linkage_ros.errors import FileError, LinkageError, list_names
from linkage_ros.tools.models import PartError
import pytest

from .support.scenes import linkage_of

TEXTS = 'where', 'reason', 'remedy'
ARGUMENTS = {FileError: ('file', 'key', 'reason', 'remedy', 7), PartError: (3, *TEXTS)}


def errors_of_the_package() -> list[type[BaseException]]:
    """Return all classes of errors that are declared in the package."""
    found: dict[type[BaseException], None] = {}
    for module in walk_packages(linkage_ros.__path__, 'linkage_ros.'):
        try:
            names = vars(import_module(module.name))
        except ModuleNotFoundError:
            continue  # of ROS, or of an extra that is not installed
        for value in names.values():
            is_error = isinstance(value, type) and issubclass(value, BaseException)
            if is_error and value.__module__.startswith('linkage_ros.'):
                found[value] = None
    return list(found)


def test_every_error_survives_pickling():
    kinds = errors_of_the_package()
    assert {LinkageError, FileError, PartError} <= set(kinds)
    for kind in kinds:
        error = kind(*ARGUMENTS.get(kind, TEXTS if issubclass(kind, LinkageError) else ('text',)))
        copy = pickle.loads(pickle.dumps(error))
        assert type(copy) is kind
        assert (str(copy), copy.args, vars(copy)) == (str(error), error.args, vars(error))


def test_list_of_names_is_shortened_with_a_count():
    assert list_names(['a', 'b\n', 'c']) == 'a, b\\n, c'
    assert list_names([]) == ''
    names = [f'joint_{index:03}' for index in range(1000)]
    text = list_names(names)
    assert len(text) < 1000
    shown = text.partition(' and ')[0].split(', ')
    assert shown == names[: len(shown)]
    assert text.endswith(f' and {1000 - len(shown)} more')
    assert len(list_names(['x' * 100_000] * 3)) < 1000


def test_error_listing_names_of_a_file_is_short():
    names = [f'{index:04}_{"x" * 60}' for index in range(300)]
    links = '\n'.join(f'  {name}: {{A: [0, 0], P{name}: [1, 0]}}' for name in names)
    text = f"""
links:
  ground: {{O: [0, 0], Q: [1, 0]}}
{links}
input: {{joint: crank, parent: ground, child: unheard of}}
joints: {{j: {{parent: ground, child: {names[0]}}}}}
"""
    with pytest.raises(FileError) as caught:
        linkage_of(text)
    assert caught.value.remedy.startswith('name one of 0000_xxx')
    assert caught.value.remedy.endswith(' more')
    assert len(caught.value.remedy) < 1000
