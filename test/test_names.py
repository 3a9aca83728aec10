# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Names reach every text that is written, and are data there: what reads it finds them again."""

from collections.abc import Iterator, Sequence
import csv
from html.parser import HTMLParser
import io
import json
from pathlib import Path
import re
import subprocess
import sys
from xml.etree import ElementTree as ET

from linkage_ros.cli.main import main
from linkage_ros.description import linkage_text, parse_yaml, read_closure, table_file
from linkage_ros.kinematics import Closure, prepare_view, usual_inputs
from linkage_ros.tools.drawing import (
    animate,
    assemblies_picture,
    draw_spread,
    JointSpread,
    links_dxf,
    paint_picture,
    painting,
    range_motion,
    svg,
)
from linkage_ros.tools.models import ModelPart, mujoco_model, urdf_model
from linkage_ros.tools.models.source_code import LANGUAGES, Subject, write_source
from linkage_ros.tools.view import LinkagePage
import numpy as np
import pytest

from .kinematics.compiling.emitted import COMPILERS, needs
from .support.commands import linkage as run

HOSTILE = [
    # C, JavaScript, Python: ends of comments and strings, trigraphs, line continuations.
    r'*\ int injected(void){return 42;} \*', '*/ int injected(void){return 42;} /*', '*??/', '??/',
    '?\\?/', '*/*/', '/*/', '**//', '//*', 'end \\', '\\', "'''", '"""', '"); injected(); //',
    r'x\u000aprint("INJECTED")#', '*/ globalThis.injected = 1 //', '`$injected`', '#error', '%s',
    r'\x1b', '\\\\', '{}', '{0}', '*', '/',
    # HTML and XML.
    '</script><script>injected()</script>', '<!--', '-->', ']]>', '--', 'a-', '&lt;&#60;', '<b>b',
    '"onload=injected()',
    # matplotlib, Plotly, rich.
    r'$\badcmd$', r'$\frac{$', '$x^$', '$', r'\$', '_hidden', '%{x}', '[red]x[/red]', '中文', '😀',
    # Spreadsheets.
    '=1+1', '+1', '-1', '@SUM(1)', "'=1", "''+1", "'a", '＝1', 'a,b', 'a;b', 'a"b',
    # DXF.
    '%%d', '%%%c', '^J', 'a^', r'\U+0041', r'\M+1', r'\Pnew', '{\\fArial;x}',
    # YAML.
    ': ', '- x', 'null', '~', '...', '---', 'a: b', ' #', ' lead', 'trail ', '0', '|', '!tag',
    '*a', 'x' * 300,
]  # fmt: skip
"""Names that mean something to a reader of what is written; all can stand in a linkage file."""
_ROLES = 12


def four_bar(names: tuple[str, ...]) -> Closure:
    """Return a four-bar whose links, points and joints have these names."""
    crank, coupler, rocker, o2, o4, a, b, traced, driven, first, second, file = names
    content = {
        'links': {
            'ground': {o2: [0, 0], o4: [0.1, 0]},
            crank: {o2: [0, 0], a: [0.04, 0]},
            coupler: {a: [0, 0], b: [0.12, 0], traced: [0.06, 0.05]},
            rocker: {o4: [0, 0], b: [0.08, 0]},
        },
        'input': {'joint': driven, 'parent': 'ground', 'child': crank},
        'assembly': {b: 'left'},
        'joints': {
            first: {'parent': crank, 'child': coupler, 'limits': [-9, 9]},
            second: {'parent': 'ground', 'child': rocker},
        },
        'traced': [traced],
    }
    text = json.dumps(content, ensure_ascii=False)
    return read(text, file)


def read(text: str, file: str = '') -> Closure:
    return read_closure(parse_yaml(text.encode(), 'odd.yaml'), file)


def linkages(step: int) -> Iterator[Closure]:
    """Yield four-bars whose names are the hostile ones from every so many on."""
    for start in range(0, len(HOSTILE), step):
        yield four_bar(tuple((HOSTILE * 2)[start:][:_ROLES]))


def subject(closure: Closure) -> Subject:
    name = f'{closure.name}.yaml'
    return Subject(closure, 'x', name, 1, tuple(closure.linkage.joints))


def code(closure: Closure, suffix: str) -> str:
    made = subject(closure)
    return write_source(made, LANGUAGES[suffix](made))


def check_comment(text: str, closure: Closure) -> None:
    """Check that the comment at the head names the joints as they are named."""
    found = re.findall(r'(?:inputs|joints)\[\d\]  (.*) \[rad\]$', text, re.MULTILINE)
    names = [re.sub(r'\\(.)', r'\1', name) for name in found]
    assert names == [closure.linkage.inputs[0].joint, *closure.linkage.joints]


