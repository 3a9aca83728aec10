# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""For all tests: how many run and in which order, how Hypothesis judges examples, a browser."""

from collections import defaultdict
from collections.abc import Generator, Iterator
import gc
from importlib.util import find_spec
from math import inf
import os
import re
from typing import Any

from hypothesis import HealthCheck, settings
from linkage_ros.cli import terminal
import pytest

from .browser import chromium
from .support.crashed_workers import pytest_handlecrashitem  # noqa: F401 (a hook)
from .support.missing_packages import missing_package
from .support.sampling import choose_covering, EXAMPLES, TAKES_ALL

# Before numpy is imported, here and in processes that tests start. The threads of OpenBLAS wait
# for each other in loops, while tests of other processes need the core: matrices here are small.
# A forked child with such threads, whose scipy is loaded later, does not end.
os.environ['OPENBLAS_NUM_THREADS'] = '1'

_skipped: set[str] = set()

# A conftest that misses a package ends the collection, and that of bags needs this one.
collect_ignore = [] if find_spec('rosbags') else ['bag']

# A property is not judged by the duration of an example.
settings.register_profile(
    'unhurried',
    deadline=None,
    max_examples=EXAMPLES,
    suppress_health_check=[HealthCheck.too_slow],
)
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


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """Skip a file of tests that needs a package which package.xml cannot name."""
    report = yield
    text = str(report.longrepr) if report.failed else ''
    package = missing_package(text)
    # What a file that was skipped holds may be imported by another one.
    part = re.search(r"cannot import name '\w+' from '[.\w]+' \((.*)\)", text)
    if package or (part and part[1] in _skipped):
        report.outcome = 'skipped'
        what = f'the package {package}' if package else part[1]
        report.longrepr = report.nodeid, 0, f'Skipped: needs {what}'
    if report.skipped:
        _skipped.add(str(collector.path))
    return report


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport() -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Skip a test whose command says that such a package is not installed."""
    report = yield
    said = ''.join(text for _, text in report.sections)
    if report.failed and (package := missing_package(f'{report.longrepr}{said}')):
        report.outcome = 'skipped'
        report.longrepr = report.nodeid, 0, f'Skipped: needs the package {package}'
    return report


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Take a sample, and put slow files first: xdist hands out files in this order."""
    if not TAKES_ALL and not any('::' in argument for argument in config.args):
        _leave_a_sample(config, items)
    slow = {item.path for item in items if item.get_closest_marker('slow')}
    items.sort(key=lambda item: item.path not in slow)


def _leave_a_sample(config: pytest.Config, items: list[pytest.Item]) -> None:
    tests = defaultdict(list)
    for item in items:
        if mark := item.get_closest_marker('sample'):
            tests[item.nodeid.partition('[')[0], mark.args].append(item)
    left_out = set()
    for (_, (count,)), cases in tests.items():
        values = [case.callspec.indices if hasattr(case, 'callspec') else {} for case in cases]
        chosen = choose_covering(values, count)
        left_out |= {item for index, item in enumerate(cases) if index not in chosen}
    if left_out:
        config.hook.pytest_deselected(items=[*left_out])
        items[:] = [item for item in items if item not in left_out]


def pytest_collection_finish() -> None:
    """Leave the thousands of tests out of garbage collections: these took a fifth of the time."""
    gc.collect()
    gc.freeze()
