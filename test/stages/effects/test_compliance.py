# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Compliance: a link that is pulled is longer, against the linkage with that length."""

from dataclasses import replace

from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics import Closure
from linkage_ros.stages.effects import ComplianceEffect
import pytest

from .four_bar_by_hand import FourBar, mp, turn
from .loaded import context, GRAVITY, moved
from ...support.messages import read_joint_state
from ...support.scenes import linkage_of, LINKAGES, pipeline_of, shipped

FOUR_BAR, SLIDER_CRANK, WATT = (shipped(name) for name in ('four_bar', 'slider_crank', 'watt_1'))
SHARED_PIN = linkage_of("""
links:
  ground: {O: [0, 0], D: [0.1, 0], E: [0.2, 0.02]}
  crank: {O: [0, 0], A: [0.04, 0]}
  coupler: {A: [0, 0], B: [0.12, 0]}
  rocker: {D: [0, 0], B: [0.08, 0]}
  rod: {B: [0, 0], C: [0.09, 0]}
  lever: {E: [0, 0], C: [0.07, 0]}
input: {joint: crank_joint, parent: ground, child: crank}
assembly: {B: left, C: left}
joints:
  rocker_joint: {parent: ground, child: rocker}
  lever_joint: {parent: ground, child: lever}
masses:
  crank: {mass: 0.1, center: [0.02, 0], inertia: 1.0e-5}
  coupler: {mass: 0.2, center: [0.06, 0.01], inertia: 1.0e-4}
  rocker: {mass: 0.1, center: [0.04, 0], inertia: 1.0e-5}
  rod: {mass: 0.1, center: [0.045, 0], inertia: 1.0e-5}
  lever: {mass: 0.3, center: [0.03, 0], inertia: 1.0e-4}
""")
"""Three links share the pin B."""

MOTIONS = [(1.0, 0.0, 0.0), (0.4, 0.0, 20.0), (2.5, -6.0, 30.0), (-1.2, 12.0, -80.0)]


def shift(within, motion, links):
    return moved(within, motion, {'pin_forces': (), 'compliance': (links,)}).deflection


def tensions_by_hand(motion):
    """Return the mean axial force of coupler and rocker, from the balance of every link."""
    phi, psi, (_, at_a, at_b, at_d) = FourBar(FOUR_BAR, motion, GRAVITY).balance()
    along, arm = turn(phi), turn(psi)
    coupler = ((-at_b - at_a) / 2 * mp.conj(along)).real
    rocker = ((at_b - at_d) / 2 * mp.conj(arm)).real
    return {'coupler': float(coupler), 'rocker': float(rocker)}


def lengthened(of, link, pin, stretch):
    """Return a linkage with a link longer along its x axis."""
    x, y = of.links[link][pin]
    points = {**of.links[link], pin: (x + stretch, y)}
    return replace(of, links={**of.links, link: points})


@pytest.mark.parametrize('link', ['coupler', 'rocker'])
@pytest.mark.parametrize('motion', MOTIONS)
def test_compliance_error_falls_with_the_square_of_stretch(motion, link):
    within, tension = context(FOUR_BAR), tensions_by_hand(motion)[link]
    rigid = within.closure.position(motion[0]).joints
    errors = []
    for stretch in (1e-4, 5e-5):
        longer = Closure(lengthened(FOUR_BAR, link, 'B', stretch)).position(motion[0]).joints
        exact = [a - b for a, b in zip(longer, rigid, strict=True)]
        sign = 1.0 if tension > 0.0 else -1.0
        # A stiffness at which it is that much longer, or shorter.
        found = [sign * value for value in shift(within, motion, {link: abs(tension) / stretch})]
        assert found == pytest.approx(exact, abs=0.05 * max(map(abs, exact)))
        errors.append(max(abs(a - b) for a, b in zip(found, exact, strict=True)))
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)


