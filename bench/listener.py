# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Listen to ``joint_states`` and ``/diagnostics`` and report on request.

For every line on its standard input it answers with a line of JSON: the monotonic time, the
publisher's number of the last message (counting could miss some), the number of messages received,
and the last diagnostics. The line ``forget`` drops the diagnostics first. ``stalls`` counts the
gaps between stamps that are as long as the shared-memory check of Fast DDS. It polls, so that its
own wake-ups take little processor time.
"""

from __future__ import annotations

import json
import select
from struct import unpack_from
import sys
from time import monotonic_ns
from typing import Any

from bench.raw_node import keep_last, node, subscription, taker
from diagnostic_msgs.msg import DiagnosticArray
from linkage_ros.messages import NANOSECONDS
from linkage_ros.signals import stop_on_signals

_POLL = 0.005
_DEPTH = 2000
_CHECK = 325_000_000, 355_000_000
"""Slightly more than a third of the ``healthy_check_timeout_ms`` of 1000, in [ns]."""


def main() -> None:
    """Listen until a signal or the end of the input."""
    stop = stop_on_signals()
    with node('listener') as listener:
        take = taker(subscription(listener, 'joint_states', keep_last(_DEPTH)))
        diagnostics = listener.create_subscription(
            DiagnosticArray, '/diagnostics', lambda _: None, keep_last(10)
        )
        published = received = stalls = stamp = 0
        health: dict[str, str] = {}
        while not stop.is_set():
            asked = bool(select.select([sys.stdin], [], [], _POLL)[0])
            while (taken := take()) is not None:
                published = taken[1]['publication_sequence_number']
                received += 1
                before, stamp = stamp, _stamp(taken[0])
                stalls += _CHECK[0] < stamp - before < _CHECK[1]
            now = monotonic_ns()
            while (message := diagnostics.handle.take_message(DiagnosticArray, False)) is not None:
                health = _values(message[0])
            if asked:
                question = sys.stdin.readline().strip()
                if not question:
                    break
                if question == 'forget':
                    health = {}
                answer = {'time': now, 'published': published, 'received': received}
                print(json.dumps({**answer, 'stalls': stalls, 'health': health}), flush=True)


def _stamp(message: bytes) -> int:
    seconds, nanoseconds = unpack_from('<iI', message, 4)
    return int(seconds * NANOSECONDS + nanoseconds)


def _values(message: DiagnosticArray) -> dict[str, Any]:
    return {v.key: v.value for status in message.status for v in status.values}


if __name__ == '__main__':
    main()
