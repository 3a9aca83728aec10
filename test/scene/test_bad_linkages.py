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


"""A linkage file that cannot be used: one line that says where, what, and what would help."""

from __future__ import annotations

from linkage_ros.errors import FileError
import pytest

from .files import CONFIG, FOUR_BAR, is_one_line, SCENE

# Without its first line, which is for editors.
WRITTEN_OUT = (CONFIG / 'linkages' / 'four_bar.yaml').read_bytes().partition(b'\n')[2]
SLIDER = b'inverted_slider_crank: {a: 0.15, swivel: [0.25, 0.1]}'

# The whole linkage file.
LINKAGES = {
    'empty': (b'', ': holds None; write a mapping (key: value)'),
    'a list': (b'- four_bar', ": holds ['four_bar']; write a mapping (key: value)"),
    'nothing known': (b'bars: 4', ':1: bars: unknown key; known: assembly, four_bar, input'),
    'shorthand misspelt': (b'fourbar: {}', ":1: fourbar: unknown key; did you mean 'four_bar'?"),
    'shorthand without a side': (
        b'four_bar: {a: 1, b: 1, c: 1}',
        ":1: four_bar: the key 'd' is missing; add d: a number in [m]",
    ),
    'zero length': (
        FOUR_BAR.replace(b'0.04', b'0'),
        ':1: four_bar.a: 0 is out of bounds; write a finite number, more than 0 and at most 1e+09',
    ),
    'negative length': (FOUR_BAR.replace(b'0.04', b'-1'), ':1: four_bar.a: -1 is out of bounds;'),
    'NaN length': (FOUR_BAR.replace(b'0.04', b'.nan'), ':1: four_bar.a: nan is out of bounds;'),
    'a length beyond squaring': (
        FOUR_BAR.replace(b'0.04', b'1e200'),
        ':1: four_bar.a: 1e+200 is out of bounds; write a finite number',
    ),
    'side of another shape': (
        FOUR_BAR.replace(b'}', b', assembly: ahead}'),
        ":1: four_bar.assembly: 'ahead' is none; write left or right",
    ),
    'two shorthands': (
        FOUR_BAR + SLIDER,
        ':2: inverted_slider_crank: unknown key; known: four_bar',
    ),
    'shorthand and links': (FOUR_BAR + b'links: {}', ':2: links: unknown key; known: four_bar'),
    'closes nowhere': (
        FOUR_BAR.replace(b'0.1}', b'1.0}'),
        ':1: four_bar: the loops close at no value of the input; the longest link of a loop',
    ),
    'swivel that is no point': (
        SLIDER.replace(b', 0.1', b''),
        ':1: inverted_slider_crank.swivel: [0.25] is not a point; write two finite numbers',
    ),
    'swivel on the pivot': (
        SLIDER.replace(b'0.25, 0.1', b'0, 0'),
        ":1: inverted_slider_crank.swivel: [0, 0] is the crank's pivot; give the swivel",
    ),
    'point of three': (
        WRITTEN_OUT.replace(b'[0.040, 0]', b'[0.040, 0, 0]'),
        ':6: links.crank.A: [0.04, 0, 0] is not a point; write two finite numbers: [x, y]',
    ),
    'point far away': (
        WRITTEN_OUT.replace(b'[0.040, 0]', b'[1e300, 0]'),
        ':6: links.crank.A: [1e+300, 0] is out of bounds; write numbers of at most 1e+09',
    ),
    'link without length': (
        WRITTEN_OUT.replace(b'[0.040, 0]', b'[0, 0]'),
        "lies on 'O2'; give the two points different places",
    ),
    'no ground': (
        WRITTEN_OUT.replace(b'ground:', b'base:'),
        ":4: links: no link is named 'ground'",
    ),
    'no pin': (
        WRITTEN_OUT.replace(b'rocker: {O4', b'rocker: {O5'),
        ':8: links.rocker: is free: its pins and sliders do not hold it',
    ),
    'crank that is no link': (
        WRITTEN_OUT.replace(b'child: crank}', b'child: krank}'),
        ":9: input.child: 'krank' is not a link; name one of coupler, crank, ground, rocker",
    ),
    'no side': (
        WRITTEN_OUT.replace(b'B: left', b''),
        ":10: assembly: 'B' is missing; write B: left",
    ),
    'joint of no link': (
        WRITTEN_OUT.replace(b'child: coupler}', b'child: copler}'),
        ":12: joints.coupler_joint.child: 'copler' is not a link; name one of coupler, crank, gr",
    ),
    'the input published': (
        WRITTEN_OUT.replace(b'rocker_joint', b'crank_joint'),
        ':13: joints.crank_joint: is the input joint; publish the dependent joints',
    ),
    'joint of no text': (
        WRITTEN_OUT.replace(b'crank_joint', b'"\\udc00"'),
        ":9: input.joint: '\\udc00' is not a text; write a name",
    ),
    'nothing to publish': (
        WRITTEN_OUT[: WRITTEN_OUT.index(b'joints:')] + b'joints: {}',
        ':11: joints: publishes nothing; name a joint',
    ),
    'slide of no slider': (
        WRITTEN_OUT.replace(b'{parent: crank, child: coupler}', b'{slider: rod}'),
        ":12: joints.coupler_joint.slider: 'rod' is not a slider; this linkage has none",
    ),
}


@pytest.mark.parametrize('kind', LINKAGES)
def test_a_bad_linkage_is_refused_in_a_line(build, kind):
    text, expected = LINKAGES[kind]
    with pytest.raises(FileError) as caught:
        build(SCENE, text)
    assert is_one_line(caught.value)
    assert expected in str(caught.value)
