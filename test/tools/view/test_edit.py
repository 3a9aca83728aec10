# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Edits: a pin goes where the hand takes it, all others stay, and the file keeps its form."""

from __future__ import annotations

from itertools import zip_longest
import random
from typing import Any

from linkage_ros.description import parse_yaml, read_closure
from linkage_ros.errors import FileError, LinkageError
from linkage_ros.kinematics import Closure, Status
from linkage_ros.resources import linkage_names, shipped_path
from linkage_ros.tools.view import build_model, edit_text, EditResult, pin_of
import pytest

SEED = 20261123
MOVES = 12
"""Random moves of each shipped linkage."""


def text_of(name: str) -> str:
    return shipped_path(f'linkages/{name}.yaml').read_text('utf-8')


FOUR_BAR = text_of('four_bar')
SHORT = '# my press\nunits: mm\nfour_bar: {a: 40, b: 120, c: 80, d: 100}   # the sides\n'


def closure_of(text: str) -> Closure:
    return read_closure(parse_yaml(text.encode(), 'edited'))


def pins_of(closure: Closure, inputs: tuple[float, ...]) -> dict[str, complex]:
    position = closure.position(*inputs)
    assert position.status.has_pose
    return {name: place for (_, name), place in closure.points(position).items()}


def changed_lines(before: str, after: str) -> list[str]:
    pairs = zip_longest(before.splitlines(), after.splitlines(), fillvalue='')
    return [new for old, new in pairs if old != new]


# A pin is dragged.


@pytest.mark.sample(2)
@pytest.mark.parametrize('name', sorted({*linkage_names()} - {'elliptic_trammel', 'scotch_yoke'}))
def test_dragged_pin_moves_and_all_others_stay(name: str) -> None:
    text = text_of(name)
    closure = closure_of(text)
    start = tuple(given['value'] for given in build_model(text, name, whole=False)['inputs'])
    places = pins_of(closure, start)
    slides = {slider.point for slider in closure.linkage.sliders.values()}
    rng, moved = random.Random(f'{SEED} {name}'), 0
    through = {slider.through for slider in closure.linkage.sliders.values()}
    for _ in range(MOVES):
        pin = rng.choice([pin for pin in places if pin not in slides | through])
        way = complex(rng.gauss(0.0, 1.0), rng.gauss(0.0, 1.0)) * 0.05 * closure.scale
        to = places[pin] + way
        found = edit_text(text, {'pin': pin, 'to': [to.real, to.imag], 'inputs': list(start)})
        try:
            after = closure_of(found.text)
        except FileError:  # a length that cannot close, which the model tells
            continue
        now = pins_of(after, found.inputs)
        assert now == pytest.approx({**places, pin: to}, abs=1e-7 * closure.scale)
        moved += 1
    assert moved >= MOVES // 2


def test_dragged_pin_changes_lengths_and_keeps_comments() -> None:
    found = edit_text(FOUR_BAR, {'pin': 'B', 'to': [0.13, 0.07], 'inputs': [0.7]})
    lines = changed_lines(FOUR_BAR, found.text)
    assert lines[:2] == [
        '  coupler: {A: [0, 0], B: [0.10880267554, 0], P: [0.06181391099, 0.02605840378]}',
        '  rocker: {O4: [0, 0], B: [0.07615773106, 0]}',
    ]
    # Centres of mass keep their share of the length.
    assert all(line.lstrip().startswith(('coupler: {mass', 'rocker: {mass')) for line in lines[2:])
    assert found.inputs == (0.7,)


def test_dragged_crank_pin_turns_the_crank() -> None:
    found = edit_text(
        FOUR_BAR, {'pin': 'A', 'to': [0.03, 0.03], 'inputs': [0.7 + 6.283185307179586]}
    )
    assert found.inputs == pytest.approx((0.7853981633974483 + 6.283185307179586,))
    assert '  crank: {O2: [0, 0], A: [0.04242640687, 0]}' in found.text


def test_pin_dragged_across_its_toggle_changes_the_assembly() -> None:
    found = edit_text(FOUR_BAR, {'pin': 'B', 'to': [0.13, -0.07], 'inputs': [0.7]})
    # The comment stays.
    assert 'assembly: {B: right}              # the side of A→O4 on which B lies' in found.text


def test_dragged_pin_of_a_slider_stays_in_its_slot() -> None:
    text = text_of('slider_crank')
    found = edit_text(text, {'pin': 'B', 'to': [0.2, 0.3], 'inputs': [0.5]})
    pins = pins_of(closure_of(found.text), found.inputs)
    assert pins['B'] == pytest.approx(0.2 + 0.01j, abs=1e-9)


