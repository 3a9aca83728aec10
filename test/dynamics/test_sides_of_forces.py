# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
On which link a published wrench acts, and with which sign: each link is cut free.

What `docs/reference/efforts.md` says of the names of `~/pin_forces` is written out here as a
reader of the linkage file would do it. With it the forces on each link are added up, and held
against mass times acceleration, the accelerations being differences of places. Nothing of the
package's ways to the forces is used: not its list of joints, and not its matrix.
"""

from cmath import rect
from dataclasses import replace
from math import copysign, hypot

from linkage_ros.dynamics import Friction, JointFriction, Loads, Mechanics, Reactions, Spring
from linkage_ros.kinematics import Closure, GROUND
import pytest

from .loaded import slope, STATES, weighed

GRAVITY = complex(1.5, -9.81)


def ground_last(linkage):
    """Return a linkage whose file names the ground behind all other links."""
    links = {name: points for name, points in linkage.links.items() if name != GROUND}
    return replace(linkage, links={**links, GROUND: linkage.links[GROUND]})


def _cases():
    # An iterated linkage is left out: differences of its places are not as good.
    for name in STATES:
        if name != 'class_3':
            yield pytest.param(weighed(name), name, id=name)
    yield pytest.param(ground_last(weighed('four_bar')), 'four_bar', id='four_bar, ground last')
    yield pytest.param(
        ground_last(weighed('slider_crank')), 'slider_crank', id='slider_crank, ground last'
    )


CASES = list(_cases())


def block_of(linkage, slider):
    """Return the link that slides: where a pin slides, a block without mass."""
    return linkage.sliders[slider].block or f'the block in {slider}'


def carriers(linkage, pin):
    """Return the links of a pin in the order of the file, and behind them blocks that it turns."""
    found = [link for link, points in linkage.links.items() if pin in points]
    found += [
        block_of(linkage, name)
        for name, slider in linkage.sliders.items()
        if slider.point == pin and not slider.block
    ]
    return found


def sides(linkage, name):
    """Return the link on which a wrench acts, the link that exerts it, and its point."""
    joint, _, link = name.partition('/')
    is_pin = len(carriers(linkage, joint)) > 1
    if joint in linkage.sliders and (not is_pin or link == linkage.sliders[joint].along):
        slider = linkage.sliders[joint]
        return block_of(linkage, joint), slider.along, slider.point
    first, *others = carriers(linkage, joint)
    return link or others[0], first, joint


class Moved:
    """A linkage whose inputs move at constant accelerations; places are looked up by time."""

    def __init__(self, linkage, start, rates, pulls):
        self.linkage = linkage
        self.closure = Closure(linkage)
        self.motion = list(zip(start, rates, pulls, strict=True))

    def position(self, t):
        return self.closure.position(*(q + v * t + 0.5 * a * t * t for q, v, a in self.motion))

    def angle(self, link, t):
        return 0.0 if link == GROUND else self.closure.link_angles(self.position(t))[link]

    def place(self, link, at, t):
        """Return where a point of a link's frame lies."""
        if link == GROUND:
            return complex(*at)
        name, known = next(iter(self.linkage.links[link].items()))
        turned = rect(1.0, self.angle(link, t))
        points = self.closure.points(self.position(t))
        return points[link, name] + turned * (complex(*at) - complex(*known))

    def pin(self, name, t):
        carrier = next(link for link, points in self.linkage.links.items() if name in points)
        return self.place(carrier, self.linkage.links[carrier][name], t)

    def line(self, slider, t):
        """Return the unit vector along a slider's line."""
        given = self.linkage.sliders[slider]
        line = complex(*given.direction) / hypot(*given.direction)
        return line * rect(1.0, self.angle(given.along, t))


def cross(one, other):
    return (one.conjugate() * other).imag


def twice(function):
    """Return the second derivative at 0."""
    return slope(lambda t: slope(function, t), 0.0)


