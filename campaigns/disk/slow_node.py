# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
``python -m campaigns.disk.slow_node FILE ARGUMENTS…``: the node on a disk that stalls.

It is used where no file system can be frozen. As long as FILE exists, no write and no flush of
this process returns. They stall in the interpreter, not in the kernel.
"""

from __future__ import annotations

from collections.abc import Callable
import os
from pathlib import Path
import sys
from time import sleep
from typing import Any

from linkage_ros.node import linkage_node

_CALLS = ('fsync', 'pwrite', 'replace', 'posix_fallocate')


def _stalling(call: Callable[..., Any], file: Path) -> Callable[..., Any]:
    def stalled(*arguments: Any) -> Any:
        while file.exists():
            sleep(0.005)
        return call(*arguments)

    return stalled


def main() -> int:
    """Make the calls wait while the file exists, and run the node."""
    file = Path(sys.argv.pop(1))
    for name in _CALLS:
        setattr(os, name, _stalling(getattr(os, name), file))
    return linkage_node.main()


if __name__ == '__main__':
    sys.exit(main())
