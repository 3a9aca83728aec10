# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Files that a page offers for download: the linkage itself, pictures, parts, source."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from linkage_ros.errors import did_you_mean, LinkageError, list_names, quote
from linkage_ros.kinematics import Closure, LinkageView, prepare_view, usual_inputs
from linkage_ros.tools.drawing import animate, paint_picture, range_motion
from linkage_ros.tools.models.source_code import c_name, LANGUAGES, Subject, write_source

_SECONDS = 4.0
"""How long an animation shows the range, in [s]."""

_DERIVATIVES = 2


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
