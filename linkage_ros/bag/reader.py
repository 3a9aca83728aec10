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


"""Read a bag: ours, rosbag2's, or the whole part of one whose recording was killed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from errno import EINVAL
from io import SEEK_END
from pathlib import Path
from typing import Any, NamedTuple

from linkage_ros.bag.metadata import METADATA_FILE, ROOT_KEY
from linkage_ros.bag.topic import QosProfile, Topic
from linkage_ros.errors import BagError, quoted
from mcap.reader import SeekingReader
from mcap.records import Attachment, Channel, McapRecord, Message, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC
import yaml

RUN_FILE = 'run.json'
"""Name of the attachment in which a run names its scene, topics and versions."""


class BagMessage(NamedTuple):
    """One message: the topic's name, when it was received and made [ns], and its CDR bytes."""

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
        As it was named.
    files
        Its MCAP files, in the order of recording.
    topics
        Its topics.
    attachments
        Name to content.
    custom
        ``custom_data`` of its metadata.
    truncated
        Whether its recording was killed, so that an end is missing.

    """

    path: Path
    files: tuple[Path, ...]
    topics: tuple[Topic, ...]
    attachments: Mapping[str, bytes]
    custom: Mapping[str, str]
    truncated: bool

    def messages(self) -> Iterator[BagMessage]:
        """
        Iterate over the messages in the order in which they were written.

        That is the order of the file, not of the log times: a replay wants to see what the
        recorder saw. A truncated bag ends with its last whole chunk.

        Raises
        ------
        BagError
            The file is damaged; the messages before the damage have been given by then.

        """
        for file in self.files:
            names: dict[int, str] = {}
            for record in _records(file, until_damage=self.truncated and file == self.files[-1]):
                if isinstance(record, Channel):
                    names[record.id] = record.topic
                elif isinstance(record, Message):
                    if record.channel_id not in names:
                        raise _damaged(file, f'no channel {record.channel_id}')
                    name = names[record.channel_id]
                    yield BagMessage(name, record.log_time, record.publish_time, record.data)


def read_bag(path: str | Path, *, allow_truncated: bool = False) -> Bag:
    """
    Open a bag for reading.

    Parameters
    ----------
    path
        The bag's folder, or an MCAP file.
    allow_truncated
        Whether a bag whose recording was killed will do, as far as it goes.

    Raises
    ------
    BagError
        It is missing, empty, not an MCAP file, damaged, or truncated and that will not do.

    """
    path = Path(path)
    information = _information(path) if path.is_dir() else {}
    files = _files(path, information)
    whole = [_is_finished(file) for file in files]
    if not all(whole) and not allow_truncated:
        raise BagError(
            files[whole.index(False)],
            'has no end: its recording was killed, or still runs',
            'ask for the part that is there',
        )
    topics: dict[str, Topic] = {}
    attachments: dict[str, bytes] = {}
    for file, finished in zip(files, whole, strict=True):
        schemas: dict[int, Schema] = {}
        for record in _definitions(file, finished=finished):
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel):
                topics.setdefault(record.topic, _topic(record, schemas.get(record.schema_id)))
            elif isinstance(record, Attachment):
                attachments.setdefault(record.name, record.data)
    custom = information.get('custom_data') or {}
    return Bag(
        path=path,
        files=tuple(files),
        topics=tuple(topics.values()),
        attachments=attachments,
        custom={str(key): str(value) for key, value in custom.items()},
        truncated=not all(whole),
    )


def _information(folder: Path) -> dict[str, Any]:
    """Return what ``metadata.yaml`` says, nothing if it is missing: the files can do without."""
    file = folder / METADATA_FILE
    try:
        information = yaml.safe_load(file.read_text(encoding='utf-8'))[ROOT_KEY]
        if not isinstance(information, dict):
            raise TypeError
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise _unreadable(file, error) from None
    except (yaml.YAMLError, UnicodeDecodeError, KeyError, TypeError):
        raise BagError(file, "is not a bag's metadata", 'read the MCAP file by itself') from None
    return information


def _files(path: Path, information: Mapping[str, Any]) -> list[Path]:
    if not path.is_dir():
        return [path]
    named = information.get('relative_file_paths')
    if isinstance(named, list) and named:
        # By name only, as rosbag2 does: old bags carry the folder too, which may have moved.
        return [path / Path(str(name)).name for name in named]
    # NAME_2.mcap before NAME_10.mcap
    files = sorted(path.glob('*.mcap'), key=lambda file: (len(file.name), file.name))
    if not files:
        raise BagError(path, 'holds no .mcap file', "name a bag's folder")
    return files


def _is_finished(file: Path) -> bool:
    """Return whether the file is MCAP to its end; raise if not even its beginning is."""
    length = len(MCAP0_MAGIC)
    try:
        with file.open('rb') as stream:
            start = stream.read(length)
            size = stream.seek(0, SEEK_END)
            stream.seek(max(0, size - length))
            end = stream.read()
    except FileNotFoundError:
        raise BagError(file, 'does not exist', 'name the folder of a bag, or its file') from None
    except OSError as error:
        raise _unreadable(file, error) from None
    if not start:
        raise BagError(file, 'is empty', 'its recording never began, or the power failed in it')
    if start != MCAP0_MAGIC:
        raise BagError(
            file, f'starts with {quoted(start)}, as no MCAP file does', 'name an MCAP file'
        )
    return size > length and end == MCAP0_MAGIC


def _definitions(file: Path, *, finished: bool) -> Iterator[McapRecord]:
    """Yield the schemas, channels and attachments of a file; from its index, if it has one."""
    if finished:
        with _translated(file), file.open('rb') as stream:
            reader = SeekingReader(stream)
            summary = reader.get_summary()
            if summary and summary.channels:
                yield from summary.schemas.values()
                yield from summary.channels.values()
                yield from reader.iter_attachments()
                return
    for record in _records(file, until_damage=not finished):
        if isinstance(record, Schema | Channel | Attachment):
            yield record


def _records(file: Path, *, until_damage: bool) -> Iterator[McapRecord]:
    """Yield a file's records in its order, those in chunks too; checksums are checked."""
    with _translated(file, ignore=until_damage), file.open('rb') as stream:
        yield from StreamReader(stream, validate_crcs=True).records


