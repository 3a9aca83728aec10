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


"""The answer for a wanted accuracy: the cheapest of what reaches it, and the rates that use it."""

from itertools import pairwise

from linkage_ros.accuracy.results import Choice, Part, replies, reply, Results
from linkage_ros.accuracy.solving import scene_choices
from linkage_ros.measuring import Spread
from linkage_ros.resources import shipped
from linkage_ros.scene.load import load_scene
import pytest

from .shown import ONE, RESULTS
from .test_solving import found

ANSWERS = replies(RESULTS)


@pytest.mark.parametrize(
    ('wanted', 'write', 'tick'),
    [
        (1.0, 'solver: {table: {tolerance: 0.001}}', '2 µs (1 µs to solve)'),
        (1e-3, 'solver: {table: {tolerance: 0.001}}', '2 µs (1 µs to solve)'),
        (0.99e-3, 'solver: closed_form # the default', '3 µs (1 µs to solve)'),
        (2.1e-16, 'solver: closed_form # the default', '3 µs (1 µs to solve)'),
        (2e-16, 'none reaches it: the most exact is 2e-16 rad off', '-'),
    ],
)
def test_the_solver_is_the_cheapest_that_reaches_it(wanted, write, tick):
    answer = reply(ANSWERS, wanted)
    assert (answer.write, answer.tick) == (write, tick)


@pytest.mark.parametrize(
    ('wanted', 'rate'),
    [
        (0.1, '100 Hz carried forward, 100 Hz held'),
        (0.05, '100 Hz carried forward, 1000 Hz held'),
        (1e-3, '1000 Hz carried forward'),
        (1e-5, 'none: at 1000 Hz a state is 0.0001 rad off when used'),
    ],
)
def test_the_rate_is_the_lowest_at_which_a_subscriber_notices_it(wanted, rate):
    assert reply(ANSWERS, wanted).rate == rate


def choice(accuracy, micros, spread=0.1):
    return Choice(accuracy, f'{accuracy:g}', ONE, Spread(micros - spread, micros, micros + spread))


def test_within_the_spread_of_the_times_the_default_wins_else_the_least_exact():
    loose, tight, default = choice(1e-3, 2.0), choice(1e-6, 1.95), choice(1e-15, 1.9, 0.2)

    def written(*choices):
        part = Part('solving', '', '', choices=choices)
        return reply(replies(Results('', [], [part])), 1.0).write

    assert written(loose, tight, default) == default.write
    assert written(loose, tight, choice(1e-15, 5.0)) == loose.write
    assert written(loose, choice(1e-6, 1.5), choice(1e-15, 5.0)) == '1e-06'


def test_answers_are_for_all_accuracies_and_each_differs_from_the_next():
    assert ANSWERS[0].accuracy == 0.0
    assert [each.accuracy for each in ANSWERS] == sorted({each.accuracy for each in ANSWERS})
    assert all(one[1:] != other[1:] for one, other in pairwise(ANSWERS))


def test_without_solvers_there_is_no_answer():
    assert replies(Results('', [], [Part('ticking', '', '', rates=RESULTS.parts[1].rates)])) == []


CHEAP_TABLES = [
    found('closed form', 2.0, 1e-16),
    *(
        found('table, Hermite', 1.0, 0.5 * wanted, setting=f'{wanted:g}')
        for wanted in (1e-3, 1e-6)
    ),
]


def test_a_table_is_a_choice_where_the_scene_takes_it(tmp_path):
    scene = load_scene(shipped('scenes/demo.yaml'))
    choices = scene_choices(scene, CHEAP_TABLES, 200)
    assert [(choice.accuracy, choice.write) for choice in choices] == [
        (1e-3, 'solver: {table: {tolerance: 0.001}}'),
        (1e-6, 'solver: {table: {tolerance: 1e-6}}'),
        (1e-16, 'solver: closed_form # the default'),
    ]
    for choice in choices:
        # What it says to write is what the scene reads.
        file = tmp_path / 'scene.yaml'
        linkage = shipped('linkages/four_bar.yaml')
        file.write_text(f'linkage: {linkage}\n{choice.write}\n', 'utf-8')
        (member,) = load_scene(file).members
        assert f'solver: {{{member.solver[0]}' in choice.write.replace(' closed', ' {closed')
        assert 0.0 < choice.tick.low <= choice.tick.middle <= choice.tick.high


def test_what_the_scene_refuses_is_no_choice():
    scene = load_scene(shipped('scenes/torque_crank.yaml'))  # forces need the closed form
    (choice,) = scene_choices(scene, CHEAP_TABLES, 200)
    assert choice.write == 'solver: closed_form # the default'
