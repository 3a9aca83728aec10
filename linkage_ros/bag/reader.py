# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Open a bag: its files, topics and attachments, and its messages in the order of the files."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from fcntl import F_RDLCK, F_SETLEASE, F_SETSIG, F_UNLCK, fcntl
from functools import lru_cache
from io import SEEK_END
import os
from pathlib import Path, PurePosixPath
from signal import SIGURG
from typing import Any, NamedTuple

from linkage_ros.bag.mcap_records import (
    attachment_at,
    DamagedError,
    DataSection,
    Definitions,
    FoundRecord,
    HEAD,
    index_of,
    Message,
    parse_strictly,
    RecordSource,
)
from linkage_ros.bag.metadata import METADATA_FILE, ROOT_KEY, STATS_RECORD, UNFINISHED
from linkage_ros.bag.other_formats import (
    BAG_SUFFIXES,
    MCAP_SUFFIXES,
    refuse_other_format,
    unpacked_file,
)
from linkage_ros.bag.topic import CHANNELS_FILE, QosProfile, Topic
from linkage_ros.description import BINARY, bounded_yaml, kind_of_bytes, read_regular
from linkage_ros.errors import BagError, quote
from mcap.records import Attachment, Channel, Metadata, Schema
from mcap.writer import MCAP0_MAGIC

MOST_METADATA = 8 * 2**20
"""Greatest size of the metadata; for thousands of topics rosbag2 writes some megabytes."""

_WITHOUT = 'move metadata.yaml away to read the folder without it'

_RECOGNISED = 512
"""Length of the start by which a text file is recognised [bytes]."""

_RECOVER = 'linkage recover makes a complete bag from it'

MOST_ATTACHED = 64 * 2**20
"""Most bytes of a file's attachments in memory."""

_LONGEST_QOS, _MOST_QOS = 1024, 64
"""Most characters and values of one profile; rosbag2 writes some 320 and 33."""

ProgressCallback = Callable[[int], None]
"""Takes the number of bytes read of a file; an exception from it ends the reading."""


def custom_of(information: Mapping[str, Any]) -> dict[str, str]:
    """Return the ``custom_data`` of a bag's metadata: its plain values, as strings."""
    custom = information.get('custom_data')
    entries = custom.items() if isinstance(custom, dict) else ()
    # No lists: with aliases a small file could expand to fill memory.
    return {str(k): str(v) for k, v in entries if not isinstance(v, dict | list | set | tuple)}


def information_of(folder: Path) -> dict[str, Any]:
    """Return the content of ``metadata.yaml``; empty if it is missing."""
    file = folder / METADATA_FILE
    try:
        text = read_regular(file, MOST_METADATA)
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise unreadable_error(file, error) from None
    try:
        if len(text) > MOST_METADATA:
            raise ValueError(f'it is larger than {MOST_METADATA:,} bytes')
        information = bounded_yaml(text.decode())
        information = information.get(ROOT_KEY) if isinstance(information, dict) else None
        if not isinstance(information, dict):
            raise ValueError(f'no mapping {ROOT_KEY}')
    except ValueError as error:
        raise BagError(
            file, f"is not a bag's metadata ({error})", 'read the MCAP file by itself'
        ) from None
    return information


def serialized_metadata(record: Metadata) -> dict[str, Any]:
    """Return the content of rosbag2's metadata record; empty if it is damaged."""
    text = record.metadata.get('serialized_metadata', '')
    try:
        content = bounded_yaml(text if len(text) <= MOST_METADATA else '')
    except ValueError:
        return {}
    return content if isinstance(content, dict) else {}


def files_of(path: Path, information: Mapping[str, Any]) -> list[Path]:
    """Return the files of a bag, in the order of recording, if all lie in its folder."""
    if not path.is_dir():
        return [unpacked_file(path)]
    named = information.get('relative_file_paths')
    if isinstance(named, list) and named:
        # By name only, as rosbag2 does: old bags also name the folder, which may have moved.
        names = [_name_of(path, PurePosixPath(str(name))) for name in named]
    else:
        names = mcap_names(path) or _file_names(path, BAG_SUFFIXES)
    if not names:
        raise BagError(path, 'holds no .mcap file', "name a bag's folder")
    for index, name in enumerate(names):
        if name in names[:index]:
            raise BagError(path / METADATA_FILE, f'names {quote(name)} twice', _WITHOUT)
        within = os.path.realpath(path)
        if os.path.commonpath([within, os.path.realpath(path / name)]) != within:
            raise BagError(
                path / name, "leads out of the bag's folder", 'name the file that it leads to'
            )
    return [unpacked_file(path / name) for name in names]


