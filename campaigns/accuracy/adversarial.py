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

"""The hard cases, and why each is hard."""

from __future__ import annotations

from collections.abc import Callable
import random
from typing import NamedTuple

from campaigns.accuracy import hard_four_bars as bars
from campaigns.accuracy import hard_others as others
from campaigns.accuracy import hard_sliders as sliders
from campaigns.accuracy.random_families import Case


class Hard(NamedTuple):
    """Why it is hard, and how a linkage with its input angles is made."""

    why: str
    make: Callable[[random.Random], Case]


ADVERSARIAL = {
    'textbook divisor': Hard(
        'Ax = d, and ±1e-9 rad about it: the textbook divides by d − Ax', bars.textbook_divisor
    ),
    'parallelogram': Hard(
        'change points at 0 and π, from 1e-3 to 1e-12 rad: two circles that almost coincide',
        bars.parallelogram,
    ),
    'folded kite': Hard('a = b, c = d, the same: B lies on the crank pivot', bars.folded_kite),
    'kite through its pivot': Hard(
        'a = d, b = c: A passes D, and the diagonal with it turns about',
        bars.kite_through_its_pivot,
    ),
    'single change point': Hard(
        'lengths with one change point exactly, 1e-3 to 1e-12 rad from it',
        bars.single_change_point,
    ),
    'almost a change point': Hard(
        'lengths 1e-3 to 1e-12 off a change point, the crank as near: both small terms count',
        bars.almost_a_change_point,
    ),
    'four-bar toggle': Hard(
        'within 1e-3 to 1e-15 of stretched or folded, from both sides: a root of what cancels',
        bars.toggle,
    ),
    'four-bar needle': Hard('length ratios up to 1e12: sums lose the short link', bars.needle),
    'Freudenstein': Hard(
        'the source’s design and its neighbours: a coupler of 3 % of the crank', bars.freudenstein
    ),
    'pins that meet': Hard(
        'a ≈ d, b ≈ c, φ ≈ 0, 1e-3 to 1e-12: the diagonal has no direction left', bars.pins_meet
    ),
    'forced angles': Hard(
        'links at 0, ±π/2, π exactly: tan and 1/sin of them, and signed zeros',
        others.forced_angles,
    ),
    'forced input': Hard('the crank at 0, ±π/2, ±π, and within 1e-9 of it', others.forced_input),
    'subnormal input': Hard('the crank at ±0, ±5e-324, ±1e-310', others.subnormal_input),
    'wound crank': Hard('1e6 rad: φ alone has lost ten digits', others.wound_crank),
    'swivel passed closely': Hard(
        'crank as long as the way to the swivel, but for 1e-3 to 1e-12: r² cancels',
        sliders.swivel_passed_closely,
    ),
    'rod through its swivel': Hard(
        'a = d exactly, the crank pin passes the swivel', sliders.rod_through_its_swivel
    ),
    'swivel toggle': Hard(
        'the offset is all of the diagonal, but for 1e-3 to 1e-15', sliders.swivel_toggle
    ),
    'slider-crank toggle': Hard(
        'the rod stands across its line, but for 1e-3 to 1e-15', sliders.slider_toggle
    ),
    'axis through the pivot': Hard(
        'no offset; crank ≈ rod, where the slider passes the pivot', sliders.axis_through_the_pivot
    ),
    'dead centre': Hard('the slider turns back: its rate is a difference', sliders.dead_centre),
    'slider-crank needle': Hard('length ratios up to 1e12', sliders.needle_slider_crank),
    'swivel needle': Hard('length ratios up to 1e12', sliders.needle_swivel),
    'lines almost parallel': Hard(
        'the two lines of a PRP or RPP at 1e-3 to 1e-12 rad', sliders.lines_almost_parallel
    ),
    'slots almost parallel': Hard(
        'the crank turns a slot to within 1e-3 to 1e-12 rad of the other',
        sliders.slots_almost_parallel,
    ),
    'lengths × 1e±9': Hard('any threshold that is a length shows', others.scaled(-9, 9)),
    'lengths × 1e±150': Hard(
        'squares and products of lengths over- or underflow soon', others.scaled(-150, 150)
    ),
    'far frames': Hard(
        'frames begin up to a million lengths from the pins: coordinates cancel',
        others.far_frames,
    ),
    'chain of needles': Hard('three dyads, lengths from 1e-3 to 1e3', others.chain_of_needles),
    'chain at a toggle': Hard(
        'the third dyad 1e-4 to 1e-15 from its toggle, with all that came before it',
        others.chain_at_a_toggle,
    ),
    'chain whose pins meet': Hard(
        'the third dyad’s outer pins 1e-3 to 1e-9 apart', others.chain_whose_pins_meet
    ),
    'chain on a parallelogram': Hard(
        'a change-point linkage carries another dyad', others.chain_on_a_parallelogram
    ),
}
