# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Clearance: pins that lean along their force, against the exact massless-clearance-link model."""

from cmath import rect
from math import hypot, sqrt

from linkage_ros.errors import DefinitionError
from linkage_ros.stages.effects import ClearanceEffect
import pytest

from .four_bar_by_hand import FourBar
from .loaded import context, GRAVITY, moved
from ...support.messages import read_joint_state
from ...support.scenes import linkage_of, LINKAGES, pipeline_of, shipped

FOUR_BAR, SLIDER_CRANK = shipped('four_bar'), shipped('slider_crank')
PINS = ('O2', 'A', 'B', 'O4')
MOTIONS = [(1.0, 0.0, 0.0), (0.4, 0.0, 20.0), (2.5, -6.0, 30.0), (-1.2, 12.0, -80.0)]


def shift(within, motion, pins):
    return moved(within, motion, {'pin_forces': (), 'clearance': (pins,)}).deflection


@pytest.mark.sample(6)
@pytest.mark.parametrize(
    'plays',
    [(0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1), (1, 0, 0, 0), (0.5, 1, 0.25, 0.75)],
    ids=['A', 'B', 'O4', 'O2', 'all'],
)
@pytest.mark.parametrize('motion', MOTIONS)
def test_clearance_error_falls_with_the_square_of_play(motion, plays):
    # Exact: pose and forces of the leaning linkage, in balance with each other.
    by_hand = FourBar(FOUR_BAR, motion, GRAVITY)
    _, *ideal = by_hand.angles(0)
    errors = []
    for play in (2e-5, 1e-5):
        sizes = [play * each for each in plays]
        phi, psi, _ = by_hand.balance(sizes)
        exact = [float(phi - ideal[0]), float(psi - ideal[1])]
        found = shift(context(FOUR_BAR), motion, dict(zip(PINS, sizes, strict=True)))
        assert found == pytest.approx(exact, abs=0.02 * max(map(abs, exact)))
        errors.append(max(abs(a - b) for a, b in zip(found, exact, strict=True)))
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)


def test_hanging_link_sinks_by_its_pin_clearance():
    # A swing, its ropes straight down: with play at both ends of the seat that comes down, and
    # nothing turns. With play at one end only it tilts, by that over its length.
    swing = linkage_of("""
links:
  ground: {O: [0, 0], D: [0.3, 0]}
  crank: {O: [0, 0], A: [0.1, 0]}
  seat: {A: [0, 0], B: [0.3, 0]}
  rope: {D: [0, 0], B: [0.1, 0]}
input: {joint: crank_joint, parent: ground, child: crank}
assembly: {B: left}
joints: {seat_joint: {parent: ground, child: seat}, rope_joint: {parent: ground, child: rope}}
masses:
  crank: {mass: 0.1, center: [0.05, 0], inertia: 1.0e-5}
  seat: {mass: 1, center: [0.15, 0], inertia: 1.0e-2}
  rope: {mass: 0.1, center: [0.05, 0], inertia: 1.0e-5}
""")
    within, down, play = context(swing), (-1.5707963267948966, 0.0, 0.0), 1e-5
    seat, rope = shift(within, down, {'A': play, 'B': play})
    assert (seat, rope) == pytest.approx((0.0, 0.0), abs=1e-18)
    for pin, tilt in (('A', 1.0), ('B', -1.0), ('D', -1.0), ('O', 1.0)):
        seat, rope = shift(within, down, {pin: play})
        assert seat == pytest.approx(tilt * play / 0.3, rel=1e-9)
        assert rope == pytest.approx(0.0, abs=1e-15)


def test_pin_clearance_moves_the_piston_slide():
    # The piston's pin lies where a circle about A meets its line: in closed form, with A beside
    # where it was by the play, against the force.
    within, motion = context(SLIDER_CRANK), (1.0, 20.0, 0.0)
    before = moved(within, motion, {'pin_forces': ()})
    index = within.reactions.names.index('A')
    assert within.closure.structure.joints[index].link == 'connecting_rod'
    fx, fy, _ = before.reactions[index]
    errors = []
    for play in (2e-5, 1e-5):
        lean = -play * complex(fx, fy) / hypot(fx, fy)

        def slide(at):
            return at.real + sqrt(0.14**2 - (at.imag - 0.01) ** 2)

        pin = rect(0.04, 1.0)
        found = shift(within, motion, {'A': play})[1]
        exact = slide(pin + lean) - slide(pin)
        assert found == pytest.approx(exact, rel=1e-2)
        errors.append(abs(found - exact))
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)


