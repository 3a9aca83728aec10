# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The pages of gallery and effects are those of the files and the code."""

from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
import inspect
from pathlib import Path
import re
import sys

from linkage_ros.description import load, parse_scene
from linkage_ros.stages.drives import DRIVES
from linkage_ros.stages.effects import effect_class, EFFECTS
from linkage_ros.stages.faults import FAULTS
from linkage_ros.tick import Pipeline
import pytest

# The gallery shows every shipped linkage, as its file is now.


ROOT = Path(__file__).parents[3]
FILES = [
    file
    for kind in ('*.yaml', 'space/*.yaml')
    for file in sorted((ROOT / 'config' / 'linkages').glob(kind))
]
PNG = b'\x89PNG\r\n\x1a\n'
SPEC = spec_from_file_location('make_gallery', ROOT / 'docs' / 'make_gallery.py')
make_gallery = module_from_spec(SPEC)


@pytest.fixture(scope='module')
def page():
    pytest.importorskip('PIL')
    SPEC.loader.exec_module(make_gallery)
    return (ROOT / 'docs' / 'gallery.md').read_text('utf-8')


@pytest.mark.sample(8)
@pytest.mark.parametrize('file', FILES, ids=lambda file: file.stem)
def test_gallery_chapter_equals_its_linkage_file(page, file):
    picture = ROOT / 'docs' / 'gallery' / f'{file.stem}.png'
    chapter = make_gallery.chapter(load(file), file, picture)
    text = picture.with_suffix('.md').read_text('utf-8')
    assert text.rstrip().splitlines() == list(chapter), 'make gallery makes it anew'
    assert picture.read_bytes().startswith(PNG)
    assert picture.stat().st_size < make_gallery.LARGEST
    small = picture.parent / 'thumbnails' / picture.name
    assert small.read_bytes().startswith(PNG)
    assert small.stat().st_size < make_gallery.LARGEST_SMALL


def test_gallery_lists_exactly_the_shipped_linkages(page):
    listed = re.findall(r'^- \[!\[\]\(gallery/thumbnails/(\w+)\.png', page, re.MULTILINE)
    assert listed == [file.stem for file in FILES]
    folder = ROOT / 'docs' / 'gallery'
    for kind in ('*.png', '*.md', 'thumbnails/*'):
        assert {file.stem for file in folder.glob(kind)} == {*listed}


@pytest.mark.parametrize('kind', ['svg', 'gif'])
def test_moving_picture_of_the_readme_is_small(page, kind):
    size = (ROOT / 'docs' / f'hero.{kind}').stat().st_size
    assert 0 < size <= make_gallery.LARGEST_MOVING[kind]


# The pages of drives, effects and faults agree with the code, and show their own scenes.


LINKAGES = ROOT / 'config' / 'linkages'
EFFECTS_SPEC = spec_from_file_location('make_effects', ROOT / 'docs' / 'make_effects.py')
make_effects = module_from_spec(EFFECTS_SPEC)

EFFECTS_SPEC.loader.exec_module(make_effects)

PAGE = make_effects.text_of_pages()
SECTIONS = make_effects.sections(PAGE)
BY_NAME = {section.name: section for section in SECTIONS}
NAMES = (*DRIVES, *EFFECTS, *FAULTS)
DRAWN = [section for section in SECTIONS if section.scene]
PARTS_OF_TORQUE = ('Motor', 'Play')


def scene_of(text):
    linkage = re.search(r'linkage: \.\./linkages/(\w+\.yaml)\n', text).group(1)
    files = {'scene.yaml': text.encode(), 'linkage.yaml': (LINKAGES / linkage).read_bytes()}
    return parse_scene('page', 'docs/effects.md', files)


def squeezed(text):
    return ' '.join(text.split())


def equations(name):
    """Return the equations of a module: the indented lines of its docstring."""
    module = import_module(effect_class(name).__module__)
    text = inspect.getdoc(module)
    # Of a module with several effects, each has its own part.
    _, named, own = text.partition(f'\n`{name}`: ')
    lines = (own.partition('\n`')[0] if named else text).splitlines()
    return [squeezed(line) for line in lines if line.startswith('    ') and '=' in line]


def test_effects_page_has_all_sections_in_order():
    names = [section.name for section in SECTIONS if section.name in NAMES]
    assert names == [*NAMES]


