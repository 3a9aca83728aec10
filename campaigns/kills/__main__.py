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
``python -m campaigns.kills``: recordings at 1 kHz, killed at random instants by SIGKILL.

What is left has to be readable, the beginning of what was offered without a false message, and
short of it by the flush period and one tick at most.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Sequence
from datetime import datetime
from importlib import metadata
from pathlib import Path
import sys
import time

from bench.report import machine_table, say, show, Table, write_page
from campaigns.campaign import percentile_texts, progress_lines
from campaigns.kills.plan import FLUSH_PERIODS, Phase, plans
from campaigns.kills.run import (
    FAULT,
    GONE_FILE,
    KillError,
    NEXT_FILE,
    NO_FILE,
    NO_FOLDER,
    Outcome,
    run,
)

INTRO = """\
Made by `make kills`: recordings at 1 kHz, a crank's and joint states, each by a process of its
own, killed by SIGKILL at random instants from before the folder is made to after the close, and
some more aimed at what takes milliseconds only. Compression, splits, rings and flush periods are
drawn for each. Every message is made of its number and the time at which it was offered, so that
what a bag holds is compared byte by byte with what was offered: it has to be all of it from the
first message on, or in a ring from the first that was kept, up to some last one, and never
less than what a flush had brought to the disk. What is recovered of it is read by rosbags too.

- *by SIGKILL*: age at the kill of the oldest message that is missing. What the system was given
  survives the process. The bound is the flush period and one tick.
- *taken as it was*: with the longest tick of that time for the one tick, since a machine may hold
  a process up, and with the time of flushes and splits in it: a message that comes while the disk
  is waited for is given to the system after that.
- *by a power cut*: age of the oldest message that no flush had brought to the disk by then.
"""

_PHASES = {
    Phase.STARTING: 'before the folder',
    Phase.MAKING: 'making the bag',
    Phase.RECORDING: 'recording',
    Phase.FLUSHING: 'in a flush',
    Phase.SPLITTING: 'in a split',
    Phase.CLOSING: 'in the close',
    Phase.CLOSED: 'after the close',
}
_NO_WHOLE_FILE = 'folder, no whole file'


def tables(outcomes: Sequence[Outcome]) -> list[Table]:
    """Return the tables of what came of the kills."""
    return [_phases(outcomes), _verdicts(outcomes), _losses(outcomes)]


def is_beyond(outcome: Outcome) -> bool:
    """Say whether more was lost than the bound allows, tick and disk taken as they were."""
    return outcome.excess > 0


def _phase(outcome: Outcome) -> str:
    said = outcome.verdicts['bag']
    if said == NO_FOLDER:
        return _PHASES[Phase.STARTING]
    return _NO_WHOLE_FILE if said == NO_FILE else _PHASES[outcome.phase]


def _phases(outcomes: Sequence[Outcome]) -> Table:
    table = Table(
        'Kills, by what the recording was doing',
        (
            '',
            'kills',
            'messages offered',
            'found',
            'let go',
            'lost',
            'metadata.yaml.tmp left',
            NEXT_FILE,
            GONE_FILE,
        ),
    )
    names = list(_PHASES.values())
    names.insert(1, _NO_WHOLE_FILE)
    groups = [(name, [o for o in outcomes if _phase(o) == name]) for name in names]
    for name, group in [*groups, ('all', list(outcomes))]:
        offered, found, gone = (
            sum(getattr(outcome, what) for outcome in group)
            for what in ('offered', 'found', 'let_go')
        )
        left = Counter(each for outcome in group for each in outcome.leftovers)
        counts = [len(group), offered, found, gone, offered - found - gone]
        counts += [left['metadata.yaml.tmp'], left[NEXT_FILE], left[GONE_FILE]]
        table.rows.append([name, *(f'{count:,}' for count in counts)])
    return table


