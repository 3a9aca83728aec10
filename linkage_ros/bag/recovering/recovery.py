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


"""What became of a damaged bag: what was saved, what is lost, what was promised."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from linkage_ros.bag.recovering.salvage import Loss

RECOVERED = 'linkage_ros.recovered'
"""Key in the ``custom_data`` of a recovered bag: what it was made of, and what was lost."""


NOTHING_LOST = 'nothing lost'
"""How that text ends where it is so."""


class TopicRecovery(NamedTuple):
    """How many messages of a topic were saved, and how many there were; None if unknown."""

    name: str
    saved: int
    promised: int | None


class Recovery(NamedTuple):
    """
    What became of a damaged bag.

    Attributes
    ----------
    folder
        The new bag.
    topics
        What was saved of each, and what was to be there.
    attachments
        Names of those that were saved.
    losses
        What is lost, with the name of its file.
    repaired
        What was damaged or missing and cost nothing, each on a line.
    remarks
        What else one has to know, each on a line.

    """

    folder: Path
    topics: tuple[TopicRecovery, ...]
    attachments: tuple[str, ...]
    losses: tuple[tuple[str, Loss], ...]
    repaired: tuple[str, ...]
    remarks: tuple[str, ...]

    @property
    def missing(self) -> int:
        """Return how many messages were promised and are not there."""
        return sum(max((topic.promised or 0) - topic.saved, 0) for topic in self.topics)

    @property
    def whole(self) -> bool:
        """Return whether nothing was lost."""
        return not self.losses and not self.missing

    def in_short(self, path: Path) -> str:
        """Return in a line what became of the bag of this name."""
        saved = sum(topic.saved for topic in self.topics)
        lost = NOTHING_LOST
        if not self.whole:
            size = sum(loss.end - loss.start for _, loss in self.losses)
            lost = f'{size} bytes lost in {len(self.losses)} places'
        return f'from {path.absolute().name}: {saved} messages, {lost}'


def promised_counts(information: Mapping[str, Any]) -> dict[str, int]:
    """Return how many messages of each topic ``metadata.yaml`` promises, if it does."""
    counts = {}
    try:
        for each in information['topics_with_message_count']:
            counts[str(each['topic_metadata']['name'])] = int(each['message_count'])
    except Exception:  # noqa: BLE001 (it may say anything)
        return {}
    return counts if any(counts.values()) else {}
