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
``python -m campaigns.disk``: recordings on a disk that fails, fills or stalls.

What was counted as recorded has to be there, what is not has to be said, and no tick may wait.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterable, Sequence
from datetime import datetime
from importlib import metadata
from math import isfinite
from pathlib import Path
import sys
import time

from bench.report import machine_table, say, show, Table, write_page
from campaigns.campaign import percentile_texts, progress_lines
from campaigns.disk import failing, filling, stalling
from campaigns.disk.failing import Tried
from campaigns.disk.filling import DISKS, Filled, FLOOR, NotPermittedError
from campaigns.disk.injection import FAULTS, why_not
from campaigns.disk.judge import AT_RECOVERY, EARLY, LEFT, MESSAGES, REFUSED, SETTINGS, WHOLE
from campaigns.disk.stalling import Stalled

INTRO = f"""\
Made by `make disk`.

**A call that fails.** A recording of {MESSAGES} messages, with flushes, splits, a ring, renewed
metadata and a close, in {len(SETTINGS)} settings. Each system call that it makes about its bag, be
it by our code, by Python's files or by the C library, fails once, and in another recording from
then on for ever, in each way that it can. The calls are intercepted in the kernel
(`seccomp_unotify(2)`) and answered by another process; a short write writes the first half for
real. *EIO, pages lost*: fsync fails, and what was written since the last one that succeeded turns
into zeros, as a kernel may leave it. For ever means all calls that the error can befall.

Judged each time: no exception but RecordingError comes out, and the recorder comes to its end;
what it says is one line with folder, reason and remedy; received = recorded + dropped + let go,
topic by topic; what is counted as recorded is in the bag byte for byte and in order, by our
reader, and by rosbags where the bag has its end; `linkage recover` loses nothing that was counted;
`metadata.yaml` is whole and names what is there; nothing is left lying about. A fault that does
the messages no harm, as a half write or a renewal of the metadata that fails once, must not end
the recording.

**A disk that fills.** tmpfs, and ext4 on a loop device, filled by the recording and by another
process; of *reserved* blocks only root may take, and the recording is not root's there. Besides
the above, with a floor of {FLOOR:,} bytes there must never be less free by the recording's doing.
These are single recordings: a node begins another file when there is space again.

**A disk that stalls.** A node ticks at 1 kHz and records to an ext4 that is frozen in the kernel
(FIFREEZE), so that every write and fsync waits. Lateness is that of the ticks in the bag, against
the most punctual one of the second about them. The disk that stalls *for ever* is thawed when the
node's first thread has ended: no process can leave the kernel before its disk answers.
"""

_VERDICTS = (WHOLE, EARLY, AT_RECOVERY, REFUSED, LEFT)


def failing_tables(tried: Sequence[Tried]) -> list[Table]:
    """Return what became of recordings with failing calls: by setting, by call, by fault."""
    by_setting = _verdicts('Calls that fail, by setting', 'setting')
    for setting in SETTINGS:
        group = [one for one in tried if one.setting == setting]
        if group:
            # As many as without a fault: a write in halves makes more of them.
            calls = 1 + max(one.injection.number for one in group if one.injection)
            _add(by_setting, f'{setting} ({calls} calls)', group)
    _add(by_setting, 'all', tried)
    by_call = _verdicts('Calls that fail, by call', 'call')
    struck = [(one, one.struck) for one in tried]
    for name in sorted({(s.what, s.name) for _, s in struck if s}):
        group = [one for one, s in struck if s and (s.what, s.name) == name]
        _add(by_call, f'{name[1]}, {name[0]}', group)
    by_fault = _verdicts('Calls that fail, by fault', 'fault')
    for fault in FAULTS:
        for lasting in (False, True):
            group = [
                one
                for one in tried
                if one.injection and one.injection[1:] == (fault, lasting) and one.struck
            ]
            if group:
                _add(by_fault, f'{fault}, {"for ever" if lasting else "once"}', group)
    return [by_setting, by_call, by_fault]


