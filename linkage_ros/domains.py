# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""ROS domains: each belongs to one process of the machine at a time."""

from __future__ import annotations

import atexit
from collections.abc import Iterator
from contextlib import contextmanager, ExitStack
import fcntl
from functools import cache
import os
from pathlib import Path
from tempfile import gettempdir

from linkage_ros.errors import LinkageError

_DOMAINS = range(1, 102)
"""ROS domains whose ports are safe on every operating system."""


@contextmanager
def held_domain() -> Iterator[int]:
    """Hold a ROS domain that no other process here holds; a LinkageError if all are held."""
    # Not from the first domain, which other programs take.
    first = os.getpid() % len(_DOMAINS)
    for domain in (*_DOMAINS[first:], *_DOMAINS[:first]):
        with _lock_domain(domain) as held:
            if held:
                yield domain
                return
    raise LinkageError(
        'ROS_DOMAIN_ID', f'{len(_DOMAINS)} graphs run on this machine', 'end some of them'
    )


@contextmanager
def _lock_domain(domain: int) -> Iterator[bool]:
    """Lock the file of a domain; return whether it could be locked."""
    with ExitStack() as opened:
        try:
            # The folder is open to all users: the name may be a link, or a file with content.
            file = os.open(
                Path(gettempdir(), f'linkage_ros_domain_{domain}'),
                os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK,
            )
            opened.callback(os.close, file)
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:  # held by another process, or another user's
            yield False
        else:
            yield True


@cache
def private_domain() -> int:
    """Return the ROS domain that this process holds until its end, see `held_domain`."""
    held = ExitStack()
    atexit.register(held.close)
    return held.enter_context(held_domain())
