# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Kill recordings at any instant, and compare each bag with the messages that were offered.

The recording is a forked process. It marks its progress in memory that it shares with this one,
which survives the kill: only aligned numbers, each stored by one instruction.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
import ctypes
from dataclasses import dataclass, field
from functools import partial
from importlib import metadata
from itertools import pairwise
import json
import mmap
import os
from pathlib import Path
from random import Random
import select
import signal
import socket
import sys
from tempfile import TemporaryDirectory
from time import monotonic, monotonic_ns, sleep
from typing import Any, ClassVar, NamedTuple

from bench.report import Table
from campaigns.campaign import Findings, Page, percentile_texts, progress_lines, results_of
from campaigns.reliability.judge import Expectation, FAULT, read, read_metadata, recover
from campaigns.reliability.processes import forked
from campaigns.reliability.recording import (
    expected,
    message,
    NumberedMessage,
    Phase,
    record,
    TOPICS,
    WatchedWriter,
)
from linkage_ros.bag import (
    BagMessage,
    COMPRESSIONS,
    DISCARDED,
    METADATA_FILE,
    Recorder,
    Storage,
    UNFINISHED,
)

PERIOD_NS = 1_000_000
"""Period of the ticks: 1 kHz."""

FLUSH_PERIODS = (0.05, 0.1, 0.25, 0.5, 1.0)  # [s]


class Plan(NamedTuple):
    """
    One kill of a recording with some storage options, which would end after a number of ticks.

    It comes after a delay in [s] from the beginning of a phase, at its occurrence ``time``, from
    1; MAKING, the first phase, aims at any instant.
    """

    number: int
    storage: Storage
    ticks: int
    aim: Phase
    time: int
    delay: float


AIMS: Mapping[Phase, float] = {
    # The longest delay from the beginning of a phase [s], twice its duration on a fast disk.
    Phase.MAKING: 0.008,
    Phase.FLUSHING: 0.002,
    Phase.SPLITTING: 0.010,
    Phase.CLOSING: 0.006,
}


def plans(seed: int, kills: int, aimed: int, seconds: tuple[float, float]) -> list[Plan]:
    """Return kills at random instants, then kills aimed at short phases; runs last ``seconds``."""
    return [
        _plan(Random(f'{seed} {index}'), index, aimed=index >= kills, seconds=seconds)
        for index in range(kills + aimed)
    ]


def _plan(random: Random, number: int, *, aimed: bool, seconds: tuple[float, float]) -> Plan:
    run = random.uniform(*seconds)
    phases = [*AIMS]
    aim = phases[number % len(phases)] if aimed else Phase.MAKING
    kinds = ['', 'bytes', 'seconds']
    if aim is Phase.SPLITTING:
        kinds, run = kinds[1:], seconds[1]
    split = random.choice(kinds)
    storage = Storage(
        flush_period=random.choice(FLUSH_PERIODS),
        split_bytes=random.randrange(20_000, 120_000) if split == 'bytes' else 0,
        split_seconds=random.uniform(0.05, 0.4) if split == 'seconds' else 0.0,
        keep_files=random.choice([0, 2, 3]) if split else 0,
        compression=random.choice(COMPRESSIONS),
    )
    delay = random.uniform(0.0, AIMS[aim] if aimed else run + 0.1)
    time = random.randrange(1, 5) if aim in (Phase.FLUSHING, Phase.SPLITTING) else 1
    return Plan(number, storage, round(run * 1e9 / PERIOD_NS), aim, time, delay)


_MOST_PAUSES = 256
_PHASES = 8
_DISK_PHASES = (Phase.FLUSHING, Phase.SPLITTING, Phase.CLOSING)
"""Phases in which the recorder waits for the disk and takes no messages."""


