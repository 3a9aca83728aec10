# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Recover a whole bag from a damaged one, which is only read."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
import os
from pathlib import Path
import shutil
from typing import Any, NamedTuple

from linkage_ros.bag.bag_file import COMPRESSION_TYPES, start_file
from linkage_ros.bag.disk import CHUNK_SIZE
from linkage_ros.bag.mcap_records import Definitions, FoundRecord, Message, RecordSource
from linkage_ros.bag.metadata import (
    BagSummary,
    METADATA_FILE,
    metadata_text,
    NO_START,
    sync_folder,
    UNFINISHED,
    write_metadata,
)
from linkage_ros.bag.other_formats import LONGEST_MAGIC, refuse_other_format
from linkage_ros.bag.reader import (
    by_number,
    custom_of,
    files_of,
    information_of,
    is_in_use,
    mcap_names,
    serialized_metadata,
    topic_of,
    unreadable_error,
)
from linkage_ros.bag.salvage import BEGINNING, LostRange, Salvage
from linkage_ros.bag.topic import Topic
from linkage_ros.errors import BagError, quote, RecordingError
from mcap.exceptions import UnsupportedCompressionError
from mcap.records import Attachment, Channel
from mcap.writer import CompressionType, Writer

RECOVERED = 'linkage_ros.recovered'
"""Key in the ``custom_data`` of a recovered bag: its origin and losses."""

NOTHING_LOST = 'nothing lost'
"""End of that text if nothing was lost."""

MOST_CHANNELS = 10_000
"""Most channels of a new bag: its metadata, 700 bytes for each, must stay readable."""

ProgressCallback = Callable[[int, int], None]
Stopped = Callable[[], bool]


class TopicRecovery(NamedTuple):
    """Numbers of messages of a topic: saved, and originally present (None if unknown)."""

    name: str
    saved: int
    expected: int | None


class Recovery(NamedTuple):
    """Outcome of a recovery."""

    folder: Path  # The new bag
    topics: tuple[TopicRecovery, ...]  # Saved and original messages of each topic
    attachments: tuple[str, ...]  # Names of the saved attachments
    losses: tuple[tuple[str, LostRange], ...]  # Losses, each with the name of its file
    repaired: tuple[str, ...]  # Damage or missing parts without loss, one line each
    remarks: tuple[str, ...]  # Further remarks, one line each

    @property
    def missing_count(self) -> int:
        """Return the number of messages that the bag should have and that are missing."""
        return sum(max((topic.expected or 0) - topic.saved, 0) for topic in self.topics)

    @property
    def is_whole(self) -> bool:
        """Return whether there is no loss."""
        return not self.losses and not self.missing_count

    def in_short(self, path: Path) -> str:
        """Return the outcome for the bag of this name, as one line."""
        saved = sum(topic.saved for topic in self.topics)
        lost = NOTHING_LOST
        if not self.is_whole:
            size = sum(loss.end - loss.start for _, loss in self.losses)
            lost = f'{size} bytes lost in {len(self.losses)} places'
        return f'from {path.absolute().name}: {saved} messages, {lost}'


def expected_counts(information: Mapping[str, Any]) -> dict[str, int]:
    """Return the message count of each topic in ``metadata.yaml``, if it has them."""
    counts = {}
    try:
        for topic in information['topics_with_message_count']:
            counts[str(topic['topic_metadata']['name'])] = int(topic['message_count'])
    except Exception:  # noqa: BLE001 (its content may be anything)
        return {}
    return counts if any(counts.values()) else {}


