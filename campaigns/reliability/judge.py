# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The judge of all campaigns.

A bag has to hold what was offered, in order and byte for byte, and to report every loss; a
recording has to count every message; a command has to end with a result, or with a line.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
import json
from operator import attrgetter
from pathlib import Path
import re
import shutil
from typing import Any, NamedTuple

from campaigns.reliability.processes import Ended
from campaigns.reliability.recording import Recorded, TOPICS
from linkage_ros.bag import (
    Bag,
    BagMessage,
    FAILURE,
    METADATA_FILE,
    read_bag,
    recover_bag,
    ROOT_KEY,
    STATS_RECORD,
    UNFINISHED,
)
from linkage_ros.errors import BagError
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
import yaml

FAULT = 'FAULT: '
"""Prefix of a verdict that is a violation."""


@dataclass(slots=True)
class Reading:
    """What a reader gives of a bag."""

    bag: Bag | None = None  # None if it is refused
    messages: list[BagMessage] = field(default_factory=list)  # Those before an error
    error: str = ''  # The reported damage; '' for none
    fault: str = ''  # Any other exception, or what rosbags reads otherwise; '' for none

    @property
    def whole(self) -> Bag | None:
        """Return the bag if all of it could be read."""
        return None if self.error or self.fault else self.bag


def read(file: Path, *, allow_truncated: bool = False) -> Reading:
    """Read a bag by our reader."""
    reading = Reading()
    try:
        reading.bag = read_bag(file, allow_truncated=allow_truncated)
        reading.messages.extend(reading.bag.messages())
    except BagError as error:
        reading.error = str(error)
    except Exception as error:  # noqa: BLE001 (a fault)
        reading.fault = f'{type(error).__name__}: {error}'
    return reading


def recover(folder: Path, target: Path | None = None) -> Reading:
    """Recover a bag, and read the result by both readers; it is removed afterwards."""
    target = target or folder.with_name(f'{folder.name}_recovered')
    try:
        recover_bag(folder, target)
        reading = read(target)
        if reading.error:
            reading.fault = f'cannot be read: {reading.error}'
        elif not reading.fault:
            reading.fault = by_rosbags(target, reading.messages)
    except BagError as error:
        return Reading(error=str(error))
    except Exception as error:  # noqa: BLE001 (a fault)
        return Reading(fault=f'{type(error).__name__}: {error}')
    finally:
        shutil.rmtree(target, ignore_errors=True)
    return reading


def by_rosbags(folder: Path, messages: Iterable[BagMessage]) -> str:
    """Return the fault that reading by rosbags finds; '' for none."""
    ours = sorted((m.topic, m.log_time, m.data) for m in messages)
    try:
        with AnyReader([folder]) as reader:
            theirs = sorted((c.topic, time, bytes(data)) for c, time, data in reader.messages())
    except Exception as error:  # noqa: BLE001 (a fault)
        return f'rosbags: {type(error).__name__}: {error}'
    return '' if ours == theirs else f'rosbags reads {len(theirs)} messages, not {len(ours)}'


class Metadata(NamedTuple):
    """The content of ``metadata.yaml``: the named files, the number of messages, and its fault."""

    files: Sequence[str] = ()
    messages: int = 0
    fault: str = ''


def read_metadata(folder: Path) -> Metadata:
    """Read ``metadata.yaml``, and check that its files exist and that its counts agree."""
    try:
        content: Any = yaml.safe_load((folder / METADATA_FILE).read_text(encoding='utf-8'))
        content = content[ROOT_KEY]
        files, count = content['relative_file_paths'], content['message_count']
        parts = [(part['path'], part['message_count']) for part in content['files']]
    except Exception as error:  # noqa: BLE001 (a fault)
        return Metadata(fault=type(error).__name__)
    fault = ''
    if [path for path, _ in parts] != files or any(not (folder / f).is_file() for f in files):
        fault = 'names a missing file'
    elif count != sum(number for _, number in parts):
        fault = f'counts {count} messages, not the sum of its files'
    return Metadata(files, count, fault)


@dataclass(frozen=True)
class Expectation:
    """The expected outcome of a recording."""

    messages: Sequence[BagMessage]  # The offered messages, in order
    keeps_all: bool = False  # Whether the recording must not lose a message
    # Whether unwanted files may remain, because they could not be removed.
    may_leave: bool = False
    # Whether data that was not flushed may be lost from the files; only recovery is judged then.
    loses_pages: bool = False
    # Whether the metadata may lack the failure, because they were written before it.
    may_be_silent: bool = False

    @cached_property
    def _numbers(self) -> dict[tuple[str, int], int]:
        return {(each.topic, each.log_time): at for at, each in enumerate(self.messages)}

    def run_of(self, found: Sequence[BagMessage]) -> range | None:
        """Return the numbers of these consecutive messages, byte for byte; None if they differ."""
        if not found:
            return range(0)
        first = self._numbers.get((found[0].topic, found[0].log_time), 0)
        end = first + len(found)
        return range(first, end) if list(self.messages[first:end]) == list(found) else None


