# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A linkage in C says what the plain steps say, to the last bit, and compiles in silence."""

from dataclasses import replace
from math import inf, nan, pi
from pathlib import Path
import random

from campaigns.topologies.families import FAMILIES
from linkage_ros.kinematics import Closure, Limits, RevoluteJoint
from linkage_ros.resources import spatial_linkage_names
from linkage_ros.tools.models.source_code import C, write_source
import pytest

from .emitted import (
    build,
    COMPILERS,
    COUNT,
    needs,
    plain,
    run_c,
    State,
    states,
    subject,
    Told,
)
from ..test_gallery import closure_of, KINDS

ON_GRIDS = ('ankle_motors', 'hexapod')
"""Outside of their cells, which limits bound, sources are undecided."""
GALLERY = [*KINDS, *(name for name in spatial_linkage_names() if name not in ON_GRIDS)]
ITERATED_TWICE = 'class III two inputs'
COMPILED = [family for family in FAMILIES if family != ITERATED_TWICE]
pytestmark = needs['C99']


def told_of(
    closure: Closure, folder: Path, count: int, seed: str, start: State = ()
) -> list[Told]:
    """Return what C says of states, after it was found to be what the steps say."""
    given = states(closure, count, seed, start)
    told = run_c(subject(closure), given, folder)
    for state, one in zip(given, told, strict=True):
        assert one == plain(closure, state), state
    return told


@pytest.mark.sample(3)
@pytest.mark.timeout(600)
@pytest.mark.parametrize('name', GALLERY)
def test_gallery_linkages_in_c_equal_the_steps(name, tmp_path):
    told = told_of(closure_of(name), tmp_path, COUNT, name)
    # Spatial linkages close in a smaller part of what their inputs are drawn from.
    assert sum(one.status == 'CLOSED' for one in told) > COUNT / (3 if name in KINDS else 6)


@pytest.mark.sample(2)
@pytest.mark.parametrize('family', COMPILED)
def test_random_linkages_in_c_equal_the_steps(family, tmp_path):
    topology = FAMILIES[family].make(random.Random(family))
    told = told_of(Closure(topology.linkage), tmp_path, 150, family, topology.start)
    assert sum(one.status == 'CLOSED' for one in told) > 15


def test_c_code_returns_the_passing_motion_at_change_points(tmp_path):
    for name in ('parallelogram', 'peaucellier'):
        closure = closure_of(name)
        given = [(i * pi, 1.5, 0.5) for i in range(-4, 5)]
        told = run_c(subject(closure), given, tmp_path)
        assert told == [plain(closure, state) for state in given]
        assert name != 'parallelogram' or {one.status for one in told} == {'CHANGE_POINT'}


def test_c_code_reports_toggle_before_a_later_open_dyad(tmp_path):
    rocker = closure_of('double_rocker')
    links = {name: dict(points) for name, points in rocker.linkage.links.items()}
    links['ground']['O6'] = (0.15, -0.3)
    links |= {
        'arm': {'B': (0.0, 0.0), 'E': (0.08, 0.0)},
        'lever': {'O6': (0.0, 0.0), 'E': (0.08, 0.0)},
    }
    assembly = {**rocker.linkage.assembly, 'E': 'left'}
    joints = {**rocker.linkage.joints, 'lever_joint': RevoluteJoint('ground', 'lever')}
    closure = Closure(replace(rocker.linkage, links=links, assembly=assembly, joints=joints))
    given = [(rocker.closing_ranges[0].lowest, 1.0, 0.0)]
    assert plain(closure, given[0]).status == 'OPEN'
    assert run_c(subject(closure), given, tmp_path) == [Told('TOGGLE', ())]


def limited(**limits: tuple[float, float]) -> Closure:
    """Return the four-bar of the gallery with limits of joints."""
    linkage = closure_of('four_bar').linkage
    inputs = tuple(
        replace(one, limits=Limits(*limits.get(one.joint, (-inf, inf)))) for one in linkage.inputs
    )
    joints = {
        name: replace(joint, limits=Limits(*limits.get(name, (-inf, inf))))
        for name, joint in linkage.joints.items()
    }
    return Closure(replace(linkage, inputs=inputs, joints=joints))


