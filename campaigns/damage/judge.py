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


"""What reading and recovering a damaged bag came to, held against what is true of it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from campaigns.damage.subject import Subject
from linkage_ros.bag.mcap_records import Message, Source
from linkage_ros.bag.reader import BagMessage, read_bag, topic_of
from linkage_ros.bag.salvage import Salvage
from linkage_ros.errors import BagError
from mcap.records import Attachment

FAULT = 'FAULT: '
"""What a verdict that must not be begins with."""


def judge_reading(subject: Subject, *, allow_truncated: bool) -> str:
    """Read the bag's file as it lies there now; return a verdict."""
    given: list[BagMessage] = []
    try:
        bag = read_bag(subject.file, allow_truncated=allow_truncated)
    except BagError:
        return 'refused'
    except Exception as error:  # noqa: BLE001
        return f'{FAULT}{type(error).__name__}'
    end = 'says nothing'
    try:
        given.extend(bag.messages())
    except BagError:
        end = 'says so'
    except Exception as error:  # noqa: BLE001
        return f'{FAULT}{type(error).__name__}'
    if bag.truncated:
        end = 'says so'
    if not _is_subset(bag.topics, subject.topics):
        return f'{FAULT}a false topic'
    if not bag.attachments.items() <= subject.attachments.items():
        return f'{FAULT}a false attachment'
    complete = len(bag.attachments) == len(subject.attachments)
    return _verdict(given, subject.messages, end, complete=complete)


def judge_salvage(subject: Subject) -> str:
    """Look for what is whole in the bag's file as it lies there now; return a verdict."""
    given: list[BagMessage] = []
    attachments: dict[str, bytes] = {}
    channels = {}
    try:
        with subject.file.open('rb') as stream:
            salvage = Salvage(Source(stream))
            for found in salvage.found():
                if isinstance(found, Message):
                    channels[id(found.channel)] = found.channel
                    given.append(
                        BagMessage(
                            found.channel.topic, found.log_time, found.publish_time, found.data
                        )
                    )
                elif isinstance(found, Attachment):
                    attachments[found.name] = found.data
    except Exception as error:  # noqa: BLE001
        return f'{FAULT}{type(error).__name__}'
    known = salvage.data.definitions
    topics = [topic_of(channel, known.schema_of(channel)) for channel in channels.values()]
    if not _is_subset(topics, subject.topics):
        return f'{FAULT}a false topic'
    if not attachments.items() <= subject.attachments.items():
        return f'{FAULT}a false attachment'
    end = 'says so' if salvage.losses else 'says nothing'
    complete = len(attachments) == len(subject.attachments)
    return _verdict(given, subject.messages, end, complete=complete)


def _verdict(
    given: Sequence[BagMessage], true: Sequence[BagMessage], end: str, *, complete: bool
) -> str:
    if given == true:
        amount = 'all' if complete else 'all messages'
    elif _is_part(given, true):
        amount = 'a part' if given else 'none'
    else:
        return f'{FAULT}a false message'
    if amount != 'all' and end == 'says nothing':
        return f'{FAULT}{amount}, and says nothing'
    return f'{amount}, {end}'


def _is_part(given: Sequence[BagMessage], true: Sequence[BagMessage]) -> bool:
    """Say whether these are some of those, in their order."""
    if given == true[: len(given)]:
        return True
    rest = iter(true)
    return all(message in rest for message in given)


def _is_subset(some: Iterable[object], those: Sequence[object]) -> bool:
    return all(each in those for each in some)
