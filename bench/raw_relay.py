# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The minimum of a node with samples: wait for one, take its bytes, publish them."""

from __future__ import annotations

from bench.raw_node import node, publisher, subscription, taker, waiter
from linkage_ros.signals import stop_on_signals

_LONGEST_WAIT = 100_000_000


def main() -> None:
    """Relay until a signal."""
    stop = stop_on_signals()
    with node('raw_relay') as relay:
        crank = subscription(relay, 'crank_states')
        take, wait = taker(crank), waiter(relay, crank)
        publish = publisher(relay, 'joint_states').handle.publish_raw
        while not stop.is_set():
            if wait(_LONGEST_WAIT):
                while (taken := take()) is not None:
                    publish(taken[0])


if __name__ == '__main__':
    main()
