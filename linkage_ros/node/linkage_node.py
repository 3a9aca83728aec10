# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""``ros2 run linkage_ros linkage_node``: the node, until a signal."""

from __future__ import annotations

from importlib import import_module
import sys

import linkage_ros.before_imports  # noqa: F401 (before all other imports)
from linkage_ros.errors import LinkageError, missing_packages_reported
from linkage_ros.signals import stop_on_signals, StoppedError


def main() -> int:
    """Run the node and return the exit code."""
    # Before anything else, since rclpy takes a second to load: signals must be handled from the
    # start.
    stop = stop_on_signals()
    try:
        with missing_packages_reported():
            parameters = import_module('linkage_ros.node.parameters')
            purpose = 'Solves a linkage each tick: crank in, joint states of the other joints out.'
            if parameters.show_help(
                'linkage_node', purpose, parameters.LINKAGE_NODE, '-p scene:=demo'
            ):
                return 0
            run = import_module('linkage_ros.node.run')
            return int(run.run_linkage_node(stop, sys.argv[1:]))
    except LinkageError as error:
        print(f'linkage_node: {error}', file=sys.stderr)
        return 2
    except StoppedError:
        return 0  # as for a signal at any other time


if __name__ == '__main__':
    sys.exit(main())