class RecoveredBag:
    """
    A new bag in an empty folder that is open for writing, with compression '', 'lz4' or 'zstd'.

    Methods that write raise `OSError`; `add_item` and `add_channels` raise `BagError` for more
    than `MOST_CHANNELS` channels.
    """

    def __init__(self, folder: Path, profile: str, compression: str) -> None:
        self.counts: Counter[str] = Counter()  # Messages by topic
        self.attachments: dict[str, bytes] = {}  # Content by name
        # Metadata that rosbag2 wrote into the damaged file.
        self.information: Mapping[str, Any] = {}
        self._folder = folder
        self._topics: dict[str, Topic] = {}
        self._schemas: dict[tuple[str, str, bytes], int] = {}
        self._channels: dict[tuple[object, ...], int] = {}
        self._numbers: dict[int, int] = {}
        self._start, self._end = NO_START, 0
        self._file = (folder / f'{folder.name}_0.mcap').open('xb')
        packing = COMPRESSION_TYPES.get(compression, CompressionType.NONE)
        try:
            self._mcap = Writer(self._file, chunk_size=CHUNK_SIZE, compression=packing)
        except UnsupportedCompressionError:
            self._mcap = Writer(
                self._file, chunk_size=CHUNK_SIZE, compression=CompressionType.NONE
            )
        start_file(self._mcap, profile)

    @property
    def topic_names(self) -> tuple[str, ...]:
        """Return the names of its topics."""
        return tuple(self._topics)

    def begin_file(self) -> None:
        """Forget the channel numbers, which are valid for one file."""
        self._numbers.clear()

    def add_item(self, record: FoundRecord, definitions: Definitions) -> None:
        """Add an item found in a file, with the file's schemas and channels so far."""
        if isinstance(record, Message):
            if not self._numbers:
                self.add_channels(definitions)
            number = self._numbers.get(record.channel.id)
            if number is None:
                # Not all channels known so far: each of thousands comes with its first message.
                number = self._number_of(record.channel, definitions)
                self._numbers[record.channel.id] = number
            self._mcap.add_message(
                number, record.log_time, record.data, record.publish_time, record.sequence
            )
            self.counts[record.channel.topic] += 1
            self._start = min(self._start, record.log_time)
            self._end = max(self._end, record.log_time)
        elif isinstance(record, Attachment):
            # The files of one bag repeat them.
            if self.attachments.get(record.name) != record.data:
                self.attachments.setdefault(record.name, record.data)
                self._mcap.add_attachment(
                    record.create_time,
                    record.log_time,
                    record.name,
                    record.media_type,
                    record.data,
                )
        elif record.name != 'rosbag2':
            self._mcap.add_metadata(record.name, record.metadata)
        else:
            self.information = serialized_metadata(record)

    def add_channels(self, definitions: Definitions) -> None:
        """Add all channels, also those without a message."""
        for channel in definitions.channels.values():
            if channel.id not in self._numbers:
                self._numbers[channel.id] = self._number_of(channel, definitions)

    def close(self, custom: Mapping[str, str]) -> BagSummary:
        """Finish the bag, and return its summary."""
        summary = self._make_summary()
        text = metadata_text(summary, custom, root=False)
        self._mcap.add_metadata('rosbag2', {'serialized_metadata': text})
        self._mcap.finish()  # type: ignore[no-untyped-call]
        self._file.flush()
        os.fsync(self._file.fileno())
        summary = self._make_summary()
        self._file.close()
        write_metadata(summary, custom)
        sync_folder(self._folder.absolute().parent)
        return summary

    def abandon(self) -> None:
        """Close the file; its content is not needed."""
        with suppress(OSError):
            self._file.close()

    def _number_of(self, channel: Channel, definitions: Definitions) -> int:
        """Return a channel's number in the new bag, the same for equal channels of all files."""
        schema = definitions.schema_of(channel)
        kind = (schema.name, schema.encoding, schema.data) if schema else None
        described = (channel.topic, channel.message_encoding, kind, *channel.metadata.items())
        if described not in self._channels:
            if len(self._channels) == MOST_CHANNELS:
                raise BagError(
                    self._folder,
                    f'would contain more than {MOST_CHANNELS:,} channels; no more are recovered',
                    'no ROS graph has as many: ask who made the bag',
                )
            number = 0
            if kind is not None:
                if kind not in self._schemas:
                    self._schemas[kind] = self._mcap.register_schema(*kind)
                number = self._schemas[kind]
            self._channels[described] = self._mcap.register_channel(
                channel.topic, channel.message_encoding, number, channel.metadata
            )
            self._topics.setdefault(channel.topic, topic_of(channel, schema))
        return self._channels[described]

    def _make_summary(self) -> BagSummary:
        return BagSummary(
            folder=self._folder,
            file=Path(self._file.name).name,
            topics=tuple(self._topics.values()),
            counts=tuple(self.counts[name] for name in self._topics),
            start=self._start,
            duration=max(0, self._end - self._start),
            size=self._file.tell(),
        )


