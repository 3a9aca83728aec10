# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The description of topics for a bag: definition and hash of a message's type, as installed."""

from __future__ import annotations

from importlib import import_module
import json
from pathlib import Path
import re
from typing import Any

from linkage_ros.bag import QosProfile, Topic
from linkage_ros.errors import LinkageError, quote, RecordingError
from linkage_ros.resources import share_folders

_MESSAGE = re.compile(r'([a-z][a-z0-9_]{0,99})/msg/([A-Z][A-Za-z0-9]{0,99})', re.ASCII)

_NESTED = re.compile(r'([a-z]\w*)/([A-Z]\w*)')
"""A message type within the type of a field, as in sequence<geometry_msgs/Point>."""

_SEPARATOR = f'\n{"=" * 80}\n'


def message_type(name: str, key: str) -> Any:
    """
    Return the class of a message type (package/msg/Type).

    Names come from bags and from the graph, so nothing is imported but the package of a message
    whose definition is installed. Raise `LinkageError`, which names ``key`` (the topic, or the key
    of the scene, with this type), if it does not name a message, or if its package is not
    installed.
    """
    matched = _MESSAGE.fullmatch(name)
    if matched is None:
        raise LinkageError(
            key,
            f'its type {quote(name)} is not a ROS 2 message',
            'messages are named package/msg/Type',
        )
    package, kind = matched.groups()
    defined = any((folder / 'msg' / f'{kind}.idl').is_file() for folder in share_folders(package))
    try:
        if defined:
            return getattr(import_module(f'{package}.msg'), kind)
    except (ImportError, AttributeError):
        pass
    raise LinkageError(
        key, f'{quote(name)} is not installed', f'install the ROS package {package}'
    )


def describe_topic(name: str, message_class: Any, qos: QosProfile) -> Topic:
    """
    Describe a topic, by its resolved name, for a bag.

    Raise `RecordingError` if the definition of the message is not installed.
    """
    package, kind = message_class.__module__.split('.')[0], message_class.__name__
    texts: dict[str, str] = {}
    _collect_definitions(message_class, package, kind, texts)
    first, *others = texts
    definition = texts[first] + ''.join(
        f'{_SEPARATOR}MSG: {name}\n{texts[name]}' for name in others
    )
    return Topic(name, f'{package}/msg/{kind}', definition, _type_hash(package, kind), qos)


def _collect_definitions(
    message_class: Any, package: str, kind: str, texts: dict[str, str]
) -> None:
    """Collect the text of a type and, after it, the texts of all types that it contains."""
    if f'{package}/{kind}' in texts:
        return
    texts[f'{package}/{kind}'] = _installed_file(package, f'{kind}.msg').read_text('utf-8')
    nested = _NESTED.findall(' '.join(message_class.get_fields_and_field_types().values()))
    # Sorted by full name, as rosbag2 does.
    for other_package, other_kind in sorted(nested):
        other_class = message_type(f'{other_package}/msg/{other_kind}', f'{package}/msg/{kind}')
        _collect_definitions(other_class, other_package, other_kind, texts)


def _type_hash(package: str, kind: str) -> str:
    described = json.loads(_installed_file(package, f'{kind}.json').read_text('utf-8'))
    hashes = {entry['type_name']: entry['hash_string'] for entry in described['type_hashes']}
    return str(hashes[f'{package}/msg/{kind}'])


def _installed_file(package: str, file: str) -> Path:
    for folder in share_folders(package):
        if (folder / 'msg' / file).is_file():
            return folder / 'msg' / file
    raise RecordingError(
        f'{package}/msg/{file}', 'is not installed', f'install the ROS package {package}'
    )