def test_slider_pin_clearance_moves_the_piston_slide():
    # The block has no mass, so that its pin carries what the cylinder's wall presses it with.
    within, motion, play = context(SLIDER_CRANK), (1.0, 20.0, 0.0), 1e-6
    index = within.reactions.names.index('B')
    fx, fy, _ = moved(within, motion, {'pin_forces': ()}).reactions[index]
    assert fx == pytest.approx(0.0, abs=1e-9 * abs(fy))
    _, slid = shift(within, motion, {'B': play})
    # The rod's pin leaves the line by the play, as if that lay so much higher or lower.
    joint = within.closure.structure.joints[index]
    assert (joint.link, joint.to) == ('block of cylinder', 'connecting_rod')
    off, height = play * (1.0 if fy > 0.0 else -1.0), 0.04 * rect(1.0, 1.0).imag - 0.01
    exact = sqrt(0.14**2 - (height - off) ** 2) - sqrt(0.14**2 - height**2)
    assert slid == pytest.approx(exact, rel=1e-4)


def test_clearance_without_force_shifts_nothing():
    weightless = context(FOUR_BAR, gravity=(0.0, 0.0))
    assert shift(weightless, (1.0, 0.0, 0.0), dict.fromkeys(PINS, 1e-5)) == (0.0, 0.0)


def test_clearance_ignores_forces_at_rounding_level():
    # Forces of 1e-13 of the largest have no direction that means anything.
    within = context(FOUR_BAR)
    before = moved(within, (1.0, 0.0, 0.0), {'pin_forces': ()})
    tiny = tuple(
        reaction._replace(fx=1e-13 * reaction.fx, fy=1e-13 * reaction.fy) if i else reaction
        for i, reaction in enumerate(before.reactions)
    )
    stage = ClearanceEffect({'A': 1e-5, 'B': 1e-5, 'O4': 1e-5}).stage(within)
    names = within.reactions.names
    assert names[0] == 'O2'
    assert stage(before._replace(reactions=tiny)).deflection == (0.0, 0.0)
    assert stage(before).deflection != (0.0, 0.0)


def test_three_link_pin_has_clearance_in_two_holes():
    # Rocker and lever have the pin D of the ground, each its own hole.
    pair = linkage_of("""
links:
  ground: {O: [0, 0], D: [0.1, 0]}
  crank: {O: [0, 0], A: [0.05, 0]}
  coupler: {A: [0, 0], B: [0.1, 0]}
  rocker: {D: [0, 0], B: [0.07, 0]}
  rod: {B: [0, 0], C: [0.09, 0]}
  lever: {D: [0, 0], C: [0.06, 0]}
input: {joint: crank_joint, parent: ground, child: crank}
assembly: {B: left, C: right}
joints:
  rocker_joint: {parent: ground, child: rocker}
  lever_joint: {parent: ground, child: lever}
masses:
  crank: {mass: 0.1, center: [0.02, 0], inertia: 1.0e-5}
  coupler: {mass: 0.1, center: [0.05, 0], inertia: 1.0e-5}
  rocker: {mass: 0.1, center: [0.03, 0], inertia: 1.0e-5}
  rod: {mass: 0.1, center: [0.04, 0], inertia: 1.0e-5}
  lever: {mass: 0.1, center: [0.03, 0], inertia: 1.0e-5}
""")
    within, motion, play = context(pair), (1.0, 0.0, 0.0), 1e-6
    before = moved(within, motion, {'pin_forces': ()})
    offsets = [0j] * len(within.reactions.names)
    for name in ('D/rocker', 'D/lever'):
        number = within.reactions.names.index(name)
        fx, fy, _ = before.reactions[number]
        offsets[number] = -play * complex(fx, fy) / hypot(fx, fy)
    expected = within.reactions.joint_deflections(before.position, offsets)
    assert shift(within, motion, {'D': play}) == pytest.approx(expected, rel=1e-12)


def test_clearance_of_a_slider_is_refused():
    line = (
        r"^effects\.clearance\.pins\.cylinder: 'cylinder' is a slider, and clearance is a "
        'property of pins; name pins: A, B, O2$'
    )
    with pytest.raises(DefinitionError, match=line):
        ClearanceEffect({'cylinder': 1e-5}).stage(context(SLIDER_CRANK))


def test_scene_publishes_joints_shifted_by_clearance():
    def tick(effects):
        scene = b'drive: {constant_rate: {rate: -6, start: 2.5}}\n' + effects
        built = pipeline_of(scene, (LINKAGES / 'four_bar.yaml').read_bytes())
        return read_joint_state(built.tick(10**9).message)

    loads = b'\nloads: {gravity: [0, -9.81]}'
    worn = tick(b'effects: {velocity: {}, clearance: {pins: {A: 1.0e-5, B: 2.0e-5}}}' + loads)
    tight = tick(b'effects: {velocity: {}}')
    expected = (0.0, *shift(context(FOUR_BAR), (2.5, -6.0, 0.0), {'A': 1e-5, 'B': 2e-5}))
    assert list(worn.position - tight.position) == pytest.approx(expected, abs=1e-15)
    assert max(map(abs, expected)) > 1e-5
    assert list(worn.velocity) == list(tight.velocity)
