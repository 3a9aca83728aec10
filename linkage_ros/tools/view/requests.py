# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
What a page asks its server for, and the answers.

A request is a JSON object with an ``id``, the name of what is to be done, ``do``, and the text of
the linkage: no document is held here, so undo, several pages and a lost connection need no care.
"""

from __future__ import annotations

from base64 import b64encode
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache, partial
import json
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple, NoReturn

from linkage_ros.description import parse_yaml, read_any_closure
from linkage_ros.errors import (
    did_you_mean,
    escape_unprintable,
    FileError,
    LinkageError,
    list_names,
    quote,
    shorten,
)
from linkage_ros.kinematics import Closure, LinkageView, prepare_view, usual_inputs
from linkage_ros.resources import linkage_names, shipped_path
from linkage_ros.tools.drawing import animate, paint_picture, range_motion
from linkage_ros.tools.models.source_code import c_name, LANGUAGES, Subject, write_source
from linkage_ros.tools.view.edit import edit_text, pin_of, read_numbers
from linkage_ros.tools.view.model import build_model, compute_pose, ViewState
from linkage_ros.tools.view.sensors import SceneFiles, Sensors

LARGEST = 1_000_000
"""Most bytes of a message."""

_MOST_POSES = 1000

_MOST_SENSORS = 8
"""Pages whose sensors are kept."""

_LONGEST_NAME = 80

_SECONDS = 4.0
"""How long an animation shows the range, in [s]."""

_DERIVATIVES = 2


class Request(NamedTuple):
    """A request of a page: the ``id`` that its answer repeats, what to do, the whole message."""

    number: float
    do: str
    content: Mapping[str, Any]


class RequestError(LinkageError):
    """A message that is not a request."""

    def __init__(self, reason: str, remedy: str, number: float | None = None) -> None:
        super().__init__('message', reason, remedy)
        self.number = number  # The ``id``, as far as it can be read


def read_request(message: str) -> Request:
    """
    Read a message of a page.

    A RequestError is raised if it is too large, not JSON, or not a request.
    """
    if len(message) > LARGEST or len(message.encode('utf-8', 'surrogatepass')) > LARGEST:
        raise RequestError(f'is larger than {LARGEST} bytes', 'send a smaller linkage')
    try:
        content = json.loads(message, parse_constant=_not_a_number)
    except (ValueError, RecursionError):
        raise RequestError('is not JSON', 'send an object with id and do') from None
    if not isinstance(content, dict):
        raise RequestError('is not an object', 'send an object with id and do')
    number: Any = content.get('id')
    if type(number) not in (int, float) or not abs(number) <= 2**53:
        raise RequestError('has no id', 'send a number as id')
    do = content.get('do')
    if not isinstance(do, str) or do not in _HANDLERS:
        raise RequestError(f'asks for {quote(do)}', f'ask for {list_names(_HANDLERS)}', number)
    return Request(number, do, content)


def _not_a_number(text: str) -> NoReturn:
    raise ValueError(f'{text} is not JSON')


class RequestHandler:
    """
    Answers the requests of all pages of a server.

    The server was opened with the linkage ``name`` and, if not None, the scene. ``report`` is
    called with one line for each defect of this package.
    """

    def __init__(self, name: str, scene: SceneFiles | None, report: Callable[[str], Any]) -> None:
        self._name = name
        self._scene = scene
        self._report = report
        self._sensors: OrderedDict[int, Sensors] = OrderedDict()

    def answer_request(self, page: int, request: Request) -> str:
        """
        Return the answer to a request of the page with this number, as JSON.

        It has ``ok``, or ``error``: its text, one line; the key in the file; and the pin or the
        link concerned. A defect of this package is such an error too.
        """
        fields = _RequestFields(request.content, self._name, partial(self._sensors_of, page))
        try:
            return _compact_json({'id': request.number, 'ok': _HANDLERS[request.do](fields)})
        except LinkageError as error:
            return failure_answer(request.number, error, request.content)
        except Exception as error:  # noqa: BLE001 (a request must not end its server)
            defect = defect_error(request.do, error)
            self._report(str(defect))
            return failure_answer(request.number, defect)

    def _sensors_of(self, page: int, text: str | None) -> Sensors:
        """Return the sensors of a page; new ones if it has changed the linkage."""
        if self._scene is None:
            raise LinkageError('read', 'a linkage has no sensors', 'open a scene')
        sensors = self._sensors.pop(page, None)
        if sensors is None or sensors.text != text:
            sensors = Sensors(self._scene, text)
        self._sensors[page] = sensors
        if len(self._sensors) > _MOST_SENSORS:
            self._sensors.popitem(last=False)
        return sensors


class _RequestFields(NamedTuple):
    """
    What a request holds: the message, and the name of the linkage that the server opened.

    ``sensors`` returns the sensors of the page, for the text of a linkage.
    """

    content: Mapping[str, Any]
    opened: str
    sensors: Callable[[str | None], Sensors]

    @property
    def text(self) -> str:
        """Return the text of the linkage."""
        text = self.content.get('text')
        if not isinstance(text, str):
            raise _invalid_value('text', text, 'the text of a linkage file')
        encode_text(text, self.name)
        return text

    @property
    def name(self) -> str:
        """Return the name of the linkage: it names files, and the place of errors."""
        name = self.content.get('name', self.opened)
        if not isinstance(name, str) or not 0 < len(name) <= _LONGEST_NAME or '/' in name:
            raise _invalid_value('name', name, f'a name of at most {_LONGEST_NAME} letters')
        return escape_unprintable(name)

    @property
    def is_whole(self) -> bool:
        """Return whether the slower parts of a model are asked for."""
        whole = self.content.get('whole', False)
        if not isinstance(whole, bool):
            raise _invalid_value('whole', whole, 'true or false')
        return whole

    @property
    def size(self) -> float:
        """Return half the width of the bars that are shown, in [m]; 0 if not given."""
        (size,) = read_numbers('size', [self.content.get('size', 0.0)], 1)
        return max(0.0, size)

    @property
    def closure(self) -> Closure:
        """Return the linkage."""
        return closure_of(self.text, self.name)

    def read_list(self, key: str, count: int) -> tuple[float, ...]:
        """Return a list of ``count`` numbers."""
        return read_numbers(key, self.content.get(key), count)


def _answer_model(fields: _RequestFields) -> dict[str, Any]:
    return build_model(fields.text, fields.name, whole=fields.is_whole)


def _answer_edit(fields: _RequestFields) -> dict[str, Any]:
    edit = fields.content.get('edit')
    if not isinstance(edit, dict):
        raise _invalid_value('edit', edit, 'an object')
    text, inputs = edit_text(fields.text, edit, fields.name)
    shown = ViewState(tuple(inputs), fields.size) if fields.size else None
    model = build_model(text, fields.name, whole=fields.is_whole, shown=shown)
    for driven, value in zip(model['inputs'], inputs, strict=False):
        driven['value'] = value
    return model


def _answer_open(fields: _RequestFields) -> dict[str, Any]:
    name, names = fields.content.get('name'), linkage_names()
    if not isinstance(name, str) or name not in names:
        remedy = did_you_mean(str(name), names, f'name one of {list_names(names)}')
        raise LinkageError('name', f'{quote(name)} is not a shipped linkage', remedy)
    return build_model(shipped_path(f'linkages/{name}.yaml').read_text('utf-8'), name, whole=True)


def _answer_names(_fields: _RequestFields) -> dict[str, Any]:
    return {'linkages': linkage_names()}


def _answer_save(fields: _RequestFields) -> dict[str, Any]:
    """Check that a text is a linkage; the server then saves it."""
    if fields.name != fields.opened:
        reason = f'{quote(fields.name)} is not the file with which this page was opened'
        raise LinkageError('save', reason, 'download the linkage')
    closure_of(fields.text, fields.name)
    return {}


def _answer_export(fields: _RequestFields) -> dict[str, Any]:
    closure = fields.closure
    wanted = fields.content.get('inputs')
    inputs = None if wanted is None else fields.read_list('inputs', len(closure.linkage.inputs))
    exported = export_linkage(
        str(fields.content.get('kind')), closure, fields.text, fields.name, inputs
    )
    return {
        'name': exported.name,
        'type': exported.media_type,
        'data': b64encode(exported.data).decode(),
    }


def _answer_poses(fields: _RequestFields) -> dict[str, Any]:
    closure, poses = fields.closure, fields.content.get('inputs')
    if not isinstance(poses, list) or len(poses) > _MOST_POSES:
        raise _invalid_value('inputs', poses, f'a list of at most {_MOST_POSES} lists of numbers')
    count = len(closure.linkage.inputs)
    return {
        'poses': [compute_pose(closure, read_numbers('inputs', inputs, count)) for inputs in poses]
    }


def _answer_read(fields: _RequestFields) -> dict[str, Any]:
    sensors = fields.sensors(fields.text if 'text' in fields.content else None)
    (t,) = read_numbers('t', [fields.content.get('t')], 1)
    return sensors.read(
        t,
        fields.read_list('inputs', sensors.count),
        fields.read_list('rates', sensors.count),
    )


_HANDLERS: dict[str, Callable[[_RequestFields], dict[str, Any]]] = {
    'model': _answer_model,
    'edit': _answer_edit,
    'open': _answer_open,
    'names': _answer_names,
    'save': _answer_save,
    'export': _answer_export,
    'poses': _answer_poses,
    'read': _answer_read,
}
"""What a page can ask for."""


@lru_cache(maxsize=4)
def closure_of(text: str, name: str) -> Closure:
    """Return the closure of a linkage file's text; errors are as in `linkage_ros.load`."""
    return read_any_closure(parse_yaml(encode_text(text, name), name), name)


