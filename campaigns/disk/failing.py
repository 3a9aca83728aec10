# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Let every system call of a recording fail, once or permanently, in every way."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
import shutil
from tempfile import TemporaryDirectory
from typing import NamedTuple

from campaigns.campaign import results_of
from campaigns.disk.injection import can_befall, FAULTS, Injection, run, SeenCall
from campaigns.disk.judge import (
    Expectation,
    expected_messages,
    judge,
    MESSAGES,
    Outcome,
    record,
    SETTINGS,
)

_PART = 20


class Part(NamedTuple):
    """Recordings of one setting that one process makes in turn."""

    setting: str
    injections: tuple[Injection | None, ...]


class Tried(NamedTuple):
    """One recording in one of `SETTINGS`: the injected fault, all system calls, the outcome."""

    setting: str
    injection: Injection | None
    calls: list[SeenCall]
    outcome: Outcome

    @property
    def failed_call(self) -> SeenCall | None:
        """Return the first call that failed; None if the recording did not reach it."""
        plan = self.injection
        return self.calls[plan.number] if plan and plan.number < len(self.calls) else None


def attempt(part: Part) -> list[Tried]:
    """Make the recordings of a part, and judge them."""
    tried = []
    with TemporaryDirectory(prefix='linkage_ros_disk_') as name:
        for injection in part.injections:
            folder = Path(name) / 'bag'
            do = partial(record, folder, SETTINGS[part.setting])
            done, calls = run(do, folder, injection)
            plan = Tried(part.setting, injection, calls, Outcome())
            outcome = judge(done, folder, _expectation(plan))
            tried.append(plan._replace(outcome=outcome))
            shutil.rmtree(folder, ignore_errors=True)
    return tried


def injections(calls: Sequence[SeenCall]) -> Iterator[Injection]:
    """Yield all possible injections for the calls of a recording without faults."""
    for index, call in enumerate(calls):
        for fault in FAULTS:
            if can_befall(fault, call.name, call.target):
                yield Injection(index, fault, lasting=False)
                yield Injection(index, fault, lasting=True)


def parts(setting: str, every: int = 1, first: int = 0) -> list[Part]:
    """Return the work for a setting: all injections, or every n-th from one on."""
    (dry,) = attempt(Part(setting, (None,)))
    if dry.outcome.faults:
        return [Part(setting, (None,))]
    chosen = [*injections(dry.calls)][first::every]
    return [
        Part(setting, tuple(chosen[begin:end]))
        for begin in range(0, len(chosen), _PART)
        for end in [begin + _PART]
    ]


def attempts(work: Sequence[Part], jobs: int) -> Iterator[list[Tried]]:
    """Make all recordings; yield them part by part."""
    yield from results_of(attempt, work, jobs)


def _expectation(tried: Tried) -> Expectation:
    plan, failed = tried.injection, tried.failed_call
    if plan is None or failed is None:
        return Expectation(expected_messages(MESSAGES), keeps_all=True)
    fault = FAULTS[plan.fault]
    return Expectation(
        expected_messages(MESSAGES),
        keeps_all=fault.harmless or _is_dispensable(failed, plan),
        # A file that cannot be closed, renamed or removed stays there.
        may_leave=plan.lasting or failed.name in ('unlink', 'rmdir'),
        loses_pages=fault.loses,
        may_be_silent=failed.phase == 'closing' and failed.target == 'folder',
    )


def _is_dispensable(call: SeenCall, plan: Injection) -> bool:
    """Return whether a recording has to continue without a call, which serves no message."""
    return (
        not plan.lasting
        and call.phase != 'beginning'
        and call.name != 'statfs'
        and (call.target in ('metadata', 'folder', 'reserve') or call.name == 'unlink')
        # The space reserved for the index of a new file is required.
        and (call.target, call.name) not in (('reserve', 'create'), ('reserve', 'fallocate'))
    )