def test_generated_parts_of_the_effects_page_are_current():
    assert make_effects.filled(PAGE) == PAGE, 'make effects makes it anew'


@pytest.mark.parametrize('name', NAMES)
def test_effects_section_names_source_output_and_limits(name):
    text = BY_NAME[name].text
    assert '**Not modelled.**' in text
    if name not in FAULTS:
        assert re.search(r'\*\*Source\.\*\* \S', text)
        assert '\n```text\n' in text
        assert re.search(rf'^!\[[^\]]{{40,}}\]\({name}\.png\)$', text, re.MULTILINE)


@pytest.mark.parametrize(
    ('name', 'equation'), [(name, each) for name in EFFECTS for each in equations(name)]
)
def test_equations_of_a_module_stand_in_its_section(name, equation):
    assert equation in squeezed(BY_NAME[name].text)


@pytest.mark.parametrize('section', DRAWN, ids=lambda section: section.name)
def test_example_scene_uses_the_effect_of_its_section(section):
    scene = scene_of(section.scene)
    (scene_linkage,) = scene.linkages
    if section.name == 'Faults':
        assert {fault.kind for fault in scene.faults.values()} == set(FAULTS)
    elif section.name == 'loads':
        assert scene_linkage.loads.applied
    elif section.name in PARTS_OF_TORQUE:
        assert getattr(scene_linkage.drive[1], section.name.lower()) is not None
    else:
        assert section.name in (scene_linkage.drive[0], *scene_linkage.effects)


def test_effects_page_links_the_tests_of_each_effect():
    section = BY_NAME['What each is held against']
    rows = [line.strip('| ').split(' | ') for line in section.text.splitlines() if line[:1] == '|']
    assert [name for name, _, _ in rows[2:]] == [*DRIVES, 'loads', *EFFECTS, *FAULTS]
    for name, _, tests in rows[2:]:
        files = re.findall(r'\]\(\.\./(test/\S+\.py)\)', tests)
        texts = [(ROOT / file).read_text('utf-8') for file in files]
        assert any(name in text.lower() for text in texts), f'no test of {name} among them'


def test_effects_page_has_one_scene_per_drive_and_effect():
    drives = [*DRIVES, *PARTS_OF_TORQUE]
    assert [section.name for section in DRAWN] == [*drives, *EFFECTS, 'Faults', 'loads']


@pytest.mark.parametrize('section', DRAWN, ids=lambda section: section.name)
def test_effects_picture_is_drawn_from_its_scene(section):
    image = pytest.importorskip('PIL.Image')
    file = make_effects.PICTURES / f'{section.name.lower()}.png'
    assert file.stat().st_size < make_effects.LARGEST
    with image.open(file) as picture:
        assert picture.format == 'PNG'
        assert picture.text['Scene'] == section.scene, 'make effects draws it anew'
        size = picture.size
    small = make_effects.PICTURES / 'thumbnails' / file.name
    assert small.stat().st_size < make_effects.LARGEST_SMALL
    with image.open(small) as picture:
        assert picture.size == (size[0] // 2, size[1] // 2)


@pytest.mark.parametrize('folder', ['.', 'thumbnails'])
def test_effects_folder_holds_no_other_pictures(folder):
    drawn = {file.name for file in (make_effects.PICTURES / folder).glob('*.png')}
    assert drawn == {f'{section.name.lower()}.png' for section in DRAWN}


def test_example_effect_of_the_page_works(monkeypatch):
    code = re.search(r'^```python\n(.*?)^```$', PAGE, re.MULTILINE | re.DOTALL).group(1)
    module = type(sys)('saturation')
    monkeypatch.setitem(sys.modules, 'saturation', module)
    exec(compile(code, 'docs/effects.md', 'exec'), module.__dict__)
    monkeypatch.setitem(EFFECTS, 'saturation', 'saturation.SaturationEffect')
    text = (
        'linkage: ../linkages/four_bar.yaml\n'
        'drive: {constant_rate: {rate: 1.0}}\n'
        'effects: {saturation: {largest: 0.5}}\n'
    )
    pipeline = Pipeline(scene_of(text))
    read = [pipeline.tick(second * 10**9).states[0].reading.joints[0] for second in range(3)]
    assert read == [0.0, 0.5, 0.5]