def encode_text(text: str, name: str) -> bytes:
    """Return the bytes of a file's text; a FileError is raised for half a surrogate pair."""
    try:
        return text.encode()
    except UnicodeEncodeError as error:
        reason = f'is not Unicode text (character {error.start})'
        raise FileError(name, '', reason, 'remove the character') from None


def defect_error(where: str, error: BaseException) -> LinkageError:
    """Return a defect of this package as an error of one line."""
    reason = f'failed by {type(error).__name__} ({shorten(str(error), 300)})'
    return LinkageError(where, reason, 'please report it with the linkage file')


def failure_answer(
    number: float | None, error: LinkageError, content: Mapping[str, Any] | None = None
) -> str:
    """
    Return the answer to a request that failed, as JSON.

    ``number`` is the number of the request; None if it has none. With the request as ``content``
    the answer has the pin or the link that the error concerns.
    """
    where = error.key if isinstance(error, FileError) else error.where
    pin = None if content is None else _find_pin(error, content)
    return _compact_json({'id': number, 'error': {'text': str(error), 'where': where, 'pin': pin}})


def _find_pin(error: LinkageError, content: Mapping[str, Any]) -> str | None:
    """Return the pin or the link that an error concerns: one that it names, or the edited one."""
    text = content.get('text')
    # A text may hold half of a surrogate pair, which may be the error.
    named = pin_of(error, text.encode(errors='ignore').decode()) if isinstance(text, str) else None
    edit = content.get('edit')
    if named is not None or not isinstance(edit, dict):
        return named
    places = [edit, *(value for value in edit.values() if isinstance(value, dict))]
    names = (place.get(key) for place in places for key in ('pin', 'to', 'point', 'link'))
    return next((pin for pin in names if isinstance(pin, str)), None)


