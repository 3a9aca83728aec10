# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Kill recordings, and compare each bag with the messages that were offered."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from itertools import pairwise
import json
import os
from pathlib import Path
import select
import subprocess
import sys
from tempfile import TemporaryDirectory
from time import monotonic, monotonic_ns, sleep
from typing import Any

from campaigns.campaign import results_of
from campaigns.kills.plan import expected, Marks, PERIOD_NS, Phase, Plan, TOPICS
from linkage_ros.bag import (
    BagMessage,
    DISCARDED,
    METADATA_FILE,
    read_bag,
    recover_bag,
    ROOT_KEY,
    UNFINISHED,
)
from linkage_ros.errors import BagError
from rosbags.highlevel import AnyReader
import yaml

FAULT = 'FAULT: '
"""Prefix of a verdict that is a violation."""

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
        period = round(self.plan.storage.flush_period * 1e9)
        return self.loss - period - self.tick - self.paused

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
    messages = _read(outcome, folder, marks)
    if messages is not None:
        _measure(outcome, marks, killed)
    elif begun and not outcome.faults:
        outcome.verdicts['bag'] = f'{FAULT}no complete file, although recording had begun'
    outcome.verdicts['metadata'] = _metadata(outcome, folder)
    outcome.verdicts['recovered'] = _recovered(outcome, folder, messages, marks)
    return outcome


def _read(outcome: Outcome, folder: Path, marks: Marks) -> list[BagMessage] | None:
    """Read the bag; return its messages, or None without a complete file."""
    try:
        bag = read_bag(folder, allow_truncated=True)
        messages = list(bag.messages())
    except BagError:
        outcome.verdicts['bag'] = NO_FILE
        return None
    except Exception as error:  # noqa: BLE001
        outcome.verdicts['bag'] = f'{FAULT}{type(error).__name__}: {error}'
        return None
    outcome.found = len(messages)
    counts = json.loads(bag.custom.get(DISCARDED, '{}'))
    outcome.discarded = sum(counts.values())
    end = outcome.discarded + len(messages)
    if not _is_run(messages, outcome.discarded, marks):
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
        verdict = 'finished'
        if end < marks.offered:
            verdict = f'{FAULT}finished, but incomplete'
    outcome.verdicts['bag'] = verdict
    return messages


