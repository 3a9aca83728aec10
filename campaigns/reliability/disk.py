# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Recordings on a disk that fails, fills or stalls.

Messages counted as recorded have to be in the bag, losses have to be reported, and no tick may
wait for the disk.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from importlib import metadata
from pathlib import Path
import shutil
from tempfile import TemporaryDirectory
from typing import NamedTuple

from bench.report import Table
from campaigns.campaign import Findings, Page, progress_lines, results_of
from campaigns.reliability import filling, stalling
from campaigns.reliability.filling import FLOOR, NotPermittedError
from campaigns.reliability.judge import (
    AT_RECOVERY,
    COMPLETE,
    EARLY,
    Expectation,
    judge,
    LEFT,
    Outcome,
    REFUSED,
)
from campaigns.reliability.recording import (
    expected_messages,
    message,
    Phase,
    record,
    Recorded,
    time_of,
    Watch,
    WatchedWriter,
)
from campaigns.reliability.system_calls import (
    FAULTS,
    Injection,
    injections,
    run_with,
    SeenCall,
    why_not,
)
from linkage_ros.bag import Storage

MESSAGES = 240
_FLUSH_EVERY = 40

SETTINGS: Mapping[str, Storage] = {
    'one file': Storage(flush_period=1e9, min_free_bytes=1),
    'split, zstd': Storage(flush_period=1e9, split_bytes=4_000, compression='zstd'),
    'ring of 2, lz4': Storage(
        flush_period=1e9, split_seconds=0.03, keep_files=2, compression='lz4'
    ),
}


def record_short(folder: Path, storage: Storage, watch: Watch) -> Recorded:
    """Make a short recording that uses every function of a writer."""
    return record(
        lambda: WatchedWriter(watch, folder, storage, _FLUSH_EVERY),
        lambda _: (message(index, time_of(index)) for index in range(MESSAGES)),
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
            do = partial(record_short, folder, SETTINGS[part.setting])
            done, calls = run_with(injection, folder, do)
            plan = Tried(part.setting, injection, calls, Outcome())
            outcome = judge(done, folder, _expectation(plan))
            tried.append(plan._replace(outcome=outcome))
            shutil.rmtree(folder, ignore_errors=True)
    return tried


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
        may_be_silent=failed.phase is Phase.CLOSING and failed.target == 'folder',
    )


def _is_dispensable(call: SeenCall, plan: Injection) -> bool:
    """Return whether a recording has to continue without a call, which serves no message."""
    return (
        not plan.lasting
        and call.phase > Phase.MAKING
        and call.name != 'statfs'
        and (call.target in ('metadata', 'folder', 'reserve') or call.name == 'unlink')
        # The space reserved for the index of a new file is required.
        and (call.target, call.name) not in (('reserve', 'create'), ('reserve', 'fallocate'))
    )


PAGE = Page(
    Path('docs/recordings/disk.md'),
    'Recordings on a disk that fails',
    f"""
Made by `make disk`.

**A call that fails.** A recording of {MESSAGES} messages, with flushes, splits, a ring, renewed
metadata and a close, is made with {len(SETTINGS)} settings. Each system call on its bag, whether
made by our code, by Python's files or by the C library, fails once, and in another recording
permanently, in each possible way. The calls are intercepted in the kernel (`seccomp_unotify(2)`)
and answered by another process. A short write really writes the first half. *EIO, pages lost*:
fsync fails, and the data written since the last successful fsync turns into zeros, as a kernel may
leave it. Permanently means that all later calls that can have this error fail too.

The requirements: no exception other than RecordingError; the recorder ends; its error is one line
with folder, reason and remedy; for each topic, received = recorded + dropped + discarded; messages
counted as recorded are in the bag byte for byte and in order, by our reader, and by rosbags if the
bag is complete; `linkage recover` loses no counted message; `metadata.yaml` is valid and names
existing files; no other file is left behind. A fault that does not harm the messages, such as a
half write or one failed renewal of the metadata, must not end the recording.

**A disk that fills.** tmpfs, and ext4 on a loop device, are filled by the recording and by another
process. *reserved* blocks are for root only, and there another user records. In addition to the
requirements above, with a floor of {FLOOR:,} bytes the recording must never leave less free space.
These are single recordings: a node begins another file when there is space again.

**A disk that stalls.** A node ticks at 1 kHz and records to an ext4 that is frozen in the kernel
(FIFREEZE), so that every write and fsync waits. Lateness is that of the ticks in the bag, relative
to the most punctual tick of the same second. A disk that stalls *permanently* is thawed when the
first thread of the node has ended: no process can leave the kernel before its disk responds.
""",
)

