# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Install a wheel or a source distribution into an empty environment, and put it to work there.

`make release` runs this file. The environment lies outside the checkout, and gets from the index
what a user would get from it, in the newest versions that the bounds in `setup.py` allow.
"""

import os
from pathlib import Path
import subprocess
import sys
import tempfile
import venv

WORK = (
    'linkage --version',
    'linkage gallery four_bar -o four_bar.yaml',
    'linkage check four_bar.yaml',
    'linkage demo --seconds 2',
    'linkage run worn_press --seconds 2 --plain',
    'linkage_node --help',
    'linkage_relay --help',
    'crank_source --help',
    'pd_controller --help',
)


def environment() -> dict[str, str]:
    """Return the settings of a run: a ROS graph of its own, and no modules from elsewhere."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith('PYTHON')}
    graph = {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST', 'ROS_DOMAIN_ID': '57'}
    return kept | graph | {'PYTHONSAFEPATH': '1'}


def main() -> int:
    """Try each file that is named; return 1 at the first that fails."""
    for named in sys.argv[1:]:
        file = Path(named).resolve()
        with tempfile.TemporaryDirectory() as folder:
            prefix = Path(folder, 'environment')
            venv.create(prefix, with_pip=True)
            install = f'python -m pip --quiet install {file}[ros,report]'
            for command in (install, *WORK):
                name, *words = command.split()
                done = subprocess.run(
                    [prefix / 'bin' / name, *words],
                    cwd=folder,
                    env=environment(),
                    stdout=subprocess.PIPE,
                    stderr=subprocess.STDOUT,
                    text=True,
                    check=False,
                )
                if done.returncode:
                    print(f'{done.stdout}{file.name}: failed: {command}', file=sys.stderr)
                    return 1
                print(f'{file.name}: works: {command}', flush=True)
    return 0


if __name__ == '__main__':
    sys.exit(main())