REFUSED = 'refused at the beginning'
LEFT = 'refused, but files could not be removed'
COMPLETE = 'complete'
EARLY = 'ended early, bag readable'
AT_RECOVERY = 'ended early, complete after recovery'


@dataclass(slots=True)
class Outcome:
    """The outcome of a recording, with counts of messages; no verdict if it has only faults."""

    verdict: str = ''
    faults: list[str] = field(default_factory=list)
    offered: int = 0
    recorded: int = 0
    discarded: int = 0


def judge(
    done: Recorded | None, folder: Path, expectation: Expectation, recovered: Path | None = None
) -> Outcome:
    """Judge a recording, None if it did not end; the recovered bag is removed afterwards."""
    if done is None:
        return Outcome(faults=['did not end'])
    outcome = Outcome(offered=done.offered, recorded=done.recorded, discarded=done.discarded)
    if done.escaped:
        outcome.faults.append(f'escaped: {done.escaped}')
        return outcome
    error = done.refused or done.failure
    if error and not _is_line(error, folder):
        outcome.faults.append(f'bad error message: {error}')
    if error and expectation.keeps_all:
        outcome.faults.append(f'ended by a harmless fault: {error}')
    if done.refused:
        outcome.verdict = LEFT if folder.exists() else REFUSED
        if folder.exists() and not expectation.may_leave:
            outcome.faults.append('refused, but files left behind')
        return outcome
    outcome.faults += _count_faults(done)
    if fault := read_metadata(folder).fault:
        outcome.faults.append(f'metadata: {fault}')
    if done.failure is None:
        outcome.verdict = COMPLETE
        outcome.faults += _complete(done, folder, expectation)
    else:
        _ended_early(outcome, done, folder, expectation, recovered)
    if not expectation.may_leave:
        outcome.faults += [
            f'left behind: {path.name}'
            for path in folder.iterdir()
            if path.name != METADATA_FILE and path.suffix != '.mcap'
        ]
    return outcome


def _is_line(error: str, folder: Path) -> bool:
    """Return whether an error has place, reason and remedy on one line."""
    where, _, rest = error.partition(': ')
    reason, _, remedy = rest.partition('; ')
    named = where == str(folder) and bool(reason and remedy)
    return named and error.isprintable() and 'please report' not in error


def _count_faults(done: Recorded) -> list[str]:
    """Return the faults of the counts, topic by topic."""
    faults = []
    for index, (received, recorded, dropped, discarded, waiting) in enumerate(done.counts):
        offered = len(range(index, done.offered, len(TOPICS)))
        if received != offered:
            faults.append(f'{offered} offered, {received} received')
        if received != recorded + dropped + discarded or waiting or min(recorded, dropped) < 0:
            faults.append(f'the counts do not add up: {done.counts[index]}')
    return faults


def _complete(done: Recorded, folder: Path, expectation: Expectation) -> list[str]:
    """Return the faults of a recording that reports no failure."""
    faults = []
    reading = read(folder)
    bag, run = reading.whole, expectation.run_of(reading.messages)
    if bag is None:
        return [f'reports no failure, but cannot be read: {reading.error or reading.fault}']
    if run is None:
        return ['a false message']
    if (run.start, run.stop) != (done.discarded, done.offered) or len(run) != done.recorded:
        faults.append(f'reports no failure, but holds {run} of {done.offered}')
    if UNFINISHED in bag.custom or FAILURE in bag.custom:
        faults.append('reports no failure, but its metadata do')
    return [*faults, *_some(by_rosbags(folder, reading.messages))]