def test_dragged_cylinder_pin_changes_the_stroke() -> None:
    text = text_of('excavator_bucket')
    found = edit_text(text, {'pin': 'C', 'to': [0.2, 0.4], 'inputs': [1.0]})
    # K is at (1.18, 0.3) in the ground.
    assert found.inputs == pytest.approx((abs(1.18 - 0.2 + (0.3 - 0.4) * 1j),))
    assert pins_of(closure_of(found.text), found.inputs)['C'] == pytest.approx(0.2 + 0.4j)


def test_snapped_pins_lie_on_the_grid() -> None:
    found = edit_text(
        FOUR_BAR, {'pin': 'O4', 'to': [0.1234, 0.0061], 'inputs': [0.7], 'snap': 0.005}
    )
    assert 'ground: {O2: [0, 0], O4: [0.125, 0.005]}' in found.text


# Numbers and choices.

EDITS: dict[str, tuple[dict[str, Any], list[str]]] = {
    'a length': (
        {'length': {'link': 'coupler', 'from': 'A', 'to': 'B', 'value': 0.13}},
        ['  coupler: {A: [0, 0], B: [0.13, 0], P: [0.060, 0.030]}'],
    ),
    'a place': (
        {'place': {'link': 'coupler', 'point': 'P', 'at': [0.01, 0.02]}},
        ['  coupler: {A: [0, 0], B: [0.120, 0], P: [0.01, 0.02]}'],
    ),
    'a traced point': (
        {'trace': {'link': 'rocker', 'at': [0.05, 0.02], 'name': 'Q'}},
        ['  rocker: {O4: [0, 0], B: [0.080, 0], Q: [0.05, 0.02]}', 'traced: [P, Q]'],
    ),
    'the other side': (
        {'side': {'B': 'right'}},
        ['assembly: {B: right}              # the side of A→O4 on which B lies, at every angle'],
    ),
}


@pytest.mark.parametrize('name', EDITS)
def test_edit_changes_only_its_own_lines(name: str) -> None:
    edit, lines = EDITS[name]
    found = edit_text(FOUR_BAR, edit)
    assert changed_lines(FOUR_BAR, found.text) == lines
    closure_of(found.text)


def test_untraced_point_is_removed_from_the_file() -> None:
    found = edit_text(FOUR_BAR, {'untrace': 'P'})
    assert 'P:' not in found.text
    assert 'traced' not in found.text


def test_changed_input_keeps_the_pose() -> None:
    before = closure_of(FOUR_BAR)
    found = edit_text(FOUR_BAR, {'input': {'link': 'rocker'}, 'inputs': [0.7]})
    after = closure_of(found.text)
    assert after.input_names == ('rocker_joint',)
    assert after.joint_names == ('crank_joint', 'coupler_joint')
    assert pins_of(after, found.inputs) == pytest.approx(pins_of(before, (0.7,)), abs=1e-12)


def test_four_bar_shorthand_is_kept_while_it_suffices() -> None:
    longer = edit_text(
        SHORT, {'length': {'link': 'coupler', 'from': 'A', 'to': 'B', 'value': 0.13}}
    )
    assert longer.text == SHORT.replace('b: 120', 'b: 130')
    found = edit_text(SHORT, {'trace': {'link': 'coupler', 'at': [0.05, 0.02], 'name': 'P'}})
    assert found.text.startswith('# my press')
    assert closure_of(found.text).linkage.traced == ('P',)


def test_edited_lengths_are_written_in_file_units() -> None:
    text = FOUR_BAR.partition('masses:')[0] + 'units: mm\n'
    text = text.replace('0.100', '100').replace('0.040', '40').replace('0.120', '120')
    text = text.replace('0.080', '80').replace('0.060, 0.030', '60, 30')
    found = edit_text(
        text, {'length': {'link': 'rocker', 'from': 'O4', 'to': 'B', 'value': 0.0815}}
    )
    assert changed_lines(text, found.text) == ['  rocker: {O4: [0, 0], B: [81.5, 0]}']


def test_edit_to_equal_values_leaves_the_text_unchanged() -> None:
    for name in linkage_names():
        link, points = next(iter(closure_of(text_of(name)).linkage.links.items()))
        point, at = next(iter(points.items()))
        edit = {'place': {'link': link, 'point': point, 'at': list(at)}}
        assert edit_text(text_of(name), edit).text == text_of(name)


