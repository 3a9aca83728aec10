# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What a request means, without a socket."""

from __future__ import annotations

import json
from typing import Any

import linkage_ros as lr
from linkage_ros.kinematics import Closure, frames_of_links, Position
from linkage_ros.resources import shipped_path
from linkage_ros.tools.view import read_request, RequestError, RequestHandler, requests
import pytest

from .test_server import BAD_MESSAGES, FOUR_BAR


def asked(do: str, answers: RequestHandler | None = None, **content: Any) -> dict[str, Any]:
    """Return the answer to a request."""
    reported: list[str] = []
    request = read_request(json.dumps({'id': 7, 'do': do, **content}))
    answer = (answers or RequestHandler('mine', None, reported.append)).answer_request(1, request)
    assert not reported
    found: dict[str, Any] = json.loads(answer, parse_constant=pytest.fail)
    assert found.pop('id') == 7
    return found


def ok(do: str, **content: Any) -> dict[str, Any]:
    found = asked(do, **content)
    assert 'ok' in found, found
    answer: dict[str, Any] = found['ok']
    return answer


def error(do: str, **content: Any) -> str:
    """Return the line of an answer that is an error."""
    text = str(asked(do, **content)['error']['text'])
    assert '\n' not in text
    return text


# Messages.


@pytest.mark.parametrize(('message', 'line'), BAD_MESSAGES.items())
def test_malformed_request_is_refused(message: str, line: str) -> None:
    with pytest.raises(RequestError) as refused:
        read_request(message)
    assert str(refused.value).startswith(f'message: {line}')
    assert len(str(refused.value)) < 300


def test_error_of_an_unknown_request_has_its_number() -> None:
    with pytest.raises(RequestError) as refused:
        read_request('{"id": 12, "do": "dance"}')
    assert refused.value.number == 12


# Answers.


def test_model_request_returns_text_and_name() -> None:
    found = ok('model', text=FOUR_BAR, whole=True)
    assert (found['name'], found['text']) == ('mine', FOUR_BAR)
    assert ok('model', text=FOUR_BAR, name='other')['name'] == 'other'


def test_open_request_returns_a_shipped_linkage() -> None:
    names = ok('names')['linkages']
    assert names == lr.linkage_names()
    found = ok('open', name='jansen_leg')
    assert found['name'] == 'jansen_leg'
    assert found['text'] == shipped_path('linkages/jansen_leg.yaml').read_text('utf-8')


@pytest.mark.parametrize('name', ['jansen_legs', '../scenes/demo', '/etc/passwd', '', None, 3, []])
def test_open_request_refuses_other_names(name: Any) -> None:
    assert 'is not a shipped linkage; ' in error('open', name=name)


def frames_of(closure: Closure, position: Position) -> list[tuple[float, float, float]]:
    return [
        (frame.place.real, frame.place.imag, frame.angle)
        for link, frame in frames_of_links(closure, position).items()
        if link != 'ground'
    ]


@pytest.mark.parametrize('name', ['four_bar', 'class_3', 'elliptic_trammel', 'five_bar'])
def test_poses_request_equals_the_closure(name: str) -> None:
    text = shipped_path(f'linkages/{name}.yaml').read_text('utf-8')
    closure: Closure = lr.load(name)
    pose = closure.linkage.pose
    first = list(pose.inputs) if pose else [1.0] * len(closure.linkage.inputs)
    inputs = [first, [value + 0.05 for value in first], [1e6] * len(first)]
    poses = ok('poses', text=text, inputs=inputs)['poses']
    for given, found in zip(inputs, poses, strict=True):
        position = closure.position(*given)
        assert found['joints'] == list(position.joints)
        if not position.joints:
            assert not any((found['rates'], found['frames'], found['frameRates']))
            assert found['status'] != 0
            continue
        velocity = closure.velocity(position, 1.0, *[0.0] * (len(first) - 1))
        assert found['rates'] == list(velocity.joints)
        frames = frames_of(closure, position)
        assert found['frames'] == [value for frame in frames for value in frame]
        step = 1e-6
        later = closure.position(given[0] + step, *given[1:])
        moved = [
            (value - before) / step
            for one, other in zip(frames_of(closure, later), frames, strict=True)
            for value, before in zip(one, other, strict=True)
        ]
        assert found['frameRates'] == pytest.approx(moved, abs=1e-3)
        assert found['status'] == 0