class _Findings:
    """Collected losses, repairs and remarks."""

    def __init__(self) -> None:
        self.losses: list[tuple[str, LostRange]] = []
        self.repaired: list[str] = []
        self.remarks: list[str] = []
        self.expected: Counter[str] = Counter()
        self.all_expected = True  # whether the index of each file is trusted


def recovered_name(path: Path) -> Path:
    """Return the default folder for the recovered bag, next to the bag."""
    whole = Path(os.path.abspath(path))  # noqa: PTH100 (keeps the name of a link)
    return whole.with_name(f'{whole.name if path.is_dir() else whole.stem}_recovered')


def recover_bag(
    path: Path,
    target: Path | None = None,
    progress: ProgressCallback = lambda done, of: None,
    stopped: Stopped = lambda: False,
) -> Recovery | None:
    """
    Save the whole parts of a bag to a new bag, by default at `recovered_name`.

    ``progress`` receives the number of bytes examined and the total; if ``stopped`` returns True,
    the result is None and nothing is left behind. Raise `BagError` if it is not a bag, leads out
    of its folder, has too many channels or has no whole part, and `RecordingError` if the new
    folder exists or cannot be written to.
    """
    target = target or recovered_name(path)
    findings = _Findings()
    information = _read_information(path, findings)
    files = _find_files(path, information, findings)
    if os.path.lexists(target):
        raise _exists_error(target)
    profile, compression = _detect_profile(path, files, stopped)
    sizes = [file.stat().st_size for file in files]
    with _new_folder(target):
        bag = RecoveredBag(target, profile, compression)
        try:
            for index, file in enumerate(files):
                before, of = sum(sizes[:index]), sum(sizes)
                for done in _copy_file(file, bag, findings):
                    progress(before + done, of)
                    if stopped():
                        bag.abandon()
                        shutil.rmtree(target)
                        return None
            recovery = _make_recovery(target, bag, information, findings)
            custom = custom_of(information or bag.information)
            # Unlike the old bag, the new one has an end.
            custom = {key: text for key, text in custom.items() if key != UNFINISHED}
            bag.close({**custom, RECOVERED: recovery.in_short(path)})
        finally:
            bag.abandon()
    return recovery


def _read_information(path: Path, findings: _Findings) -> dict[str, Any]:
    """Return the metadata; empty if damaged."""
    if not path.is_dir():
        return {}
    try:
        information = information_of(path)
    except BagError:
        information = {}
    if not information:
        findings.repaired.append(METADATA_FILE)
    return information


def _find_files(path: Path, information: Mapping[str, Any], findings: _Findings) -> list[Path]:
    """Return the files of a bag: those in its metadata, and others in its folder."""
    if path.is_dir():
        named = files_of(path, information) if information else []
        there = files_of(path, {}) if mcap_names(path) or not named else []
        if [file for file in there if file in named] == named:
            # By number: a file removed from a ring may remain, from before the named ones.
            files = there
        else:
            files = _in_order(named, [file for file in there if file not in named])
    else:
        files = files_of(path, {})
    present = []
    for file in files:
        try:
            if file.is_file():
                with file.open('rb') as stream:
                    refuse_other_format(file, stream.read(LONGEST_MAGIC))
                present.append(file)
                continue
            reason = 'is not a file' if file.exists() else 'does not exist'
        except OSError as error:
            reason = unreadable_error(file, error).reason
        if len(files) == 1:
            raise BagError(file, reason, "name a bag's folder, or its file")
        findings.losses.append((file.name, LostRange(0, 0, reason)))
    findings.remarks += [
        f'{file.name} is still being written; what comes after this is not in the new bag'
        for file in present
        if is_in_use(file)
    ]
    return present


def _in_order(named: Sequence[Path], others: Sequence[Path]) -> list[Path]:
    """Insert unnamed files among the named ones: a killed ring recording leaves older files."""
    place = by_number(named[0]) if named else (0, '')
    older = [file for file in others if by_number(file) < place]
    return [*older, *named, *(file for file in others if file not in older)]


