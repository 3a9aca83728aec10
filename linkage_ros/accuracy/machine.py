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


"""What a reader has to know of the machine, to compare its numbers with those of another."""

from __future__ import annotations

from contextlib import suppress
from importlib import metadata
import os
from pathlib import Path
import platform
import re

from linkage_ros import __version__

_CPU = Path('/proc/cpuinfo')
_GOVERNOR = Path('/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor')


def describe_machine() -> list[tuple[str, str]]:
    """Return names and values: the processor, the system, and the versions that count."""
    model = None
    with suppress(OSError):
        model = re.search(r'^model name\s*: (.+)$', _CPU.read_text(), re.MULTILINE)
    return [
        ('processor', model.group(1) if model else platform.machine()),
        ('cores', str(os.cpu_count())),
        ('governor', _GOVERNOR.read_text().strip() if _GOVERNOR.exists() else 'unknown'),
        ('kernel', platform.release()),
        ('python', platform.python_version()),
        ('numpy', _version('numpy')),
        ('rclpy', _version('rclpy', 'ros-jazzy-rclpy')),
        ('middleware', os.environ.get('RMW_IMPLEMENTATION', 'as rclpy chooses')),
        ('linkage_ros', __version__),
    ]


def _version(*names: str) -> str:
    for name in names:
        with suppress(metadata.PackageNotFoundError):
            return metadata.version(name)
    return 'unknown'
