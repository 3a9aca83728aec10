# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Small disks, where a test may mount them."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from campaigns.reliability.filling import Disk, mounted, NotPermittedError
import pytest


@contextmanager
def small_disk(work: Path, size: int) -> Iterator[Path]:
    """Mount an empty disk of so many MiB below a folder, or skip the test."""
    try:
        with mounted(Disk('small', 'tmpfs', size), work) as folder:
            yield folder
    except NotPermittedError as error:
        pytest.skip(str(error))