def pulled(within, motion, link, pins):
    """Return the mean tension of a link from the reactions, the far pin's less the near one's."""
    closure = within.closure
    motion = moved(within, motion, {'pin_forces': ()})
    points = closure.points(motion.position)
    between = points[link, pins[1]] - points[link, pins[0]]
    force = 0j
    for joint, reaction in zip(closure.structure.joints, motion.reactions, strict=True):
        if joint.name in pins and link in (joint.link, joint.to):
            sign = (1.0 if joint.link == link else -1.0) * (1.0 if joint.name == pins[1] else -1.0)
            force += sign * complex(reaction.fx, reaction.fy)
    return (0.5 * force * between.conjugate()).real / abs(between)


@pytest.mark.parametrize(
    ('of', 'link', 'pins'),
    [
        (FOUR_BAR, 'crank', ('O2', 'A')),
        (SLIDER_CRANK, 'connecting_rod', ('A', 'B')),
        (WATT, 'upper_link', ('C', 'E')),
        (SHARED_PIN, 'coupler', ('A', 'B')),
        (SHARED_PIN, 'rod', ('B', 'C')),
    ],
    ids=['crank', 'rod of a slider', 'six-bar', 'first of a shared pin', 'last of a shared pin'],
)
def test_compliance_stretches_any_bar_between_two_pins(of, link, pins):
    within, motion, stretch = context(of), (1.0, 5.0, 3.0), 1e-6
    tension = pulled(within, motion, link, pins)
    longer = Closure(lengthened(of, link, pins[1], stretch)).position(motion[0]).joints
    exact = [a - b for a, b in zip(longer, within.closure.position(1.0).joints, strict=True)]
    found = shift(within, motion, {link: tension / stretch if tension > 0 else -tension / stretch})
    sign = 1.0 if tension > 0.0 else -1.0
    assert [sign * value for value in found] == pytest.approx(
        exact, rel=1e-3, abs=1e-4 * max(map(abs, exact))
    )


def test_stretches_of_two_links_add_up():
    within, motion = context(FOUR_BAR), MOTIONS[2]
    one, other = ({'coupler': 2e4}, {'rocker': 1e4})
    alone = [shift(within, motion, links) for links in (one, other)]
    both = shift(within, motion, one | other)
    assert both == pytest.approx([a + b for a, b in zip(*alone, strict=True)], rel=1e-12)


@pytest.mark.parametrize(
    ('of', 'link', 'reason'),
    [
        (WATT, 'coupler', "'coupler' has the pins A, B, C, so it is not a bar between two pins"),
        (shipped('excavator_bucket'), 'cylinder_rod', "has the slider 'bore', so it is not"),
        (shipped('excavator_bucket'), 'cylinder_tube', "has the slider 'bore', so it is not"),
    ],
)
def test_compliance_of_other_links_is_refused(of, link, reason):
    with pytest.raises(DefinitionError, match=f'^effects.compliance.links.{link}: .*{reason}'):
        ComplianceEffect({link: 1e4}).stage(context(of))


def test_scene_with_compliance_publishes_only_shifted_joints():
    def tick(effects):
        scene = b'drive: {constant_rate: {rate: -6, start: 2.5}}\n' + effects
        return pipeline_of(scene, (LINKAGES / 'four_bar.yaml').read_bytes()).tick(10**9)

    loads = b'\nloads: {gravity: [0, -9.81]}'
    soft = tick(b'effects: {compliance: {links: {coupler: 1.0e4}}}' + loads)
    rigid = tick(b'effects: {}')
    assert soft.extras == ()
    one, other = (read_joint_state(each.message) for each in (soft, rigid))
    assert len(one.velocity) == len(one.effort) == 0
    # The crank is held, and published first.
    expected = (0.0, *shift(context(FOUR_BAR), (2.5, -6.0, 0.0), {'coupler': 1e4}))
    assert list(one.position - other.position) == pytest.approx(expected, abs=1e-15)
    assert max(map(abs, expected)) > 1e-6
