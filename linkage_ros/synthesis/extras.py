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


"""Libraries that only some kinds of synthesis need, and what to install where one is missing."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from linkage_ros.errors import LinkageError


def scipy_optimize() -> Any:
    """Return scipy.optimize, for all that is fitted."""
    return _library('scipy.optimize', 'design')


def distributed() -> Any:
    """Return dask.distributed, for studies that outgrow one machine."""
    return _library('distributed', 'dask')


def _library(name: str, extra: str) -> Any:
    try:
        return import_module(name)
    except ModuleNotFoundError:
        raise LinkageError(
            name.partition('.')[0], 'is not installed', f"pip install 'linkage_ros[{extra}]'"
        ) from None