def _verdicts(outcomes: Sequence[Outcome]) -> Table:
    counts = Counter(
        (what, said[:80]) for outcome in outcomes for what, said in outcome.verdicts.items()
    )
    table = Table('Verdicts', ('', 'kills'))
    order = {'bag': 0, 'metadata': 1, 'recovered': 2}
    for what, said in sorted(counts, key=lambda k: (not k[1].startswith(FAULT), order[k[0]], k)):
        table.rows.append((f'{what}: {said}', f'{counts[what, said]:,}'))
    faults = sum(bool(outcome.faults) for outcome in outcomes)
    table.rows.append(('kills with a fault', f'{faults:,}'))
    return table


def _losses(outcomes: Sequence[Outcome]) -> Table:
    table = Table(
        'What was lost, in ms, of recordings that were not closed',
        (
            'flush period',
            'kills',
            'by SIGKILL: p50',
            'p99',
            'most',
            'bound',
            'above it',
            'above it, taken as it was',
            'by a power cut: p50',
            'p99',
            'most',
        ),
    )
    lossy = [o for o in outcomes if Phase.MAKING < o.phase < Phase.CLOSED and o.offered]
    for period in FLUSH_PERIODS:
        group = [o for o in lossy if o.plan.storage.flush_period == period]
        if not group:
            continue
        table.rows.append(
            [
                f'{1e3 * period:g}',
                f'{len(group):,}',
                *percentile_texts([o.loss / 1e6 for o in group], 1),
                f'{1e3 * period + 1:g}',
                f'{sum(o.strict_excess > 0 for o in group):,}',
                f'{sum(map(is_beyond, group)):,}',
                *percentile_texts([o.power_loss / 1e6 for o in group], 1),
            ]
        )
    return table


PAGE = Path('docs/recordings/kills.md')


def main() -> int:
    """Kill and judge; 1 where a verdict is a fault, or more was lost than may be."""
    parser = argparse.ArgumentParser('python -m campaigns.kills', description=__doc__)
    parser.add_argument('--kills', type=int, default=1000, help='at any instant')
    parser.add_argument('--aimed', type=int, default=400, help='at what takes milliseconds only')
    parser.add_argument(
        '--seconds', type=float, nargs=2, default=(0.2, 3.0), help='shortest and longest run'
    )
    parser.add_argument('--jobs', type=int, default=4, help='recordings at once')
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--write', action='store_true', help=f'keep the outcome in {PAGE}')
    given = parser.parse_args()
    started, begin = time.monotonic(), datetime.now().astimezone()
    work = plans(given.seed, given.kills, given.aimed, (given.seconds[0], given.seconds[1]))
    outcomes = []
    progress = progress_lines(len(work), 'kills')
    try:
        for outcome in run(work, given.jobs):
            outcomes.append(outcome)
            progress(1)
    except KeyboardInterrupt:
        say('stopped')
        return 130
    except KillError as error:
        print(f'kills: {error}', file=sys.stderr)
        return 1
    outcomes.sort(key=lambda outcome: outcome.plan.number)
    for outcome in outcomes:
        for fault in outcome.faults:
            say(f'{fault}: {outcome.plan}')
        if is_beyond(outcome):
            say(f'lost for {outcome.excess / 1e6:.1f} ms more than may be: {outcome.plan}')
    seconds = time.monotonic() - started
    machine = machine_table(
        begin,
        ('mcap', metadata.version('mcap')),
        ('rosbags', metadata.version('rosbags')),
        ('seed', str(given.seed)),
        ('kills', f'{given.kills:,} at any instant, {given.aimed:,} aimed'),
        ('took', f'{seconds:.0f} s, {given.jobs} at once'),
    )
    found = [*tables(outcomes), machine]
    for table in found:
        show(table)
    if given.write:
        write_page(PAGE, 'Recordings that are killed', INTRO, found)
    return int(any(outcome.faults or is_beyond(outcome) for outcome in outcomes))


if __name__ == '__main__':
    sys.exit(main())
