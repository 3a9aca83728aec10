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


"""What a bag needs to know of a topic, from the installed message packages and the graph."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
import json
from pathlib import Path
import re
from typing import Any

from linkage_ros.bag.topic import INFINITE, QosProfile, Topic
from linkage_ros.errors import LinkageError, RecordingError
from linkage_ros.shipped import share_folders
from rclpy.qos import QoSProfile

_FIELD = re.compile(r'^\s*(?P<type>[A-Za-z]\w*(?:/\w+)*)(?:<=\d+)?(?:\[[^\]]*\])?\s+[a-z]\w*')
_PRIMITIVES = frozenset(
    [
        'bool',
        'byte',
        'char',
        'float32',
        'float64',
        'int8',
        'uint8',
        'int16',
        'uint16',
        'int32',
        'uint32',
        'int64',
        'uint64',
        'string',
        'wstring',
    ]
)
_SEPARATOR = f'\n{"=" * 80}\n'


def message_type(name: str, key: str) -> Any:
    """
    Return the class of a message; it is imported here, so that only what is called for is.

    Parameters
    ----------
    name
        package/msg/Type.
    key
        Of the scene, that calls for it.

    Raises
    ------
    LinkageError
        Where its package is not installed.

    """
    package, _, kind = name.split('/')
    try:
        return getattr(import_module(f'{package}.msg'), kind)
    except ImportError:
        raise LinkageError(
            key,
            f'the ROS package {package} is not installed',
            'install it, or leave it out',
        ) from None


def bag_topic(name: str, message_type: Any, qos: QoSProfile) -> Topic:
    """
    Describe a topic for a bag.

    Parameters
    ----------
    name
        Resolved name.
    message_type
        The message's class.
    qos
        What is offered on the topic.

    Raises
    ------
    RecordingError
        Where the message's definition is not installed.

    """
    package, _, kind = message_type.__module__.split('.')[0], None, message_type.__name__
    texts: dict[str, str] = {}
    _collect(package, kind, texts)
    first, *others = texts
    definition = texts[first] + ''.join(
        f'{_SEPARATOR}MSG: {other}\n{texts[other]}' for other in others
    )
    return Topic(name, f'{package}/msg/{kind}', definition, _type_hash(package, kind), _qos(qos))


def _collect(package: str, kind: str, texts: dict[str, str]) -> None:
    """Collect the text of a type and, behind it, of all that it needs."""
    if f'{package}/{kind}' in texts:
        return
    text = texts[f'{package}/{kind}'] = _share(package, f'{kind}.msg').read_text('utf-8')
    # In the order of their full names, as rosbag2 has them.
    for needed in sorted(name if '/' in name else f'{package}/{name}' for name in _types(text)):
        needed_package, _, needed_kind = needed.rpartition('/')
        _collect(needed_package, needed_kind, texts)


def _types(text: str) -> Iterator[str]:
    for line in text.splitlines():
        field = _FIELD.match(line.split('#')[0])
        if field and field['type'] not in _PRIMITIVES:
            yield field['type']


def _type_hash(package: str, kind: str) -> str:
    described = json.loads(_share(package, f'{kind}.json').read_text('utf-8'))
    hashes = {entry['type_name']: entry['hash_string'] for entry in described['type_hashes']}
    return str(hashes[f'{package}/msg/{kind}'])


def _share(package: str, file: str) -> Path:
    for folder in share_folders(package):
        if (folder / 'msg' / file).is_file():
            return folder / 'msg' / file
    raise RecordingError(
        f'{package}/msg/{file}', 'is not installed', f'install the ROS package {package}'
    )


def _qos(profile: QoSProfile) -> QosProfile:
    return QosProfile(
        history=profile.history.name.lower(),
        depth=profile.depth,
        reliability=profile.reliability.name.lower(),
        durability=profile.durability.name.lower(),
        # Of rclpy's own profiles these are 0, which stands for no limit and for automatic.
        deadline=profile.deadline.nanoseconds or INFINITE,
        lifespan=profile.lifespan.nanoseconds or INFINITE,
        liveliness=profile.liveliness.name.lower() if profile.liveliness else 'automatic',
        liveliness_lease_duration=profile.liveliness_lease_duration.nanoseconds or INFINITE,
        avoid_ros_namespace_conventions=bool(profile.avoid_ros_namespace_conventions),
    )