def _is_run(messages: Sequence[BagMessage], first: int, marks: Marks) -> bool:
    """Return whether these are consecutive offered messages, byte for byte."""
    return first + len(messages) <= marks.offered and all(
        message == expected(number, marks.times[number // len(TOPICS)])
        for number, message in enumerate(messages, first)
    )


def _measure(outcome: Outcome, marks: Marks, killed: int) -> None:
    """Measure the loss by the kill, and the greatest loss by a power cut."""
    # A tick may have begun between reading the clock and the kill.
    killed = max(killed, marks.times[marks.ticks - 1] if marks.ticks else 0)

    def age(number: int) -> int:
        return killed - marks.times[number // len(TOPICS)] if number < marks.offered else 0

    first = outcome.discarded + outcome.found
    outcome.loss, outcome.power_loss = age(first), age(marks.safe)
    if outcome.loss:
        begin = killed - outcome.loss
        outcome.paused = marks.paused(begin, killed)
        tick, end = first // len(TOPICS), marks.ticks
        times = [*marks.times[tick:end], killed]
        outcome.tick = max(PERIOD_NS, *(after - before for before, after in pairwise(times)))


def _metadata(outcome: Outcome, folder: Path) -> str:
    """Judge ``metadata.yaml``: valid, and every name and count in it has its file and messages."""
    files = {file.name for file in folder.glob('*.mcap')}
    others = {file.name for file in folder.iterdir()} - files
    outcome.leftovers += sorted(others - {METADATA_FILE})
    if METADATA_FILE not in others:
        begun = outcome.phase > Phase.MAKING
        return f'{FAULT}none' if begun else 'none yet'
    try:
        content: dict[str, Any] = yaml.safe_load((folder / METADATA_FILE).read_text())[ROOT_KEY]
        named = content['relative_file_paths']
        count = content['message_count']
        parts = [(part['path'], part['message_count']) for part in content['files']]
    except Exception as error:  # noqa: BLE001
        return f'{FAULT}{type(error).__name__}'
    if not files.issuperset(named) or [path for path, _ in parts] != named:
        return f'{FAULT}names a missing file'
    if count > outcome.found or count != sum(number for _, number in parts):
        return f'{FAULT}counts {count} messages, {outcome.found} exist'
    newest = max(map(_number, named))
    outcome.leftovers += [
        NEXT_FILE if _number(name) > newest else OLD_FILE
        for name in sorted(files.difference(named))
    ]
    return 'valid, names existing files'


def _number(name: str) -> int:
    """Return the number in the name of a bag's file."""
    return int(Path(name).stem.rpartition('_')[2])


def _recovered(
    outcome: Outcome, folder: Path, messages: list[BagMessage] | None, marks: Marks
) -> str:
    """Recover the bag, and read the result by rosbags and by our reader."""
    target = folder.with_name(f'{folder.name}_recovered')
    try:
        recover_bag(folder, target)
    except BagError:
        empty = not messages and not marks.safe
        return 'nothing to recover, reported' if empty else f'{FAULT}nothing recovered'
    except Exception as error:  # noqa: BLE001
        return f'{FAULT}{type(error).__name__}: {error}'
    try:
        ours = list(read_bag(target).messages())
        with AnyReader([target]) as reader:
            theirs = sorted(
                (time, connection.topic, bytes(data))
                for connection, time, data in reader.messages()
            )
    except Exception as error:  # noqa: BLE001
        return f'{FAULT}cannot be read: {type(error).__name__}: {error}'
    if theirs != sorted((each.log_time, each.topic, each.data) for each in ours):
        return f'{FAULT}rosbags reads other messages'
    if ours == (messages or []):
        return 'the same messages'
    # The ring had not yet removed an old file, or the next file was not yet in the metadata.
    first = _first(ours, marks)
    end = first + len(ours)
    holds_all = first <= outcome.discarded and end >= outcome.discarded + outcome.found
    if holds_all and _is_run(ours, first, marks):
        return 'the same and older messages, from an old file of the ring'
    return f'{FAULT}other messages'


def _first(messages: Sequence[BagMessage], marks: Marks) -> int:
    """Return the number of the first message."""
    if not messages:
        return 0
    ticks = marks.times[: marks.ticks]
    tick = bisect_left(ticks, messages[0].log_time)
    names = [topic.name for topic in TOPICS]
    return tick * len(TOPICS) + names.index(messages[0].topic)


_PATIENCE = 30.0
"""Time limit for a process to reach the awaited phase [s]."""


class KillError(Exception):
    """A recording ended before its kill."""


def run(plans: list[Plan], jobs: int) -> Iterator[Outcome]:
    """Carry out plans, several at once; yield the outcomes."""
    yield from results_of(kill, plans, jobs)


def kill(plan: Plan) -> Outcome:
    """Start a recording, kill it as planned, and judge."""
    with TemporaryDirectory(prefix='linkage_ros_kill_') as name:
        work = Path(name)
        marks = Marks.make(work / 'marks', plan.ticks)
        try:
            killed = _kill(plan, work / 'bag', work / 'marks', work / 'log')
            return judge(plan, work / 'bag', marks, killed)
        finally:
            marks.close()


def _kill(plan: Plan, folder: Path, marks: Path, log: Path) -> int:
    """Kill a recording; return the time of the kill in [ns] of the steady clock."""
    signals, signal_pipe = os.pipe()
    arguments = [folder, marks, signal_pipe, plan.ticks, json.dumps(asdict(plan.storage))]
    command = [sys.executable, '-m', 'campaigns.kills.child', *map(str, arguments)]
    with log.open('wb') as errors:
        process = subprocess.Popen(
            command, cwd=Path(__file__).parents[2], pass_fds=[signal_pipe], stderr=errors
        )
    os.close(signal_pipe)
    try:
        if not _wait_for(plan, signals):
            raise KillError(f'ended by itself: {log.read_text(errors="replace").strip()}')
        sleep(plan.delay)
        killed = monotonic_ns()
        process.kill()
    finally:
        # Whatever failed, the process has to end before the bag is judged.
        process.kill()
        process.wait()
        os.close(signals)
    return killed


def _wait_for(plan: Plan, signals: int) -> bool:
    """Wait for the phase, or else for the close; return False if the process ended."""
    until = monotonic() + _PATIENCE + plan.ticks * 1e-3
    missing = plan.time
    while (left := until - monotonic()) > 0:
        if not select.select([signals], [], [], left)[0]:
            break
        phase = os.read(signals, 1)
        if not phase:
            return False
        missing -= phase[0] == plan.aim
        if not missing or phase[0] == Phase.CLOSED:
            return True
    return False
