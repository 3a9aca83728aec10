# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
``python -m campaigns.kills``: recordings at 1 kHz, killed at random instants by SIGKILL.

The bag has to be readable and to begin with the offered messages, without a false one. At most the
messages of the last flush period and one tick may be lost.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from datetime import datetime
from importlib import metadata
from pathlib import Path
import sys

from bench.report import say, Table
from campaigns.campaign import (
    exit_code,
    machine_of,
    Page,
    parser_of,
    percentile_texts,
    progress_lines,
    publish,
)
from campaigns.kills.plan import FLUSH_PERIODS, Phase, plans
from campaigns.kills.run import (
    FAULT,
    KillError,
    NEXT_FILE,
    NO_FILE,
    NO_FOLDER,
    OLD_FILE,
    Outcome,
    run,
)

PAGE = Page(
    Path('docs/recordings/kills.md'),
    'Recordings that are killed',
    """
Made by `make kills`. Recordings of crank samples and joint states at 1 kHz, each in its own
process, are killed by SIGKILL at random instants from before the folder is made to after the
close. More kills are aimed at phases that last only milliseconds. Compression, splits, rings and
flush periods are drawn at random. The bytes of every message contain its number and its time, so
the bag is compared byte by byte with the offered messages. It has to hold all messages from the
first one, or from the first one that the ring kept, up to some last one, and at least all messages
that a flush had brought to the disk. The recovered bag is read by rosbags too.

- *by SIGKILL*: age at the kill of the oldest lost message. Data that was given to the system
  survives the process. The bound is the flush period and one tick.
- *above it, with delays*: losses above the sum of the flush period, the longest tick and the time
  of flushes and splits. A busy machine may hold a process up, and a message that arrives while the
  recorder waits for the disk is given to the system afterwards.
- *by a power cut*: age of the oldest message that no flush had brought to the disk.
""",
)

_PHASES = {
    Phase.STARTING: 'before the folder',
    Phase.MAKING: 'making the bag',
    Phase.RECORDING: 'recording',
    Phase.FLUSHING: 'in a flush',
    Phase.SPLITTING: 'in a split',
    Phase.CLOSING: 'in the close',
    Phase.CLOSED: 'after the close',
}
_NO_COMPLETE_FILE = 'folder, no complete file'


def tables(outcomes: Sequence[Outcome]) -> list[Table]:
    """Return the tables of the outcomes."""
    return [_phases(outcomes), _verdicts(outcomes), _losses(outcomes)]


def is_beyond(outcome: Outcome) -> bool:
    """Return whether the loss is above the bound with the longest tick and the disk's time."""
    return outcome.excess > 0


def _phase(outcome: Outcome) -> str:
    verdict = outcome.verdicts['bag']
    if verdict == NO_FOLDER:
        return _PHASES[Phase.STARTING]
    return _NO_COMPLETE_FILE if verdict == NO_FILE else _PHASES[outcome.phase]


def _phases(outcomes: Sequence[Outcome]) -> Table:
    table = Table(
        'Kills by phase of the recording',
        (
            '',
            'kills',
            'messages offered',
            'found',
            'removed by the ring',
            'lost',
            'metadata.yaml.tmp left',
            NEXT_FILE,
            OLD_FILE,
        ),
    )
    names = list(_PHASES.values())
    names.insert(1, _NO_COMPLETE_FILE)
    groups = [(name, [o for o in outcomes if _phase(o) == name]) for name in names]
    for phase, group in [*groups, ('all', list(outcomes))]:
        offered, found, removed = (
            sum(getattr(outcome, name) for outcome in group)
            for name in ('offered', 'found', 'discarded')
        )
        left = Counter(each for outcome in group for each in outcome.leftovers)
        counts = [len(group), offered, found, removed, offered - found - removed]
        counts += [left['metadata.yaml.tmp'], left[NEXT_FILE], left[OLD_FILE]]
        table.rows.append([phase, *(f'{count:,}' for count in counts)])
    return table


def _verdicts(outcomes: Sequence[Outcome]) -> Table:
    counts = Counter(
        (of, text[:80]) for outcome in outcomes for of, text in outcome.verdicts.items()
    )
    table = Table('Verdicts', ('', 'kills'))
    order = {'bag': 0, 'metadata': 1, 'recovered': 2}
    for of, text in sorted(counts, key=lambda k: (not k[1].startswith(FAULT), order[k[0]], k)):
        table.rows.append((f'{of}: {text}', f'{counts[of, text]:,}'))
    faults = sum(bool(outcome.faults) for outcome in outcomes)
    table.rows.append(('kills with a fault', f'{faults:,}'))
    return table


def _losses(outcomes: Sequence[Outcome]) -> Table:
    table = Table(
        'Losses of recordings that were not closed, in ms',
        ('flush period', 'kills', 'by SIGKILL: p50', 'p99', 'most', 'bound', 'above it',
         'above it, with delays', 'by a power cut: p50', 'p99', 'most'),
    )  # fmt: skip
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


def main() -> int:
    """Kill and judge; return 1 if a verdict is a fault, or a loss is above the bound."""
    parser = parser_of('kills', __doc__, page=PAGE, jobs=4)
    parser.add_argument('--kills', type=int, default=1000, help='at any instant')
    parser.add_argument('--aimed', type=int, default=400, help='aimed at short phases')
    parser.add_argument(
        '--seconds', type=float, nargs=2, default=(0.2, 3.0), help='shortest and longest run'
    )
    options = parser.parse_args()
    begin = datetime.now().astimezone()
    shortest, longest = options.seconds
    work = plans(options.seed, options.kills, options.aimed, (shortest, longest))
    outcomes = []
    progress = progress_lines(len(work), 'kills')
    try:
        for outcome in run(work, options.jobs):
            outcomes.append(outcome)
            progress(1)
    except KillError as error:
        print(f'kills: {error}', file=sys.stderr)
        return 1
    outcomes.sort(key=lambda outcome: outcome.plan.number)
    for outcome in outcomes:
        for fault in outcome.faults:
            say(f'{fault}: {outcome.plan}')
        if is_beyond(outcome):
            say(f'loss {outcome.excess / 1e6:.1f} ms above the bound: {outcome.plan}')
    versions = [(package, metadata.version(package)) for package in ('mcap', 'rosbags')]
    machine = machine_of(begin, options, 'kills', len(work), *versions)
    publish([*tables(outcomes), machine], PAGE if options.write else None)
    return int(any(outcome.faults or is_beyond(outcome) for outcome in outcomes))


if __name__ == '__main__':
    sys.exit(exit_code(main))