# What is wrong.

REFUSED = {
    'no edit': ({}, r'^edit: \{\} is not an edit; send pin, length'),
    'no such pin': ({'pin': 'C', 'to': [0, 0]}, "^pin: 'C' is not there; "),
    'a place of one number': ({'pin': 'B', 'to': [0.1]}, r'^to: \[0\.1\] is not 2 numbers; '),
    'a place that is no number': (
        {'pin': 'B', 'to': [0.1, float('nan')]},
        '^to: .* not 2 numbers',
    ),
    'a place out of bounds': ({'pin': 'B', 'to': [0.1, 1e300]}, '^to: .* is not 2 numbers'),
    'two pins in one place': (
        {'pin': 'B', 'to': [0.1, 0.0]},
        '^B: O4 and B of rocker would be',
    ),
    'no length': (
        {'length': {'link': 'crank', 'from': 'O2', 'to': 'A', 'value': 0.0}},
        '^links.crank.A: 0 m is not a length; type one above 0',
    ),
    'no such link': (
        {'length': {'link': 'crnk'}},
        "^link: 'crnk' is not there; did you mean",
    ),
    'no object': ({'length': 3}, '^length: 3 is not an object; send an object'),
    'a name that is taken': (
        {'trace': {'link': 'rocker', 'at': [0.05, 0.02], 'name': 'B'}},
        "^name: 'B' is taken, or is not a name",
    ),
    'no side': (
        {'side': {'B': 'up'}},
        "^assembly.B: 'up' is not one of its sides; choose left or right",
    ),
    'a link without a pin on the ground': (
        {'input': {'link': 'coupler'}},
        '^coupler: has no pin on the ground; ',
    ),
    'a point that is not traced': ({'untrace': 'B'}, "^untrace: 'B' is not there; "),
}


@pytest.mark.parametrize('name', REFUSED)
def test_wrong_edit_is_refused_in_one_line(name: str) -> None:
    edit, message = REFUSED[name]
    with pytest.raises(LinkageError, match=message) as caught:
        edit_text(FOUR_BAR, edit)
    assert '\n' not in str(caught.value)


def test_random_edit_is_applied_or_refused_in_one_line() -> None:
    rng = random.Random(SEED)
    values: list[Any] = [
        None, True, 0, -1, 1e9, float('inf'), '', 'B', 'crank', [], [0.1, 0.05], {}, 'coupler',
        {'link': 'rocker', 'at': [0.1, 0.0]}, {'B': 'right'}, {'link': 'rocker'}, 'x' * 2000,
    ]  # fmt: skip
    keys = ['pin', 'to', 'inputs', 'snap', 'length', 'place', 'trace', 'untrace', 'input', 'side']
    done = 0
    for _ in range(400):
        edit = {key: rng.choice(values) for key in rng.sample(keys, rng.randint(1, 4))}
        try:
            done += isinstance(edit_text(FOUR_BAR, edit), EditResult)
        except LinkageError as error:
            assert '\n' not in str(error)  # noqa: PT017
    assert done > 5


def test_error_names_its_pin_or_link() -> None:
    text = FOUR_BAR.replace('B: left', 'B: ahead')
    with pytest.raises(FileError) as caught:
        build_model(text, 'x')
    assert pin_of(caught.value, FOUR_BAR) == 'B'
    assert pin_of(LinkageError('links.crank.A', 'is wrong', 'mend it'), FOUR_BAR) == 'A'
    assert pin_of(LinkageError('links.crank', 'is wrong', 'mend it'), FOUR_BAR) == 'crank'
    assert pin_of(LinkageError('rate', 'is wrong', 'mend it'), FOUR_BAR) is None
    assert pin_of(LinkageError('B', 'is wrong', 'mend it'), 'no: [linkage') is None


def test_pin_dragged_back_restores_the_joint_angles() -> None:
    found = edit_text(FOUR_BAR, {'pin': 'B', 'to': [0.13, 0.07], 'inputs': [0.7]})
    first = pins_of(closure_of(FOUR_BAR), (0.7,))['B']
    back = edit_text(found.text, {'pin': 'B', 'to': [first.real, first.imag], 'inputs': [0.7]})
    position = closure_of(back.text).position(0.7)
    assert position.status is Status.CLOSED
    assert position.joints == pytest.approx(closure_of(FOUR_BAR).position(0.7).joints, abs=1e-8)
