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

"""What a disk can answer to a call, and to which."""

from __future__ import annotations

from collections.abc import Mapping
import errno
from typing import NamedTuple

_WRITES = frozenset({'write', 'pwrite'})
_TAKE_ROOM = _WRITES | {'create', 'fsync', 'rename', 'fallocate', 'mkdir', 'close'}
_CHANGE = _WRITES | {'create', 'fsync', 'rename', 'fallocate', 'mkdir', 'ftruncate', 'unlink'}
_ALL = _CHANGE | {'open', 'close', 'rmdir', 'statfs'}


class Fault(NamedTuple):
    """
    What a call comes to.

    Attributes
    ----------
    calls
        The calls that it can befall.
    error
        Its error number; 0 where it is none.
    short
        Whether it writes less than it was given.
    loses
        Whether what was written since the last fsync that succeeded is gone with it.
    harmless
        Whether a recording has to go on to its end as if nothing had been.

    """

    calls: frozenset[str]
    error: int = 0
    short: bool = False
    loses: bool = False
    harmless: bool = False


FAULTS: Mapping[str, Fault] = {
    'EIO': Fault(_ALL, errno.EIO),
    'ENOSPC': Fault(_TAKE_ROOM, errno.ENOSPC),
    'EDQUOT': Fault(_TAKE_ROOM, errno.EDQUOT),
    'EROFS': Fault(_CHANGE | {'rmdir'}, errno.EROFS),
    'EOPNOTSUPP': Fault(frozenset({'fallocate'}), errno.EOPNOTSUPP, harmless=True),
    'half is written': Fault(_WRITES, short=True, harmless=True),
    'nothing is written': Fault(_WRITES),
    'EIO, pages lost': Fault(frozenset({'fsync'}), errno.EIO, loses=True),
}