@contextmanager
def _translated(file: Path, *, ignore: bool = False) -> Iterator[None]:
    """Turn what mcap raises on a damaged file into a `BagError`, or into nothing at all."""
    try:
        yield
    except OSError as error:
        # A damaged index sends mcap to a negative place in the file.
        if error.errno != EINVAL:
            raise _unreadable(file, error) from None
        if not ignore:
            raise _damaged(file, 'its index points outside of it') from None
    except Exception as error:  # noqa: BLE001
        # Any: mcap raises its own errors, struct.error, ValueError, KeyError, MemoryError and
        # those of the decompressors, as the damage has it.
        if not ignore:
            raise _damaged(file, f'{type(error).__name__} {error}') from None


def _topic(channel: Channel, schema: Schema | None) -> Topic:
    return Topic(
        name=channel.topic,
        type=schema.name if schema else '',
        definition=schema.data.decode('utf-8', 'replace') if schema else '',
        type_hash=channel.metadata.get('topic_type_hash', ''),
        qos=_qos(channel.metadata.get('offered_qos_profiles', '')),
    )


def _qos(text: str) -> QosProfile:
    """Return the first of the profiles; the default if there is none, or none to be understood."""
    try:
        return QosProfile.from_mapping(yaml.safe_load(text)[0])
    except (yaml.YAMLError, LookupError, TypeError, ValueError):
        # A QoS nobody understands is no reason to withhold the messages.
        return QosProfile()


def _unreadable(file: Path, error: OSError) -> BagError:
    reason = f'cannot be read: {error.strerror or error}'
    return BagError(file, reason, 'check its permissions and the disk')


def _damaged(file: Path, reason: str) -> BagError:
    return BagError(file, f'is damaged: {reason}', 'what lies before the damage can be read')
