# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A drawn pose tells the assembly: of random linkages, and of those near change points.

A random linkage is made from its drawing: the places of all points come first, and the frames of
the links are laid into them. So the drawing is the truth, whatever the code finds.
"""

from cmath import exp, phase
from collections.abc import Mapping
from dataclasses import replace
from itertools import product
from math import cos, pi, radians, remainder, sin, sqrt, tau
import random
from typing import NamedTuple

from linkage_ros.description import load
from linkage_ros.errors import DefinitionError, FileError
from linkage_ros.kinematics import (
    AssemblyPose,
    Closure,
    Input,
    Linkage,
    Point,
    read_drawn_pose,
    RevoluteJoint,
    sides_at,
    Slider,
)
from linkage_ros.stages.effects import ToleranceEffect
import pytest

from ..linkages import four_bar_linkage


class Drawing(NamedTuple):
    """A linkage without sides, and where its points and links are drawn."""

    linkage: Linkage
    at: float
    places: dict[tuple[str, str], complex]
    angles: dict[str, float]
    tells: list[str]  # For each dyad a point that tells its side


class _Drafter:
    def __init__(self, seed: int) -> None:
        self.rng = random.Random(seed)
        self.places: dict[str, dict[str, complex]] = {'ground': {}}
        self.frames = {'ground': (0j, 0.0)}
        self.sliders: dict[str, Slider] = {}
        self.tells: list[str] = []

    def somewhere(self) -> complex:
        return complex(self.rng.uniform(-2.0, 2.0), self.rng.uniform(-2.0, 2.0))

    def link(self, name: str, points: Mapping[str, complex]) -> None:
        self.places[name] = dict(points)
        self.frames[name] = (self.somewhere(), self.rng.uniform(-pi, pi))

    def local(self, link: str, place: complex) -> Point:
        origin, angle = self.frames[link]
        own = (place - origin) * exp(-1j * angle)
        return own.real, own.imag

    def moving_pair(self) -> tuple[tuple[str, complex], tuple[str, complex], str]:
        """Return two points of different links, and the link of the second one."""
        while True:
            one, other = self.rng.sample(list(self.places), 2)
            p = self.rng.choice(list(self.places[one].items()))
            q = self.rng.choice(list(self.places[other].items()))
            shared = p[0] in self.places[other] or q[0] in self.places[one]
            if abs(p[1] - q[1]) > 0.3 and not shared:
                return p, q, other

    def dyad(self, number: int) -> None:
        """Add a dyad that is far from a toggle."""
        p, q, on = self.moving_pair()
        kind = self.rng.choice(('RRR', 'RRP', 'RPR'))
        one, other, pin = f'L{number}a', f'L{number}b', f'B{number}'
        while True:
            place = self.somewhere()
            along, side = (place - p[1]) / (q[1] - p[1]), place - p[1]
            if abs(side) < 0.4 or abs(place - q[1]) < 0.4:
                continue
            if kind == 'RRR' and abs(along.imag) * abs(q[1] - p[1]) > 0.3:
                self.link(one, {p[0]: p[1], pin: place, f'T{number}': self.somewhere()})
                self.link(other, {q[0]: q[1], pin: place})
            elif kind == 'RRP':
                unit = (place - q[1]) / abs(place - q[1])
                if abs((side * unit.conjugate()).real) < 0.3:
                    continue
                self.link(one, {p[0]: p[1], pin: place})
                self.slide(f'S{number}', pin, on, q[0], unit)
            elif kind == 'RPR':
                unit = (place - q[1]) / abs(place - q[1])
                if abs(((q[1] - p[1]) * unit.conjugate()).real) < 0.3:
                    continue
                self.link(one, {p[0]: p[1], pin: place})
                self.slide(f'S{number}', q[0], one, pin, unit)
            else:
                continue
            self.tells.append(pin)
            return

    def slide(self, name: str, point: str, along: str, through: str, unit: complex) -> None:
        own = unit * exp(-1j * self.frames[along][1])
        self.sliders[name] = Slider(point, along, through, (own.real, own.imag))


def drawing(seed: int, dyads: int) -> Drawing:
    drafter = _Drafter(seed)
    pivots = {'O': drafter.somewhere(), 'D': drafter.somewhere(), 'E': drafter.somewhere()}
    drafter.places['ground'] = pivots
    crank = pivots['O'] + 0.5 * exp(1j * drafter.rng.uniform(-pi, pi))
    drafter.link('crank', {'O': pivots['O'], 'A': crank})
    for index in range(dyads):
        drafter.dyad(index)
    links = {
        link: {name: drafter.local(link, place) for name, place in points.items()}
        for link, points in drafter.places.items()
    }
    moving = [link for link in links if link not in ('ground', 'crank')]
    linkage = Linkage(
        links,
        (Input('crank_joint', 'ground', 'crank'),),
        {},
        {link: RevoluteJoint('ground', link) for link in moving},
        drafter.sliders,
    )
    places = {
        (link, name): place
        for link, points in drafter.places.items()
        for name, place in points.items()
    }
    angles = {link: drafter.frames[link][1] for link in moving}
    return Drawing(linkage, drafter.frames['crank'][1], places, angles, drafter.tells)


def posed(drawn: Drawing, points: Mapping[str, complex], angles: Mapping[str, float]) -> Closure:
    named = {name: (place.real, place.imag) for name, place in points.items()}
    return Closure(replace(drawn.linkage, pose=AssemblyPose((drawn.at,), named, dict(angles))))


def is_as_drawn(closure: Closure, drawn: Drawing) -> bool:
    found = closure.points(closure.position(drawn.at))
    return all(abs(found[key] - place) < 1e-6 for key, place in drawn.places.items())


RANDOM = [(seed, dyads) for dyads in (1, 2, 3, 5, 8) for seed in range(25)]
MANY = [(seed, 24) for seed in range(3)]


@pytest.mark.sample(40)
@pytest.mark.parametrize(('seed', 'dyads'), [*RANDOM, *MANY])
def test_rough_points_of_each_dyad_select_the_drawn_assembly(seed, dyads):
    drawn = drawing(seed, dyads)
    rng = random.Random(seed)
    places = {name: place for (_, name), place in drawn.places.items() if name in drawn.tells}
    rough = {
        name: place + 0.1 * rng.random() * exp(1j * rng.uniform(-pi, pi))
        for name, place in places.items()
    }
    closure = posed(drawn, rough, {})
    assert is_as_drawn(closure, drawn)


@pytest.mark.sample(40)
@pytest.mark.parametrize(('seed', 'dyads'), RANDOM)
def test_rough_link_angles_select_the_drawn_assembly(seed, dyads):
    drawn = drawing(seed, dyads)
    rng = random.Random(seed)
    rough = {
        link: angle + rng.uniform(-0.08, 0.08) + tau * rng.randrange(-2, 3)
        for link, angle in drawn.angles.items()
    }
    assert is_as_drawn(posed(drawn, {}, rough), drawn)


@pytest.mark.sample(30)
@pytest.mark.parametrize(('seed', 'dyads'), RANDOM)
def test_too_few_points_are_refused_with_a_remedy(seed, dyads):
    drawn = drawing(seed, dyads)
    rng = random.Random(seed)
    names = rng.sample(drawn.tells, 1 + rng.randrange(dyads))
    few = {name: place for (_, name), place in drawn.places.items() if name in names}
    refused = None
    try:
        assert is_as_drawn(posed(drawn, few, {}), drawn)
    except DefinitionError as error:
        refused = error
    if len(names) == dyads:
        assert refused is None
    if refused is not None:
        assert refused.where in ('pose', 'assembly')
        assert refused.remedy.startswith(('name ', 'write '))


@pytest.mark.sample(13)
@pytest.mark.parametrize(('seed', 'dyads'), RANDOM)
def test_exported_pose_and_sides_reproduce_the_drawing(seed, dyads):
    drawn = drawing(seed, dyads)
    places = {name: place for (_, name), place in drawn.places.items() if name in drawn.tells}
    closure = posed(drawn, places, {})
    position = closure.position(drawn.at)
    again = Closure(replace(drawn.linkage, pose=read_drawn_pose(closure, position)))
    assert again.position(drawn.at).joints == position.joints
    sides = sides_at(closure, position)
    by_sides = Closure(replace(drawn.linkage, assembly=sides, pose=AssemblyPose((drawn.at,), {})))
    assert is_as_drawn(by_sides, drawn)
    # Each side of a pose that draws the other one is refused, and both are named.
    name, side = random.Random(seed).choice(list(sides.items()))
    words = {'left', 'right'} if side in ('left', 'right') else {'ahead', 'behind'}
    (other,) = words - {side}
    with pytest.raises(DefinitionError) as error:
        posed(drawn._replace(linkage=replace(drawn.linkage, assembly={name: other})), places, {})
    assert error.value.where == f'assembly.{name}'
    assert repr(other) in error.value.reason
    assert repr(side) in error.value.reason


def test_ambiguous_pose_error_lists_the_assemblies():
    linkage = replace(four_bar_linkage((0.04, 0.12, 0.08, 0.1), 'left'), assembly={})
    meant = AssemblyPose((1.0,), {'B': (0.12, 0.0)})
    with pytest.raises(DefinitionError) as error:
        Closure(replace(linkage, pose=meant))
    assert error.value.where == 'pose'
    assert error.value.reason.startswith('does not distinguish {B: ')
    for side in ('left', 'right'):
        assert f'{{B: {side}}}' in error.value.reason
        closure = Closure(replace(linkage, assembly={'B': side}))
        place = closure.points(closure.position(1.0))['rocker', 'B']
        assert f'[{place.real:.4g}, {place.imag:.4g}] m' in error.value.remedy


LEG = """
units: mm
angles: degrees
links:
  ground: {hip: [0, 0]}
  front_crank: {hip: [0, 0], A: [90, 0]}
  rear_crank: {hip: [0, 0], B: [90, 0]}
  front_shin: {A: [0, 0], foot: [162, 0]}
  rear_shin: {B: [0, 0], foot: [162, 0]}
