# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A search over random candidates, in this process or on the workers of a Dask scheduler.

Candidates come in chunks. Each chunk has its own random generator, seeded by the study's seed and
the chunk's number, and results are ordered by score, then by place in the study. So the result
depends neither on the number of workers nor on their order. (It is equal to the last bit on the
same processor and numpy; elsewhere as far as their exp and sin agree.)
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing
from functools import partial
from importlib import import_module
from typing import Any, NamedTuple, Protocol

from linkage_ros.dask_workers import results_of
from linkage_ros.errors import check_installed
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

CHUNK = 16384
"""Number of candidates drawn and scored at once."""

_MOST_CHUNKS = 16
"""Chunks in a task: for a cheap problem one chunk takes no longer than sending it."""

_FEWEST_TASKS = 16
"""Tasks for each thread before they grow, so that the last thread does not finish far behind."""


def scipy_optimize() -> Any:
    """Return scipy.optimize, for fits."""
    check_installed('scipy', "pip install 'linkage_ros[design]'")
    return import_module('scipy.optimize')


class Problem(Protocol):
    """A search problem; it goes to workers by pickle, and has no state."""

    def sample(self, generator: np.random.Generator, count: int) -> Array:
        """Draw candidates, (count, n)."""

    def score(self, candidates: Array) -> Array:
        """Return the scores of candidates (count, n), (count,): less is better, inf is invalid."""


class DesignFound(NamedTuple):
    """A candidate and its score."""

    score: float
    candidate: tuple[float, ...]


class _Best(NamedTuple):
    """Candidates in order: scores (k,), indices in the study (k,), and values (k, n)."""

    scores: Array
    places: NDArray[np.int64]
    candidates: Array


class _StudyPart(NamedTuple):
    """A part of a study: a range of candidates that begins with a chunk."""

    first: int
    last: int


def search(
    problem: Problem,
    *,
    seed: int,
    count: int,
    keep: int,
    progress: Callable[[int, int], None] | None = None,
    address: str = '',
) -> list[DesignFound]:
    """
    Return the best ``keep`` of ``count`` candidates with a finite score, the best first.

    The seed is 0 or above. ``progress`` is called with the number of finished candidates and the
    total. ``address`` names a Dask scheduler, such as ``tcp://host:8786``; '' searches in this
    process. A LinkageError is raised if the scheduler or its workers fail.
    """
    work = partial(_search_part, problem, seed, keep)
    results = (
        results_of(work, partial(_task_parts, count), address)
        if address
        else ((part, work(part)) for part in _split_parts(count, CHUNK))
    )
    best, done = None, 0
    with closing(results):
        for part, chunk_best in results:
            best = chunk_best if best is None else _merge_best((best, chunk_best), keep)
            done += part.last - part.first
            if progress is not None:
                progress(done, count)
    if best is None:
        return []
    return [
        DesignFound(score, tuple(candidate))
        for score, candidate in zip(best.scores.tolist(), best.candidates.tolist(), strict=True)
    ]


def _split_parts(count: int, size: int) -> Iterator[_StudyPart]:
    return (_StudyPart(first, min(first + size, count)) for first in range(0, count, size))


def _task_parts(count: int, threads: int) -> Iterator[_StudyPart]:
    chunks = count // (CHUNK * _FEWEST_TASKS * threads)
    return _split_parts(count, CHUNK * min(max(chunks, 1), _MOST_CHUNKS))


def _search_part(problem: Problem, seed: int, keep: int, part: _StudyPart) -> _Best:
    """Return the best candidates of a part, which may have several chunks."""
    best = None
    for first in range(part.first, part.last, CHUNK):
        generator = np.random.default_rng([seed, first // CHUNK])
        candidates = problem.sample(generator, min(CHUNK, part.last - first))
        scores = np.asarray(problem.score(candidates), np.float64)
        possible = np.flatnonzero(scores < np.inf)
        chosen = possible[np.argsort(scores[possible], kind='stable')[:keep]]
        chunk_best = _Best(scores[chosen], first + chosen, candidates[chosen])
        best = chunk_best if best is None else _merge_best((best, chunk_best), keep)
    if best is None:
        raise ValueError(f'{part} is empty')
    return best


def _merge_best(parts: tuple[_Best, ...], keep: int) -> _Best:
    scores, places, candidates = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    order = np.lexsort((places, scores))[:keep]
    return _Best(scores[order], places[order], candidates[order])
