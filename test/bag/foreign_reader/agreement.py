# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The foreign reader agrees with our reader, rclpy, rosbags and metadata.yaml.

Messages are compared as bytes and as what is in them; what is in them is worked out three times:
by npm's packages and by rosbags from the definitions in the bag, by rclpy from its own.
"""

from array import array
import base64
from collections.abc import Iterator, Sequence
from dataclasses import fields, is_dataclass
import hashlib
from importlib import import_module
import json
from math import copysign, inf, isnan
from operator import itemgetter
import os
from pathlib import Path
import subprocess
from typing import Any
import warnings

from linkage_ros.bag import Bag, CHANNELS_FILE, DISCARDED, read_bag
import numpy as np
import pytest
from rclpy.serialization import deserialize_message
from rosbags.highlevel import AnyReader
from rosbags.typesys import get_types_from_msg, get_typestore, Stores
import yaml

from ...node_packages import (
    FOREIGN_READER,
    install_foreign_reader,
    node,
    UnreachableError,
)

_SCRIPT = Path(__file__).with_name('read.cjs')
Record = dict[str, Any]


def require_reader() -> None:
    """Skip what needs the foreign reader where it cannot be had, and say so loudly."""
    try:
        install_foreign_reader()
    except UnreachableError as error:
        loss = 'NO BAG IS READ IN ANOTHER LANGUAGE: the npm registry cannot be reached'
        warnings.warn(f'{loss}: {error}', stacklevel=1)
        pytest.skip(loss)
    except ModuleNotFoundError as error:
        pytest.skip(f'NO BAG IS READ IN ANOTHER LANGUAGE: {error}')


def read(file: Path, how: str) -> list[Record]:
    """Return all that the foreign reader finds in a file, 'indexed' or 'streamed'."""
    environment = os.environ | {'NODE_PATH': str(FOREIGN_READER / 'node_modules')}
    process = subprocess.run(
        [node(), _SCRIPT, how, file], env=environment, capture_output=True, text=True, check=False
    )
    assert process.returncode == 0, process.stderr
    # JavaScript has no integers: of 2**60 it writes as many digits as tell it from others.
    return [json.loads(line, parse_int=float) for line in process.stdout.splitlines()]


def of_kind(records: Sequence[Record], kind: str) -> list[Record]:
    return [record for record in records if record['kind'] == kind]


def plain(value: Any) -> Any:
    """Return a message of rclpy or rosbags as the foreign reader prints it."""
    if hasattr(value, 'get_fields_and_field_types'):
        return {name: plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if is_dataclass(value):
        # The others are constants, and the type's name.
        names = [field.name for field in fields(value) if field.name[0].islower()]
        return {name: plain(getattr(value, name)) for name in names}
    if isinstance(value, np.ndarray | array):
        return [plain(each) for each in value.tolist()]
    if isinstance(value, list | tuple):
        return [plain(each) for each in value]
    if isinstance(value, bytes):  # rclpy's byte
        (value,) = value
    if isinstance(value, float):
        if isnan(value):
            return 'NaN'
        if abs(value) == inf:
            return 'Infinity' if value > 0 else '-Infinity'
        if value == 0 and copysign(1, value) < 0:
            return '-0'
    return value


def assert_agreement(folder: Path) -> Bag:
    """Assert that all readers find the same in a finished bag, and return it."""
    bag = read_bag(folder)
    information = yaml.safe_load((folder / 'metadata.yaml').read_text())[
        'rosbag2_bagfile_information'
    ]
    ours = list(_ours(bag))
    files = [(file, read(file, 'indexed'), read(file, 'streamed')) for file in bag.files]
    assert [m for *_, streamed in files for m in _messages(streamed)] == ours
    for told, (file, indexed, streamed) in zip(information['files'], files, strict=True):
        assert told['path'] == file.name
        messages = _messages(streamed)
        # Where log times are equal, the order of the index is nobody's promise.
        key = itemgetter('logTime', 'topic', 'sequence')
        assert sorted(_messages(indexed), key=key) == sorted(messages, key=key)
        times = [int(m['logTime']) for m in _messages(indexed)]
        assert times == sorted(times)
        assert (told['message_count'], told['duration']['nanoseconds']) == (
            len(times),
            times[-1] - times[0] if times else 0,
        )
        assert of_kind(streamed, 'end') == [{'kind': 'end', 'whole': True}]
        for kind in ('header', 'schema', 'channel', 'attachment', 'metadata', 'statistics'):
            assert of_kind(indexed, kind) == of_kind(streamed, kind)
        _assert_described(bag, information, indexed)
    assert sum(told['message_count'] for told in information['files']) == len(ours)
    last = of_kind(files[-1][1], 'metadata')
    (said,) = [record['metadata'] for record in last if record['name'] == 'rosbag2']
    assert yaml.safe_load(said['serialized_metadata']) == information
    return bag


def _messages(records: Sequence[Record]) -> list[Record]:
    messages = of_kind(records, 'message')
    assert not any(message['left'] for message in messages), 'bytes that no field explains'
    return messages


def _ours(bag: Bag) -> Iterator[Record]:
    """Yield the messages that our reader finds, as the foreign one prints them."""
    # Of a ring the files that are gone have had the first numbers.
    gone = json.loads(bag.custom.get(DISCARDED, '{}'))
    sequences = {topic.name: gone.get(topic.name, 0) for topic in bag.topics}
    kinds = {topic.name: topic.type for topic in bag.topics}
    with AnyReader([bag.path]) as rosbags:
        for topic, log_time, publish_time, data in bag.messages():
            message = plain(rosbags.deserialize(data, kinds[topic]))
            assert plain(deserialize_message(data, message_class(kinds[topic]))) == message
            yield {
                'kind': 'message',
                'topic': topic,
                'sequence': sequences[topic],
                'logTime': str(log_time),
                'publishTime': str(publish_time),
                'sha256': hashlib.sha256(data).hexdigest(),
                'left': False,
                'message': message,
            }
            sequences[topic] += 1


def message_class(name: str) -> Any:
    """Return rclpy's class of a message, by 'package/msg/Type'."""
    package, _, kind = name.split('/')
    return getattr(import_module(f'{package}.msg'), kind)


