# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""For all tests: how Hypothesis judges examples, a browser, and which files run first."""

from collections.abc import Iterator
import gc
from math import inf
from typing import Any

from hypothesis import HealthCheck, settings
from linkage_ros.cli import terminal
import pytest

from .browser import chromium

# A property is not judged by the duration of an example.
settings.register_profile('unhurried', deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile('unhurried')


@pytest.fixture(autouse=True)
def no_progress_in_a_pipe(monkeypatch):
    """Print no line of progress, or what a command prints would depend on how fast it is."""
    monkeypatch.setattr(terminal, 'FIRST_LINE', inf)


@pytest.fixture(scope='module')
def browser() -> Iterator[Any]:
    """Give a running Chromium; not for the whole session, since its event loop runs as long."""
    with chromium.browser() as started:
        yield started


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the files with slow tests first: xdist hands out files in this order, one a worker."""
    slow = {item.path for item in items if item.get_closest_marker('slow')}
    items.sort(key=lambda item: item.path not in slow)


def pytest_collection_finish() -> None:
    """Leave the thousands of tests out of garbage collections: these took a fifth of the time."""
    gc.collect()
    gc.freeze()
