# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Files to download open in the programs of others, and hold the linkage."""

from __future__ import annotations

from base64 import b64decode
from io import BytesIO
import json
from pathlib import Path
from xml.etree import ElementTree as ET

import linkage_ros as lr
from linkage_ros.errors import LinkageError
from linkage_ros.resources import named_file, shipped_path
from linkage_ros.tools.view import (
    EXPORT_KINDS,
    export_linkage,
    read_request,
    RequestHandler,
    requests,
)
from PIL import Image
import pytest

from ...support.commands import linkage

NAMES = ('four_bar', 'slider_crank', 'five_bar')


def exported(kind: str, name: str, inputs: list[float] | None = None) -> bytes:
    """Return a file as a page gets it."""
    text = shipped_path(f'linkages/{name}.yaml').read_text('utf-8')
    content = {'id': 1, 'do': 'export', 'kind': kind, 'text': text, 'name': name}
    request = read_request(json.dumps(content | ({'inputs': inputs} if inputs else {})))
    answer = json.loads(RequestHandler('mine', None, pytest.fail).answer_request(1, request))
    assert answer['ok']['name'] == f'{name}.{kind}'
    assert answer['ok']['type'] == EXPORT_KINDS[kind][0]
    return b64decode(answer['ok']['data'])


@pytest.mark.parametrize('name', NAMES)
def test_yaml_export_equals_the_shipped_file(name: str) -> None:
    assert exported('yaml', name) == shipped_path(f'linkages/{name}.yaml').read_bytes()


@pytest.mark.sample(1)
@pytest.mark.parametrize('name', NAMES)
def test_svg_export_is_xml_and_shows_the_pose(name: str) -> None:
    one, other = (
        exported('svg', name, [value] * len(lr.load(name).linkage.inputs)) for value in (1.0, 1.2)
    )
    for picture in (one, other):
        assert ET.fromstring(picture).tag == '{http://www.w3.org/2000/svg}svg'
    assert one != other


def test_gif_export_has_several_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(requests, '_SECONDS', 0.5)
    picture = Image.open(BytesIO(exported('gif', 'four_bar')))
    assert picture.format == 'GIF'
    assert picture.n_frames == 10


@pytest.mark.parametrize('name', NAMES)
@pytest.mark.parametrize('kind', ['c', 'h', 'js', 'py'])
def test_source_export_equals_linkage_compile(name: str, kind: str, tmp_path: Path) -> None:
    answer = linkage(tmp_path, 'compile', name, '-o', f'{name}.{kind}')
    assert answer.returncode == 0
    assert exported(kind, name) == (tmp_path / f'{name}.{kind}').read_bytes()


@pytest.mark.parametrize(
    ('kind', 'remedy'),
    [('exe', 'ask for one of yaml, '), ('gifs', "did you mean 'gif'?"), ('../x', '')],
)
def test_unknown_export_kind_is_refused(kind: str, remedy: str) -> None:
    with pytest.raises(LinkageError) as refused:
        export_linkage(kind, lr.load('four_bar'), '', 'four_bar', None)
    assert str(refused.value).startswith(f"kind: '{kind}' cannot be written; {remedy}")


def test_source_export_of_inputs_with_too_many_cells_is_refused() -> None:
    text = named_file('hexapod', 'linkages').read_text('utf-8')
    request = read_request(json.dumps({'id': 1, 'do': 'export', 'kind': 'c', 'text': text}))
    answer = json.loads(RequestHandler('hexapod', None, pytest.fail).answer_request(1, request))
    assert 'within their limits are more than' in answer['error']['text']
