# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""``python -m linkage_ros`` is ``linkage``, also where no script of that name is installed."""

import linkage_ros.before_imports  # noqa: F401 (before all other imports)
from linkage_ros.signals import end_at_signals


def main() -> int:
    """Run ``linkage``; a signal ends it in order from here on, also during the first imports."""
    end_at_signals(b'linkage: stopped\n')
    from linkage_ros.cli import main as command  # local import: see above

    return command.main()


if __name__ == '__main__':
    raise SystemExit(main())