@needs['C99']
@pytest.mark.parametrize('suffix', ['.c', '.h'])
def test_names_in_c_are_comments(suffix: str, tmp_path: Path) -> None:
    count = 0
    for closure in linkages(4):
        text = code(closure, suffix)
        check_comment(text, closure)
        (tmp_path / f'a{count}{suffix}').write_text(text, 'utf-8')
        count += 1
    for kind, standard in COMPILERS.items():
        for index in range(count):
            file = tmp_path / f'one{index}'
            file.write_text(f'#include "a{index}{suffix}"\nint injected;\n')
            typed = [
                *standard, '-trigraphs', '-Wall', '-Wextra', '-Wpedantic', '-Werror',
                '-Wno-unused-function', '-fsyntax-only', str(file),
            ]  # fmt: skip
            done = subprocess.run(typed, capture_output=True, text=True, timeout=60, check=False)
            assert done.returncode == 0, (kind, done.stderr)


_RUN_PYTHON = """
import runpy, sys
expected = {'atan2', 'copysign', 'cos', 'inf', 'isfinite', 'sin', 'sqrt', 'velocity'}
for file in sys.argv[1:]:
    defined = runpy.run_path(file)
    names = {name for name in defined if not name.startswith('__') and not name.isupper()}
    assert names == expected, (file, names)
    assert defined['velocity']([1.0], [1.0])[0] == defined['CLOSED'], file
"""


def run_python(*files: Path) -> None:
    typed = [sys.executable, '-W', 'error', '-c', _RUN_PYTHON, *map(str, files)]
    done = subprocess.run(typed, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout) == (0, ''), done.stdout + done.stderr


def test_names_in_python_are_comments(tmp_path: Path) -> None:
    files = []
    for index, closure in enumerate(linkages(2)):
        text = code(closure, '.py')
        check_comment(text, closure)
        files.append(tmp_path / f'a{index}.py')
        files[-1].write_text(text, 'utf-8')
    run_python(*files)


CODINGS = [
    'raw_unicode_escape',
    'unicode_escape',
    'utf-7',
    'utf-16',
    'rot13',
    'no_such',
    'latin-1',
]


@pytest.mark.parametrize('coding', CODINGS)
@pytest.mark.parametrize('form', ['coding={} ', '-*- coding: {} -*-', 'vim: fileencoding={} :'])
def test_file_name_is_no_encoding_of_a_python_module(
    form: str, coding: str, tmp_path: Path
) -> None:
    name = form.format(coding)
    closure = four_bar((*HOSTILE[14:25], name))
    made = subject(closure)._replace(name=name)
    file = tmp_path / 'a.py'
    file.write_text(write_source(made, LANGUAGES['.py'](made)), 'utf-8')
    run_python(file)


@needs['JavaScript']
def test_names_in_javascript_are_comments(tmp_path: Path) -> None:
    count = 0
    for closure in linkages(2):
        text = code(closure, '.js')
        check_comment(text, closure)
        (tmp_path / f'a{count}.mjs').write_text(text, 'utf-8')
        count += 1
    program = f"""
for (let i = 0; i < {count}; ++i) {{
    const found = await import(`./a${{i}}.mjs`);
    if (Object.keys(found).join() !== 'Status,velocity') throw i;
    if (found.velocity([1.0], [1.0]).status !== found.Status.CLOSED) throw i;
}}
if ('injected' in globalThis) throw 'injected';
"""
    (tmp_path / 'all.mjs').write_text(program, 'utf-8')
    done = subprocess.run(
        ['node', 'all.mjs'], cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stdout) == (0, ''), done.stderr


def texts_of(file: Path) -> set[str]:
    """Return the texts of an SVG whose texts are text."""
    return {
        ''.join(each.itertext())
        for each in ET.parse(file).iter('{http://www.w3.org/2000/svg}text')
    }


def check_shown(names: Sequence[str], file: Path) -> None:
    """Check that an SVG has texts that begin with the names, which it may shorten."""
    texts = texts_of(file)
    assert all(any(text.startswith(name[:15]) for text in texts) for name in names), texts


@pytest.mark.filterwarnings('error')
def test_pictures_draw_names_as_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(painting._SETTINGS, 'svg.fonttype', 'none')
    file = tmp_path / 'a.svg'
    for closure in linkages(24):
        joints = list(closure.linkage.joints)
        pose = usual_inputs(closure)
        paint_picture(prepare_view(closure, pose), closure.name, file, names=True)
        # Names of links and pins have an outline: they are paths, behind the same setting.
        check_shown([*joints, closure.name], file)
        spread = [JointSpread(name, 'rad', np.zeros((2, 3))) for name in joints]
        draw_spread(closure.name, 1.0, spread, file)
        check_shown([*joints, closure.name], file)
        drawn = prepare_view(closure, pose)
        assemblies_picture({f'assembly: {{{name}: left}}': drawn for name in joints[::4]}, file)
        ET.parse(file)
        animate(range_motion(prepare_view(closure, pose), closure.name, 0.1), file)
        check_shown([*joints, closure.name], file)
        title, *_ = ET.fromstring(svg(closure))
        assert title.text == repr(closure)


