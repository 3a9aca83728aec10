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


"""The gallery shows every linkage that comes with the package, as its file is now."""

from __future__ import annotations

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

from linkage_ros.scene.linkage_file import load
import pytest

ROOT = Path(__file__).parents[2]
FILES = sorted((ROOT / 'config' / 'linkages').glob('*.yaml'))
PNG = b'\x89PNG\r\n\x1a\n'

SPEC = spec_from_file_location('make_gallery', ROOT / 'docs' / 'make_gallery.py')
make_gallery = module_from_spec(SPEC)


@pytest.fixture(scope='module')
def page() -> str:
    pytest.importorskip('PIL')
    SPEC.loader.exec_module(make_gallery)
    return (ROOT / 'docs' / 'gallery.md').read_text('utf-8')


@pytest.mark.parametrize('file', FILES, ids=lambda file: file.stem)
def test_a_linkage_is_told_as_its_file_has_it(page: str, file: Path) -> None:
    picture = ROOT / 'docs' / 'gallery' / f'{file.stem}.png'
    chapter = make_gallery.chapter(load(file), file, picture)
    assert '\n'.join(chapter) in page, 'make gallery makes it anew'
    assert picture.read_bytes().startswith(PNG)
    assert picture.stat().st_size < make_gallery.LARGEST


def test_nothing_else_is_in_the_gallery(page: str) -> None:
    assert page.count('\n## ') == len(FILES)
    drawn = {file.stem for file in (ROOT / 'docs' / 'gallery').iterdir()}
    assert drawn == {file.stem for file in FILES}
