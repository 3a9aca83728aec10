# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Parts in a DXF, read back by ezdxf: holes where the file has pins, outlines around them."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path
import subprocess
from typing import Any

from linkage_ros.description import load
from linkage_ros.resources import linkage_names, shipped_path
from linkage_ros.tools.drawing import links_dxf
import pytest
import yaml

from ...support.commands import linkage as run

ezdxf = pytest.importorskip('ezdxf')
NEAR = 1e-6
"""In [mm]."""


def read(data: bytes, folder: Path) -> Any:
    file = folder / 'parts.dxf'
    file.write_bytes(data)
    document = ezdxf.readfile(file)
    assert not document.audit().errors
    return document


def box(outline: Any) -> tuple[float, float, float, float]:
    """Return the corners of the box about an outline, arcs included."""
    from ezdxf import bbox

    found = bbox.extents([outline])
    return found.extmin.x, found.extmin.y, found.extmax.x, found.extmax.y


WRITTEN_OUT = [
    name
    for name in linkage_names()
    if 'links:' in shipped_path(f'linkages/{name}.yaml').read_text()
]
"""Linkages whose files have points, from which distances are known; the others have lengths."""


@pytest.mark.sample(6)
@pytest.mark.parametrize('name', WRITTEN_OUT)
def test_dxf_part_of_every_link_has_its_pin_holes(name: str, tmp_path: Path) -> None:
    document = read(links_dxf(load(name)), tmp_path)
    assert document.header['$INSUNITS'] == 4  # millimetres
    space = document.modelspace()
    links = yaml.safe_load(shipped_path(f'linkages/{name}.yaml').read_text('utf-8'))
    points = links['links']
    pins = {
        point
        for point in {p for each in points.values() for p in each}
        if sum(point in each for each in points.values()) > 1
    } | {slider['point'] for slider in links.get('sliders', {}).values()}
    outlines = [box(outline) for outline in space.query('LWPOLYLINE[layer=="CUT"]')]
    names = [text.dxf.text for text in space.query('TEXT[layer=="NAME"]')]
    assert names == list(points)
    assert len(outlines) == len(points)
    for one, other in combinations(outlines, 2):  # no part lies on another
        assert one[2] < other[0] or other[2] < one[0] or one[3] < other[1] or other[3] < one[1]
    holes = [circle.dxf.center for circle in space.query('CIRCLE[layer=="HOLE"]')]
    radius = next(iter(space.query('CIRCLE[layer=="HOLE"]'))).dxf.radius
    for link, (left, low, right, top) in zip(names, outlines, strict=True):
        inside = [h for h in holes if left < h.x < right and low < h.y < top]
        there = [complex(*at) * 1e3 for point, at in points[link].items() if point in pins]
        assert len(inside) == len(there)
        # The file gives their distances.
        wanted = sorted(abs(one - other) for one, other in combinations(there, 2))
        found = sorted(
            abs(complex(one.x - other.x, one.y - other.y))
            for one, other in combinations(inside, 2)
        )
        assert found == pytest.approx(wanted, abs=NEAR)
        for hole in inside:  # with material all around
            assert left + radius < hole.x < right - radius
            assert low + radius < hole.y < top - radius


def test_dxf_link_with_a_slider_has_a_slot(tmp_path: Path) -> None:
    space = read(links_dxf(load('slider_crank')), tmp_path).modelspace()
    (slot,) = space.query('LWPOLYLINE[layer=="HOLE"]')
    left, _, right, _ = box(slot)
    (circle, *_) = space.query('CIRCLE[layer=="HOLE"]')
    # r.h.s.: sqrt((l+r)^2 - e^2) - sqrt((l-r)^2 - e^2), the stroke of an offset slider-crank.
    stroke = 1e3 * ((0.18**2 - 0.01**2) ** 0.5 - (0.10**2 - 0.01**2) ** 0.5)
    assert right - left == pytest.approx(stroke + 2.0 * circle.dxf.radius, abs=1e-2)


def test_dxf_assembly_layer_is_off(tmp_path: Path) -> None:
    document = read(links_dxf(load('jansen_leg')), tmp_path)
    assert document.layers.get('ASSEMBLY').is_off()
    assert len(document.modelspace().query('LWPOLYLINE[layer=="ASSEMBLY"]')) == 8


def test_draw_writes_the_parts_of_a_dxf(tmp_path: Path) -> None:
    answer: subprocess.CompletedProcess[str] = run(tmp_path, 'draw', 'four_bar', '-o', 'parts.dxf')
    assert (answer.returncode, answer.stdout) == (0, 'parts.dxf\n')
    circles = ezdxf.readfile(tmp_path / 'parts.dxf').modelspace().query('CIRCLE[layer=="HOLE"]')
    assert len(circles) == 8
