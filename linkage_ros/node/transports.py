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

"""
Transports of Fast DDS: no shared memory, unless the user configures the transports.

For every new subscriber, a publisher opens and checks its shared-memory port, on the publishing
thread. The check may wait a third of the ``healthy_check_timeout_ms`` of the port's creator, 0.33
s by default (Fast-DDS issue 6535, `SharedMemGlobal.hpp` of 2.14.5). Ticks stand still meanwhile.
UDP within a machine costs the same, and clients with default settings receive it.
"""

from __future__ import annotations

import os
from pathlib import Path
import re

from rclpy.utilities import get_rmw_implementation_identifier

_TRANSPORTS = 'FASTDDS_BUILTIN_TRANSPORTS'
_SAID = (
    _TRANSPORTS,
    'FASTRTPS_DEFAULT_PROFILES_FILE',
    'FASTDDS_DEFAULT_PROFILES_FILE',
    'RMW_FASTRTPS_PUBLICATION_MODE',
)
"""Environment variables with which the user configures the transports."""

_PROFILES = 'DEFAULT_FASTRTPS_PROFILES.xml', 'DEFAULT_FASTDDS_PROFILES.xml'
"""Files in the working folder with the same purpose."""

_SHARED = re.compile(r'/(?:fastrtps|fastdds)_port\d+$', re.MULTILINE)


def leave_out_shared_memory() -> None:
    """
    Make Fast DDS use UDP only, unless the user has configured the transports.

    Call it before `rclpy.init`; it holds for this process and its children.
    """
    if not (any(map(os.environ.get, _SAID)) or any(Path(name).is_file() for name in _PROFILES)):
        os.environ[_TRANSPORTS] = 'UDPv4'


def standstill() -> str:
    """
    Return why ticks may stand still when a subscriber comes, and the remedy; '' if they do not.

    The process's memory maps decide: with the discovery range LOCALHOST rmw_fastrtps uses shared
    memory whatever the environment says, and a context made by other code has chosen its
    transports already.
    """
    if not get_rmw_implementation_identifier().startswith('rmw_fastrtps'):
        return ''
    try:
        shared = _SHARED.search(Path('/proc/self/maps').read_text())
    except OSError:  # not Linux
        return ''
    if shared is None:
        return ''
    return (
        'Fast DDS uses shared memory: ticks may stand still for 0.33 s when a subscriber comes; '
        'start the process with FASTDDS_BUILTIN_TRANSPORTS=UDPv4, or, in the place of '
        'ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST, with the profile config/fastdds/local.xml'
    )
