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

"""The user's linkage file behind a page, which saves it unless someone else has changed it."""

from __future__ import annotations

from hashlib import sha256
import os
from pathlib import Path

from linkage_ros.errors import LinkageError
from linkage_ros.files.file_access import atomic_write, read_regular
from linkage_ros.files.yaml_file import LARGEST_FILE

_REMEDY = 'download this version, or load the page again to go on from the file'


class UserFile:
    """A linkage file that pages may save."""

    def __init__(self, path: Path) -> None:
        self.path = path.absolute()

    @property
    def writable(self) -> bool:
        """Return whether the user may write it."""
        return os.access(self.path, os.W_OK)

    def state(self) -> str:
        """Return what tells its content from another one; '' if it cannot be read."""
        try:
            return digest(read_regular(self.path, LARGEST_FILE))
        except (OSError, ValueError):
            return ''

    def save(self, data: bytes, known: str) -> str:
        """
        Replace the content that the page has seen as the state ``known``; return the new state.

        A LinkageError says that the content is another, or that it cannot be written.
        """
        if self.state() != known:
            raise LinkageError(self.path.name, 'has changed since this page read it', _REMEDY)
        atomic_write(self.path, data)
        return digest(data)


def digest(data: bytes) -> str:
    """Return a digest of the content of a file."""
    return sha256(data).hexdigest()
