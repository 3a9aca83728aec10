# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
``python -m campaigns.disk``: recordings on a disk that fails, fills or stalls.

Messages counted as recorded have to be in the bag, losses have to be reported, and no tick may
wait for the disk.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from datetime import datetime
from importlib import metadata
from math import isfinite
from pathlib import Path
import sys
import time

from bench.report import machine_table, say, Table
from campaigns.campaign import (
    exit_code,
    Page,
    parser_of,
    percentile_texts,
    progress_lines,
    publish,
)
from campaigns.disk import failing, filling, stalling
from campaigns.disk.failing import Tried
from campaigns.disk.filling import DISKS, Filled, FLOOR, NotPermittedError
from campaigns.disk.injection import FAULTS, why_not
from campaigns.disk.judge import AT_RECOVERY, COMPLETE, EARLY, LEFT, MESSAGES, REFUSED, SETTINGS
from campaigns.disk.stalling import Stalled

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
            calls = 1 + max(one.injection.number for one in group if one.injection)
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


def filling_table(filled: Sequence[Filled]) -> Table:
    """Return the outcomes of recordings on disks that fill."""
    table = Table(
        'Disks that fill',
        ('disk, storage', 'filled by', 'verdict', 'received', 'recorded',
         'removed by the ring', 'least free, kB', 'free at the end, kB', 'faults'),
    )  # fmt: skip
    for one in filled:
        outcome = one.outcome
        table.rows.append(
            (
                f'{one.disk}; {one.storage}',
                one.filler,
                outcome.verdict,
                *(f'{n:,}' for n in (outcome.offered, outcome.recorded, outcome.discarded)),
                f'{one.least_free / 1e3:,.0f}',
                f'{one.free / 1e3:,.0f}',
                '; '.join(outcome.faults) or 'none',
            )
        )
    return table


def stalling_tables(runs: Sequence[Stalled]) -> list[Table]:
    """Return the outcome for the ticks and for the messages."""
    ticks = Table(
        'Disks that stall: ticks',
        ('stall', 'ticks in the bag', 'missing', 'of these dropped', 'lateness, µs: p50',
         'p99', 'most', 'during the stall: ticks', 'p50', 'p99', 'most'),
    )  # fmt: skip
    messages = Table(
        'Disks that stall: messages',
        ('stall', 'received', 'recorded', 'dropped', 'node ended after, s', 'last line', 'faults'),
    )
    for run in runs:
        dropped = run.counts.get('dropped', {}).get('/joint_states', 0)
        ticks.rows.append(
            (
                run.plan.name,
                f'{run.ticks:,}',
                f'{run.gaps:,}',
                f'{dropped:,}' if run.counts else '',
                *percentile_texts([t / 1e3 for t in run.lateness], 0),
                f'{run.during:,}',
                *percentile_texts([t / 1e3 for t in run.lateness_during], 0),
            )
        )
        messages.rows.append(
            (
                run.plan.name,
                *(
                    f'{run.total(kind):,}' if run.counts else ''
                    for kind in ('received', 'recorded', 'dropped')
                ),
                f'{run.ended:.1f}' if run.ended and isfinite(run.ended) else '',
                run.last_line.partition(', /linkage_node')[0],
                '; '.join(run.faults) or 'none',
            )
        )
    return [ticks, messages]


def _verdicts(title: str, head: str) -> Table:
    return Table(title, (head, 'recordings', *_VERDICTS, 'with a fault'))


def _add(table: Table, name: str, group: Iterable[Tried]) -> None:
    group = list(group)
    counts = Counter(one.outcome.verdict for one in group)
    faults = sum(bool(one.outcome.faults) for one in group)
    numbers = [len(group), *(counts[verdict] for verdict in _VERDICTS), faults]
    table.rows.append([name, *(f'{number:,}' for number in numbers)])


PARTS = ('failing', 'filling', 'stalling')


def main() -> int:
    """Let disks fail, and judge; return 1 if there are faults."""
    parser = parser_of('disk', __doc__, page=PAGE, seed=False)
    parser.add_argument('--only', nargs='+', choices=PARTS, default=PARTS, help='only these')
    parser.add_argument('--every', type=int, default=1, help='only every n-th failing call')
    parser.add_argument('--messages', type=int, default=100_000, help='to a disk that fills')
    options = parser.parse_args()
    started, begin = time.monotonic(), datetime.now().astimezone()
    tables: list[Table] = []
    faults: list[str] = []
    skipped: list[tuple[str, str]] = []
    parts = {
        'failing': lambda: _fail(options.every, options.jobs, faults),
        'filling': lambda: _fill(options.messages, faults),
        'stalling': lambda: _stall(faults),
    }
    for part in PARTS:
        if part in options.only:
            try:
                tables += parts[part]()
            except NotPermittedError as error:
                skipped.append((f'left out: {part}', str(error)))
    versions = [(package, metadata.version(package)) for package in ('mcap', 'rosbags')]
    took = f'{time.monotonic() - started:.0f} s, {options.jobs} processes'
    tables.append(machine_table(begin, *versions, ('took', took), *skipped))
    publish(tables, PAGE if options.write else None)
    for fault in faults:
        say(fault)
    return int(bool(faults))


def _fail(every: int, jobs: int, faults: list[str]) -> list[Table]:
    if why_not():
        raise NotPermittedError(why_not())
    work = [part for setting in SETTINGS for part in failing.parts(setting, every)]
    progress = progress_lines(sum(len(part.injections) for part in work), 'failing calls')
    tried: list[Tried] = []
    for some in failing.attempts(work, jobs):
        tried += some
        progress(len(some))
    for one in tried:
        faults += [f'{f}: {one.setting}, {one.injection}' for f in one.outcome.faults]
    return failing_tables(tried)


def _fill(messages: int, faults: list[str]) -> list[Table]:
    filled = []
    cases = [*filling.cases(DISKS)]
    for case in cases:
        filled.append(filling.fill(*case, messages))
        faults += [f'{fault}: {filled[-1][:3]}' for fault in filled[-1].outcome.faults]
        say(f'{len(filled)} of {len(cases)} disks that fill')
    return [filling_table(filled)]


def _stall(faults: list[str]) -> list[Table]:
    runs = []
    for plan in stalling.PLANS:
        say(f'a disk that stalls: {plan.name}')
        runs.append(stalling.run(plan, frozen=True))
        faults += [f'{fault}: {plan.name}' for fault in runs[-1].faults]
    return stalling_tables(runs)


if __name__ == '__main__':
    sys.exit(exit_code(main))
