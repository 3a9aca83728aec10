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


"""The campaign's parts: which damages, shared out among processes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
import tempfile
from typing import NamedTuple

from campaigns.damage.judge import FAULT, judge_reading, judge_salvage
from campaigns.damage.subject import make, Subject
from campaigns.processes import results_of

_PART = 4000
"""Damages that a process takes at a time."""

JUDGES: dict[str, Callable[[Subject], str]] = {
    'read': lambda subject: judge_reading(subject, allow_truncated=False),
    'read, truncated allowed': lambda subject: judge_reading(subject, allow_truncated=True),
    'recover': judge_salvage,
}


class Part(NamedTuple):
    """
    Some of the damages to one bag.

    Attributes
    ----------
    kind, seed, size
        Which bag, as `make` takes it.
    damage
        'cut' to so many bytes, or 'flip' of the bit of this number.
    places
        The bytes or bits.

    """

    kind: str
    seed: int
    size: int
    damage: str
    places: range | list[int]


@dataclass
class Tally:
    """How often each judge came to each verdict, and the first damages that led to a fault."""

    verdicts: Counter[tuple[str, str, str, str]] = field(default_factory=Counter)
    faults: list[tuple[str, str, int, str, str]] = field(default_factory=list)

    def add(self, other: Tally) -> None:
        self.verdicts += other.verdicts
        self.faults += other.faults[: 20 - len(self.faults)]


def parts(kinds: list[str], seed: int, size: int, sample: int | None) -> list[Part]:
    """Return all damages to the bags of these kinds, or of each damage so many at random."""
    work = []
    for kind in kinds:
        with tempfile.TemporaryDirectory() as folder:
            length = len(make(kind, Path(folder) / 'run', seed, size).content)
        for damage, count in (('cut', length), ('flip', 8 * length)):
            if sample is None or sample >= count:
                work += [
                    Part(kind, seed, size, damage, range(start, min(start + _PART, count)))
                    for start in range(0, count, _PART)
                ]
            else:
                places = sorted(Random(f'{seed} {kind} {damage}').sample(range(count), sample))
                work += [
                    Part(kind, seed, size, damage, places[start : start + _PART])
                    for start in range(0, sample, _PART)
                ]
    return work


def run(work: list[Part], jobs: int) -> Iterator[tuple[Part, Tally]]:
    """Damage and judge; yield each part as it is done."""
    yield from results_of(_with_part, work, jobs)


def _with_part(part: Part) -> tuple[Part, Tally]:
    return part, run_part(part)


def run_part(part: Part) -> Tally:
    """Make the bag, damage its file at each place, judge, and make it whole again."""
    tally = Tally()
    with tempfile.TemporaryDirectory() as folder:
        subject = make(part.kind, Path(folder) / 'run', part.seed, part.size)
        content = subject.content
        with subject.file.open('r+b', buffering=0) as file:
            for place in part.places:
                if part.damage == 'flip':
                    at, bit = divmod(place, 8)
                    file.seek(at)
                    file.write(bytes([content[at] ^ 1 << bit]))
                else:
                    file.truncate(place)
                for name, judge in JUDGES.items():
                    verdict = judge(subject)
                    tally.verdicts[part.kind, part.damage, name, verdict] += 1
                    if verdict.startswith(FAULT) and len(tally.faults) < 20:
                        tally.faults.append((part.kind, part.damage, place, name, verdict))
                if part.damage == 'flip':
                    file.seek(at)
                    file.write(content[at : at + 1])
                else:
                    file.seek(place)
                    file.write(content[place:])
    return tally