@pytest.mark.parametrize(
    'inputs',
    [None, 1, [1.0], [['1']], [[None]], [[True]], [[1.0, 2.0]], [[]], [[1e300]], [[0.0]] * 1001],
)
def test_poses_request_refuses_malformed_inputs(inputs: Any) -> None:
    assert error('poses', text=FOUR_BAR, inputs=inputs).startswith('inputs: ')


@pytest.mark.parametrize(
    ('content', 'where'),
    [
        ({}, 'text'),
        ({'text': 1}, 'text'),
        ({'text': FOUR_BAR, 'whole': 1}, 'whole'),
        ({'text': FOUR_BAR, 'name': ''}, 'name'),
        ({'text': FOUR_BAR, 'name': '../x'}, 'name'),
        ({'text': FOUR_BAR, 'name': 'x' * 81}, 'name'),
        ({'text': FOUR_BAR, 'name': 1}, 'name'),
        ({'text': '\ud800'}, ''),
        ({'text': 'links: 1'}, 'links'),
        ({'text': '&a [*a]'}, ''),
        ({'text': '[' * 1000}, ''),
    ],
)
def test_request_error_names_its_key(content: dict[str, Any], where: str) -> None:
    found = asked('model', **content)['error']
    assert found['where'] == where
    assert '\n' not in found['text']


@pytest.mark.parametrize(
    ('edit', 'pin'),
    [
        ({'length': {'link': 'rocker', 'from': 'O4', 'to': 'B', 'value': 0.5}}, 'B'),
        ({'place': {'link': 'rocker', 'point': 'B', 'at': [0.5, 0.0]}}, 'B'),
        ({'pin': 'nowhere', 'to': [0.0, 0.0]}, 'nowhere'),
        ({'input': {'link': 'coupler'}}, 'coupler'),
        ({}, None),
        ({'pin': ['B']}, None),
        ({'length': 7}, None),
    ],
)
def test_edit_error_names_its_pin(edit: dict[str, Any], pin: str | None) -> None:
    assert asked('edit', text=FOUR_BAR, edit=edit)['error']['pin'] == pin


@pytest.mark.parametrize(
    ('name', 'old', 'new'),
    [('four_bar', '0.080', '0.800'), ('five_bar', '0.120', '9.120')],
)
def test_edit_of_an_open_linkage_returns_an_error(name: str, old: str, new: str) -> None:
    text = shipped_path(f'linkages/{name}.yaml').read_text('utf-8')
    far = text.replace(old, new)
    assert far != text
    for inputs in (None, [1.0] * len(lr.load(name).linkage.inputs)):
        edit = {'pin': 'A', 'to': [0.03, 0.03], 'inputs': inputs}
        assert 'error' in asked('edit', text=far, edit=edit)


def test_save_request_writes_only_the_opened_file() -> None:
    assert ok('save', text=FOUR_BAR) == {}
    line = error('save', text=FOUR_BAR, name='jansen_leg')
    assert line.startswith("save: 'jansen_leg' is not the file with which this page was opened; ")
    assert error('save', text='links: 1').startswith('mine:1: links: 1 is not a mapping')


def test_sensor_request_for_a_linkage_is_refused() -> None:
    assert error('read', t=0, inputs=[0], rates=[0]) == (
        'read: a linkage has no sensors; open a scene'
    )


def test_internal_error_is_one_line_on_page_and_report(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fails(*_: Any, **__: Any) -> None:
        raise ZeroDivisionError('float\ndivision')

    monkeypatch.setattr(requests, 'build_model', fails)
    reported: list[str] = []
    answers = RequestHandler('mine', None, reported.append)
    request = read_request(json.dumps({'id': 7, 'do': 'model', 'text': FOUR_BAR}))
    found = json.loads(answers.answer_request(1, request))
    line = (
        'model: failed by ZeroDivisionError (float division); '
        'please report it with the linkage file'
    )
    assert found == {'id': 7, 'error': {'text': line, 'where': 'model', 'pin': None}}
    assert reported == [line]
