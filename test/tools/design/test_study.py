# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Studies: the best of all candidates, whoever works them out."""

from dataclasses import dataclass
import sys
import tracemalloc

from linkage_ros.dask_workers import import_distributed
from linkage_ros.errors import LinkageError
from linkage_ros.tools.design import CHUNK, DesignFound, scipy_optimize, search
import numpy as np
import pytest

from ...support.sampling import sample_count

# A study finds the best of all its candidates, whichever process evaluates them.


CAST = 3 * CHUNK + 7
"""Candidates, of which the last chunk has only some."""


@dataclass(frozen=True)
class Steps:
    """A bowl in steps, so that many candidates are worth the same; half of the plane is none."""

    dimensions: int = 2
    step: float = 0.25
    none: float = np.inf

    def sample(self, generator, count):
        return generator.uniform(-1.0, 1.0, (count, self.dimensions))

    def score(self, candidates):
        scores = np.floor((candidates**2).sum(1) / self.step) * self.step
        scores[candidates[:, 0] < 0.0] = self.none
        return scores


def every_candidate(problem, seed, count):
    """Score and sort all there are, at once and by Python's own sort."""
    chunks = [
        problem.sample(np.random.default_rng([seed, chunk]), min(CHUNK, count - chunk * CHUNK))
        for chunk in range(-(-count // CHUNK))
    ]
    found = [
        (score, chunk, index, tuple(candidate))
        for chunk, candidates in enumerate(chunks)
        for index, (score, candidate) in enumerate(
            zip(problem.score(candidates).tolist(), candidates.tolist(), strict=True)
        )
        if score < np.inf
    ]
    return [DesignFound(score, candidate) for score, _, _, candidate in sorted(found)]


@pytest.mark.sample(6)
@pytest.mark.parametrize('count', [0, 1, CHUNK - 1, CHUNK, CHUNK + 1, CAST])
@pytest.mark.parametrize('keep', [1, 100, 10 * CHUNK])
def test_search_keeps_the_best_in_score_order(count, keep):
    found = search(Steps(), seed=5, count=count, keep=keep)
    assert found == every_candidate(Steps(), 5, count)[:keep]


@pytest.mark.parametrize('none', [np.inf, np.nan])
def test_search_never_keeps_impossible_candidates(none):
    found = search(Steps(none=none), seed=5, count=CHUNK, keep=CHUNK)
    assert len(found) == len(every_candidate(Steps(), 5, CHUNK)) < CHUNK
    assert all(each.candidate[0] >= 0.0 for each in found)


def test_search_without_possible_candidates_returns_nothing():
    class Nothing(Steps):
        def score(self, candidates):
            return np.full(len(candidates), np.inf)

    assert search(Nothing(), seed=5, count=CAST, keep=10) == []


def test_search_seed_changes_the_result():
    studies = [search(Steps(), seed=seed, count=1000, keep=3) for seed in (1, 2, 2**40)]
    assert studies[0] != studies[1] != studies[2] != studies[0]


def test_search_progress_counts_done_and_total():
    told = []
    search(Steps(), seed=5, count=CAST, keep=1, progress=lambda *now: told.append(now))
    assert told == [(done, CAST) for done in (CHUNK, 2 * CHUNK, 3 * CHUNK, CAST)]


def test_search_memory_does_not_grow_with_its_length():
    assert _peak(40 * CHUNK) < 1.5 * _peak(4 * CHUNK)


def _peak(count):
    tracemalloc.start()
    search(Steps(), seed=5, count=count, keep=50)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return peak


def test_search_result_does_not_depend_on_the_workers():
    distributed = pytest.importorskip('distributed')
    # Workers cannot import this module, whose name only pytest knows: the classes go along. A
    # local one keeps Dask from trying it by name.
    pytest.importorskip('cloudpickle').register_pickle_by_value(sys.modules[__name__])

    class SentAlong(Steps):
        pass

    studies = [{'count': CAST, 'keep': 100}, {'count': 70 * CHUNK + 1, 'keep': 1}]
    studies = studies[: sample_count(2, 1)]
    here = [search(SentAlong(), seed=5, **study) for study in studies]
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, host='127.0.0.1', dashboard_address='127.0.0.1:0'
    ) as cluster:
        for workers in (1, 2):
            cluster.scale(workers)
            cluster.wait_for_workers(workers, timeout=30)
            for study, expected in zip(studies, here, strict=True):
                done = [0]
                found = search(
                    SentAlong(),
                    seed=5,
                    progress=lambda now, _: done.append(now),  # noqa: B023 -- called at once
                    address=cluster.scheduler_address,
                    **study,
                )
                assert found == expected
                assert done == sorted(done)
                assert done[-1] == study['count']


# A missing library that only some kinds of synthesis need is named, with how to install it.


@pytest.mark.parametrize(
    ('library', 'asked', 'extra'),
    [('scipy', scipy_optimize, 'design'), ('distributed', import_distributed, 'dask')],
)
def test_missing_library_error_names_the_install_command(library, asked, extra, monkeypatch):
    # None stands for a module that is not there.
    monkeypatch.setitem(sys.modules, library, None)
    monkeypatch.delitem(sys.modules, 'scipy.optimize', raising=False)
    with pytest.raises(LinkageError) as caught:
        asked()
    assert str(caught.value) == f"{library}: is not installed; pip install 'linkage_ros[{extra}]'"