def _ended_early(
    outcome: Outcome,
    done: Recorded,
    folder: Path,
    expectation: Expectation,
    target: Path | None,
) -> None:
    """Judge the bag of a recording that reports a failure."""
    outcome.verdict = EARLY
    counted = range(done.discarded, done.discarded + done.recorded)
    reading = read(folder, allow_truncated=True)
    outcome.faults += _some(reading.fault and f'reading: {reading.fault}')
    bag = reading.whole
    run = expectation.run_of(reading.messages) if bag else range(0)
    if run is None:
        outcome.faults.append('a false message')
        return
    if bag is not None:
        if FAILURE in bag.custom and bag.custom[FAILURE] != done.failure:
            outcome.faults.append('another failure in the metadata')
        silent = FAILURE not in bag.custom and UNFINISHED not in bag.custom
        if silent and not expectation.may_be_silent:
            outcome.faults.append('its metadata report no failure')
        if not bag.truncated and not expectation.loses_pages:
            outcome.faults += _some(by_rosbags(folder, reading.messages))
    if bag is None or not _holds(run, counted):
        outcome.verdict = AT_RECOVERY
    fault = _recovery_fault(counted, recover(folder, target), expectation)
    outcome.faults += _some(fault and f'recover: {fault}')


def _recovery_fault(counted: range, recovered: Reading, expectation: Expectation) -> str:
    """Return the fault of the recovered bag; '' for none."""
    if recovered.fault:
        return recovered.fault
    if recovered.error:
        return recovered.error if counted else ''
    messages = recovered.messages
    if expectation.may_leave:
        # An old file of the ring that could not be removed comes after the named files.
        messages = sorted(messages, key=attrgetter('log_time'))
    run = expectation.run_of(messages)
    if run is None:
        return 'a false message'
    return '' if _holds(run, counted) else f'counted {counted}, recovered {run}'


def _holds(run: range, counted: range) -> bool:
    return not counted or (run.start <= counted.start and counted.stop <= run.stop)


def _some(fault: str) -> list[str]:
    return [fault] if fault else []


Counts = dict[str, dict[str, int]]


def counts_of(folder: Path) -> Counts:
    """Return received, recorded, dropped and discarded by topic, from the bag's last file."""
    with read_bag(folder).files[-1].open('rb') as stream:
        metadata = {each.name: each.metadata for each in make_reader(stream).iter_metadata()}
    return {kind: json.loads(text) for kind, text in metadata.get(STATS_RECORD, {}).items()}


def shortcomings(folder: Path, *, may_drop: bool = False) -> list[str]:
    """Return the inconsistencies and missing parts of a bag, by its own counts."""
    try:
        bag = read_bag(folder)
        messages = Counter(message.topic for message in bag.messages())
        counts = counts_of(folder)
    except BagError as error:
        return [str(error)]
    if not counts:
        return ['the bag has no counts']
    faults = []
    for topic, received in counts['received'].items():
        recorded, dropped = counts['recorded'][topic], counts['dropped'][topic]
        if recorded != messages[topic]:
            faults.append(f'{topic}: {recorded} counted, {messages[topic]} in the bag')
        if received != recorded + dropped + counts['discarded'][topic]:
            faults.append(f'{topic}: the counts do not add up')
        if dropped and not may_drop:
            faults.append(f'{topic}: {dropped} dropped')
    return faults


Try = tuple[str, str]
"""How a try ended, and its violation in a line; '' for none."""


_PLACED = re.compile(r'linkage \w+: .*?:\d+: ')
"""Beginning of an error that names a place in a file."""

_MOST_ERRORS = 1000
"""Most errors of one file."""


class Manners(NamedTuple):
    """How a command has to end."""

    codes: tuple[int, ...] = (0, 2)  # Allowed exit codes
    notes: int = 0  # Most lines on standard error beside a result
    longest: int = 1000  # Most characters of such a line
    # Pattern of lines that do not count, and of those that do not count beside a result.
    beside: str = '$^'
    with_result: str = '$^'
    silent: bool = True  # Whether a result may be without output


def fault_of(ended: Ended, manners: Manners) -> str:
    """Return the fault of the end of a command, in a line; '' if it is correct."""
    code, errors, out = ended
    lines = [line for line in errors.splitlines() if not re.search(manners.beside, line)]
    if code == 0:
        lines = [line for line in lines if not re.search(manners.with_result, line)]
    most = manners.notes
    if code == 2:
        # All errors of a file are told, each in a line that names its place.
        most = _MOST_ERRORS if all(map(_PLACED.match, lines)) else 1
    fault = ''
    if code not in manners.codes:
        fault = f'{code}: {errors.strip()}'
    elif len(lines) > most or (code == 2 and not lines):
        fault = f'{len(lines)} lines: {errors.strip()}'
    elif not all(line.isprintable() for line in (*lines, *out.split('\n'))):
        fault = 'a line that is not printable'
    elif any(len(line) > manners.longest for line in lines):
        fault = f'a line of {max(map(len, lines))} characters'
    elif code == 0 and not (out or manners.silent):
        fault = 'no output'
    return fault[:300]
