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


"""What a terminal shows of what accuracy costs."""

from __future__ import annotations

from linkage_ros.accuracy.results import Part, Results, Table
from linkage_ros.cli.accuracy_tables import print_results
from linkage_ros.measuring import Spread

RESULTS = Results(
    'four_bar',
    [('cores', '2')],
    [
        Part(
            'solving',
            'Solving the loop',
            ['A text for the page.'],
            (),
            [
                Table(
                    'methods',
                    'What each takes',
                    ('method', 'time [µs]', 'error [rad]'),
                    [
                        ('closed form', Spread(0.68, 0.7, 0.75), 2.1e-16),
                        ('Newton', 12.25, None),
                        ('another', 'failed', 1e-6),
                    ],
                ),
                Table('none', 'What nobody takes', ('method', 'time [µs]'), []),
            ],
            ['For 1e-12 rad: the closed form.'],
        ),
        Part('ticking', 'Ticking', ['Nothing in numbers.']),
    ],
)


def test_tables_part_by_part_and_the_advice_at_the_end(capsys):
    print_results(RESULTS)
    assert capsys.readouterr().out == (
        'Solving the loop\n\n'
        'What each takes\n'
        'method              time [µs]  error [rad]\n'
        'closed form  0.70 (0.68–0.75)      2.1e-16\n'
        'Newton                   12.2\n'
        'another                failed         1e-6\n'
        '\n'
        'What nobody takes\n'
        'method  time [µs]\n'
        '\n'
        'Ticking\n\n'
        'Solving the loop\n'
        '  For 1e-12 rad: the closed form.\n'
    )
