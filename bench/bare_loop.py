# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The minimum of a tick: sleep until it is due, take bytes until none are left, publish.

It decodes no crank sample and solves no linkage; only the stamp of each message changes. The
difference between the node and this loop is the cost of the node's work.
"""

from __future__ import annotations

from struct import Struct
import sys
from time import monotonic_ns, sleep, time_ns

from bench.raw_node import node, publisher, subscription, taker
from linkage_ros.messages import JointStateWriter, NANOSECONDS
from linkage_ros.signals import stop_on_signals

_STAMP = Struct('<iI')


def main() -> None:
    """Tick until a signal; the rate, in [Hz], is the first argument."""
    stop = stop_on_signals()
    period = NANOSECONDS / float(sys.argv[1])
    message = bytearray(
        JointStateWriter(['coupler_joint', 'rocker_joint']).write(0, (1.0, 2.0), (3.0, 4.0))
    )
    with node('bare_loop') as bare:
        take = taker(subscription(bare, 'crank_states'))
        publish = publisher(bare, 'joint_states').handle.publish_raw
        begin = monotonic_ns()
        number = 0
        while not stop.is_set():
            number += 1
            wait = begin + round(number * period) - monotonic_ns()
            if wait > 0:
                sleep(wait * 1e-9)
            while take() is not None:
                pass
            _STAMP.pack_into(message, 4, *divmod(time_ns(), NANOSECONDS))
            publish(message)


if __name__ == '__main__':
    main()
