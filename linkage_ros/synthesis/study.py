# Copyright 2026 The linkage_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.


"""
A search over random candidates: here, or by the workers of a Dask scheduler.

Candidates come in chunks. Each chunk draws from a generator of its own, seeded by the study's seed
and the chunk's number, and results are ordered by score, then by place in the study. So what is
found depends neither on how many workers there are nor on which of them is first. (To the last
bit where they have the same processor and the same numpy; elsewhere as far as its exp and sin
agree.)
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing
from functools import partial
from typing import NamedTuple, Protocol

from linkage_ros.synthesis.workers import results_of
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

CHUNK = 16384
"""Candidates that are drawn and scored at once."""

_MOST_CHUNKS = 16
"""In a task: of a cheap problem one chunk takes no longer than to send it away."""

_FEWEST_TASKS = 16
"""For each thread, before they grow: the last thread shall not be long behind the others."""


class Problem(Protocol):
    """What is searched for; it goes to workers by pickle, and keeps no state."""

    def sample(self, generator: np.random.Generator, count: int) -> Array:
        """Draw candidates, (count, n)."""

    def score(self, candidates: Array) -> Array:
        """Return what candidates (count, n) are worth, (count,): less is better, inf is none."""


class Found(NamedTuple):
    """A candidate and its score."""

    score: float
    candidate: tuple[float, ...]


class _Best(NamedTuple):
    """Candidates in order: scores (k,), places in the study (k,), and numbers (k, n)."""

    scores: Array
    places: NDArray[np.int64]
    candidates: Array


class _Part(NamedTuple):
    """A part of a study: the candidates from one place, at which a chunk begins, to another."""

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
) -> list[Found]:
    """
    Return the best candidates of a problem, the best first.

    Parameters
    ----------
    problem
        Draws and scores candidates.
    seed
        Of the study, 0 or above.
    count
        Candidates to draw.
    keep
        Candidates to return; fewer where fewer have a score below infinity.
    progress
        Is told how many candidates are done, and of how many.
    address
        Of a Dask scheduler, such as ``tcp://host:8786``; '' to search in this process.

    Raises
    ------
    LinkageError
        Where the scheduler or its workers cannot do it.

    """
    work = partial(_best, problem, seed, keep)
    results = (
        results_of(work, partial(_tasks, count), address)
        if address
        else ((part, work(part)) for part in _parts(count, CHUNK))
    )
    best, done = None, 0
    with closing(results):
        for part, found in results:
            best = found if best is None else _merged((best, found), keep)
            done += part.last - part.first
            if progress is not None:
                progress(done, count)
    if best is None:
        return []
    return [
        Found(score, tuple(candidate))
        for score, candidate in zip(best.scores.tolist(), best.candidates.tolist(), strict=True)
    ]


def _parts(count: int, size: int) -> Iterator[_Part]:
    return (_Part(first, min(first + size, count)) for first in range(0, count, size))


def _tasks(count: int, threads: int) -> Iterator[_Part]:
    chunks = count // (CHUNK * _FEWEST_TASKS * threads)
    return _parts(count, CHUNK * min(max(chunks, 1), _MOST_CHUNKS))


def _best(problem: Problem, seed: int, keep: int, part: _Part) -> _Best:
    """Return the best candidates of a part, which may be of many chunks."""
    best = None
    for first in range(part.first, part.last, CHUNK):
        generator = np.random.default_rng([seed, first // CHUNK])
        candidates = problem.sample(generator, min(CHUNK, part.last - first))
        scores = np.asarray(problem.score(candidates), np.float64)
        possible = np.flatnonzero(scores < np.inf)
        chosen = possible[np.argsort(scores[possible], kind='stable')[:keep]]
        found = _Best(scores[chosen], first + chosen, candidates[chosen])
        best = found if best is None else _merged((best, found), keep)
    if best is None:
        raise ValueError(f'{part} is empty')
    return best


def _merged(found: tuple[_Best, ...], keep: int) -> _Best:
    scores, places, candidates = (np.concatenate(each) for each in zip(*found, strict=True))
    order = np.lexsort((places, scores))[:keep]
    return _Best(scores[order], places[order], candidates[order])