@pytest.mark.parametrize('write', [urdf_model, mujoco_model])
def test_robot_models_hold_names_without_new_tags(write) -> None:
    for closure in linkages(4):
        root = ET.fromstring(write(closure.name, [ModelPart(closure)]))
        found = {each.get('name') for each in root.iter()}
        assert {*closure.linkage.joints, *closure.linkage.links} <= found
        assert {each.tag for each in root.iter()} <= {
            'robot', 'link', 'visual', 'origin', 'geometry', 'box', 'cylinder', 'material',
            'color', 'computed', 'joint', 'parent', 'child', 'axis', 'limit', 'linkage_start',
            'input', 'mujoco', 'compiler', 'option', 'default', 'geom', 'equality', 'site',
            'worldbody', 'body', 'connect', 'actuator', 'position', 'keyframe', 'key',
        }  # fmt: skip


def test_csv_holds_names_but_no_formula(tmp_path: Path) -> None:
    file = tmp_path / 'a.csv'
    heads = [f'{name} [rad]' for name in HOSTILE]
    with table_file(file, heads, ()) as write:
        write([[-1.0] * len(heads)])
    found, *rows = csv.reader(io.StringIO(file.read_text('utf-8')))
    for cell in [*found, *(cell for row in rows for cell in row if cell != '-1.0')]:
        assert cell[0] not in '=+-@\uff1d\uff0b\uff0d\uff20', cell
    assert [re.sub("^'(?='*[-=+@\uff1d])", '', cell) for cell in found] == heads
    for closure in linkages(12):
        (tmp_path / 'odd.yaml').write_text(linkage_text(closure.linkage), 'utf-8')
        typed = ['solve', str(tmp_path / 'odd.yaml'), '--steps', '2', '-o', str(file), '--force']
        assert main(typed) == 0
        found, *_ = csv.reader(io.StringIO(file.read_text('utf-8')))
        assert not any(cell[0] in '=+-@\uff1d' for cell in found)


def test_dxf_holds_names_but_no_control_codes(tmp_path: Path) -> None:
    ezdxf = pytest.importorskip('ezdxf')
    file = tmp_path / 'a.dxf'
    for closure in linkages(3):
        file.write_bytes(links_dxf(closure))
        texts = [text.plain_text() for text in ezdxf.readfile(file).query('TEXT')]
        for text, name in zip(texts, closure.linkage.links, strict=True):
            # This reader drops a caret at the end.
            found, named = text.replace(' ', ''), name.replace(' ', '').rstrip('^')
            assert found == named or (len(name) > 250 and found[:100] == named[:100])


class _Page(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.data = ''
        self._within = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self._within = ('id', 'data') in attrs
        assert not any(name == 'onload' for name, _ in attrs)

    def handle_data(self, data: str) -> None:
        if self._within:
            self.data += data
            self._within = False


def test_view_page_holds_names_as_text() -> None:
    tags = None
    for closure in linkages(12):
        page = _Page()
        page.feed(LinkagePage(closure).text)
        assert page.tags == (tags := tags or page.tags)
        told = json.loads(page.data)['model']
        names = {*closure.linkage.joints, *closure.linkage.links}
        assert all(json.dumps(name) in json.dumps(told) for name in names)


def test_linkage_file_holds_any_name() -> None:
    for closure in linkages(4):
        assert read(linkage_text(closure.linkage)).linkage == closure.linkage


FILES = ['a\nb', 'a\x1b[31mb', 'a\x7fb', 'a\u202eb', 'a\udcffb', '$x^$', '=1+1', 'a\U000e0001b']
"""Names of files can hold what names in files cannot."""


@pytest.mark.sample(2)
@pytest.mark.parametrize('name', FILES)
def test_commands_accept_any_file_name(name: str, tmp_path: Path) -> None:
    given = f'{name}.yaml'
    (tmp_path / given).write_text('four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1}')
    for suffix in ('.c', '.h', '.py', '.js'):
        name_in_c = ('--name', 'x') if suffix in ('.c', '.h') else ()
        typed = ['compile', given, '-o', f'a{suffix}', *name_in_c]
        answer = run(tmp_path, *typed)
        assert answer.returncode == 0, answer.stderr
        head = (tmp_path / f'a{suffix}').read_text('utf-8').split('The function')[0]
        assert head.replace('\n', '').isprintable()
        assert len(head.splitlines()) <= 5
    for typed in (
        ['draw', given, '-o', 'a.svg'],
        ['urdf', given, '-o', 'a.urdf'],
        ['mjcf', given, '-o', 'a.xml'],
        ['view', given, '-o', 'a.html'],
    ):
        answer = run(tmp_path, *typed)
        assert answer.returncode == 0, (typed, answer.stderr)
        assert answer.stderr == ''
        (tmp_path / typed[-1]).read_text('utf-8')
    told = run(tmp_path, 'check', given, '--json')
    assert json.loads(told.stdout)