def mcap_names(folder: Path) -> list[str]:
    """Return the names of the MCAP files in a folder, packed ones too, by number."""
    return _file_names(folder, MCAP_SUFFIXES)


def _file_names(folder: Path, suffixes: tuple[str, ...]) -> list[str]:
    files = [file for file in folder.iterdir() if file.name.endswith(suffixes)]
    return [file.name for file in sorted(files, key=by_number)]


def by_number(file: Path) -> tuple[int, str]:
    """Return a key to sort files by number: NAME_2.mcap comes before NAME_10.mcap."""
    name = file.name.removesuffix('.zstd')
    return len(name), name


def _name_of(folder: Path, path: PurePosixPath) -> str:
    if '..' in path.parts or not path.name or not path.name.isprintable():
        raise BagError(folder / METADATA_FILE, f'names {quote(str(path))} as a file', _WITHOUT)
    return path.name


def is_empty(file: Path) -> bool:
    """Return whether a file exists and is empty."""
    try:
        return file.stat().st_size == 0
    except OSError:
        return False


def is_finished(file: Path) -> bool:
    """Return whether an MCAP file is complete; raise if it is not an MCAP file."""
    length = len(MCAP0_MAGIC)
    try:
        if file.exists() and not file.is_file():
            # Opening a pipe would wait for a writer.
            raise BagError(file, 'is not a file', "name a bag's folder, or its file")
        with file.open('rb') as stream:
            start = stream.read(_RECOGNISED)
            size = stream.seek(0, SEEK_END)
            stream.seek(max(0, size - length))
            end = stream.read()
    except FileNotFoundError:
        raise BagError(file, 'does not exist', 'name the folder of a bag, or its file') from None
    except OSError as error:
        raise unreadable_error(file, error) from None
    if not start:
        raise BagError(file, 'is empty', 'its recording never began, or the power failed in it')
    refuse_other_format(file, start)
    if not start.startswith(MCAP0_MAGIC):
        kind = kind_of_bytes(start)
        binary = kind.noun == BINARY.noun
        content = f'starts with {quote(start[:length])}' if binary else f'is {kind.noun}'
        raise BagError(
            file, f'{content}, not an MCAP file', "name a bag's folder, or its .mcap file"
        )
    return size > length and end == MCAP0_MAGIC


def unreadable_error(file: Path, error: OSError) -> BagError:
    """Return the error for a file that the system cannot read."""
    reason = f'cannot be read: {error.strerror or error}'
    return BagError(file, reason, 'check its permissions and the disk')


def is_in_use(file: Path) -> bool:
    """
    Return whether a process has a file open for writing; False if that cannot be known.

    The system grants a read lease only if no process does. The lease is returned at once; nothing
    is locked. Only a file's owner may ask, and not every file system supports it.
    """
    try:
        descriptor = os.open(file, os.O_RDONLY)
    except OSError:
        return False
    try:
        # A process that opens the file between the two lines causes a signal, by default a fatal
        # one.
        fcntl(descriptor, F_SETSIG, SIGURG)
        fcntl(descriptor, F_SETLEASE, F_RDLCK)
        fcntl(descriptor, F_SETLEASE, F_UNLCK)
    except BlockingIOError:
        return True
    except OSError:
        return False
    finally:
        os.close(descriptor)
    return False


class FooterMetadata(NamedTuple):
    """Metadata that our writer puts at the end of a file."""

    custom: Mapping[str, str]  # ``custom_data`` of the bag at the end of the file
    accounted: bool  # Whether it has the statistics, the last record of a recording