@pytest.mark.parametrize(
    'limits',
    [
        {'crank_joint': (0.2, 2.0)},
        {'rocker_joint': (1.5, 1.9)},
        # The same angles, some turns on: a published angle is compared in the nearest turn.
        {'rocker_joint': (1.5 + 4.0 * pi, 1.9 + 4.0 * pi), 'crank_joint': (-9.0, 2.5)},
    ],
)
def test_c_code_returns_values_and_limited_beyond_limits(limits, tmp_path):
    told = told_of(limited(**limits), tmp_path, 400, 'limited')
    assert {'CLOSED', 'LIMITED'} <= {one.status for one in told}
    assert all(len(one.values) == 6 for one in told if one.status == 'LIMITED')


def test_c_code_checks_limits_of_joints_not_requested(tmp_path):
    closure = limited(rocker_joint=(1.5, 1.9))
    given = states(closure, 300, 'limited')
    told = run_c(subject(closure, 0, ['coupler_joint']), given, tmp_path)
    assert [one.status for one in told] == [plain(closure, state).status for state in given]


@pytest.mark.parametrize('derivatives', [0, 1, 2])
def test_c_code_omits_joints_and_derivatives_not_requested(derivatives, tmp_path):
    closure = closure_of('jansen_leg')
    joint = list(closure.linkage.joints)[1]
    asked, whole = subject(closure, derivatives, [joint]), subject(closure)
    given = states(closure, 200, 'asked')
    for one, all_of_it in zip(
        run_c(asked, given, tmp_path), run_c(whole, given, tmp_path), strict=True
    ):
        count = len(closure.linkage.joints)
        assert one.values == all_of_it.values[1::count][: 1 + derivatives]
    short, long = (write_source(what, C('leg', header=False)) for what in (asked, whole))
    assert short.count(' const ') < long.count(' const ')


@pytest.mark.sample(4)
@pytest.mark.parametrize('odd', [nan, inf, -inf])
@pytest.mark.parametrize('place', [0, 1, 2])
def test_c_code_returns_indeterminate_for_values_not_finite(odd, place, tmp_path):
    state = [1.0, 1.0, 1.0]
    state[place] = odd
    assert run_c(subject(closure_of('four_bar')), [tuple(state)], tmp_path) == [
        Told('INDETERMINATE', ())
    ]


@pytest.mark.sample(7)
@pytest.mark.parametrize('kind', [pytest.param(k, marks=needs[k]) for k in COMPILERS])
@pytest.mark.parametrize('header', [False, True])
@pytest.mark.parametrize('name', GALLERY)
def test_c_code_of_gallery_linkages_compiles_without_a_warning(name, header, kind, tmp_path):
    text = write_source(subject(closure_of(name)), C('linkage', header=header))
    file = tmp_path / 'linkage.c'
    # A header may be included twice.
    (tmp_path / 'linkage.h').write_text(text)
    file.write_text('#include "linkage.h"\n' * 2 + 'int nothing;\n' if header else text)
    build([*COMPILERS[kind], '-c'], file, tmp_path / 'linkage.o')


@pytest.mark.parametrize('kind', [pytest.param(k, marks=needs[k]) for k in COMPILERS])
def test_headers_of_one_linkage_compile_in_one_file(kind, tmp_path):
    closure = closure_of('four_bar')
    texts = [write_source(subject(closure, i), C('four_bar', header=True)) for i in range(3)]
    (tmp_path / 'all.c').write_text('\n'.join(texts))
    build([*COMPILERS[kind], '-Wno-unused-function', '-c'], tmp_path / 'all.c', tmp_path / 'all.o')


@pytest.mark.sample(1)
@pytest.mark.parametrize('name', ['class III', 'class III sliders', 'class III chain'])
def test_iterated_groups_in_c_equal_the_steps(name, tmp_path):
    closed = 0
    for seed in range(4):
        topology = FAMILIES[name].make(random.Random(f'compiled {seed}'))
        closure = Closure(topology.linkage)
        given = states(closure, 100, name, topology.start)
        (within,) = closure.closing_ranges
        for state, one in zip(given, run_c(subject(closure), given, tmp_path), strict=True):
            closed += one.status == 'CLOSED'
            # A slide has no end, and its table is only as long as the range.
            if (
                one.status != 'UNDECIDED'
                or within.turning
                or within.lowest < state[0] < within.highest
            ):
                assert one == plain(closure, state), state
    assert closed > 200
