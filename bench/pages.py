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

"""The measurements that the documentation keeps, each as a page of its own."""

from __future__ import annotations

from collections.abc import Sequence

from bench.processes import ROOT
from bench.report import say, Table

FOLDER = ROOT / 'docs' / 'timing'

_COMERS = """\
Made by `python -m bench --only comers --write`. A node ticks with what stands in the first column;
a client listens throughout, and other clients come one after the other, each a participant of its
own that hears some messages and goes. All clients have the defaults of Fast DDS, with shared
memory. *UDP only* is `config/fastdds/local.xml`; the shorter timeout is the node's, in such a
profile.

- *stood still for 0.33 s*: gaps of 0.325 to 0.355 s between the stamps of two joint states. Where
  processors are scarce a gap may have that length by chance; *waited for CPU* says how scarce they
  were, as a sum over all threads of the node.
- *lost*: ticks that were more than 20 ms late, of all that were due while clients came and went.
- *longest*: the greatest lateness since the node began.
- *messages missed*: between the first and the last that each client heard.
"""

_REAL_TIME = """\
Made by `python -m bench --only real_time --write`: the node beside as many busy processes as there
are processors, with nothing asked for and with each of the three parameters more. A crank comes at
500 Hz, and one client listens. Lateness is that of all ticks, from the start of each run to its
end.

Discovery is LOCALHOST, which brings shared memory: of the ticks that are lost, those of a run
whose longest lateness is 0.33 s stood still when the client came. What else is lost or late with a
priority waited for threads that have none: for the interpreter's lock, or for one of the
middleware.
"""

_COMPILED = """\
Made by `python -m bench --only compiled --write`. The plain steps of a linkage are run on symbols
once, and what they do is kept as one straight Python function, which gives the same bits. Both are
asked for all published joints with rates and accelerations, in turn, over the whole range of each
linkage. `class_3` is iterated: its constraints are a straight line, the iteration is a call.

Arrays of closed states, drawn at random from the whole range, are solved by `solve` (numpy in
blocks) and by the C that `linkage compile` writes, in a loop over the states; both come of the
same tape.

![What chains of crank-rockers take over their number of dyads](chains.svg)
"""

PAGES = {
    'compiled': ('Compiled linkages', _COMPILED),
    'comers': ('Clients that come and go', _COMERS),
    'real_time': ('Ticks beside busy processes', _REAL_TIME),
}
"""Title and beginning of each page."""


def write_page(name: str, tables: Sequence[Table]) -> None:
    """Write tables as a page of the documentation."""
    title, beginning = PAGES[name]
    file = FOLDER / f'{name}.md'
    file.parent.mkdir(exist_ok=True)
    text = '\n'.join([f'# {title}', '', beginning, *(table.markdown() for table in tables)])
    file.write_text(text, encoding='utf-8')
    say(f'kept in {file}')