def filling_table(filled: Sequence[Filled]) -> Table:
    """Return what became of recordings on disks that filled."""
    table = Table(
        'Disks that fill',
        (
            'disk, storage',
            'filled by',
            'verdict',
            'received',
            'recorded',
            'let go',
            'least free, kB',
            'free at the end, kB',
            'faults',
        ),
    )
    for one in filled:
        outcome = one.outcome
        table.rows.append(
            (
                f'{one.disk}; {one.storage}',
                one.filler,
                outcome.verdict,
                *(f'{n:,}' for n in (outcome.offered, outcome.recorded, outcome.let_go)),
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
        (
            'stall',
            'ticks in the bag',
            'missing',
            'of these dropped',
            'lateness, µs: p50',
            'p99',
            'most',
            'during the stall: ticks',
            'p50',
            'p99',
            'most',
        ),
    )
    account = Table(
        'Disks that stall: messages',
        ('stall', 'received', 'recorded', 'dropped', 'node ended after, s', 'says', 'faults'),
    )
    for run in runs:
        dropped = run.account.get('dropped', {}).get('/joint_states', 0)
        ticks.rows.append(
            (
                run.plan.name,
                f'{run.ticks:,}',
                f'{run.gaps:,}',
                f'{dropped:,}' if run.account else '',
                *percentile_texts([t / 1e3 for t in run.lateness], 0),
                f'{run.during:,}',
                *percentile_texts([t / 1e3 for t in run.lateness_during], 0),
            )
        )
        account.rows.append(
            (
                run.plan.name,
                *(
                    f'{run.total(word):,}' if run.account else ''
                    for word in ('received', 'recorded', 'dropped')
                ),
                f'{run.ended:.1f}' if run.ended and isfinite(run.ended) else '',
                run.said.partition(', /linkage_node')[0],
                '; '.join(run.faults) or 'none',
            )
        )
    return [ticks, account]


def _verdicts(title: str, head: str) -> Table:
    return Table(title, (head, 'recordings', *_VERDICTS, 'with a fault'))


def _add(table: Table, name: str, group: Iterable[Tried]) -> None:
    group = list(group)
    counts = Counter(one.outcome.verdict for one in group)
    faults = sum(bool(one.outcome.faults) for one in group)
    numbers = [len(group), *(counts[verdict] for verdict in _VERDICTS), faults]
    table.rows.append([name, *(f'{number:,}' for number in numbers)])


PAGE = Path('docs/recordings/disk.md')
PARTS = ('failing', 'filling', 'stalling')


def main() -> int:
    """Let disks fail, and judge; 1 where a verdict is a fault."""
    parser = argparse.ArgumentParser('python -m campaigns.disk', description=__doc__)
    parser.add_argument('--only', nargs='+', choices=PARTS, default=PARTS, help='only these')
    parser.add_argument('--every', type=int, default=1, help='only every so manyth failing call')
    parser.add_argument('--messages', type=int, default=100_000, help='to a disk that fills')
    parser.add_argument('--jobs', type=int, default=2, help='processes')
    parser.add_argument('--write', action='store_true', help=f'keep the outcome in {PAGE}')
    given = parser.parse_args()
    started, begin = time.monotonic(), datetime.now().astimezone()
    tables: list[Table] = []
    faults: list[str] = []
    skipped: list[tuple[str, str]] = []
    doing = {
        'failing': lambda: _fail(given.every, given.jobs, faults),
        'filling': lambda: _fill(given.messages, faults),
        'stalling': lambda: _stall(faults),
    }
    try:
        for part in PARTS:
            if part in given.only:
                try:
                    tables += doing[part]()
                except NotPermittedError as error:
                    skipped.append((f'left out: {part}', str(error)))
    except KeyboardInterrupt:
        say('stopped')
        return 130
    tables.append(
        machine_table(
            begin,
            ('mcap', metadata.version('mcap')),
            ('rosbags', metadata.version('rosbags')),
            ('took', f'{time.monotonic() - started:.0f} s, {given.jobs} processes'),
            *skipped,
        )
    )
    for table in tables:
        show(table)
    for fault in faults:
        say(fault)
    if given.write:
        write_page(PAGE, 'Recordings on a disk that fails', INTRO, tables)
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
    sys.exit(main())
