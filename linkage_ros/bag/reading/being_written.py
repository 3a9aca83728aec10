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


"""Whether somebody is writing to a file, as Linux knows it."""

from __future__ import annotations

from fcntl import F_RDLCK, F_SETLEASE, F_SETSIG, F_UNLCK, fcntl
import os
from pathlib import Path
from signal import SIGURG


def is_being_written(file: Path) -> bool:
    """
    Return whether some process has a file open for writing; not if that cannot be known.

    A lease for reading is granted where nobody has. It is asked of the system and given back at
    once; nothing is locked. Only a file's owner may ask, and not of every file system.
    """
    try:
        descriptor = os.open(file, os.O_RDONLY)
    except OSError:
        return False
    try:
        # Who opens the file between the two lines has us told, by default with a deadly signal.
        fcntl(descriptor, F_SETSIG, SIGURG)
        fcntl(descriptor, F_SETLEASE, F_RDLCK)
        fcntl(descriptor, F_SETLEASE, F_UNLCK)
    except BlockingIOError:
        return True
    except OSError:
        return False
    finally:
        os.close(descriptor)
    return False
