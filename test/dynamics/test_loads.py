# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Forces on what a linkage does not have, refused in one line; and what a spring pulls with."""

from dataclasses import replace

from linkage_ros.dynamics import (
    check_loads,
    Friction,
    JointFriction,
    Loads,
    Mechanics,
    Spring,
)
from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics import Closure
import pytest

from .loaded import shipped

RUBBING = JointFriction(0.1, 0.2)
SPRING = Spring('ground', 'O2', 'rocker', 'B', 100.0, 0.1, 3.0)

# The linkage, the loads, the friction, and the error.
REFUSED = {
    'a link that is not there': (
        'four_bar',
        Loads(springs=(Spring('ground', 'O2', 'roker', 'B', 1.0, 0.1, name='return'),)), {},
        "loads.springs.return: 'roker' is not a link; name one of coupler, crank, ground, rocker",
    ),
    'a point of another link': (
        'four_bar', Loads(springs=(Spring('rocker', 'P', 'ground', 'O2', 1.0, 0.1),)), {},
        "loads.springs.1: 'P' is not a point of 'rocker'; name one of B, O4",
    ),
    'the second spring': (
        'four_bar', Loads(springs=(SPRING, Spring('ground', 'O3', 'rocker', 'B', 1.0, 0.1))), {},
        "loads.springs.2: 'O3' is not a point of 'ground'; name one of O2, O4",
    ),
    'a spring within a link': (
        'four_bar', Loads(springs=(Spring('rocker', 'O4', 'rocker', 'B', 1.0, 0.1),)), {},
        "loads.springs.1: both its ends lie on 'rocker', so that nothing stretches it; name p",
    ),
    'friction in a point of one link': (
        'four_bar', Loads(), {'P': RUBBING},
        "effects.friction.joints.P: 'P' is not a pin or slider; name one of A, B, O2, O4",
    ),
    'friction in a slider that is not there': (
        'slider_crank', Loads(), {'bore': RUBBING},
        "effects.friction.joints.bore: 'bore' is not a pin or slider; name one of A, B, O2, cyl",
    ),
    'the point of a block that is a link, and no pin': (
        'scotch_yoke', Loads(), {'Y': RUBBING},
        "effects.friction.joints.Y: 'Y' is not a pin or slider; name one of A, O2, guide, slot",
    ),
    'a pin with a coefficient alone': (
        'four_bar', Loads(), {'A': JointFriction(coefficient=0.1)},
        'effects.friction.joints.A.coefficient: friction by the force in a pin needs both, and r',
    ),
    'a pin with a radius alone': (
        'four_bar', Loads(), {'A': JointFriction(radius=0.1)},
        'effects.friction.joints.A.radius: friction by the force in a pin needs both, and coef',
    ),
    'a slider with a radius': (
        'slider_crank', Loads(), {'cylinder': JointFriction(coefficient=0.1, radius=0.01)},
        "effects.friction.joints.cylinder.radius: 'cylinder' is a slider, which has none; leave",
    ),
}  # fmt: skip


@pytest.mark.parametrize('kind', REFUSED)
def test_loads_on_unknown_parts_are_refused(kind):
    name, loads, friction, expected = REFUSED[kind]
    with pytest.raises(DefinitionError) as caught:
        check_loads(shipped(name), loads, Friction(friction))
    assert str(caught.value).startswith(expected)


def test_mechanics_refuses_friction_of_an_unknown_joint():
    closure = Closure(shipped('four_bar'))
    with pytest.raises(DefinitionError, match=r'^effects\.friction\.joints\.X: '):
        Mechanics(closure, Loads(), Friction({'X': RUBBING}))


def test_friction_of_an_ambiguous_joint_name_is_refused():
    linkage = shipped('slider_crank')
    linkage = replace(linkage, sliders={'B': linkage.sliders['cylinder']})
    with pytest.raises(DefinitionError) as caught:
        check_loads(linkage, Loads(), Friction({'B': RUBBING}))
    assert str(caught.value) == (
        "effects.friction.joints.B: 'B' names a pin and a slider; give the slider another name"
    )


@pytest.mark.parametrize('joint', ['O2', 'A', 'B', 'cylinder'])
def test_friction_is_accepted_in_every_pin_and_slider(joint):
    # B is the pin between the rod and the block of the slot, which is no link of the file's.
    check_loads(shipped('slider_crank'), Loads(), Friction({joint: RUBBING}))


@pytest.mark.parametrize(
    ('length', 'growth', 'pull'),
    [(0.3, 0.0, 20.0), (0.1, 0.0, 0.0), (0.05, 0.0, -5.0), (0.1, 2.0, 6.0), (0.05, -1.0, -8.0)],
)
def test_spring_tension_equals_stiffness_and_damping_terms(length, growth, pull):
    assert SPRING.tension(length, growth) == pytest.approx(pull)
