# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A fault of a Dask scheduler or of its workers is survived, or told in one line."""

import os
from pathlib import Path
import socket
import sys

import linkage_ros
from linkage_ros import dask_workers
from linkage_ros.dask_workers import results_of
from linkage_ros.errors import LinkageError
import pytest

distributed = pytest.importorskip('distributed')
cloudpickle = pytest.importorskip('cloudpickle')

# Workers cannot import this module, since only pytest knows its name.
cloudpickle.register_pickle_by_value(sys.modules[__name__])

WITHOUT_US = """
import sys

class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.split('.')[0] == 'linkage_ros':
            raise ModuleNotFoundError(f'No module named {name!r}', name=name)

sys.meta_path.insert(0, Refuse())
"""


def cluster_of(count, **options):
    return distributed.LocalCluster(
        n_workers=count,
        threads_per_worker=1,
        host='127.0.0.1',
        dashboard_address='127.0.0.1:0',
        **options,
    )


@pytest.fixture(scope='module')
def cluster():
    # On a busy machine a worker that died takes long to be replaced.
    with pytest.MonkeyPatch.context() as patch, cluster_of(2) as cluster:
        patch.setattr(dask_workers, '_PATIENCE', 60.0)
        yield cluster


@pytest.fixture
def impatient(monkeypatch):
    monkeypatch.setattr(dask_workers, '_PATIENCE', 1.0)


def numbers(count):
    return lambda threads: iter(range(count))


def squares(address, count=10):
    return dict(results_of(lambda x: x * x, numbers(count), address))


def refusal(address):
    with pytest.raises(LinkageError) as caught:
        squares(address)
    assert '\n' not in str(caught.value)
    return str(caught.value)


def test_workers_compute_every_part_once(cluster):
    assert squares(cluster.scheduler_address, 200) == {x: x * x for x in range(200)}


def test_workers_request_parts_only_as_needed(cluster):
    asked = []

    def parts(threads):
        assert threads == 2
        for part in range(100):
            asked.append(part)
            yield part

    for done, _ in enumerate(results_of(abs, parts, cluster.scheduler_address)):
        assert len(asked) <= done + 2 * dask_workers._AHEAD


def test_closed_iterator_closes_the_dask_client(cluster):
    before = set(cluster.scheduler.clients)
    results = results_of(abs, numbers(100), cluster.scheduler_address)
    next(results)
    assert set(cluster.scheduler.clients) - before
    results.close()
    assert set(cluster.scheduler.clients) == before


def test_worker_error_is_raised_unchanged(cluster):
    with pytest.raises(ZeroDivisionError):
        list(results_of(lambda x: 1 // x, numbers(3), cluster.scheduler_address))


def test_dead_worker_is_replaced(cluster, tmp_path):
    grave = str(tmp_path / 'grave')

    def dies_once(x):
        if x == 3 and not Path(grave).exists():
            Path(grave).touch()
            os._exit(1)
        return -x

    found = dict(results_of(dies_once, numbers(20), cluster.scheduler_address))
    assert Path(grave).exists()
    assert found == {x: -x for x in range(20)}


def test_work_that_kills_every_worker_is_abandoned(cluster):
    with pytest.raises(LinkageError, match='4 workers died one after another'):
        list(results_of(lambda x: os._exit(1), numbers(1), cluster.scheduler_address))


def test_worker_of_another_version_is_refused(cluster, monkeypatch):
    monkeypatch.setattr(linkage_ros, '__version__', '99.0')
    said = refusal(cluster.scheduler_address)
    assert 'this worker has linkage_ros' in said
    assert 'here is 99.0' in said


def test_worker_without_the_package_is_refused(tmp_path):
    preload = tmp_path / 'without_us.py'
    preload.write_text(WITHOUT_US)
    with cluster_of(1, preload=[str(preload)]) as cluster:
        assert 'cannot import linkage_ros' in refusal(cluster.scheduler_address)


def test_missing_library_on_workers_is_named(cluster):
    def imports(x):
        import a_library_that_nobody_has  # type: ignore[import-not-found]  # noqa: F401

    with pytest.raises(LinkageError, match='cannot import a_library_that_nobody_has'):
        list(results_of(imports, numbers(1), cluster.scheduler_address))


def test_scheduler_without_workers_is_refused(impatient):
    with cluster_of(0) as cluster:
        assert 'no workers; start `dask worker tcp://127' in refusal(cluster.scheduler_address)


def test_lost_workers_are_reported(impatient):
    with cluster_of(1) as cluster:
        results = results_of(abs, numbers(100), cluster.scheduler_address)
        next(results)
        cluster.scale(0)
        with pytest.raises(LinkageError, match='the scheduler has no workers'):
            list(results)


def test_lost_scheduler_is_reported(impatient):
    with cluster_of(1) as cluster:
        results = results_of(abs, numbers(100), cluster.scheduler_address)
        next(results)
        cluster.close()
        with pytest.raises(LinkageError, match='the scheduler was lost'):
            list(results)


@pytest.mark.parametrize(
    ('address', 'reason'),
    [
        ('127.0.0.1', 'missing port number'),
        ('tcp://127.0.0.1:many', 'invalid literal'),
        ('pigeon://127.0.0.1:1', 'unknown address scheme'),
        ('tls://127.0.0.1:1', 'TLS'),
        ('inproc://127.0.0.1/1/2', 'inproc'),
    ],
)
def test_invalid_scheduler_address_is_refused(address, reason, impatient):
    said = refusal(address)
    assert said.startswith(f'{address}: no Dask scheduler answers here (')
    assert reason in said


def test_closed_scheduler_port_is_reported(impatient):
    with socket.socket() as closed:
        closed.bind(('127.0.0.1', 0))
        port = closed.getsockname()[1]
    assert 'Timed out trying to connect' in refusal(f'tcp://127.0.0.1:{port}')


def test_silent_scheduler_is_reported(impatient):
    with socket.create_server(('127.0.0.1', 0)) as silent:
        said = refusal(f'tcp://127.0.0.1:{silent.getsockname()[1]}')
    assert 'no Dask scheduler answers here (it is silent)' in said


def test_worker_address_is_refused_as_scheduler(cluster):
    worker = next(iter(cluster.scheduler.workers))
    assert refusal(worker).startswith(f'{worker}: is a Dask Worker')
