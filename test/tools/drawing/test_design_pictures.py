# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A design's picture shows what was wanted, what is met, and on which assembly."""

from cmath import phase, rect
from functools import cache
from itertools import combinations
from math import acos, cos, degrees, pi, radians, remainder, sin, tau
from pathlib import Path
from typing import Any, NamedTuple

from linkage_ros.errors import LinkageError
from linkage_ros.kinematics import INK
from linkage_ros.tools.design import (
    Design,
    DesignRequest,
    draw_design,
    FourBar,
    picture as drawing,
)
from linkage_ros.tools.drawing import OTHER, WANTED
import numpy as np
import pytest

from ...support.four_bar import meeting_point

colors = pytest.importorskip('matplotlib.colors')

# sources/003: lengths and coefficients with 50 digits, rounded; see sources/README.md.
A, B, C = 5.5965383934988620854, 0.16985782027961906789, 4.8786334643580194266
K = (0.17868187970650492505, -0.20497543160512679448, 1.0272224808848817759)
EXAMPLE = Design(
    FourBar.of_lengths(A, B, C, 1.0),
    tuple(DesignRequest(radians(t), radians(p)) for t, p in ((25, 30), (35, 40), (50, 60))),
)
CRANK_ROCKER = FourBar((0j, 0.1 + 0j), 0.04 + 0j, (0j, 0.12 + 0j), 0.08 + 0j, 'left', 0.06 + 0.05j)


def closed_left(four_bar: FourBar, crank: float) -> tuple[complex, float, float]:
    """Return where P is, and the directions of coupler and rocker."""
    a = four_bar.pivots[0] + four_bar.crank * rect(1.0, crank)
    pivot = four_bar.pivots[1]
    pin = meeting_point(a, pivot, abs(four_bar.coupler[1]), abs(four_bar.rocker))
    coupler, rocker = phase(pin - a), phase(pin - pivot) - phase(four_bar.rocker)
    return a + (four_bar.traced or 0j) * rect(1.0, coupler), coupler, rocker


def pairs(four_bar: FourBar, *cranks: float, off: float = 0.0) -> Design:
    return Design(
        four_bar, tuple(DesignRequest(t, closed_left(four_bar, t)[2] + off) for t in cranks)
    )


def path(count: int, off: complex = 0j) -> Design:
    cranks = [0.2 + 5.7 * i / (count - 1) for i in range(count)]
    return Design(
        CRANK_ROCKER,
        tuple(DesignRequest(t, place=closed_left(CRANK_ROCKER, t)[0] + off) for t in cranks),
    )


def poses() -> Design:
    found = [(t, *closed_left(CRANK_ROCKER, t)) for t in (0.5, 1.5, 2.6)]
    return Design(
        CRANK_ROCKER,
        tuple(DesignRequest(t, coupler=angle, place=place) for t, place, angle, _ in found),
    )


OFF = 0.001 + 0.0005j
DRAG_LINK = FourBar.of_lengths(0.1, 0.08, 0.1, 0.04, alpha=0.4, beta=-0.9)
REVERSED = FourBar.of_lengths(0.04, 0.12, -0.08, 0.1)
DESIGNS = {
    'example': EXAMPLE,
    'drag link, zeros free': pairs(DRAG_LINK, 0.3, 1.9, 3.5, 4.4, 5.5),
    'reversed rocker': pairs(REVERSED, 0.3, 1.9, 3.5),
    'nine pairs, missed': pairs(CRANK_ROCKER, *np.linspace(0.3, 2.4, 9).tolist(), off=0.02),
    'seven places': path(7),
    'twenty places, missed': path(20, OFF),
    'poses': poses(),
}


class Sheet(NamedTuple):
    """A picture before it is stored."""

    left: Any
    panels: list[Any]
    right: Any
    under: list[Any]


def drawn(design: Design, **more: Any) -> Sheet:
    """Draw a design, and keep the figure instead of storing it."""
    kept = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(drawing, 'save_picture', lambda figure, _file: kept.append(figure))
        draw_design(design, 'a design', Path('never.png'), **more)
    left, *others = kept[-1].axes
    panels = [axes for axes in others if not axes.get_xlabel()]
    right, *under = (axes for axes in others if axes.get_xlabel())
    return Sheet(left, panels, right, under)


@cache
def sheet(name: str) -> Sheet:
    return drawn(DESIGNS[name])