def _assert_described(bag: Bag, information: dict[str, Any], records: Sequence[Record]) -> None:
    """Assert that a file says of itself what metadata.yaml and our reader say."""
    (header,) = of_kind(records, 'header')
    assert header['profile'] == 'ros2'
    attachments = of_kind(records, 'attachment')
    found = {each['name']: base64.b64decode(each['base64']) for each in attachments}
    found.pop(CHANNELS_FILE, None)  # What is recovered is finished, and needs none.
    assert found == bag.attachments
    schemas = {schema['id']: schema for schema in of_kind(records, 'schema')}
    channels = of_kind(records, 'channel')
    assert [topic['topic_metadata'] for topic in information['topics_with_message_count']] == [
        {
            'name': channel['topic'],
            'type': schemas[channel['schemaId']]['name'],
            'serialization_format': channel['messageEncoding'],
            'offered_qos_profiles': yaml.safe_load(channel['metadata']['offered_qos_profiles']),
            'type_description_hash': channel['metadata']['topic_type_hash'],
        }
        for channel in channels
    ]
    for channel in channels:
        schema = schemas[channel['schemaId']]
        assert channel['messageEncoding'] == 'cdr'
        assert schema['encoding'] == 'ros2msg'
        assert set(channel['metadata']) == {'offered_qos_profiles', 'topic_type_hash'}
        assert channel['metadata']['topic_type_hash'] == _hash_of(schema)
    messages = of_kind(records, 'message')
    (statistics,) = of_kind(records, 'statistics')
    assert statistics['messageCount'] == str(len(messages))
    assert {key: int(count) for key, count in statistics['channelMessageCounts'].items()} == {
        f'{channel["id"]:.0f}': count
        for channel in channels
        if (count := sum(m['topic'] == channel['topic'] for m in messages))
    }
    assert statistics['attachmentCount'] == len(attachments)
    assert statistics['metadataCount'] == len(of_kind(records, 'metadata'))
    assert (statistics['schemaCount'], statistics['channelCount']) == (len(schemas), len(channels))
    if messages:
        times = [int(message['logTime']) for message in messages]
        assert (int(statistics['messageStartTime']), int(statistics['messageEndTime'])) == (
            min(times),
            max(times),
        )


def _hash_of(schema: Record) -> str:
    """Return the hash (REP 2016) of the type that a schema's text defines."""
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(schema['text'], schema['name']))
    return str(store.hash_rihs01(schema['name']))
