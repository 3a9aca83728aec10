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


"""Linkage to URDF and back: the joints have the same values all over the range."""

from __future__ import annotations

from math import remainder, tau

from linkage_ros.kinematics.survey import samples, Way
from linkage_ros.models.imported import imported
from linkage_ros.models.part import Part
from linkage_ros.models.urdf import urdf
from linkage_ros.models.urdf_file import read_urdf
from linkage_ros.scene.linkage_file import load
from linkage_ros.scene.linkage_text import linkage_text
import pytest

from .gallery import GALLERY, LINKAGES, size_of
from .odd import closure_of, ODD

WITHIN = 1e-12


def back(closure):
    """Return a linkage that went through URDF and through the text of a linkage file."""
    made = imported(read_urdf(urdf('it', [Part(closure)]), 'it.urdf'))
    text = linkage_text(made.linkage)
    return closure_of(text)


def inputs_of(closure):
    """Return inputs all over the range, but for its very ends, where rounding opens loops."""
    if len(closure.linkage.inputs) > 1:
        return [(1.3 + 0.05 * i, 1.8 - 0.03 * i) for i in range(15)]
    interval = Way(closure).widest_range
    return [(value,) for value in samples(interval, 200)[1:-1]]


def differences(one, other):
    """Yield by how much each joint of the one differs in the other, of its size."""
    places = {name: i for i, name in enumerate(other.linkage.joints)}
    for inputs in inputs_of(one):
        here, there = one.position(*inputs), other.position(*inputs)
        assert here.joints
        assert there.joints, inputs
        for name, value, turns in zip(one.linkage.joints, here.joints, one.turning, strict=True):
            if name in places:
                off = there.joints[places[name]] - value
                yield abs(remainder(off, tau)) if turns else abs(off) / size_of(one)


@pytest.mark.parametrize('name', [*GALLERY, 'five_bar'])
def test_every_shipped_linkage_comes_back_with_the_same_joints_and_masses(name):
    closure = load(LINKAGES / f'{name}.yaml')
    again = back(closure)
    assert list(again.linkage.joints) == list(closure.linkage.joints)
    assert [e.joint for e in again.linkage.inputs] == [e.joint for e in closure.linkage.inputs]
    assert max(differences(closure, again)) <= WITHIN
    assert again.linkage.masses.keys() == closure.linkage.masses.keys()
    for link, mass in closure.linkage.masses.items():
        origin = next(iter(again.linkage.links[link].values()))
        assert origin == (0.0, 0.0)
        assert again.linkage.masses[link].mass == mass.mass
        assert again.linkage.masses[link].inertia == pytest.approx(mass.inertia, rel=1e-15)


@pytest.mark.parametrize('name', ODD)
def test_every_way_from_frame_to_frame(name):
    closure = closure_of(name)
    again = back(closure)
    lost = set(closure.linkage.joints) - set(again.linkage.joints)
    assert len(lost) <= LOST.get(name, 0)
    assert max(differences(closure, again)) <= WITHIN


LOST = {'one more than needed, and the crank once more': 3, 'a rod that only slides hold': 1}
"""Joints that no link hangs by; those of links that others tell of are left out."""