def lines(axes: Any, colour: str) -> list[list[complex]]:
    return [
        [complex(x, y) for x, y in zip(line.get_xdata(), line.get_ydata(), strict=True)]
        for line in axes.get_lines()
        if colors.to_hex(line.get_color()).lower() == colour.lower() and len(line.get_xdata()) > 1
    ]


def marks(axes: Any) -> list[complex]:
    """Return what is marked with a point that is filled with the colour of what was wanted."""
    return [
        complex(line.get_xdata()[0], line.get_ydata()[0])
        for line in axes.get_lines()
        if len(line.get_xdata()) == 1
        and colors.to_hex(line.get_markerfacecolor()) == WANTED.lower()
    ]


def legend(axes: Any) -> list[str]:
    return [text.get_text() for text in axes.get_legend().get_texts()]


@pytest.mark.sample(2)
@pytest.mark.parametrize('name', DESIGNS)
def test_numbers_of_a_design_picture_do_not_overlap(name):
    found = sheet(name)
    for axes in (found.left, found.right, *found.panels):
        boxes = [text.get_window_extent() for text in axes.texts if text.get_text()]
        assert boxes
        for one, other in combinations(boxes, 2):
            assert not one.overlaps(other)
        frame = axes.get_window_extent().padded(2.0)
        for box in boxes:
            assert frame.x0 <= box.x0
            assert box.x1 <= frame.x1
            assert frame.y0 <= box.y0
            assert box.y1 <= frame.y1


@pytest.mark.sample(2)
@pytest.mark.parametrize('name', [name for name in DESIGNS if 'places' not in name])
def test_design_marks_lie_at_the_wanted_angles(name):
    design = DESIGNS[name]
    found = marks(sheet(name).right)
    assert len(found) == len(design.wanted)
    for mark, wanted in zip(found, design.wanted, strict=True):
        angle = wanted.rocker if wanted.coupler is None else wanted.coupler
        assert remainder(radians(mark.real) - wanted.crank, tau) == pytest.approx(0.0, abs=1e-12)
        assert remainder(radians(mark.imag) - angle, tau) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize('name', ['drag link, zeros free', 'reversed rocker', 'example'])
def test_ray_leads_from_the_pivot_through_the_pin(name):
    design = DESIGNS[name]
    four_bar = design.four_bar
    rays = lines(sheet(name).left, WANTED)
    assert len(rays) == len(design.wanted)
    for (start, end), wanted in zip(rays, design.wanted, strict=True):
        assert start == four_bar.pivots[1]
        pin = four_bar.rocker * rect(1.0, wanted.rocker)
        assert phase((end - start) / pin) == pytest.approx(0.0, abs=1e-12)
        assert abs(end - start) > abs(pin)


def test_legend_names_the_offset_of_a_pin():
    said = legend(sheet('drag link, zeros free').left)
    assert f'wanted rocker angle φ, its pin at φ − {degrees(0.9):.4g}°' in said
    assert f'crank pin at θ + {degrees(0.4):.4g}°' in said


def test_position_on_the_other_assembly_has_its_colour():
    found = sheet('example')
    drawn = [place for line in lines(found.left, OTHER) for place in line]
    for pin in (rect(A, radians(50.0)), 1.0 + rect(C, radians(60.0))):
        assert min(abs(pin - place) for place in drawn) < 1e-12
    for pin in (rect(A, radians(35.0)), 1.0 + rect(C, radians(40.0))):
        assert min(abs(pin - place) for place in drawn) > 0.1
    assert 'met on the other assembly' in legend(found.left)
    assert 'met on the other assembly' not in legend(sheet('poses').left)


def test_both_branches_obey_freudensteins_equation_up_to_toggles():
    found = sheet('example')
    # Coupler and rocker in line: the diagonal from A to O4 is c + b long, or c − b.
    ends = [degrees(acos((A * A + 1.0 - s * s) / (2.0 * A))) for s in (C - B, C + B)]
    own, other = (max(lines(found.right, colour), key=len) for colour in (INK, OTHER))
    for curve in (own, other):
        assert [curve[0].real, curve[-1].real] == pytest.approx(ends, abs=1e-9)
        for place in curve:
            t, p = radians(place.real), radians(place.imag)
            assert K[0] * cos(p) + K[1] * cos(t) + K[2] == pytest.approx(cos(t - p), abs=1e-12)
    # They meet at the toggles and nowhere else.
    apart = np.array([abs(x - y) for x, y in zip(own, other, strict=True)])
    assert max(apart[0], apart[-1]) < 1e-5
    assert apart[1:-1].min() > 1e-3
    marked = {line.get_xdata()[0] for line in found.right.get_lines() if line.is_dashed()}
    assert sorted(marked) == pytest.approx(ends, abs=1e-9)