def _compact_json(answer: Any) -> str:
    return json.dumps(answer, allow_nan=False, separators=(',', ':'))


def _invalid_value(key: str, value: Any, expected: str) -> LinkageError:
    return LinkageError(key, f'{quote(value)} is not valid', f'send {expected}')


class Export(NamedTuple):
    """A file to download, with its type for the browser."""

    name: str
    media_type: str
    data: bytes


class _ExportedLinkage(NamedTuple):
    closure: Any
    text: str
    name: str
    inputs: tuple[float, ...]

    @property
    def view(self) -> LinkageView:
        return prepare_view(self.closure, self.inputs)


def export_linkage(
    kind: str, closure: Closure, text: str, name: str, inputs: Sequence[float] | None = None
) -> Export:
    """
    Return a linkage as a file of one of `EXPORT_KINDS`.

    ``name`` is the file's name without suffix; ``inputs`` is the pose to draw, in [rad] or [m],
    None for the usual one. A LinkageError is raised if there is no such kind, the linkage is open
    in that pose or cannot be compiled, or a library is missing.
    """
    if kind not in EXPORT_KINDS:
        remedy = did_you_mean(kind, EXPORT_KINDS, f'ask for one of {list_names(EXPORT_KINDS)}')
        raise LinkageError('kind', f'{quote(kind)} cannot be written', remedy)
    media_type, write = EXPORT_KINDS[kind]
    shown = usual_inputs(closure) if inputs is None else tuple(inputs)
    data = write(_ExportedLinkage(closure, text, name, shown))
    return Export(f'{name}.{kind}', media_type, data)


def _to_yaml(linkage: _ExportedLinkage) -> bytes:
    return linkage.text.encode()


def _to_svg(linkage: _ExportedLinkage) -> bytes:
    return _written_bytes('svg', lambda file: paint_picture(linkage.view, linkage.name, file))


def _to_gif(linkage: _ExportedLinkage) -> bytes:
    motion = range_motion(linkage.view, linkage.name, _SECONDS)
    return _written_bytes('gif', lambda file: animate(motion, file))


def _to_dxf(linkage: _ExportedLinkage) -> bytes:
    from linkage_ros.tools.drawing import links_dxf  # local import: ezdxf is slow to load

    return links_dxf(linkage.closure)


def _compile_for(suffix: str) -> Callable[[_ExportedLinkage], bytes]:
    def write_subject(linkage: _ExportedLinkage) -> bytes:
        closure, name = linkage.closure, linkage.name
        in_c = (c_name(name) or 'linkage') if suffix in ('.c', '.h') else name
        joints = tuple(closure.linkage.joints)
        subject = Subject(closure, in_c, f'{name}.yaml', _DERIVATIVES, joints)
        return write_source(subject, LANGUAGES[suffix](subject)).encode()

    return write_subject


def _written_bytes(kind: str, write: Callable[[Path], None]) -> bytes:
    """Return what is written to a file."""
    with TemporaryDirectory() as folder:
        file = Path(folder) / f'picture.{kind}'
        write(file)
        return file.read_bytes()


EXPORT_KINDS: dict[str, tuple[str, Callable[[_ExportedLinkage], bytes]]] = {
    'yaml': ('application/yaml', _to_yaml),
    'svg': ('image/svg+xml', _to_svg),
    'gif': ('image/gif', _to_gif),
    'dxf': ('image/vnd.dxf', _to_dxf),
    'c': ('text/x-c', _compile_for('.c')),
    'h': ('text/x-c', _compile_for('.h')),
    'js': ('text/javascript', _compile_for('.js')),
    'py': ('text/x-python', _compile_for('.py')),
}
"""Media type and writer of each kind of file, which is also the file's suffix."""
