# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Subscribers of ``joint_states`` that come and go in turn, each a DDS participant of its own.

Arguments: the number of subscribers, and the time for which each listens, in [s]. At the end it
prints a line of JSON: the number of subscribers, the number that received nothing, the number of
messages received, and the number missed between the first and the last message of each.
"""

from __future__ import annotations

from collections.abc import Iterator
import json
import sys
from time import monotonic, sleep

from bench.raw_node import keep_last, node, subscription, taker
from linkage_ros.signals import stop_on_signals

_PATIENCE = 5.0
"""Time limit for the first message, in [s]."""

_POLL = 0.005
_DEPTH = 2000


def main() -> None:
    """Create subscribers one after the other, until all are done or a signal comes."""
    stop = stop_on_signals()
    count, duration = int(sys.argv[1]), float(sys.argv[2])
    del sys.argv[1:]
    counts = {'subscribers': 0, 'silent': 0, 'received': 0, 'missed': 0}
    while counts['subscribers'] < count and not stop.is_set():
        numbers = set(_listen(duration))
        counts['subscribers'] += 1
        counts['silent'] += not numbers
        counts['received'] += len(numbers)
        if numbers:
            counts['missed'] += max(numbers) - min(numbers) + 1 - len(numbers)
    print(json.dumps(counts), flush=True)


def _listen(duration: float) -> Iterator[int]:
    """Yield the publisher's numbers of the messages received in a time in [s]."""
    with node('comer') as comer:
        take = taker(subscription(comer, 'joint_states', keep_last(_DEPTH)))
        until = monotonic() + _PATIENCE
        first = True
        while monotonic() < until:
            while (taken := take()) is not None:
                if first:
                    first, until = False, monotonic() + duration
                yield taken[1]['publication_sequence_number']
            sleep(_POLL)


if __name__ == '__main__':
    main()
