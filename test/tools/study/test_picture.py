# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The picture: every setting, the scene's own marked, labels that lie on nothing."""

from __future__ import annotations

from itertools import combinations, pairwise
from math import hypot
from typing import Any, NamedTuple
from xml.etree import ElementTree as ET

from linkage_ros.tools.study import Budget, budget_svg, Knob
import pytest

from .random_budgets import random_budgets
from .shown_budget import BUDGET, STEP

font_manager = pytest.importorskip('matplotlib.font_manager')
textpath = pytest.importorskip('matplotlib.textpath')

SVG = '{http://www.w3.org/2000/svg}'
FONT = font_manager.FontProperties(family='DejaVu Sans', size=13.0)


class Rectangle(NamedTuple):
    """Where letters are, in pixels."""

    left: float
    top: float
    right: float
    bottom: float


def letters_of(text: ET.Element) -> Rectangle:
    """Return where the letters of a text are, as matplotlib has them in the same typeface."""
    width, height, descent = textpath.TextToPath().get_text_width_height_descent(
        text.text, FONT, ismath=False
    )
    x, y = float(text.attrib['x']), float(text.attrib['y'])
    x -= {'start': 0.0, 'middle': 0.5, 'end': 1.0}[text.get('text-anchor', 'start')] * width
    return Rectangle(x, y - height + descent, x + width, y + descent)


def errors_of(budget: Budget) -> list[Knob]:
    return [knob for knob in budget.knobs if not knob.is_deliberate]


def pictures() -> list[tuple[Budget, ET.Element]]:
    shown = [BUDGET, *random_budgets(100)]
    return [(each, ET.fromstring(budget_svg(each))) for each in shown if errors_of(each)]


PICTURES = pictures()


def marks_of(drawn: ET.Element) -> list[ET.Element]:
    return [group for group in drawn.iter(f'{SVG}g') if group.find(f'{SVG}title') is not None]


def center_of(mark: ET.Element) -> tuple[float, float]:
    shape = list(mark)[-1]
    if shape.tag == f'{SVG}circle':
        return float(shape.attrib['cx']), float(shape.attrib['cy'])
    points = [tuple(map(float, pair.split(','))) for pair in shape.attrib['points'].split()]
    low, high = ([f(each[i] for each in points) for i in (0, 1)] for f in (min, max))
    return 0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])


def test_picture_marks_every_setting_and_rings_own() -> None:
    for budget, drawn in PICTURES:
        marks = marks_of(drawn)
        knobs = errors_of(budget)
        assert len(marks) == sum(len(knob.settings) for knob in knobs)
        rings = [mark for mark in marks if len(mark) == 3]
        assert len(rings) == len(knobs)


def test_picture_fades_dominated_settings() -> None:
    for budget, drawn in PICTURES:
        marks = iter(marks_of(drawn))
        for knob in sorted(errors_of(budget), key=lambda knob: -knob.own_setting.error.worst):
            at = [(budget.core_of(knob, each), each.error.worst) for each in knob.settings]
            for own in at:
                beaten = any(a <= own[0] and b <= own[1] and (a, b) != own for a, b in at)
                opacity = float(list(next(marks))[-1].attrib['fill-opacity'])
                assert (opacity < 1.0) == beaten, budget


def test_picture_labels_overlap_nothing() -> None:
    for _, drawn in PICTURES:
        texts = [text for text in drawn.iter(f'{SVG}text') if 'x' in text.attrib]
        labels = [letters_of(text) for text in texts if text.get('class') == 'label']
        for one, other in combinations(map(letters_of, texts), 2):
            assert (
                one.right <= other.left
                or other.right <= one.left
                or one.bottom <= other.top
                or other.bottom <= one.top
            ), (one, other)
        centers = [center_of(mark) for mark in marks_of(drawn)]
        for label in labels:
            for x, y in [*centers, *_places_on_curves(drawn)]:
                assert not (
                    label.left < x < label.right and label.top < y < label.bottom
                ), (label, x, y)  # fmt: skip
            for x, y in centers:
                dx = max(label.left - x, 0.0, x - label.right)
                dy = max(label.top - y, 0.0, y - label.bottom)
                assert hypot(dx, dy) > 4.0


def _places_on_curves(drawn: ET.Element) -> list[tuple[float, float]]:
    found = []
    for line in drawn.iter(f'{SVG}polyline'):
        points = [tuple(map(float, pair.split(','))) for pair in line.attrib['points'].split()]
        for (x, y), (u, v) in pairwise(points):
            found += [(x + (u - x) * k / 200, y + (v - y) * k / 200) for k in range(201)]
    return found


def test_picture_contents_lie_within_its_frame() -> None:
    for _, drawn in PICTURES:
        width, height = map(float, drawn.attrib['viewBox'].split()[2:])
        for text in drawn.iter(f'{SVG}text'):
            if 'x' in text.attrib:
                letters = letters_of(text)
                assert min(letters.left, letters.top) >= 0.0, text.text
                assert letters.right <= width, text.text
                assert letters.bottom <= height, text.text
        for mark in marks_of(drawn):
            x, y = center_of(mark)
            assert 60.0 < x < width
            assert 0.0 < y < height - 40.0


def test_picture_labels_most_settings() -> None:
    drawn = ET.fromstring(budget_svg(BUDGET))
    labels = {text.text for text in drawn.iter(f'{SVG}text') if text.get('class') == 'label'}
    assert labels >= {'rk4, 1 ms', '1 kHz, held', 'closed form', 'rk4, 0.25 ms', '30 digits'}


def test_budget_without_errors_has_no_picture() -> None:
    assert budget_svg(BUDGET._replace(knobs=[STEP._replace(is_deliberate=True)])) == ''


def test_picture_escapes_markup_in_names() -> None:
    odd: Any = '</svg><script>x</script>&'
    knob = STEP._replace(name=odd, settings=[STEP.settings[1]._replace(label=odd)], chosen=0)
    drawn = ET.fromstring(budget_svg(BUDGET._replace(scene=odd, knobs=[knob])))
    assert not list(drawn.iter(f'{SVG}script'))