def footer_metadata(file: Path) -> FooterMetadata:
    """Return the metadata at the end of a file; empty if the end is missing or damaged."""
    custom: Mapping[str, str] = {}
    accounted = False
    try:
        with file.open('rb') as stream:
            source = RecordSource(stream)
            records = index_of(source).metadata
            accounted = any(record.name == STATS_RECORD for record in records)
            # Of several records, the last one has the final outcome.
            latest = [record for record in records if record.name == 'rosbag2'][-1:]
            for latest_record in latest:
                content = source.read(latest_record.offset, latest_record.length)
                # Other records may take seconds to parse, and are not needed.
                if b'linkage_ros.' in content:
                    head = HEAD.size
                    record = parse_strictly(Metadata, content[head:])
                    custom = custom_of(serialized_metadata(record))
    except (DamagedError, OSError):
        pass  # reading the messages reports the error
    return FooterMetadata(custom, accounted)


class BagMessage(NamedTuple):
    """A message: name of the topic, log and publish time [ns], and its CDR bytes."""

    topic: str
    log_time: int
    publish_time: int
    data: bytes


@dataclass(frozen=True, slots=True)
class Bag:
    """
    A bag that can be read.

    Parameters
    ----------
    path
        Path as given by the user.
    files
        Its MCAP files, in the order of recording.
    topics
        Its topics.
    attachments
        Content by name, up to 64 MiB in total.
    passed_over
        Names of the attachments that are not read, since they exceed this limit.
    custom
        ``custom_data`` of its metadata; without metadata, the custom data of its last file.
    truncated
        Whether an end is missing, since the recording was killed or is still running: the end of a
        file, or a further file of a bag whose files are complete.

    """

    path: Path
    files: tuple[Path, ...]
    topics: tuple[Topic, ...]
    attachments: Mapping[str, bytes]
    passed_over: tuple[str, ...]
    custom: Mapping[str, str]
    truncated: bool

    def messages(self) -> Iterator[BagMessage]:
        """
        Iterate over the messages in the order in which they were written.

        This is the file order, not the order of log times: a replay needs the order of the
        recorder. A truncated bag ends with its last whole chunk.

        Raises
        ------
        BagError
            A file is damaged; the messages before the damage have been yielded by then.

        """
        for file in self.files:
            until_damage = self.truncated and file == self.files[-1]
            for record in _read_contents(file, Definitions(), until_damage=until_damage):
                if isinstance(record, Message):
                    yield BagMessage(
                        record.channel.topic, record.log_time, record.publish_time, record.data
                    )


def read_bag(
    path: str | Path,
    *,
    allow_truncated: bool = False,
    progress: ProgressCallback = lambda read: None,
) -> Bag:
    """
    Open a bag for reading.

    Parameters
    ----------
    path
        The bag's folder, or an MCAP file.
    allow_truncated
        Whether to accept the bag of a killed recording, as far as it goes.
    progress
        Progress callback for files without an index, which are read to their end.

    Raises
    ------
    BagError
        It is missing, empty, not an MCAP file, damaged, or truncated although that is not allowed.

    """
    path = Path(path)
    information = information_of(path) if path.is_dir() else {}
    files = files_of(path, information)
    begun = allow_truncated and len(files) > 1 and is_empty(files[-1])
    if begun:
        # Killed after creating the next file and before writing to it.
        files.pop()
    whole = [is_finished(file) for file in files]
    if not all(whole) and not allow_truncated:
        raise BagError(
            files[whole.index(False)],
            'has no end: its recording was killed, or still runs',
            _RECOVER,
        )
    topics: dict[str, Topic] = {}
    attachments: dict[str, bytes] = {}
    passed_over: dict[str, None] = {}
    for file, finished in zip(files, whole, strict=True):
        definitions, attached, beyond = _read_description(file, progress, finished=finished)
        passed_over |= dict.fromkeys(beyond)
        for channel in definitions.channels.values():
            topic = topic_of(channel, definitions.schema_of(channel))
            topics.setdefault(topic.name, topic)
        for attachment in attached:
            if attachment.name != CHANNELS_FILE:
                attachments.setdefault(attachment.name, attachment.data)
    ending = footer_metadata(files[-1])
    custom = custom_of(information) if information else ending.custom
    # With the final statistics, only the last update of the metadata is missing.
    unfinished = UNFINISHED in custom and not ending.accounted
    # A file given by itself is complete, even if its recording continues in another file.
    if unfinished and path.is_dir() and not allow_truncated:
        raise BagError(path, 'is not finished: its recording was killed, or still runs', _RECOVER)
    return Bag(
        path=path,
        files=tuple(files),
        topics=tuple(topics.values()),
        attachments=attachments,
        passed_over=tuple(name for name in passed_over if name not in attachments),
        custom=custom,
        truncated=begun or not all(whole) or unfinished,
    )