@pytest.mark.parametrize(('linkage', 'name'), CASES)
def test_published_pin_forces_balance_every_link(linkage, name):
    pins = {
        p for points in linkage.links.values() for p in points if len(carriers(linkage, p)) > 1
    }
    rubbing = sorted((pins | set(linkage.sliders)) - (pins & set(linkage.sliders)))
    friction = Friction({each: JointFriction(0.05, 0.2) for each in rubbing})
    moving = [link for link in linkage.links if link != GROUND]
    near, far = next(iter(linkage.links[GROUND])), next(reversed(linkage.links[moving[-1]]))
    spring = Spring(GROUND, near, moving[-1], far, 200.0, 0.03, 7.0)
    loads = Loads((GRAVITY.real, GRAVITY.imag), (spring,), 0.4)
    start = STATES[name][0]
    rates, pulls = [1.3, -0.8][: len(start)], [-2.0, 3.5][: len(start)]
    moved = Moved(linkage, start, rates, pulls)
    mechanics = Mechanics(moved.closure, loads, friction)
    reactions = Reactions(mechanics)
    position = moved.position(0.0)
    velocity = moved.closure.velocity(position, *rates)
    acceleration = moved.closure.acceleration(position, velocity, *pulls)
    wrenches = reactions.solve(position, velocity, acceleration)
    efforts = Reactions(mechanics).drive_efforts(position, velocity, acceleration)
    acting = {}  # for each link forces with their places, and moments

    def act(link, force, place, moment=0.0):
        acting.setdefault(link, []).append((force, place, moment))

    for joint, wrench in zip(reactions.names, wrenches, strict=True):
        on, by, point = sides(linkage, joint)
        force, place = complex(wrench.fx, wrench.fy), moved.pin(point, 0.0)
        act(on, force, place, wrench.moment)
        act(by, -force, place, -wrench.moment)
    for given, effort, pull in zip(linkage.inputs, efforts, pulls, strict=True):
        exerted = effort - loads.drive_inertia * pull  # the drive's own inertia is no link's
        if given.slider:
            slider = linkage.sliders[given.slider]
            push, place = exerted * moved.line(given.slider, 0.0), moved.pin(slider.point, 0.0)
            act(block_of(linkage, given.slider), push, place)
            act(slider.along, -push, place)
        else:
            act(given.child, 0j, 0j, exerted)
            act(given.parent, 0j, 0j, -exerted)

    def stretched(t):
        ends = moved.place(GROUND, linkage.links[GROUND][near], t), moved.pin(far, t)
        return abs(ends[1] - ends[0]), ends

    length, (one, other) = stretched(0.0)
    tension = 200.0 * (length - 0.03) + 7.0 * slope(lambda t: stretched(t)[0], 0.0)
    if length:
        act(moving[-1], tension * (one - other) / length, other)
    for link in moving:
        mass = linkage.masses[link]

        def center(t, link=link, mass=mass):
            return moved.place(link, mass.center, t)

        force = mass.mass * GRAVITY + sum(push for push, _, _ in acting[link])
        moment = sum(
            cross(place - center(0.0), push) + turning for push, place, turning in acting[link]
        )
        size = max(abs(push) for push, _, _ in acting[link]) + 1.0
        assert force == pytest.approx(mass.mass * twice(center), abs=1e-7 * size)
        turned = mass.inertia * twice(lambda t, link=link: moved.angle(link, t))
        assert moment == pytest.approx(turned, abs=1e-7 * size)
    for slider, given in linkage.sliders.items():
        if not given.block:  # a block without mass is in balance by itself
            on_block = acting[block_of(linkage, slider)]
            assert sum(push for push, _, _ in on_block) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(('linkage', 'name'), CASES)
def test_slider_and_pin_friction_opposes_the_slip(linkage, name):
    # A joint resists: on the link that the wrench acts on, against its motion from the other.
    start = STATES[name][0]
    rates, still = [1.3, -0.8][: len(start)], [0.0] * len(start)
    moved = Moved(linkage, start, rates, still)
    position = moved.position(0.0)
    velocity = moved.closure.velocity(position, *rates)
    acceleration = moved.closure.acceleration(position, velocity, *still)

    def slid(slider, t):
        given = linkage.sliders[slider]
        start = moved.place(given.along, linkage.links[given.along][given.through], t)
        return ((moved.pin(given.point, t) - start) * moved.line(slider, t).conjugate()).real

    def turned(on, by, t):
        # A block turns as the link that it slides along.
        along = {block_of(linkage, s): given.along for s, given in linkage.sliders.items()}
        angles = [
            moved.angle(link if link in linkage.links else along[link], t) for link in (on, by)
        ]
        return angles[0] - angles[1]

    pins = {
        p for points in linkage.links.values() for p in points if len(carriers(linkage, p)) > 1
    }
    friction = Friction({joint: JointFriction(0.05, 0.2) for joint in pins | set(linkage.sliders)})
    reactions = Reactions(Mechanics(moved.closure, Loads(), friction))
    found = reactions.solve(position, velocity, acceleration)
    for joint, wrench in zip(reactions.names, found, strict=True):
        on, by, _ = sides(linkage, joint)
        if joint in linkage.sliders:
            rate = slope(lambda t, joint=joint: slid(joint, t), 0.0)
            along = complex(wrench.fx, wrench.fy) * moved.line(joint, 0.0).conjugate()
            resisting = along.real
        else:
            rate = slope(lambda t, on=on, by=by: turned(on, by, t), 0.0)
            resisting = wrench.moment
        dry = copysign(0.2, rate) if abs(rate) > 1e-9 else 0.0
        assert resisting == pytest.approx(-0.05 * rate - dry, abs=1e-9)