def _detect_profile(path: Path, files: Sequence[Path], stopped: Stopped) -> tuple[str, str]:
    """Return profile and compression for the new bag; raise BagError if no part is whole."""
    profile, anything, reason = '', False, 'holds no file'
    for file in files:
        with file.open('rb') as stream:
            salvage = Salvage(RecordSource(stream))
            for record in salvage.find_records():
                anything = True
                if isinstance(record, Message):
                    ros = record.channel.message_encoding == 'cdr'
                    return 'ros2' if ros else salvage.data.profile, salvage.data.compression
                if stopped():
                    break
            anything |= bool(salvage.data.definitions.channels)
            profile = profile or salvage.data.profile
            reason = _why_nothing(file, salvage)
    if not anything:
        raise BagError(path, f'holds nothing that can be saved: {reason}', 'name another bag')
    return profile or 'ros2', ''


def _why_nothing(file: Path, salvage: Salvage) -> str:
    with file.open('rb') as stream:
        start = stream.read(8)
    if not start:
        return f'{file.name} is empty'
    if BEGINNING in salvage.repaired:
        return f'{file.name} starts with {quote(start)}, unlike an MCAP file'
    if salvage.losses:
        loss = salvage.losses[0]
        return f'{file.name} at byte {loss.start:,}: {loss.reason}'
    return f'{file.name} is whole, and empty'


def _copy_file(file: Path, bag: RecoveredBag, findings: _Findings) -> Iterator[int]:
    """Copy the whole parts of a file; yield the number of bytes examined, now and then."""
    bag.begin_file()
    with file.open('rb') as stream:
        salvage = Salvage(RecordSource(stream))
        definitions = salvage.data.definitions
        reported = 0
        for record in salvage.find_records():
            bag.add_item(record, definitions)
            if salvage.examined_to != reported:
                reported = salvage.examined_to
                yield reported
        bag.add_channels(definitions)
    findings.losses += [(file.name, loss) for loss in salvage.losses]
    findings.repaired += [f'{file.name}: {what}' for what in salvage.repaired]
    if salvage.data.unchecked:
        findings.remarks.append(
            f'{file.name}: {salvage.data.unchecked:,} messages without a checksum, kept unchecked'
        )
    statistics = salvage.index.statistics if salvage.index else None
    if statistics is None:
        findings.all_expected = False
        return
    for number, count in statistics.channel_message_counts.items():
        if number in definitions.channels:
            findings.expected[definitions.channels[number].topic] += count


def _make_recovery(
    target: Path, bag: RecoveredBag, information: Mapping[str, Any], findings: _Findings
) -> Recovery:
    promised: Mapping[str, int] = findings.expected
    exact = findings.all_expected
    if not exact:
        promised = expected_counts(information)
        exact = UNFINISHED not in custom_of(information)
    names = dict.fromkeys([*bag.topic_names, *promised])
    return Recovery(
        folder=target,
        topics=tuple(
            TopicRecovery(name, saved, _known_expected_count(promised, name, saved, exact))
            for name, saved in ((name, bag.counts[name]) for name in names)
        ),
        attachments=tuple(bag.attachments),
        losses=tuple(findings.losses),
        repaired=tuple(findings.repaired),
        remarks=tuple(findings.remarks),
    )


def _known_expected_count(
    promised: Mapping[str, int], name: str, saved: int, exact: bool
) -> int | None:
    """
    Return the original number of messages; None if unknown.

    An unfinished bag counts the messages on the disk at the last flush: there were at least as
    many. If more were saved than it states, the number is unknown.
    """
    count = promised.get(name, 0)
    known = saved < count or (exact and bool(promised) and saved == count)
    return count if known else None


@contextmanager
def _new_folder(target: Path) -> Iterator[None]:
    """Create a folder; remove it again if the body fails."""
    remedy = 'name a folder on a disk with free space, with -o'
    try:
        target.mkdir(parents=True)
    except FileExistsError:
        raise _exists_error(target) from None
    except OSError as error:
        reason = f'cannot be made: {error.strerror or error}'
        raise RecordingError(target, reason, remedy) from None
    try:
        yield
    except OSError as error:
        shutil.rmtree(target, ignore_errors=True)
        reason = f'cannot be written: {error.strerror or error}'
        raise RecordingError(target, reason, remedy) from None
    except BaseException:
        shutil.rmtree(target, ignore_errors=True)
        raise


def _exists_error(target: Path) -> RecordingError:
    return RecordingError(target, 'exists already', 'name a new folder with -o')
