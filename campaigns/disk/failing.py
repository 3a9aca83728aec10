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

"""Every system call of a recording fails, once or from then on, in every way."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
import shutil
from tempfile import TemporaryDirectory
from typing import NamedTuple

from campaigns.campaign import results_of
from campaigns.disk.injection import can_befall, FAULTS, Injection, run, Seen
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
    """Recordings of one setting that a process makes one after the other."""

    setting: str
    injections: tuple[Injection | None, ...]


class Tried(NamedTuple):
    """
    One recording, and its outcome.

    Attributes
    ----------
    setting
        Name of one of `SETTINGS`.
    injection
        The injected fault; None for none.
    calls
        All calls that it made.
    outcome
        What became of it.

    """

    setting: str
    injection: Injection | None
    calls: list[Seen]
    outcome: Outcome

    @property
    def struck(self) -> Seen | None:
        """Return the first call that failed; None where it did not come to it."""
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


def injections(calls: Sequence[Seen]) -> Iterator[Injection]:
    """Yield all there are, for calls as a dry run has shown them."""
    for number, call in enumerate(calls):
        for fault in FAULTS:
            if can_befall(fault, call.name, call.what):
                yield Injection(number, fault, lasting=False)
                yield Injection(number, fault, lasting=True)


def parts(setting: str, every: int = 1, first: int = 0) -> list[Part]:
    """Return the work for a setting: all injections, or every so manyth from one on."""
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
    plan, struck = tried.injection, tried.struck
    if plan is None or struck is None:
        return Expectation(expected_messages(MESSAGES), keeps_all=True)
    fault = FAULTS[plan.fault]
    return Expectation(
        expected_messages(MESSAGES),
        keeps_all=fault.harmless or _can_be_done_without(struck, plan),
        # What fails to be closed, named or removed lies there.
        may_leave=plan.lasting or struck.name in ('unlink', 'rmdir'),
        loses_pages=fault.loses,
        may_be_silent=struck.phase == 'closing' and struck.what == 'folder',
    )


def _can_be_done_without(call: Seen, plan: Injection) -> bool:
    """Return whether a recording has to do without a call: what it is for is not the messages."""
    return (
        not plan.lasting
        and call.phase != 'beginning'
        and call.name != 'statfs'
        and (call.what in ('metadata', 'folder', 'reserve') or call.name == 'unlink')
        # The room for the index of a new file has to be there.
        and (call.what, call.name) not in (('reserve', 'create'), ('reserve', 'fallocate'))
    )
