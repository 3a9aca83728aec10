# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The picture of a linkage can be read: names, units, curves and the mark of its pose."""

from itertools import combinations, pairwise
from math import radians
from pathlib import Path
import re
from typing import Any

from linkage_ros.cli.main import main
from linkage_ros.description import find_closures, LENGTHS, linkage_content, load
from linkage_ros.errors import FileError
from linkage_ros.kinematics import prepare_view, usual_inputs
from linkage_ros.resources import linkage_names, named_file
from linkage_ros.tools.drawing import degree_step, figure as drawing, paint_picture
from linkage_ros.tools.drawing.painting import NAME_INK
import pytest

pytest.importorskip('matplotlib')

_APART = 3.5
"""Smallest distance between two names, in pixels."""


def drawn(name: str, inputs: tuple[float, ...] = (), length: str = 'm', **options: Any) -> Any:
    """Draw a linkage with names; return the figure instead of storing it."""
    closure = load(name)
    kept = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(drawing, 'save_picture', lambda figure, _file: kept.append(figure))
        shown = prepare_view(closure, inputs or usual_inputs(closure))._replace(length=length)
        paint_picture(shown, name, Path('never.png'), names=True, **options)
    (figure,) = kept
    figure.draw_without_rendering()
    return figure


def box(text: Any) -> tuple[str, Any]:
    """Return a text and its box in pixels."""
    return text.get_text(), text.get_window_extent()


def nearer(written: list[tuple[str, Any]], apart: float) -> list[tuple[str, str]]:
    """Return the pairs of texts that are less than so many pixels apart."""
    return [
        (one, other)
        for (one, a), (other, b) in combinations(written, 2)
        if max(a.x0, b.x0) - min(a.x1, b.x1) < apart and max(a.y0, b.y0) - min(a.y1, b.y1) < apart
    ]


def struck_by_leaders(axes: Any) -> list[str]:
    """Return the names that a line from a name to its place passes through."""
    struck = []
    for leader in (line for line in axes.lines if line.get_color() == NAME_INK):
        (x0, y0), (x1, y1) = axes.transData.transform(leader.get_xydata())
        for name, b in map(box, axes.texts):
            on_way = [(x0 + (x1 - x0) * k / 200.0, y0 + (y1 - y0) * k / 200.0) for k in range(201)]
            if any(b.x0 < x < b.x1 and b.y0 < y < b.y1 for x, y in on_way):
                struck.append(name)
    return struck


@pytest.mark.sample(2)
@pytest.mark.parametrize('name', linkage_names())
def test_names_in_a_picture_do_not_overlap(name):
    figure = drawn(name)
    names = [box(text) for text in figure.axes[0].texts]
    assert {*load(name).linkage.links} - {'ground'} <= {text for text, _ in names}
    assert nearer(names, _APART) == []
    assert struck_by_leaders(figure.axes[0]) == []
    others = [
        box(text)
        for axes in figure.axes
        for text in (axes._left_title, axes.xaxis.label, axes.yaxis.label, *axes.texts)
        if text.get_text()
    ]
    assert nearer(others, 0.0) == []
    low, high = figure.bbox.min, figure.bbox.max
    assert [text for text, b in others if (b.min < low).any() or (b.max > high).any()] == []


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ('name', 'at', 'mark', 'title', 'ends'),
    [
        ('four_bar', 40.0, 40.0, 'four_bar, crank_joint 40°', (0.0, 360.0)),
        ('four_bar', 999.0, 279.0, 'four_bar, crank_joint 999° (279° on the axis)', (0.0, 360.0)),
        ('double_rocker', 400.0, 40.0, 'left_rocker_joint 400° (40° on the axis)', (36.87, 101.5)),
        ('double_rocker', -320.0, 40.0, '-320° (40° on the axis)', (36.87, 101.5)),
    ],
)
def test_pose_mark_is_shown_within_the_range(name, at, mark, title, ends):
    figure = drawn(name, (radians(at),))
    plane, joints = figure.axes
    assert title in plane.get_title(loc='left')
    dotted = next(line for line in joints.lines if line.get_linestyle() == ':')
    assert dotted.get_xdata()[0] == pytest.approx(mark)
    assert joints.get_xlim() == pytest.approx(ends, abs=0.1)