_VERDICTS = (COMPLETE, EARLY, AT_RECOVERY, REFUSED, LEFT)


def failing_tables(tried: Sequence[Tried]) -> list[Table]:
    """Return the outcomes of recordings with failing calls: by setting, by call, by fault."""
    by_setting = _verdicts('Calls that fail, by setting', 'setting')
    for setting in SETTINGS:
        group = [one for one in tried if one.setting == setting]
        if group:
            # The number of calls without a fault: a write in halves makes more.
            calls = 1 + max((one.injection.number for one in group if one.injection), default=-1)
            _add(by_setting, f'{setting} ({calls} calls)', group)
    _add(by_setting, 'all', tried)
    by_call = _verdicts('Calls that fail, by call', 'call')
    failed = [(one, one.failed_call) for one in tried]
    for target, name in sorted({(call.target, call.name) for _, call in failed if call}):
        group = [one for one, call in failed if call and call[:2] == (name, target)]
        _add(by_call, f'{name}, {target}', group)
    by_fault = _verdicts('Calls that fail, by fault', 'fault')
    for fault in FAULTS:
        for lasting in (False, True):
            group = [
                one
                for one in tried
                if one.injection and one.injection[1:] == (fault, lasting) and one.failed_call
            ]
            if group:
                _add(by_fault, f'{fault}, {"permanently" if lasting else "once"}', group)
    return [by_setting, by_call, by_fault]


def _verdicts(title: str, head: str) -> Table:
    return Table(title, (head, 'recordings', *_VERDICTS, 'with a fault'))


def _add(table: Table, name: str, group: Iterable[Tried]) -> None:
    group = list(group)
    counts = Counter(one.outcome.verdict for one in group)
    faults = sum(bool(one.outcome.faults) for one in group)
    numbers = [len(group), *(counts[verdict] for verdict in _VERDICTS), faults]
    table.rows.append([name, *(f'{number:,}' for number in numbers)])


PARTS = ('failing', 'filling', 'stalling')


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of this campaign."""
    parser.add_argument('--only', nargs='+', choices=PARTS, default=PARTS, help='only these')
    parser.add_argument('--every', type=int, default=1, help='only every n-th failing call')
    parser.add_argument('--messages', type=int, default=100_000, help='to a disk that fills')


def run(options: argparse.Namespace) -> Findings:
    """Let disks fail, and judge."""
    findings = Findings([], [])
    parts = {
        'failing': lambda: _fail(options.every, options.jobs),
        'filling': lambda: filling.fill_all(options.messages),
        'stalling': stalling.stall_all,
    }
    facts = [(package, metadata.version(package)) for package in ('mcap', 'rosbags')]
    for part in options.only:
        try:
            tables, faults = parts[part]()
        except NotPermittedError as error:  # noqa: PERF203
            facts.append((f'left out: {part}', str(error)))
        else:
            findings.tables.extend(tables)
            findings.faults.extend(faults)
    return findings._replace(facts=facts)


def _fail(every: int, jobs: int) -> tuple[list[Table], list[str]]:
    if why_not():
        raise NotPermittedError(why_not())
    work = [part for setting in SETTINGS for part in parts(setting, every)]
    progress = progress_lines(sum(len(part.injections) for part in work), 'failing calls')
    tried: list[Tried] = []
    for some in results_of(attempt, work, jobs):
        tried += some
        progress(len(some))
    faults = [f'{f}: {one.setting}, {one.injection}' for one in tried for f in one.outcome.faults]
    return failing_tables(tried), faults
