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

"""
``python -m campaigns.attacks``: what comes from elsewhere, changed at random, through everything.

Nothing shows a traceback, hangs, fills the memory, or says more than a screen.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from datetime import datetime
from functools import partial
from pathlib import Path
import sys
import time

from bench.report import machine_table, say, show, Table, write_page
from campaigns.attacks import bags, files, graph, signals

PAGE = Path('docs/recordings/attacks.md')

INTRO = """\
Made by `make attacks`. All linkages and scenes that come with the package, URDFs made of them, and
tables are changed at random: numbers by zeros, by the smallest and the greatest there are, by what
is none; keys and values by others, by other types and by words that mean something elsewhere;
lines left out, doubled and moved; bits flipped; files cut, and encoded otherwise. Each goes
through a command that takes such a file, which has to end in time and within 4 GiB of addresses:
with what it was asked for, or with exit code 2 and one line of at most 1,000 letters, without a
warning of a library. `linkage scene` may say several things that are wrong, a line each. Bags have
bits flipped, records taken out, doubled and moved, lengths and texts replaced, and go through the
commands that look at one, likewise. Signals come to commands at random instants: the command ends
with exit code 1 and a line, and leaves no file but what it was asked for. A node gets floods of
messages, good and bad, small and of megabytes, and storms of calls: it goes on, and accounts for
every message. Whatever else happens is a finding.
"""

_Attack = Callable[[], tuple[dict[str, int], list[str]]]


def main() -> int:
    """Attack; 1 where anything is found."""
    parser = argparse.ArgumentParser('python -m campaigns.attacks', description=__doc__)
    parser.add_argument('--files', type=int, default=3000, help='changed files')
    parser.add_argument('--signals', type=int, default=60, help='commands that get a signal')
    parser.add_argument('--bags', type=int, default=300, help='hostile bags')
    parser.add_argument('--seconds', type=float, default=60.0, help='of storms on the graph')
    parser.add_argument('--jobs', type=int, default=2, help='processes that share the files')
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--write', action='store_true', help=f'keep the outcome in {PAGE}')
    given = parser.parse_args()
    began, begin = time.monotonic(), datetime.now().astimezone()
    attacks: dict[str, _Attack] = {
        'Files': partial(files.attack, given.files, given.seed, given.jobs),
        'Bags': partial(bags.attack, given.bags, given.seed, given.jobs),
        'Signals': partial(signals.attack, given.signals, given.seed),
        'Graph': partial(graph.attack, given.seconds, given.seed),
    }
    tables, all_found = [], []
    for name, attack in attacks.items():
        tried, findings = attack()
        table = Table(f'{name}: {sum(tried.values()):,} tried, {len(findings)} findings', ('', ''))
        table.rows.extend((how, f'{count:,}') for how, count in tried.items())
        tables.append(table)
        all_found += findings
        for finding in findings:
            say(finding)
    seconds = time.monotonic() - began
    tables.append(machine_table(begin, ('seed', str(given.seed)), ('took', f'{seconds:.0f} s')))
    for table in tables:
        show(table)
    if given.write:
        write_page(PAGE, 'Attacks', INTRO, tables)
    return int(bool(all_found))


if __name__ == '__main__':
    sys.exit(main())
