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


"""Statistics of a recording in the bag: counts of messages, and how it ended."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import json
from typing import NamedTuple

from linkage_ros.bag.metadata import BagSummary, metadata_text

_PREFIX = 'linkage_ros.'

STATS_RECORD = f'{_PREFIX}account'
"""Name of the metadata record with the `RecordingStats` at the end of a bag's last file."""

LET_GO = f'{_PREFIX}let_go'
"""Key in the ``custom_data`` of a bag whose first files were removed: counts by topic, as JSON."""

FAILURE = f'{_PREFIX}failure'
"""Key in the ``custom_data`` of a bag whose recording ended early: the reason."""

UNFINISHED = f'{_PREFIX}unfinished'
"""Key in the ``custom_data`` of a bag in recording, or of a killed recording."""

UNFINISHED_DATA: Mapping[str, str] = {
    UNFINISHED: 'being recorded, or killed; counted is what was on the disk by the last flush'
}


class RecordingStats(NamedTuple):
    """
    Messages by topic: ``received == recorded + dropped + let_go``.

    Attributes
    ----------
    received
        Messages offered to the recorder.
    recorded
        Messages in the bag.
    dropped
        Messages for which the disk was too slow or too full, or whose times do not fit into a bag.
    let_go
        Messages in files that were removed to keep newer ones.

    """

    received: Sequence[int]
    recorded: Sequence[int]
    dropped: Sequence[int]
    let_go: Sequence[int]


def custom_data(
    custom: Mapping[str, str], summary: BagSummary, account: RecordingStats | None
) -> dict[str, str]:
    """
    Return the ``custom_data`` of a bag's metadata.

    Parameters
    ----------
    custom
        Further entries.
    summary
        Summary of the bag.
    account
        The statistics; None while they are unknown.

    """
    entries = dict(custom)
    if any(summary.let_go):
        entries[LET_GO] = _by_topic(summary.let_go, summary)
    if account:
        entries[f'{_PREFIX}received'] = _by_topic(account.received, summary)
        entries[f'{_PREFIX}dropped'] = _by_topic(account.dropped, summary)
    return entries


def last_records(
    custom: Mapping[str, str], summary: BagSummary, account: RecordingStats | None
) -> dict[str, dict[str, str]]:
    """Return the metadata records at the end of a file, by name; arguments as `custom_data`."""
    text = metadata_text(summary, custom_data(custom, summary, account), root=False)
    records = {'rosbag2': {'serialized_metadata': text}}
    if account:
        words = zip(RecordingStats._fields, account, strict=True)
        records[STATS_RECORD] = {word: _by_topic(counts, summary) for word, counts in words}
    return records


def counts_in(custom: Mapping[str, str], word: str) -> dict[str, int]:
    """
    Return the counts by topic in a bag's ``custom_data``; empty if missing or damaged.

    Parameters
    ----------
    custom
        The ``custom_data``.
    word
        Kind of counts: 'received', 'dropped' or 'let_go'.

    """
    try:
        said = json.loads(custom[f'{_PREFIX}{word}'])
    except (KeyError, ValueError, RecursionError):
        return {}
    entries = said.items() if isinstance(said, dict) else ()
    return {topic: count for topic, count in entries if type(count) is int and count >= 0}


def _by_topic(counts: Sequence[int], summary: BagSummary) -> str:
    return json.dumps({t.name: n for t, n in zip(summary.topics, counts, strict=True)})
