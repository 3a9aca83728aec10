# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Run tests that failed again, one at a time, and list them.

`make test` runs this file last, with the caches of its parts. On a busy machine a test that starts
nodes may wait in vain, so of the parts in `WITH_NODES` the second outcome counts. Any other test
that failed once fails the run, which that part has said already: what it tests depends on chance.
Where a worker crashed, its whole file runs again, since the tests after the crash did not run.
"""

import json
from pathlib import Path
import subprocess
import sys

WITH_NODES = {'pytest_nodes', 'pytest_alone'}
"""Caches of the parts whose tests start nodes."""


def failed_in(cache: Path) -> list[str]:
    """Return the tests that failed when this cache was last used."""
    return _read(cache, 'cache/lastfailed')


def _read(cache: Path, key: str) -> list[str]:
    file = cache / 'v' / key
    return [*json.loads(file.read_text('utf-8'))] if file.exists() else []


def main(caches: list[Path]) -> int:
    """Return 0 if nothing failed but tests with nodes, which pass now."""
    failed = {cache: failed_in(cache) for cache in caches}
    lines = []
    code = 0
    for cache, first in failed.items():
        if not first:
            continue
        print('make: tests that failed beside others run again, one at a time', flush=True)
        # `CRASHED` of test/support/crashed_workers.py.
        files = dict.fromkeys(_read(cache, 'linkage_ros/crashed'))
        chosen = [*files, *(test for test in first if test.partition('::')[0] not in files)]
        run = ['-m', 'pytest', '-o', f'cache_dir={cache}', '--durations', '25', *chosen]
        ran = subprocess.run([sys.executable, *run], check=False).returncode
        second = failed_in(cache) if ran <= 1 else first
        for test in first:
            passed = 'failed again' if test in second else 'passes alone'
            lines.append(f'  {test}: {passed}')
        if second or ran > 1 or cache.name not in WITH_NODES:
            code = 1
    if lines:
        print('make: tests that failed once:', *lines, sep='\n', flush=True)
    return code


if __name__ == '__main__':
    sys.exit(main([Path(name) for name in sys.argv[1:]]))
