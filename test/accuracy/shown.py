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


"""Results that have all that results may have; nobody has measured them."""

from math import inf, nan

from linkage_ros.accuracy.results import (
    Axis,
    Choice,
    Curve,
    Diagram,
    Part,
    Point,
    Rate,
    Results,
    Table,
)
from linkage_ros.measuring import Spread

TIME, ERROR = Axis('time per state', 'µs'), Axis('greatest error', 'rad')
CLOSING = 'closing </script><b>tag</b> & "quotes"'
LONG = (
    'Newton warm-started from the state before, to a tolerance, with its Jacobian in closed form'
)
FOREIGN = 'größe ω̇ of 曲柄, $5$ and | a_b*c*'
CHEAP = Curve('closed form', [Point(0.7, 2.1e-16, Spread(0.68, 0.7, 0.75), None, 'double')])
NEWTON = Curve(
    LONG,
    [
        Point(1.9, 1e-3, Spread(1.8, 1.9, 2.1), Spread(5e-4, 1e-3, 2e-3), 'tolerance 1e-2'),
        Point(2.2, 1e-6, Spread(2.1, 2.2, 2.4), Spread(0.0, 1e-6, 1e-5), 'tolerance 1e-4'),
        Point(nan, 1e-9, None, None, 'tolerance 1e-8: failed'),
        Point(2.5, 1e-12, Spread(2.4, 2.5, 2.9), None, 'tolerance 1e-12'),
    ],
)
EXACT = Curve(CLOSING, [Point(300.0, 0.0, None, None, '50 digits')])
ASTRAY = Curve(
    FOREIGN, [Point(9.0, 0.1, None, None, 'started well'), Point(9.5, inf)], joined=False
)

ONE = Spread(0.9, 1.0, 1.1)

POSITION = Diagram(
    'solving_position',
    f'Position: {CLOSING} is what $is$ most accurate, and this title goes on for so long that it '
    'needs a second line',
    TIME,
    ERROR,
    [CHEAP, NEWTON, EXACT, ASTRAY],
    front=True,
)
MANY = Diagram(
    'solving_many',
    'Twenty methods that are told apart',
    TIME,
    ERROR,
    [
        CHEAP,
        *(
            Curve(f'method {n}', [Point(2.0 + n, 10.0**-k, None, None, f'{k} digits')
                                  for k in range(1, n)])
            for n in range(3, 22)
        ),
    ],
)  # fmt: skip
EMPTY = Diagram('ticking_nothing', 'Nothing came of it', TIME, Axis('CPU', '%', False), [])
FAILED = Diagram('ticking_failed', 'All failed', TIME, ERROR, [Curve('fails', [Point(nan, nan)])])
LINE = Diagram(
    'ticking_cpu',
    'What a kHz takes',
    Axis('tick rate', 'Hz', False),
    Axis('share of a processor', '', False),
    [
        Curve(
            'held',
            [Point(f, f / 9e3, None, Spread(f / 1e4, f / 9e3, f / 8e3)) for f in (0, 500, 3000)],
        )
    ],
)
DIAGRAMS = (POSITION, MANY, EMPTY, FAILED, LINE)

METHODS = Table(
    'solving_methods',
    f'What each method takes {CLOSING}',
    ('method', 'time [µs]', 'error [rad]', 'memory [B]', 'ratio', 'remark'),
    [
        ('closed form', Spread(0.68, 0.7, 0.75), 2.1e-16, 0, Spread(1.0, 1.0, 1.0), ''),
        (
            LONG,
            Spread(1.8, 1.9, 2.1),
            0.1 + 0.2,
            None,
            None,
            'said at some length, as remarks are',
        ),
        (CLOSING, 300.25, 0.0, 2**40, None, 'x, "y"\nz'),
        (FOREIGN, 'failed', inf, 3, Spread(1.0, 2.0, inf), None),
        ('fails', None, nan, None, None, None),
    ],
)
NOTHING = Table('ticking_table', 'An empty table', ('rate [Hz]', 'error [rad]'), [])
TABLES = (METHODS, NOTHING)

RESULTS = Results(
    f'four_bar {CLOSING}',
    [('processor', 'Some CPU @ 2.50GHz'), ('cores', '2'), ('linkage_ros <&>', '0.8.0')],
    [
        Part(
            'solving',
            'Solving the loop',
            f'Exact to a headline of {CLOSING}.',
            ['And what it says: $x$ and $y$.', FOREIGN],
            ['How it was measured, in <i>words</i>.'],
            [POSITION, MANY],
            [METHODS],
            ['For 1e-6 rad: a table.', f'For 1e-12 rad: {CLOSING}.'],
            f'exact to {CLOSING}',
            [
                Choice(1e-3, 'solver: {table: {tolerance: 0.001}}', ONE, Spread(1.9, 2.0, 2.1)),
                Choice(2.1e-16, 'solver: closed_form # the default', ONE, Spread(2.9, 3.0, 3.1)),
            ],
        ),
        Part(
            'ticking',
            'Ticking',
            'A headline.',
            [],
            [],
            [EMPTY, FAILED, LINE],
            [NOTHING],
            rates=[
                Rate(100.0, 0.1, 'held'),
                Rate(100.0, 1e-2, 'carried forward'),
                Rate(1000.0, 1e-2, 'held'),
                Rate(1000.0, 1e-4, 'carried forward'),
            ],
        ),
        Part('recording', 'Recording', 'Nothing was recorded.'),
    ],
)