class Marks(ctypes.Structure):
    """The marks of one recording, which both processes see."""

    # Number of messages: offered to the recorder, with the current one; and brought to the disk by
    # a flush, a split or the close.
    offered: int
    safe: int
    ticks: int  # Number of ticks begun
    state: int
    pauses: int
    ends_of_pauses: Any
    times: memoryview
    _fields_: ClassVar = [
        *((name, ctypes.c_int64) for name in ('state', 'offered', 'safe', 'ticks', 'pauses')),
        ('ends_of_pauses', 2 * ctypes.c_int64 * _MOST_PAUSES),
    ]

    @classmethod
    def make(cls, ticks: int) -> Marks:
        """Return marks for a number of ticks."""
        size = ctypes.sizeof(cls)
        memory = mmap.mmap(-1, size + 8 * ticks)
        marks = cls.from_buffer(memory)
        # Begin of each tick, in [ns] of the steady clock; 0 before.
        marks.times = memoryview(memory)[size:].cast('q')
        return marks

    @property
    def phase(self) -> Phase:
        """Return the current phase, or the one in which the process was killed."""
        return Phase(self.state % _PHASES)

    def begin_tick(self) -> int:
        """Mark the begin of a tick; return its time in [ns]."""
        self.times[self.ticks] = now = monotonic_ns()
        self.ticks += 1
        return now

    def enter(self, phase: Phase, written: int = 0) -> int:
        """Mark the begin of a phase, with the messages written; return its time in [ns]."""
        now = monotonic_ns()
        since, before = divmod(self.state, _PHASES)
        if before in _DISK_PHASES:
            self.safe = written
        # One number, so that a kill cannot come between phase and time.
        self.state = now * _PHASES + phase
        if before in _DISK_PHASES:
            self.ends_of_pauses[self.pauses % _MOST_PAUSES][:] = since, now
            self.pauses += 1
        return now

    def paused(self, begin: int, end: int) -> int:
        """Return the time, in [ns], that the recorder waited for the disk within an interval."""
        pauses = [tuple(ends) for ends in self.ends_of_pauses[: min(self.pauses, _MOST_PAUSES)]]
        since, phase = divmod(self.state, _PHASES)
        if phase in _DISK_PHASES:
            pauses.append((since, end))
        return sum(max(0, min(end, until) - max(begin, since)) for since, until in pauses)

    def messages(self) -> list[BagMessage]:
        """Return the offered messages, as they have to be in the bag."""
        return [expected(index, self.times[index // len(TOPICS)]) for index in range(self.offered)]


NO_FOLDER = 'no folder yet'
NO_FILE = 'no complete file yet, reported'
NEXT_FILE = 'next file not yet in the metadata'
OLD_FILE = 'old file no longer in the metadata'


@dataclass(slots=True)
class Outcome:
    """The outcome of one recording."""

    plan: Plan  # The plan of the kill
    phase: Phase  # The phase in which it was killed
    # Numbers of messages: offered to the recorder, in the bag, and in files that the ring removed.
    offered: int = 0
    found: int = 0
    discarded: int = 0
    loss: int = 0  # Age at the kill of the oldest lost message [ns]; 0 for none
    # Age of the oldest message that no flush had brought to the disk: the greatest loss by a power
    # cut at this instant [ns].
    power_loss: int = 0
    # Time within `loss` in which the recorder waited for the disk: flushes, splits, close [ns].
    paused: int = 0
    tick: int = PERIOD_NS  # The longest tick within `loss` [ns]
    # The verdicts on the bag, on its metadata, and on the recovered bag.
    verdicts: dict[str, str] = field(default_factory=dict)
    leftovers: list[str] = field(default_factory=list)  # Other files in the folder

    @property
    def strict_excess(self) -> int:
        """Return the excess of the loss over the flush period and one tick [ns]."""
        return self.loss - round(self.plan.storage.flush_period * 1e9) - PERIOD_NS

    @property
    def excess(self) -> int:
        """Return the excess over the flush period, the longest tick and the disk's time [ns]."""
        return self.strict_excess + PERIOD_NS - self.tick - self.paused

    @property
    def faults(self) -> list[str]:
        """Return the verdicts that are violations."""
        return [f'{of}: {text}' for of, text in self.verdicts.items() if text.startswith(FAULT)]


def judge(plan: Plan, folder: Path, marks: Marks, killed: int) -> Outcome:
    """Judge the bag after a kill at a time in [ns] of the steady clock."""
    outcome = Outcome(plan, marks.phase, offered=marks.offered)
    begun = marks.phase > Phase.MAKING
    if not folder.exists():
        outcome.verdicts['bag'] = f'{FAULT}no folder' if begun else NO_FOLDER
        return outcome
    offered = Expectation(marks.messages())
    messages = _read(outcome, folder, marks, offered)
    if messages is not None:
        _measure(outcome, marks, killed)
    elif begun and not outcome.faults:
        outcome.verdicts['bag'] = f'{FAULT}no complete file, although recording had begun'
    outcome.verdicts['metadata'] = _metadata(outcome, folder)
    outcome.verdicts['recovered'] = _recovered(outcome, folder, messages or [], marks, offered)
    return outcome


def _read(
    outcome: Outcome, folder: Path, marks: Marks, offered: Expectation
) -> list[BagMessage] | None:
    """Read the bag; return its messages, or None without a complete file."""
    reading = read(folder, allow_truncated=True)
    bag = reading.whole
    if bag is None:
        outcome.verdicts['bag'] = FAULT + reading.fault if reading.fault else NO_FILE
        return None
    outcome.found = len(reading.messages)
    outcome.discarded = sum(json.loads(bag.custom.get(DISCARDED, '{}')).values())
    end = outcome.discarded + outcome.found
    run = offered.run_of(reading.messages)
    if run is None or (run and run.start != outcome.discarded):
        verdict = f'{FAULT}a false message'
    elif end < marks.safe:
        verdict = f'{FAULT}{marks.safe - end} flushed messages lost'
    elif marks.phase is Phase.CLOSED and (bag.truncated or UNFINISHED in bag.custom):
        verdict = f'{FAULT}closed, but not finished'
    elif bag.truncated:
        verdict = 'a beginning, truncation reported'
    elif UNFINISHED in bag.custom:
        verdict = 'complete files, marked as unfinished'
    else:
        verdict = f'{FAULT}finished, but incomplete' if end < marks.offered else 'finished'
    outcome.verdicts['bag'] = verdict
    return reading.messages


def _measure(outcome: Outcome, marks: Marks, killed: int) -> None:
    """Measure the loss by the kill, and the greatest loss by a power cut."""
    # A tick may have begun between reading the clock and the kill.
    killed = max(killed, marks.times[marks.ticks - 1] if marks.ticks else 0)

    def age(number: int) -> int:
        return killed - marks.times[number // len(TOPICS)] if number < marks.offered else 0

    first = outcome.discarded + outcome.found
    outcome.loss, outcome.power_loss = age(first), age(marks.safe)
    if outcome.loss:
        outcome.paused = marks.paused(killed - outcome.loss, killed)
        tick, end = first // len(TOPICS), marks.ticks
        times = [*marks.times[tick:end], killed]
        outcome.tick = max(PERIOD_NS, *(after - before for before, after in pairwise(times)))


def _metadata(outcome: Outcome, folder: Path) -> str:
    """Judge ``metadata.yaml``: valid, and every name and count in it has its file and messages."""
    files = {file.name for file in folder.glob('*.mcap')}
    others = {file.name for file in folder.iterdir()} - files
    outcome.leftovers += sorted(others - {METADATA_FILE})
    if METADATA_FILE not in others:
        return f'{FAULT}none' if outcome.phase > Phase.MAKING else 'none yet'
    listed = read_metadata(folder)
    if listed.fault:
        return FAULT + listed.fault
    if listed.messages > outcome.found:
        return f'{FAULT}counts {listed.messages} messages, {outcome.found} exist'
    newest = max(map(_number, listed.files))
    outcome.leftovers += [
        NEXT_FILE if _number(name) > newest else OLD_FILE
        for name in sorted(files.difference(listed.files))
    ]
    return 'valid, names existing files'


def _number(name: str) -> int:
    """Return the number in the name of a bag's file."""
    return int(Path(name).stem.rpartition('_')[2])


def _recovered(
    outcome: Outcome,
    folder: Path,
    messages: Sequence[BagMessage],
    marks: Marks,
    offered: Expectation,
) -> str:
    """Recover the bag, and compare the result with what was read."""
    recovered = recover(folder)
    if recovered.fault:
        return FAULT + recovered.fault
    if recovered.error:
        empty = not messages and not marks.safe
        return 'nothing to recover, reported' if empty else f'{FAULT}nothing recovered'
    if recovered.messages == messages:
        return 'the same messages'
    # The ring had not yet removed an old file, or the next file was not yet in the metadata.
    run = offered.run_of(recovered.messages)
    end = outcome.discarded + outcome.found
    if run and run.start <= outcome.discarded and run.stop >= end:
        return 'the same and older messages, from an old file of the ring'
    return f'{FAULT}other messages'


_PATIENCE = 30.0
"""Time limit for a process to reach the awaited phase [s]."""

_SWITCH_INTERVAL = 1e-4  # as the node has it [s]


class KillError(Exception):
    """A recording ended before its kill."""


def kill(plan: Plan) -> Outcome:
    """Start a recording, kill it as planned, and judge."""
    with TemporaryDirectory(prefix='linkage_ros_kill_') as name:
        folder, marks = Path(name) / 'bag', Marks.make(plan.ticks)
        with forked(partial(_record, plan, folder, marks)) as (process, phases):
            if end := _wait_for(plan, phases):
                raise KillError(end)
            sleep(plan.delay)
            killed = monotonic_ns()
            os.kill(process, signal.SIGKILL)
        return judge(plan, folder, marks, killed)


class _Announcer:
    """Marks each phase, and sends it to the process that kills."""

    def __init__(self, marks: Marks, phases: socket.socket) -> None:
        self._marks, self._phases = marks, phases

    def enter(self, phase: Phase, written: int) -> None:
        self._phases.send(bytes([phase]))
        self._marks.enter(phase, written)


def _record(plan: Plan, folder: Path, marks: Marks, phases: socket.socket) -> None:
    """Record at 1 kHz, close, and wait to be killed."""
    sys.setswitchinterval(_SWITCH_INTERVAL)
    watch = _Announcer(marks, phases)
    done = record(
        lambda: WatchedWriter(watch, folder, plan.storage), partial(_messages, plan.ticks, marks)
    )
    if done.recorded + done.discarded != done.offered or not done.offered:
        phases.send(b'!' + repr(done).encode())
        return
    sleep(2.0 * _PATIENCE)


def _messages(ticks: int, marks: Marks, _: Recorder) -> Iterator[NumberedMessage]:
    begin = monotonic_ns()
    for tick in range(ticks):
        wait = begin + tick * PERIOD_NS - monotonic_ns()
        if wait > 0:
            sleep(wait * 1e-9)
        now = marks.begin_tick()
        for index in range(2 * tick, 2 * tick + 2):
            offered = message(index, now)
            marks.offered = index + 1
            yield offered


def _wait_for(plan: Plan, phases: socket.socket) -> str:
    """Wait for the phase, or else for the close; return why neither comes, or ''."""
    until = monotonic() + _PATIENCE + plan.ticks * 1e-3
    missing = plan.time
    while (left := until - monotonic()) > 0:
        if not select.select([phases], [], [], left)[0]:
            break
        phase = phases.recv(1)
        if phase in (b'', b'!'):
            return f'ended by itself: {phases.recv(1000).decode()}'
        missing -= phase[0] == plan.aim
        if not missing or phase[0] == Phase.CLOSED:
            return ''
    return f'{plan} reaches no phase to be killed in'


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

_NAMES = {
    Phase.STARTING: 'before the folder',
    Phase.MAKING: 'making the bag',
    Phase.RECORDING: 'recording',
    Phase.FLUSHING: 'in a flush',
    Phase.SPLITTING: 'in a split',
    Phase.CLOSING: 'in the close',
    Phase.CLOSED: 'after the close',
}
_NO_COMPLETE_FILE = 'folder, no complete file'


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of this campaign."""
    parser.add_argument('--kills', type=int, default=1000, help='at any instant')
    parser.add_argument('--aimed', type=int, default=400, help='aimed at short phases')
    parser.add_argument(
        '--seconds', type=float, nargs=2, default=(0.2, 3.0), help='shortest and longest run'
    )
    parser.set_defaults(jobs=4)


def run(options: argparse.Namespace) -> Findings:
    """Kill and judge; a loss above the bound is a fault too."""
    shortest, longest = options.seconds
    work = plans(options.seed, options.kills, options.aimed, (shortest, longest))
    outcomes = []
    progress = progress_lines(len(work), 'kills')
    try:
        for outcome in results_of(kill, work, options.jobs):
            outcomes.append(outcome)
            progress(1)
    except KillError as error:
        return Findings([], [str(error)])
    outcomes.sort(key=lambda outcome: outcome.plan.number)
    faults = [f'{fault}: {outcome.plan}' for outcome in outcomes for fault in outcome.faults]
    faults += [
        f'loss {outcome.excess / 1e6:.1f} ms above the bound: {outcome.plan}'
        for outcome in outcomes
        if outcome.excess > 0
    ]
    versions = [(package, metadata.version(package)) for package in ('mcap', 'rosbags')]
    tables = [_phases(outcomes), _verdicts(outcomes), _losses(outcomes)]
    return Findings(tables, faults, [*versions, ('kills', f'{len(work):,}')])


def _phase(outcome: Outcome) -> str:
    verdict = outcome.verdicts['bag']
    if verdict == NO_FOLDER:
        return _NAMES[Phase.STARTING]
    return _NO_COMPLETE_FILE if verdict == NO_FILE else _NAMES[outcome.phase]


def _phases(outcomes: Sequence[Outcome]) -> Table:
    table = Table(
        'Kills by phase of the recording',
        ('', 'kills', 'messages offered', 'found', 'removed by the ring', 'lost',
         'metadata.yaml.tmp left', NEXT_FILE, OLD_FILE),
    )  # fmt: skip
    names = list(_NAMES.values())
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
    for of, text in sorted(counts, key=lambda k: (not k[1].startswith(FAULT), k)):
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
        if group:
            table.rows.append(
                [
                    f'{1e3 * period:g}',
                    f'{len(group):,}',
                    *percentile_texts([o.loss / 1e6 for o in group], 1),
                    f'{1e3 * period + 1:g}',
                    f'{sum(o.strict_excess > 0 for o in group):,}',
                    f'{sum(o.excess > 0 for o in group):,}',
                    *percentile_texts([o.power_loss / 1e6 for o in group], 1),
                ]
            )
    return table
