# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
``linkage`` for a shell: asks the server of `commands.py`, at LINKAGE_SERVER, to run it.

It is run without site packages, so that it starts at once; signals are handed on.
"""

import json
import os
import signal
import socket
import struct
import sys
from tempfile import TemporaryFile

_NUMBER = struct.Struct('i')


def main() -> int:
    request = {
        'arguments': sys.argv[1:],
        'folder': os.getcwd(),  # noqa: PTH109 (pathlib takes as long as all the rest)
        'path': [],
        'environment': dict(os.environ),
    }
    with socket.socket(socket.AF_UNIX) as server, TemporaryFile('w+') as asked:
        json.dump(request, asked)
        asked.seek(0)
        server.connect(os.environ['LINKAGE_SERVER'])
        socket.send_fds(server, [b'.'], [0, 1, 2, asked.fileno()])
        (pid,) = _NUMBER.unpack(server.recv(_NUMBER.size))
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, lambda number, _: os.kill(pid, number))
        (code,) = _NUMBER.unpack(server.recv(_NUMBER.size))
        return code if code >= 0 else 128 - code


if __name__ == '__main__':
    sys.exit(main())
