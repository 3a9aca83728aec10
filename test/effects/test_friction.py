# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Friction: parameters that everything with forces takes into account, and no stage of its own."""

from linkage_ros.dynamics import Friction, JointFriction
from linkage_ros.errors import FileError
from linkage_ros.stages.effects import BASES, ForceEffect, FrictionEffect
import pytest

from .loaded import context, moved
from ..support.messages import read_joint_state
from ..support.scenes import LINKAGES, pipeline_of, shipped

SLIDER_CRANK = shipped('slider_crank')


def test_each_joint_has_its_own_friction():
    joints = {'A': JointFriction(viscous=0.002), 'cylinder': JointFriction(3.0, 4.0)}
    assert FrictionEffect(joints).friction == Friction(joints)


@pytest.mark.parametrize('rate', [5.0, -5.0])
def test_a_cylinder_that_rubs_takes_that_much_more_power(rate):
    # The piston's rate is the slope of its place over time: the rod's pin on its line.
    rubbing = FrictionEffect({'cylinder': JointFriction(3.0, 4.0)}).friction
    with_it, without = (
        moved(context(SLIDER_CRANK, by), (1.0, rate, 7.0), {'effort': ()})
        for by in (rubbing, None)
    )
    step = 1e-6
    closure = context(SLIDER_CRANK).closure
    before, after = (closure.position(1.0 + rate * t).joints[1] for t in (-step, step))
    slide = (after - before) / (2.0 * step)
    more = (with_it.efforts[0] - without.efforts[0]) * rate
    assert more == pytest.approx(3.0 * slide**2 + 4.0 * abs(slide), rel=1e-7)


def efforts_of(effects):
    scene = b'drive: {constant_rate: {rate: 3}}\n' + effects
    pipeline = pipeline_of(scene, (LINKAGES / 'slider_crank.yaml').read_bytes())
    ticks = [pipeline.tick(10**9 + i * 10**6) for i in range(50)]
    messages = [read_joint_state(t.message) for t in ticks]
    return [message.effort[0] for message in messages]


def test_a_scene_with_friction_says_so_in_the_effort():
    dry = efforts_of(b'effects: {effort: {}, friction: {joints: {O2: {coulomb: 0.5}}}}')
    bare = efforts_of(b'effects: {effort: {}}')
    assert dry == pytest.approx([effort + 0.5 for effort in bare], abs=1e-12)


def test_where_nothing_asks_for_forces_it_is_refused():
    with pytest.raises(FileError, match=r'effects\.friction: acts on nothing here'):
        efforts_of(b'effects: {velocity: {}, friction: {joints: {O2: {coulomb: 0.5}}}}')


def test_it_has_no_stage():
    assert [base for base in BASES if issubclass(FrictionEffect, base)] == [ForceEffect]
