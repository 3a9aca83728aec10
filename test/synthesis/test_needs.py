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

"""What a user needs is missed by so much, and said with what was found instead."""

from __future__ import annotations

from math import inf, log, nan, radians
import random

from linkage_ros.errors import SynthesisError
from linkage_ros.synthesis.defects import assess, distance, distances, misses, Needs
from linkage_ros.synthesis.design import Design, FourBar, Wanted
import numpy as np
import pytest

from .by_hand import design, Lengths, transmission
from .test_proof import THREE_PAIRS

# One of each of Barker's kinds that a word may stand for.
FOUR_BARS = {
    'crank-rocker': (2.0, 7.0, 9.0, 6.0),
    'double rocker': (4.0, 1.0, 5.0, 5.0),
    'rocker-crank': (6.0, 7.0, 2.0, 9.0),
    'double crank': (5.0, 4.0, 6.0, 2.0),
    'longest ground': (4.0, 5.0, 6.0, 8.0),
    'longest input': (8.0, 5.0, 6.0, 4.0),
    'longest coupler': (5.0, 8.0, 6.0, 4.0),
    'longest output': (5.0, 6.0, 8.0, 4.0),
    'parallelogram': (1.0, 2.0, 1.0, 2.0),
    'change-point crank-rocker': (2.0, 5.0, 4.0, 3.0),
    'change-point double rocker': (5.0, 2.0, 4.0, 3.0),
}
WORDS = {
    'crank-rocker': {'crank-rocker', 'change-point crank-rocker'},
    'rocker-crank': {'rocker-crank'},
    'double-crank': {'double crank'},
    'drag-link': {'double crank'},
    'double-rocker': {'double rocker', 'change-point double rocker'},
    'triple-rocker': {'longest ground', 'longest input', 'longest coupler', 'longest output'},
    'grashof': {name for name in FOUR_BARS if 'longest' not in name},
    'non-grashof': {'longest ground', 'longest input', 'longest coupler', 'longest output'},
    'turning': {'crank-rocker', 'double crank', 'parallelogram', 'change-point crank-rocker'},
}


def closing(lengths: Lengths) -> float:
    """Return a crank angle in degrees at which a four-bar closes."""
    a, b, c, d = lengths
    for t in range(20, 180, 5):
        s = abs(d - a * np.exp(1j * radians(t)))
        if abs(b - c) < s < b + c:
            return float(t)
    raise AssertionError(lengths)


@pytest.mark.parametrize('word', WORDS)
@pytest.mark.parametrize('name', FOUR_BARS)
def test_a_word_stands_for_kinds_of_four_bars(word: str, name: str) -> None:
    lengths = FOUR_BARS[name]
    found = assess(design(lengths, [(closing(lengths), 'left')]))
    needs = Needs(word)
    needs.check()
    if name in WORDS[word]:
        assert misses(found, needs) == ()
        assert distance(found, needs) == 0.0
    else:
        assert misses(found, needs) == (f'a {found.kind.name}, no {word}',)
        assert distance(found, needs) == 1.0


@pytest.mark.parametrize(
    ('word', 'remedy'),
    [
        ('crank_rocker', "did you mean 'crank-rocker'?"),
        ('Grashoff', "did you mean 'grashof'?"),
        (
            'quick',
            (
                'name one of crank-rocker, rocker-crank, double-crank, drag-link, double-rocker, '
                'triple-rocker, grashof, non-grashof, turning'
            ),
        ),
    ],
)
def test_an_unknown_word_is_refused(word: str, remedy: str) -> None:
    with pytest.raises(SynthesisError) as caught:
        Needs(word).check()
    assert str(caught.value) == f'{word}: is no kind of four-bar; {remedy}'


def test_misses_say_what_was_found_and_what_was_wanted() -> None:
    """At 60° on a ground of 6, s² = 28: cos μ = (49 + 81 − 28)/126, so that μ = 35.95°."""
    found = assess(design((2.0, 7.0, 9.0, 6.0), [(60.0, 'left')]))
    assert misses(found, Needs('double-crank', radians(40.0), 4.0)) == (
        'a crank-rocker, no double-crank',
        'a transmission angle of 35.95°, not 40°',
        'a link ratio of 4.5, not 4',
    )
    assert misses(found, Needs('crank-rocker', radians(35.0), 4.6)) == ()
    assert misses(found, Needs()) == ()


def test_the_distance_grows_with_what_is_missing() -> None:
    found = assess(design((2.0, 7.0, 9.0, 6.0), [(60.0, 'left')]))
    angle = found.transmission
    assert distance(found, Needs(transmission=2.0 * angle)) == pytest.approx(0.5)
    assert distance(found, Needs(link_ratio=3.0)) == pytest.approx(log(1.5))
    assert distance(found, Needs(transmission=2.0 * angle, link_ratio=3.0)) == pytest.approx(
        0.5 + log(1.5)
    )
    by_wish = [distance(found, Needs(transmission=radians(t))) for t in (30, 40, 50, 90)]
    assert by_wish == sorted(by_wish)
    assert by_wish[0] == 0.0 < by_wish[1]


def test_a_defect_is_farther_than_any_number() -> None:
    found = assess(THREE_PAIRS)
    assert misses(found, Needs(usable=True)) == ('branch defect',)
    assert misses(found, Needs(usable=False)) == ()
    sound = assess(design((2.0, 7.0, 9.0, 6.0), [(60.0, 'left')]))
    wishes = Needs('non-grashof', radians(90.0), 1.0, usable=True)
    assert distance(found, wishes._replace(link_ratio=inf)) > distance(sound, wishes)


def test_links_that_never_close_are_of_no_kind() -> None:
    found = assess(Design(FourBar.of_lengths(1.0, 1.0, 1.0, 4.0), (Wanted(1.0, 2.0),)))
    for word in WORDS:
        assert misses(found, Needs(word)) == (f'a {found.kind.name}, no {word}',)


def test_many_at_once_are_as_far_as_each_alone() -> None:
    rng = random.Random(3)
    lengths, angles, found = [], [], []
    while len(found) < 300:
        links = tuple(rng.uniform(1.0, 4.0) for _ in range(4))
        shortest, p, q, longest = sorted(links)
        if longest > shortest + p + q:
            continue
        at = next((t for t in range(180) if _closes(links, t)), None)
        if at is None:
            continue
        lengths.append(links)
        angles.append(transmission(links, radians(at)))
        found.append(assess(design(links, [(at, 'left')])))
    assert not any(one.defects for one in found)
    for word in ('', *WORDS):
        needs = Needs(word, radians(rng.uniform(10.0, 80.0)), rng.uniform(1.5, 3.0))
        together = distances(np.array(lengths), np.array(angles), needs)
        assert together == pytest.approx([distance(one, needs) for one in found], abs=1e-9)


def _closes(lengths: Lengths, angle: float) -> bool:
    a, b, c, d = lengths
    return abs(b - c) + 1e-3 < abs(d - a * np.exp(1j * radians(angle))) < b + c - 1e-3


@pytest.mark.parametrize(
    ('needs', 'said'),
    [
        (Needs(transmission=-0.1), r'^transmission angle: -5\.7'),
        (Needs(transmission=1.6), r'^transmission angle: 91\.'),
        (Needs(transmission=nan), '^transmission angle: nan° is none'),
        (Needs(link_ratio=0.99), r'^link ratio: 0\.99 is none'),
        (Needs(link_ratio=nan), '^link ratio: nan is none'),
    ],
)
def test_what_cannot_be_needed_is_refused(needs: Needs, said: str) -> None:
    with pytest.raises(SynthesisError, match=said):
        needs.check()
