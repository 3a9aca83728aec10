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
What a page asks its server for, and the answers.

A request is a JSON object with an ``id``, the name of what is to be done, ``do``, and the text of
the linkage: no document is held here, so undo, several pages and a lost connection need no care.
"""

from __future__ import annotations

from base64 import b64encode
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
import json
from math import isfinite
import sys
from typing import Any, NamedTuple, NoReturn

from linkage_ros.drawing.shapes import link_frames
from linkage_ros.errors import (
    clean,
    did_you_mean,
    FileError,
    LinkageError,
    listed,
    quoted,
    shortened,
)
from linkage_ros.files.linkage_file import FARTHEST, read_closure
from linkage_ros.files.yaml_file import parse_yaml
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.compiling.source import STATUSES
from linkage_ros.kinematics.linkage import GROUND
from linkage_ros.resources import linkage_names, shipped
from linkage_ros.view.edit import edited, pin_of
from linkage_ros.view.exports import export
from linkage_ros.view.model import model
from linkage_ros.view.sensors import SceneFiles, Sensors

LARGEST = 1_000_000
"""Most bytes of a message."""

_MOST_POSES = 1000
_MOST_PAGES = 8
"""Pages whose sensors are kept; a page that comes back begins again."""

_LONGEST_NAME = 80

_STATUSES = {name: number for number, name in enumerate(STATUSES)}


class Request(NamedTuple):
    """
    A request of a page.

    Attributes
    ----------
    id
        Its number, which the answer repeats; None if it has none.
    do
        What is to be done.
    content
        The whole message.

    """

    id: float | None
    do: str
    content: Mapping[str, Any]


class RequestError(LinkageError):
    """
    A message that is no request.

    Attributes
    ----------
    id
        The number of the request, as far as it can be read.

    """

    def __init__(self, reason: str, remedy: str, number: float | None = None) -> None:
        super().__init__('message', reason, remedy)
        self.id = number


def read_request(message: str) -> Request:
    """
    Read a message of a page.

    Raises
    ------
    RequestError
        It is too large, no JSON, or no request.

    """
    if len(message) > LARGEST or len(message.encode('utf-8', 'surrogatepass')) > LARGEST:
        raise RequestError(f'is larger than {LARGEST} bytes', 'send a smaller linkage')
    try:
        content = json.loads(message, parse_constant=_not_a_number)
    except (ValueError, RecursionError):
        raise RequestError('is not JSON', 'send an object with id and do') from None
    if not isinstance(content, dict):
        raise RequestError('is no object', 'send an object with id and do')
    number = content.get('id')
    if type(number) not in (int, float) or not abs(number) <= 2**53:
        raise RequestError('has no id', 'send a number as id')
    do = content.get('do')
    if not isinstance(do, str) or do not in ANSWERED:
        raise RequestError(f'asks for {quoted(do)}', f'ask for one of {listed(ANSWERED)}', number)
    return Request(number, do, content)


def _not_a_number(text: str) -> NoReturn:
    raise ValueError(f'{text} is not JSON')


class Answers:
    """
    Answers the requests of all pages of a server.

    Parameters
    ----------
    name
        Name of the linkage with which the server was opened.
    scene
        The scene with which it was opened; None for a linkage.

    """

    def __init__(self, name: str, scene: SceneFiles | None = None) -> None:
        self._name = name
        self._scene = scene
        self._sensors: OrderedDict[int, Sensors] = OrderedDict()

    def answer(self, page: int, request: Request) -> str:
        """
        Return the answer to a request, as JSON.

        Parameters
        ----------
        page
            Number of the page that asks.
        request
            The request.

        Returns
        -------
        answer : str
            With ``ok``, or with ``error``: its text, one line; the key in the file; and the pin or
            the link that it concerns. A defect of this package is an error too, and is printed.

        """
        text = request.content.get('text')
        try:
            found = _ANSWERS[request.do](self, page, request.content)
            return _json({'id': request.id, 'ok': found})
        except LinkageError as error:
            return failed(request.id, error, text)
        except Exception as error:  # noqa: BLE001 (a page must not end its server)
            return failed(request.id, defect(request.do, error))

    def _model(self, _page: int, content: Mapping[str, Any]) -> dict[str, Any]:
        return model(_text(content), self._named(content), whole=_flag(content, 'whole'))

    def _edit(self, _page: int, content: Mapping[str, Any]) -> dict[str, Any]:
        edit = content.get('edit')
        if not isinstance(edit, dict):
            raise _wrong('edit', edit, 'an object')
        name = self._named(content)
        text, inputs = edited(_text(content), edit)
        found = model(text, name, whole=_flag(content, 'whole'))
        for given, value in zip(found['inputs'], inputs, strict=False):
            given['value'] = value
        return found

    def _open(self, _page: int, content: Mapping[str, Any]) -> dict[str, Any]:
        name = content.get('name')
        names = linkage_names()
        if not isinstance(name, str) or name not in names:
            remedy = did_you_mean(str(name), names, f'name one of {listed(names)}')
            raise LinkageError('name', f'{quoted(name)} is no shipped linkage', remedy)
        text = shipped(f'linkages/{name}.yaml').read_text('utf-8')
        return model(text, name, whole=True)

    def _names(self, _page: int, _content: Mapping[str, Any]) -> dict[str, Any]:
        return {'linkages': linkage_names()}

    def _save(self, _page: int, content: Mapping[str, Any]) -> dict[str, Any]:
        """Check that a text is a linkage; then the server saves it."""
        closure_of(_text(content), self._named(content))
        return {}

    def _export(self, _page: int, content: Mapping[str, Any]) -> dict[str, Any]:
        kind, name = content.get('kind'), self._named(content)
        text = _text(content)
        closure = closure_of(text, name)
        exported = export(str(kind), closure, text, name, _inputs(content, closure))
        data = b64encode(exported.data).decode()
        return {'name': exported.name, 'type': exported.type, 'data': data}

    def _poses(self, _page: int, content: Mapping[str, Any]) -> dict[str, Any]:
        closure = closure_of(_text(content), self._named(content))
        asked = content.get('inputs')
        if not isinstance(asked, list) or len(asked) > _MOST_POSES:
            raise _wrong('inputs', asked, f'a list of at most {_MOST_POSES} lists of numbers')
        count = len(closure.linkage.inputs)
        return {'poses': [_pose(closure, _numbers('inputs', one, count)) for one in asked]}

    def _read(self, page: int, content: Mapping[str, Any]) -> dict[str, Any]:
        if self._scene is None:
            raise LinkageError('read', 'a linkage has no sensors', 'open a scene')
        text = content.get('text')
        text = None if text is None else _text(content)
        sensors = self._sensors.pop(page, None)
        if sensors is None or sensors.text != text:
            sensors = Sensors(self._scene, text)
        self._sensors[page] = sensors
        while len(self._sensors) > _MOST_PAGES:
            self._sensors.popitem(last=False)
        (t,) = _numbers('t', [content.get('t')], 1)
        inputs, rates = (
            _numbers(key, content.get(key), sensors.count) for key in ('inputs', 'rates')
        )
        return sensors.read(t, inputs, rates)

    def _named(self, content: Mapping[str, Any]) -> str:
        """Return the name of the linkage: it names files, and the place of errors."""
        name = content.get('name', self._name)
        if not isinstance(name, str) or not 0 < len(name) <= _LONGEST_NAME or '/' in name:
            raise _wrong('name', name, f'a name of at most {_LONGEST_NAME} letters')
        return clean(name)


_Answer = Callable[[Answers, int, Mapping[str, Any]], dict[str, Any]]

_ANSWERS: dict[str, _Answer] = {
    'model': Answers._model,
    'edit': Answers._edit,
    'open': Answers._open,
    'names': Answers._names,
    'save': Answers._save,
    'export': Answers._export,
    'poses': Answers._poses,
    'read': Answers._read,
}

ANSWERED = tuple(_ANSWERS)
"""What a page can ask for."""


@lru_cache(maxsize=4)
def closure_of(text: str, name: str) -> Closure:
    """
    Return the closure of a linkage file's text.

    Raises
    ------
    FileError
        As `linkage_ros.load`.

    """
    return read_closure(parse_yaml(encoded(text, name), name), name)


def encoded(text: str, name: str) -> bytes:
    """
    Return the bytes of a file's text.

    Raises
    ------
    FileError
        It holds half of a surrogate pair, which UTF-8 has not.

    """
    try:
        return text.encode()
    except UnicodeEncodeError as error:
        reason = f'is not Unicode text (character {error.start})'
        raise FileError(name, '', reason, 'remove the character') from None


def _pose(closure: Closure, inputs: Sequence[float]) -> dict[str, Any]:
    """Return a pose as the program of a model gives it; rates are those of a first input at 1."""
    position = closure.position(*inputs)
    found: dict[str, Any] = {
        'status': _STATUSES[position.status.name],
        'joints': list(position.joints),
        'rates': [],
        'accelerations': [],
        'frames': [],
        'frameRates': [],
    }
    if not position.joints:
        return found
    for link, frame in link_frames(closure, position).items():
        if link != GROUND:
            found['frames'] += [frame.place.real, frame.place.imag, frame.angle]
    if position.status.has_rates:
        rest = [0.0] * (len(inputs) - 1)
        velocity = closure.velocity(position, 1.0, *rest)
        acceleration = closure.acceleration(position, velocity, 0.0, *rest)
        rates, accelerations = list(velocity.joints), list(acceleration.joints)
        if all(map(isfinite, [*rates, *accelerations])):
            found |= {'rates': rates, 'accelerations': accelerations}
    return found


def defect(where: str, error: BaseException) -> LinkageError:
    """Return a defect of this package as an error of one line, and print it."""
    line = LinkageError(
        where,
        f'failed by {type(error).__name__} ({shortened(str(error), 300)})',
        'please report it with the linkage file',
    )
    print(f'linkage view: {line}', file=sys.stderr, flush=True)
    return line


def failed(number: float | None, error: LinkageError, text: Any = None) -> str:
    """
    Return the answer to a request that failed, as JSON.

    Parameters
    ----------
    number
        The number of the request; None if it has none.
    error
        Why it failed.
    text
        The text of the linkage, in which a pin is sought that the error concerns.

    """
    where = error.key if isinstance(error, FileError) else error.where
    pin = pin_of(error, text) if isinstance(text, str) else None
    return _json({'id': number, 'error': {'text': str(error), 'where': where, 'pin': pin}})


def _json(answer: Any) -> str:
    return json.dumps(answer, allow_nan=False, separators=(',', ':'))


def _text(content: Mapping[str, Any]) -> str:
    text = content.get('text')
    if not isinstance(text, str):
        raise _wrong('text', text, 'the text of a linkage file')
    return text


def _flag(content: Mapping[str, Any], key: str) -> bool:
    value = content.get(key, False)
    if not isinstance(value, bool):
        raise _wrong(key, value, 'true or false')
    return value


def _inputs(content: Mapping[str, Any], closure: Closure) -> tuple[float, ...] | None:
    """Return the inputs of the pose at hand; None if the request names none."""
    if content.get('inputs') is None:
        return None
    return _numbers('inputs', content['inputs'], len(closure.linkage.inputs))


def _numbers(key: str, values: Any, count: int) -> tuple[float, ...]:
    if (
        not isinstance(values, list)
        or len(values) != count
        or not all(type(value) in (int, float) and abs(value) <= FARTHEST for value in values)
    ):
        raise _wrong(key, values, 'a number' if count == 1 else f'{count} numbers')
    return tuple(map(float, values))


def _wrong(key: str, value: Any, expected: str) -> LinkageError:
    return LinkageError(key, f'{quoted(value)} is not valid', f'send {expected}')