def test_pose_beyond_the_limits_keeps_the_axis(tmp_path):
    file = tmp_path / 'limited.yaml'
    file.write_text('four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1, input: {limits: [0.5, 1.5]}}\n')
    plane, joints = drawn(str(file), (2.5,)).axes
    assert '(limited: ' in plane.get_title(loc='left')
    assert joints.get_xlim() == pytest.approx((28.65, 85.94), abs=0.01)


def test_lengths_below_a_metre_are_drawn_in_millimetres():
    plane = drawn('four_bar').axes[0]
    assert plane.get_xlabel() == 'x [mm]'
    assert drawn('windscreen_wiper').axes[0].get_xlabel() == 'x [m]'
    slide = drawn('elliptic_trammel').axes[-1]
    assert slide.get_xlabel() == 'trammel_slide [mm]'
    assert slide.xaxis.get_major_formatter()(-0.1) == '−100'


@pytest.mark.sample(1)
@pytest.mark.parametrize('length', LENGTHS)
def test_picture_lengths_have_round_numbers_in_file_units(length):
    shown = 'mm' if length == 'm' else length
    per_metre = {'mm': 1000.0, 'cm': 100.0, 'in': 1.0 / 0.0254}[shown]
    plane, *_, joints = drawn('elliptic_trammel', (0.05,), length).axes
    if length != 'm':  # from metres only axes and bars go to millimetres
        assert f'trammel_slide {0.05 * per_metre:.5g} {length}' in plane.get_title(loc='left')
    assert joints.get_xlabel() == f'trammel_slide [{shown}]'
    for axis in (plane.xaxis, plane.yaxis, joints.xaxis):
        assert axis.get_label_text().endswith(f'[{shown}]')
        ticks = [tick * per_metre for tick in axis.get_ticklocs()]
        (step,) = {float(f'{b - a:.6g}') for a, b in pairwise(ticks)}
        assert step in {k * 10.0**n for k in (1.0, 2.0, 2.5, 5.0) for n in (-1, 0, 1, 2)}
    texts = [text.get_text() for text in drawn('wishbone', length=length).axes[0].texts]
    (bar,) = (text for text in texts if re.fullmatch(rf'[\d.]+ {length}', text))
    assert bar.strip(f' {length}0.') in {'1', '2', '5'}


@pytest.mark.sample(1)
@pytest.mark.parametrize('name', ['jansen_leg', 'slider_crank'])
def test_curves_are_continuous_with_names_in_their_colours(name):
    joints = drawn(name).axes[1]
    names = {text.get_text(): text.get_color() for text in joints.texts}
    for line in joints.lines:
        if line.get_linestyle() == '-':
            y = line.get_ydata()
            assert max(abs(b - a) for a, b in pairwise(y)) < 10.0
            assert names[line.get_label()] == line.get_color()


WITHOUT_SIDES = """\
links:
  ground:  {O2: [0, 0], O4: [0.100, 0]}
  crank:   {O2: [0, 0], A: [0.040, 0]}
  coupler: {A: [0, 0], B: [0.120, 0], C: [0.100, 0.050]}
  rocker:  {O4: [0, 0], B: [0.080, 0]}
  arm:     {C: [0, 0], D: [0.150, 0]}
  foot:    {O4: [0, 0], D: [0.200, 0]}
input: {joint: crank_joint, parent: ground, child: crank}
joints: {rocker_joint: {parent: ground, child: rocker}}
"""


def find_assemblies(linkage):
    file = named_file(linkage, 'linkages')
    return find_closures(linkage_content(file), file.stem)


def test_assemblies_vary_the_sides_missing_in_the_file(tmp_path):
    file = tmp_path / 'x.yaml'
    file.write_text(WITHOUT_SIDES)
    sides = 'left', 'right'
    assert [*find_assemblies(file)] == [
        f'assembly: {{B: {one}, D: {other}}}' for one in sides for other in sides
    ]
    file.write_text(f'{WITHOUT_SIDES}assembly: {{B: right}}\n')
    assert [*find_assemblies(file)] == [f'assembly: {{B: right, D: {other}}}' for other in sides]
    file.write_text(f'{WITHOUT_SIDES}assembly: {{B: right, D: left}}\n')
    assert len(find_assemblies(file)) == 4


