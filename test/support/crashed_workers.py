# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What a worker of xdist leaves undone when it crashes, as rclpy may when it destroys a node."""

from typing import Any

import pytest

CRASHED = 'linkage_ros/crashed'
"""Key of pytest's cache for the files whose worker crashed: their other tests did not run."""


@pytest.hookimpl(optionalhook=True)
def pytest_handlecrashitem(crashitem: str, sched: Any) -> None:
    """Remember the file of the test at which a worker crashed."""
    cache = sched.config.cache
    cache.set(CRASHED, [*cache.get(CRASHED, []), crashitem.partition('::')[0]])