def _read_description(
    file: Path, progress: ProgressCallback, *, finished: bool
) -> tuple[Definitions, list[Attachment], list[str]]:
    """
    Return schemas and channels, attachments, and the names of attachments not kept in memory.

    They come from the file's index, if it has one.
    """
    if finished:
        with _translate_errors(file), file.open('rb') as stream:
            source = RecordSource(stream)
            index = index_of(source)
            if index.definitions.channels:
                return index.definitions, *_fitting_attachments(
                    attachment_at(source, entry.offset)[0] for entry in index.attachments
                )
    definitions = Definitions()
    contents = _read_contents(file, definitions, progress, until_damage=not finished)
    return definitions, *_fitting_attachments(
        record for record in contents if isinstance(record, Attachment)
    )


def _fitting_attachments(attachments: Iterable[Attachment]) -> tuple[list[Attachment], list[str]]:
    """Return the attachments that fit into memory, and the names of the others."""
    kept, beyond, left = [], [], MOST_ATTACHED
    for attachment in attachments:
        if len(attachment.data) <= left:
            left -= len(attachment.data)
            kept.append(attachment)
        else:
            beyond.append(attachment.name)
    return kept, beyond


def _read_contents(
    file: Path,
    definitions: Definitions,
    progress: ProgressCallback = lambda _: None,
    *,
    until_damage: bool,
) -> Iterator[FoundRecord]:
    """Yield messages, attachments and metadata in file order, with checksums verified."""
    finished = is_finished(file)
    with _translate_errors(file), file.open('rb') as stream:
        source = RecordSource(stream)
        index = index_of(source) if finished else None
        if index and index.checked:
            # What the data says must be what the index says.
            definitions.schemas |= index.definitions.schemas
            definitions.channels |= index.definitions.channels
        data = DataSection(source, definitions, index.start if index else 0)
        messages, at = 0, len(MCAP0_MAGIC)
        try:
            while not data.finished:
                progress(at)
                records, end = data.read_record(at)
                for record in records:
                    messages += isinstance(record, Message)
                    yield record
                at = end
        except DamagedError as error:
            if until_damage and not finished:
                return
            raise DamagedError(f'the record at byte {at:,}: {error}') from None
        if index is None:
            return
        data.has_checksum()
        if at != index.start:
            raise DamagedError('its index does not begin at the stated position')
        promised = index.statistics
        if promised and promised.message_count != messages:
            raise DamagedError(f'{messages:,} of {promised.message_count:,} messages are there')


@contextmanager
def _translate_errors(file: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise unreadable_error(file, error) from None
    except DamagedError as error:
        raise BagError(
            file, f'is damaged: {error}', 'linkage recover saves the whole parts'
        ) from None


def topic_of(channel: Channel, schema: Schema | None) -> Topic:
    """Return the topic of a channel."""
    return Topic(
        name=channel.topic,
        type=schema.name if schema else '',
        definition=schema.data.decode('utf-8', 'replace') if schema else '',
        type_hash=channel.metadata.get('topic_type_hash', ''),
        qos=_parse_qos(channel.metadata.get('offered_qos_profiles', '')),
    )


@lru_cache(maxsize=256)
def _parse_qos(text: str) -> QosProfile:
    """Return the first profile; the default if there is none or it is invalid."""
    # The list has one profile per publisher: for /tf possibly hundreds.
    first = text.partition('\n- ')[0]
    try:
        if len(first) > _LONGEST_QOS:
            raise ValueError
        return QosProfile.from_mapping(bounded_yaml(first, _MOST_QOS)[0])
    except Exception:  # noqa: BLE001 (yaml and its numbers raise many kinds)
        # The messages are read even if their QoS is invalid.
        return QosProfile(understood=not text)