input:
  - {joint: front_joint, parent: ground, child: front_crank}
  - {joint: rear_joint, parent: ground, child: rear_crank}
joints: {front_knee: {parent: front_crank, child: front_shin}}
"""

LIFT = """
links:
  ground: {P0: [0, 0]}
  arm_a: {P0: [0, 0], M: [0.5, 0], T1: [1, 0]}
  arm_b: {S0: [0, 0], M: [0.5, 0], T2: [1, 0]}
  platform: {T2: [0, 0], load: [0.4, 0.1]}
sliders:
  foot: {point: S0, along: ground, through: P0, direction: [1, 0]}
  top: {point: T1, along: platform, through: T2, direction: [1, 0]}
input: {joint: foot_slide, slider: foot, limits: [0.3, 0.99]}
joints: {platform_joint: {parent: ground, child: platform}}
"""


def loaded(tmp_path, text):
    file = tmp_path / 'drawn.yaml'
    file.write_text(text)
    return load(file)


@pytest.mark.parametrize('half', [20, 30, 45, 60, 80])
@pytest.mark.parametrize('drawn_half', [25, 45, 70])
def test_two_motor_leg_keeps_the_drawn_assembly(half, drawn_half, tmp_path):
    pose = (
        f'pose: {{inputs: [{-90 + drawn_half}, {-90 - drawn_half}], points: {{foot: [9, -190]}}}}'
    )
    closure = loaded(tmp_path, LEG + pose)
    at = radians(-90 + half), radians(-90 - half)
    foot = closure.points(closure.position(*at))['front_shin', 'foot']
    below = 0.09 * cos(radians(half)) + sqrt(0.162**2 - (0.09 * sin(radians(half))) ** 2)
    assert abs(foot + 1j * below) < 1e-12


def test_scissor_lift_keeps_the_drawn_assembly(tmp_path):
    pose = 'pose: {inputs: [0.866], points: {M: [0.4, 0.2], load: [0.4, 0.6]}}'
    closure = loaded(tmp_path, LIFT + pose)
    for slide in (0.4, 0.6, 0.9):
        points = closure.points(closure.position(slide))
        assert abs(points['arm_a', 'T1'] - complex(slide, sqrt(1.0 - slide**2))) < 1e-12
        assert abs(points['platform', 'load'] - complex(0.4, 0.1 + sqrt(1.0 - slide**2))) < 1e-12
    with pytest.raises(
        FileError, match=r'pose: does not distinguish \{top: ahead\} from \{top: behind\}'
    ):
        loaded(tmp_path, LIFT + 'pose: {inputs: [0.866], points: {M: [0.4, 0.2]}}')


@pytest.mark.parametrize('at', ['[-60]', '[60]', '[150]'])
def test_four_bar_shorthand_accepts_a_pose(at, tmp_path):
    side = -1 if at == '[-60]' else 1
    drawn = f'pose: {{inputs: {at}, angles: {{rocker: {at[1:-1]}}}}}'
    lengths = 'a: 0.08, b: 0.1, c: 0.0799999, d: 0.1'
    closure = loaded(tmp_path, f'angles: degrees\nfour_bar: {{{lengths}, {drawn}}}')
    assert closure.position(side).joints[1] == pytest.approx(side, abs=1e-5)


# Near change points, against a continuation that knows no sides: it steps along the crank's angle
# from the drawn pose, and goes on along the curve of its last steps, so that it crosses each
# change point straight on. Newton's method then takes each pose to a changed length.

_STEP = radians(0.31)
_ANGLES = [radians(at) for at in (-400, -300, -140, -60, 60, 120, 230, 330, 470, 650)]


def _solved(lengths, angles, right):
    """Return the changes of coupler and rocker that move the closing pin by a vector."""
    _, b, c, _ = lengths
    x, y = angles
    p, q, r, t = -b * sin(x), c * sin(y), b * cos(x), -c * cos(y)
    whole = p * t - q * r
    return (right[0] * t - q * right[1]) / whole, (p * right[1] - r * right[0]) / whole


def _corrected(lengths, phi, angles):
    a, b, c, d = lengths
    for _ in range(7):
        x, y = angles
        if abs(sin(x - y)) < 3e-3:
            break  # next to a change point straight on is better than any correction
        gap = (
            d + c * cos(y) - a * cos(phi) - b * cos(x),
            c * sin(y) - a * sin(phi) - b * sin(x),
        )
        step = _solved(lengths, angles, gap)
        angles = x + step[0], y + step[1]
        if max(map(abs, step)) < 1e-15:
            break
    return angles


def continued(lengths, side):
    """Return coupler and rocker angles at the crank angles, from a pose at 61.3 degrees."""
    a, b, c, d = lengths
    start = radians(61.3)
    pin = a * exp(1j * start)
    s = abs(d - pin)
    foot = (b * b - c * c + s * s) / (2 * s)
    unit = (d - pin) / s
    joint = pin + unit * complex(foot, side * sqrt(b * b - foot * foot))
    begun = _corrected(lengths, start, (phase(joint - pin), phase(joint - d)))

    def ahead(at, angles, by):
        rates = _solved(lengths, angles, (a * sin(at), -a * cos(at)))
        return [x + by * rate for x, rate in zip(angles, rates, strict=True)]

    found = {}
    for way in (1, -1):
        at, last = start, [begun]
        for mark in sorted(way * mark for mark in _ANGLES if way * (mark - start) > 0.0):
            while mark - way * at > _STEP:
                if len(last) < 3:
                    guess = ahead(at, last[-1], way * _STEP)
                else:
                    guess = [3.0 * (z - y) + x for x, y, z in zip(*last[-3:], strict=True)]
                at += way * _STEP
                last.append(_corrected(lengths, at, guess))
            guess = ahead(at, last[-1], way * mark - at)
            found[way * mark] = _corrected(lengths, way * mark, guess)
    return found


FAMILIES = {
    'parallelogram': (0.08, 0.1, 0.08, 0.1),
    'crank longer': (0.1, 0.07, 0.1, 0.07),
    'kite about the ground': (0.06, 0.09, 0.09, 0.06),
    'kite about the coupler': (0.06, 0.06, 0.09, 0.09),
    'rhombus': (0.09, 0.09, 0.09, 0.09),
}
ONCE = {
    (name, side): continued(lengths, side)
    for (name, lengths), side in product(FAMILIES.items(), (1, -1))
    # A rhombus and a kite that lie folded have a coupler along the crank for ever.
    if not (side < 0 and name in ('kite about the coupler', 'rhombus'))
}
CHANGED = [0.0, *(sign * 10.0**k for k in (-12, -9, -7, -5, -4) for sign in (1, -1))]


def changed(lengths, number, by):
    return tuple(x + by * (i == number) for i, x in enumerate(lengths))


def off(one, other):
    return abs(remainder(one - other, tau))


@pytest.mark.sample(40)
@pytest.mark.parametrize('how', ['sides', 'pose', 'pose below', 'nominal'])
@pytest.mark.parametrize('number', range(4))
@pytest.mark.parametrize(('name', 'side'), ONCE)
def test_changed_length_keeps_the_branch_through_change_points(name, side, number, how):
    nominal, branch = FAMILIES[name], ONCE[name, side]
    word = {1: 'left', -1: 'right'}[side]
    for by in CHANGED:
        lengths = changed(nominal, number, by)
        linkage = four_bar_linkage(lengths, word)
        if how == 'nominal':
            linkage = replace(linkage, nominal=four_bar_linkage(nominal, word))
        elif how != 'sides':
            at = _ANGLES[4 if how == 'pose' else 3]
            drawn = AssemblyPose((at,), {}, {'coupler': branch[at][0], 'rocker': branch[at][1]})
            linkage = replace(linkage, assembly={}, pose=drawn)
        closure = Closure(linkage)
        for at, angles in branch.items():
            truth = _corrected(lengths, at, angles)
            coupler, rocker = closure.position(at).joints
            assert off(coupler + at, truth[0]) < 1e-6, (by, at)
            assert off(rocker, truth[1]) < 1e-6, (by, at)


@pytest.mark.parametrize('name', FAMILIES)
@pytest.mark.parametrize('seed', range(10))
def test_tolerance_keeps_the_linkage_on_its_branch(name, seed):
    linkage = four_bar_linkage(FAMILIES[name], 'left')
    made = Closure(ToleranceEffect(1e-5).alter(linkage, random.Random(seed)))
    for at, angles in ONCE[name, 1].items():
        coupler, rocker = made.position(at).joints
        assert max(off(coupler + at, angles[0]), off(rocker, angles[1])) < radians(0.2)


def _slider_crank(rod, offset):
    return Linkage(
        {
            'ground': {'O': (0.0, 0.0), 'Q': (0.0, offset)},
            'crank': {'O': (0.0, 0.0), 'A': (0.1, 0.0)},
            'rod': {'A': (0.0, 0.0), 'B': (rod, 0.0)},
        },
        (Input('crank_joint', 'ground', 'crank'),),
        {'line': 'ahead'},
        {'rod': RevoluteJoint('ground', 'rod')},
        {'line': Slider('B', 'ground', 'Q', (1.0, 0.0))},
    )


def _swivel(crank, offset):
    return Linkage(
        {
            'ground': {'O': (0.0, 0.0), 'D': (0.1, 0.0)},
            'crank': {'O': (0.0, 0.0), 'A': (crank, 0.0)},
            'rail': {'A': (0.0, 0.0), 'Q': (0.0, offset), 'T': (0.1, 0.0)},
        },
        (Input('crank_joint', 'ground', 'crank'),),
        {'line': 'ahead'},
        {'rail': RevoluteJoint('ground', 'rail')},
        {'line': Slider('D', 'rail', 'Q', (1.0, 0.0))},
    )


# The angle of rod and rail, known without solving: an isosceles slider-crank has its rod at the
# negative angle of the crank, a straight rail whose crank is as long as the ground turns at half.
TURNING = {
    'isosceles slider-crank': (lambda by: _slider_crank(0.1 + by, 0.0), lambda phi: -phi),
    'slider-crank beside': (lambda by: _slider_crank(0.1, by), lambda phi: -phi),
    'swivel': (lambda by: _swivel(0.1 + by, 0.0), lambda phi: 0.5 * phi - 0.5 * pi),
    'swivel beside': (lambda by: _swivel(0.1, by), lambda phi: 0.5 * phi - 0.5 * pi),
}


@pytest.mark.parametrize('name', TURNING)
@pytest.mark.parametrize('by', CHANGED)
def test_changed_sliders_follow_the_nominal_linkage_near_change_points(name, by):
    made, angle = TURNING[name]
    closure = Closure(replace(made(by), nominal=made(0.0)))
    for degrees in (-430, -300, -60, 50, 130, 250, 400, 670):
        phi = radians(degrees)
        assert off(closure.position(phi).joints[0], angle(phi)) < 6e-3
        velocity = closure.velocity(closure.position(phi), 1.0)
        ahead = closure.position(phi + 1e-6).joints[0] - closure.position(phi - 1e-6).joints[0]
        assert remainder(ahead, tau) / 2e-6 == pytest.approx(velocity.joints[0], abs=1e-6)


@pytest.mark.parametrize('name', [*FAMILIES, *TURNING])
def test_batch_equals_single_states_near_a_change_point(name):
    if name in FAMILIES:
        linkage = four_bar_linkage(changed(FAMILIES[name], 2, 1e-6), 'left')
    else:
        made, _ = TURNING[name]
        linkage = replace(made(1e-6), nominal=made(0.0))
    closure = Closure(linkage)
    angles = [0.1 + 0.37 * k for k in range(-30, 30)]
    batch = closure.solve(angles)
    for k, at in enumerate(angles):
        position = closure.position(at)
        assert position.joints == pytest.approx(batch.positions[:, k], abs=1e-12)
        if position.status.has_rates:
            velocity = closure.velocity(position, 1.0)
            assert velocity.joints == pytest.approx(batch.velocities[:, k], rel=1e-9, abs=1e-9)


@pytest.mark.parametrize('side', ['left', 'right'])
@pytest.mark.parametrize('drawn', ['P', 'A', 'left', 'left_rod'])
def test_pose_places_links_driven_at_their_elbows(side, drawn):
    """A five-bar that its elbows drive: each half is one body, whose second link comes behind."""
    arms = {
        f'{name}{part}': ends
        for name, foot, elbow in (('left', 'O', 'A'), ('right', 'E', 'B'))
        for part, ends in (
            ('', {foot: (0.0, 0.0), elbow: (0.05, 0.0)}),
            ('_rod', {elbow: (0.0, 0.0), 'P': (0.09, 0.0)}),
        )
    }
    linkage = Linkage(
        {'ground': {'O': (0.0, 0.0), 'E': (0.1, 0.0)}, **arms},
        tuple(Input(f'{name}_elbow', name, f'{name}_rod') for name in ('left', 'right')),
        {'P': side},
        {'q': RevoluteJoint('ground', 'left')},
        {},
    )
    inputs = (-1.2, 1.2)
    told = Closure(replace(linkage, pose=AssemblyPose(inputs, {})))
    position = told.position(*inputs)
    places = told.points(position)
    points, angles = {}, {}
    if drawn in arms:
        ends = [places[drawn, point] for point in arms[drawn]]
        angles[drawn] = phase(ends[1] - ends[0]) + 0.1
    else:
        at = places['left_rod', drawn] + 0.005
        points[drawn] = at.real, at.imag
    found = Closure(replace(linkage, assembly={}, pose=AssemblyPose(inputs, points, angles)))
    assert found.position(*inputs).joints == position.joints