def test_crank_that_turns_fully_has_no_range_ends():
    found = sheet('reversed rocker')
    (curve,) = (line for line in lines(found.right, INK) if len(line) > 100)
    assert curve[-1].real - curve[0].real == pytest.approx(360.0)
    assert 'end of the range' not in legend(found.right)


@pytest.mark.parametrize(('name', 'panels'), [('example', 3), ('reversed rocker', 0)])
def test_short_link_is_magnified_at_each_position(name, panels):
    found = sheet(name).panels
    assert len(found) == panels
    titles = [panel.get_title() for panel in found]
    assert titles == ['coupler at 1', 'coupler at 2', 'coupler at 3, other assembly'][:panels]
    for panel in found:
        low, high = panel.get_xlim()
        assert high - low < 3.0 * B
        assert {text.get_text() for text in panel.texts} == {'A', 'B'}


def test_rocker_error_is_drawn_in_degrees():
    design = pairs(CRANK_ROCKER, 0.5, 1.0, 1.5)
    crank = np.linspace(0.4, 1.6, 241)
    found = drawn(design, error=(crank, 0.01 * np.sin(2.0 * pi * crank)))
    (axes,) = found.under
    curve = max(lines(axes, INK), key=len)
    for place, x in zip(curve, crank, strict=True):
        assert place == pytest.approx(complex(degrees(x), degrees(0.01 * sin(2.0 * pi * x))))
    assert [mark.real for mark in marks(axes)] == pytest.approx(
        [degrees(wanted.crank) for wanted in design.wanted]
    )
    assert 'error of the rocker [°]' in axes.get_ylabel()


def test_distances_of_missed_places_are_drawn():
    (axes,) = sheet('twenty places, missed').under
    assert axes.get_ylabel() == 'distance [mm]'
    (line,) = (line for line in axes.get_lines() if len(line.get_xdata()) == 20)
    assert list(line.get_ydata()) == pytest.approx([1e3 * abs(OFF)] * 20)
    assert not sheet('seven places').under


def test_open_position_is_omitted_and_named():
    design = EXAMPLE._replace(
        wanted=(*EXAMPLE.wanted, DesignRequest(radians(60.0), radians(70.0)))
    )
    found = drawn(design)
    assert 'position 4: the loop does not close' in legend(found.left)
    assert len(marks(found.right)) == 3


def test_position_beyond_a_toggle_by_rounding_is_drawn():
    toggle = acos((A * A + 1.0 - (C - B) ** 2) / (2.0 * A))
    rocker = closed_left(EXAMPLE.four_bar, toggle + 1e-9)[2]
    design = EXAMPLE._replace(wanted=(DesignRequest(toggle - 1e-10, rocker), *EXAMPLE.wanted[1:]))
    found = drawn(design)
    assert not any('does not close' in said for said in legend(found.left))
    assert marks(found.right)[0].real == pytest.approx(degrees(toggle), abs=1e-6)


def test_design_that_closes_nowhere_is_refused(tmp_path):
    design = EXAMPLE._replace(wanted=(DesignRequest(radians(60.0), radians(70.0)),))
    with pytest.raises(LinkageError, match='closes at none of its positions'):
        draw_design(design, 'none', tmp_path / 'none.png')


def test_repeated_design_picture_has_the_same_bytes(tmp_path):
    one, other = tmp_path / 'one.svg', tmp_path / 'other.svg'
    for file in (one, other):
        draw_design(EXAMPLE, 'twice', file)
    assert one.read_bytes() == other.read_bytes()
    assert one.read_text('utf-8').startswith('<?xml')


def test_design_picture_without_matplotlib_names_the_package(monkeypatch, tmp_path):
    monkeypatch.setattr('linkage_ros.errors.find_spec', lambda _name: None)
    with pytest.raises(LinkageError, match=r'linkage_ros\[report\]'):
        draw_design(EXAMPLE, 'none', tmp_path / 'none.png')


def test_design_picture_in_a_missing_folder_is_refused(tmp_path):
    with pytest.raises(LinkageError, match='there is no folder'):
        draw_design(EXAMPLE, 'none', tmp_path / 'missing' / 'none.png')
