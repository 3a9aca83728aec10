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


"""Where lines go out: what a terminal would obey does not, whatever a file calls its topics."""

from __future__ import annotations

import sys
from typing import Any, TextIO

from linkage_ros.errors import clean


class Outlet:
    """
    A stream of text whose lines are printable; all else is that of the stream.

    Parameters
    ----------
    stream
        Standard output, say.

    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """Write a text, of one line or several."""
        if not text.isprintable():
            text = '\n'.join(map(clean, text.split('\n')))
        return self._stream.write(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def clean_output() -> None:
    """Let standard output and standard error be clean; rich draws on what was there before."""
    sys.stdout, sys.stderr = Outlet(sys.stdout), Outlet(sys.stderr)
