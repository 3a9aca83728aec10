# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The outcome of an attack with random inputs, each known by the seed and its number."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

from campaigns.campaign import results_of


@dataclass(slots=True)
class Attacked:
    """The number of tries by how each ended, and the violations, one line each."""

    tried: Counter[str] = field(default_factory=Counter)
    findings: list[str] = field(default_factory=list)

    def add(self, outcome: str, finding: str) -> None:
        """Add a try, with its violation or ''."""
        self.tried[outcome] += 1
        if finding:
            self.findings.append(finding)


Attack = Callable[[int, range, Attacked], None]
"""Tries the inputs of a seed and of some numbers, and adds each try."""


def attack_in_parts(attack: Attack, count: int, seed: int, jobs: int, part: int) -> Attacked:
    """Try a number of inputs in several processes, each of them ``part`` inputs at a time."""
    parts = [range(begin, min(begin + part, count)) for begin in range(0, count, part)]
    whole = Attacked()
    for attacked in results_of(partial(_run_part, attack, seed), parts, jobs):
        whole.tried += attacked.tried
        whole.findings += attacked.findings
    whole.tried = Counter(dict(sorted(whole.tried.items())))
    return whole


def _run_part(attack: Attack, seed: int, numbers: range) -> Attacked:
    attacked = Attacked()
    attack(seed, numbers, attacked)
    return attacked