def test_assemblies_of_a_shorthand_are_named_in_shorthand(tmp_path):
    file = tmp_path / 'x.yaml'
    file.write_text('four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1}\n')
    found = find_assemblies(file)
    assert [*found] == ['assembly: left', 'assembly: right']
    assert found['assembly: right'].linkage.assembly == {'B': 'right'}


def test_each_assembly_closes_on_its_sides():
    for closure in find_assemblies('jansen_leg').values():
        position = closure.position(*usual_inputs(closure))
        points = closure.points(position)
        a, b, c = points['crank', 'A'], points['ground', 'B'], points['upper_rod', 'C']
        side = ((b - a).conjugate() * (c - a)).imag
        assert (side > 0.0) == (closure.linkage.assembly['C'] == 'left')


def test_assemblies_that_close_nowhere_are_left_out():
    sides = 'left', 'right'
    found = [f'assembly: {{B: left, D: {other}}}' for other in sides]
    assert [*find_assemblies('stephenson_3')] == found


@pytest.mark.parametrize('name', ['class_3', 'scotch_yoke'])
def test_assemblies_of_a_linkage_without_dyads_are_refused(name):
    with pytest.raises(FileError, match='no dyad of this linkage has two assemblies'):
        find_assemblies(name)


def test_assemblies_of_an_open_linkage_are_refused(tmp_path):
    file = tmp_path / 'x.yaml'
    file.write_text(WITHOUT_SIDES.replace('0.080', '0.380'))
    with pytest.raises(FileError, match='close at no value of the input'):
        find_assemblies(file)


UNITS = 'units: mm\nangles: degrees\n'
IN_MM = UNITS + re.sub(r'0\.\d+', lambda of: f'{1e3 * float(of[0]):g}', WITHOUT_SIDES)


@pytest.mark.parametrize('text', [WITHOUT_SIDES, IN_MM], ids=['m', 'mm'])
def test_draw_assemblies_prints_the_pose_of_each(text, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path('x.yaml').write_text(text)
    assert main(['draw', 'x.yaml', '--assemblies', '-o', 'x.svg']) == 0
    *lines, file = capsys.readouterr().out.splitlines()
    assert file == 'x.svg'
    titles = re.findall('<!-- (.*?) -->', Path('x.svg').read_text('utf-8'), re.DOTALL)
    folded = [title for title in titles if title.startswith('pose')]
    assert len(lines) == len(folded) == 4
    for line, title, drawn in zip(lines, folded, find_assemblies('x.yaml').values(), strict=True):
        assert line.startswith(title)
        Path('y.yaml').write_text(f'{text}{line}\n')
        found = load('y.yaml')
        at = found.linkage.pose.inputs
        assert found.position(*at).joints == drawn.position(*at).joints


@pytest.mark.sample(1)
@pytest.mark.parametrize('name', ['parallelogram', 'jansen_leg', 'slider_crank', 'watt_1'])
def test_printed_pose_reproduces_its_assembly(name, tmp_path, capsys):
    assert main(['draw', name, '--assemblies', '-o', str(tmp_path / 'x.svg')]) == 0
    lines = capsys.readouterr().out.splitlines()[:-1]
    text = named_file(name, 'linkages').read_text('utf-8')
    own = re.sub(r'(?m)^(assembly|pose):.*\n(  .*\n)*', '', text)
    for line, drawn in zip(lines, find_assemblies(name).values(), strict=True):
        file = tmp_path / 'y.yaml'
        file.write_text(f'{own}{line}\n')
        found = load(file)
        at = found.linkage.pose.inputs
        assert found.position(*at).joints == drawn.position(*at).joints


@pytest.mark.parametrize(
    ('high', 'step'),
    [(7.0, 1.0), (200.0, 30.0), (360.0, 60.0), (1440.0, 180.0), (36000.0, 4680.0)],
)
def test_axis_of_many_turns_has_few_ticks(high, step):
    assert degree_step((0.0, high)) == step
