# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""``ros2 run linkage_ros pd_controller``: a controller of a joint's effort, until a signal."""

from __future__ import annotations

from importlib import import_module
import sys

import linkage_ros.before_imports  # noqa: F401 (before all other imports)
from linkage_ros.errors import LinkageError, missing_packages_reported
from linkage_ros.signals import stop_on_signals


def main() -> int:
    """Run the node and return the exit code."""
    # First of all, as in `linkage_node`.
    stop = stop_on_signals()
    try:
        with missing_packages_reported():
            nodes = import_module('linkage_ros.node.demo_nodes')
    except LinkageError as error:
        print(f'pd_controller: {error}', file=sys.stderr)
        return 2
    return int(nodes.run_pd_controller(stop))


if __name__ == '__main__':
    sys.exit(main())
