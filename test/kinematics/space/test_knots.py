# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Links that close only together: they depend on the inputs alone, and are exact."""

from itertools import product
from math import dist, remainder, tau
from pathlib import Path
from random import Random

from linkage_ros.description import load
from linkage_ros.kinematics import Grid, InputSweep, Status
from linkage_ros.kinematics.compiling import Compiled
import numpy as np
import pytest
from scipy.optimize import fsolve
from scipy.spatial.transform import Rotation

from ...support.sampling import sample_count
from ...support.spatial import load_in_space

FOLDER = Path(__file__).parent / 'linkages'
BOTH_WAYS = {'ankle': 'ankle_motors', 'hexapod_inverse': 'hexapod'}


def closure_of(name):
    own = FOLDER / f'{name}.yaml'
    return load_in_space(own if own.is_file() else name)


def random_inputs(closure, count, reach):
    random = Random(closure.name)
    pose = closure.linkage.pose.inputs
    return [
        [
            value + reach * random.uniform(-1.0, 1.0) * (0.1 if given.slider else 1.0)
            for value, given in zip(pose, closure.linkage.inputs, strict=True)
        ]
        for _ in range(count)
    ]


@pytest.mark.sample(1)
@pytest.mark.parametrize('name', BOTH_WAYS)
def test_inverse_linkage_returns_the_inputs(name):
    there, back = closure_of(name), closure_of(BOTH_WAYS[name])
    met, count = 0, sample_count(200, 20)
    for inputs in random_inputs(there, count, 0.3):
        position = there.position(*inputs)
        if position.status is not Status.CLOSED:
            continue
        met += 1
        found = back.position(*position.joints)
        assert found.status is Status.CLOSED
        assert found.joints == pytest.approx(inputs, abs=1e-14)
        product = back.jacobian(found) @ there.jacobian(position)
        assert product == pytest.approx(np.eye(len(inputs)), abs=1e-11)
    assert met > 0.5 * count


def test_iterated_states_do_not_depend_on_their_order():
    states = random_inputs(closure_of('ankle_motors'), sample_count(1_000_000, 10_000), 0.7)
    one, other = (Compiled(closure_of('ankle_motors'), 0, within_limits=False) for _ in range(2))
    forward = [one.fast(*inputs) for inputs in states]
    assert [other.fast(*inputs) for inputs in reversed(states)] == forward[::-1]
    assert sum(map(bool, forward)) > 0.9 * len(states)


def test_earlier_motion_does_not_change_state_bits():
    """Some cells on the way are narrow, next to a place where the loop nearly ends."""
    state = -0.7383024407166474
    file = Path(__file__).parent.parent / 'three_cylinders.yaml'
    moved = load(file)
    for value in np.linspace(0.0, state, 40)[:-1].tolist():
        moved.position(value)
    assert moved.position(state).joints == load(file).position(state).joints


def test_dropped_cells_are_computed_again_bit_for_bit(monkeypatch):
    states = random_inputs(closure_of('ankle_motors'), 60, 0.6)
    whole = closure_of('ankle_motors')
    expected = [whole.position(*inputs).joints for inputs in states]
    monkeypatch.setattr('linkage_ros.kinematics.iterated.grid._KEPT', 800)
    few = closure_of('ankle_motors')
    assert [few.position(*inputs).joints for inputs in states] == expected


@pytest.mark.parametrize('turns', [-7, 1, 3, 1000])
def test_whole_turns_of_the_crank_repeat_the_pose(turns):
    closure = closure_of('ankle_of_one_motor')
    gear, *others = range(len(closure.joint_names))
    for (x,) in random_inputs(closure, 20, 3.0):
        one, later = closure.position(x), closure.position(x + tau * turns)
        assert later.status is one.status is Status.CLOSED
        assert later.joints[gear] - one.joints[gear] == pytest.approx(-tau * turns)
        for k in others:
            assert later.joints[k] == pytest.approx(one.joints[k], abs=1e-11)
    wound = 0.3 + tau * turns
    position = closure.position(wound)
    rates = closure.velocity(position, 1.0).joints
    assert Compiled(closure, 1)(wound, 1.0).values == (position.joints, rates)


def test_cells_within_limits_cover_all_solved_states():
    one, other = closure_of('ankle_motors'), closure_of('ankle_motors')
    (grid,), (met,) = one.grids, other.grids
    cells = grid.fill(4096)
    assert {key[0] for key in cells} == {0}
    for inputs in random_inputs(other, 300, 0.6):
        assert met(*inputs) in cells.values()
    assert closure_of('hexapod').grids[0].fill(4096) is None


@pytest.mark.sample(1)
@pytest.mark.parametrize('ahead', [True, False])
def test_cells_made_ahead_serve_a_hexapod_in_motion(monkeypatch, ahead):
    closure, made, counts = closure_of('hexapod'), [], []
    make = Grid._make_cell
    monkeypatch.setattr(Grid, '_make_cell', lambda *given: made.append(given) or make(*given))
    begin, rates = closure.linkage.pose.inputs, (0.0, -0.1, 0.0, 0.0, 0.0, 0.0)
    closure.position(*begin)
    for tick in range(100):
        inputs = [value + rate * 0.01 * tick for value, rate in zip(begin, rates, strict=True)]
        before = len(made)
        assert closure.position(*inputs).status is Status.CLOSED
        counts.append(len(made) - before)
        if ahead:
            closure.make_cells_ahead(inputs, rates)
    assert made
    assert (sum(counts) == 0) == ahead


def test_range_search_samples_only_near_the_range_ends(monkeypatch):
    closure, asked = closure_of('hexapod'), []
    begin = closure.linkage.pose.inputs
    sweep = InputSweep(closure, begin)
    position_at = closure.position
    monkeypatch.setattr(closure, 'position', lambda *x: asked.append(x[0]) or position_at(*x))
    interval = sweep.range_about(begin[0])
    assert interval.lowest < begin[0] < interval.highest
    assert min(asked) < interval.lowest
    assert max(asked) > interval.highest
    # A sample is a 360th of the farthest that a leg may be long.
    sample = closure.slide_bound / 360.0
    assert min(asked) > interval.lowest - 1.01 * sample
    assert max(asked) < interval.highest + 1.01 * sample
    for end, way in ((interval.lowest, -1e-9), (interval.highest, 1e-9)):
        assert position_at(end, *begin[1:]).status.has_pose
        assert position_at(end + way, *begin[1:]).status is Status.OPEN


def test_only_linkages_with_many_inputs_make_cells_in_motion():
    assert closure_of('hexapod').makes_cells_in_motion
    for name in ('ankle_motors', 'hexapod_inverse', 'four_bar'):
        assert not closure_of(name).makes_cells_in_motion


def test_solved_joints_equal_a_walk_from_the_pose():
    """The motors are closed forms of the joints; the walk inverts these by Newton's method."""
    motors = Compiled(closure_of('ankle'), 1, within_limits=False)
    joints = closure_of('ankle_motors')
    for inputs in random_inputs(joints, sample_count(10_000, 4), 0.6):
        now, steps = np.zeros(2), 4000
        for step in range(1, steps + 1):
            wanted = np.array(inputs) * (step / steps)
            for _ in range(2):
                place, first = motors(*now.tolist(), 1.0, 0.0).values
                _, second = motors(*now.tolist(), 0.0, 1.0).values
                now = now + np.linalg.solve(np.transpose([first, second]), wanted - place)
        assert joints.close_unlimited(*inputs).joints == pytest.approx(now, abs=1e-13)


def last_with(attribute, closure, inputs):
    """Return the part of the way to inputs up to which the linkage has a pose, or rates."""
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        status = closure.close_unlimited(*(middle * value for value in inputs)).status
        if getattr(status, attribute):
            low = middle
        else:
            high = middle
    return low


def test_passing_a_singularity_and_returning_keeps_the_assembly():
    closure = closure_of('ankle_motors')
    far = [3.0, 3.0]
    end = last_with('has_pose', closure, far)
    assert 0.0 < end < 1.0
    parts = np.linspace(0.0, min(1.0, 1.2 * end), 60).tolist()
    there = [closure.close_unlimited(*(part * value for value in far)) for part in parts]
    back = [closure.close_unlimited(*(part * value for value in far)) for part in parts[::-1]]
    assert [one.joints for one in there] == [one.joints for one in back[::-1]]
    statuses = {one.status for one in there}
    assert {Status.CLOSED, Status.OPEN} <= statuses


def test_toggle_separates_closed_and_open_states():
    closure = closure_of('ankle_motors')
    far = np.array([3.0, 3.0])
    begin, end = (last_with(what, closure, far) for what in ('has_rates', 'has_pose'))
    # Within the rounding of the equations, the pose is valid and its rates are not.
    assert 0.0 < end - begin < 2e-13
    for part in np.linspace(begin, end, 7)[1:-1].tolist():
        assert closure.close_unlimited(*(far * part)).status is Status.TOGGLE
    gaps = []
    for power in range(-12, -2):
        apart = 10.0**power
        inside = closure.close_unlimited(*(far * (end - apart)))
        outside = closure.close_unlimited(*(far * (end + apart)))
        assert inside.status is Status.CLOSED, power
        assert closure.residual(inside) < 1e-14
        assert outside.status is Status.OPEN, power
        gaps.append(outside.gap / apart)
    # The gap grows with the distance.
    assert gaps == pytest.approx([gaps[-1]] * len(gaps), rel=0.2)


def test_group_names_its_links_and_counts_its_equations():
    groups = [group for group in closure_of('ankle_motors').groups if group.kind == 'knot']
    assert [(group.links, group.assembly) for group in groups] == [
        (('cross', 'foot'), 'as in the pose')
    ]
    assert '2 equations for pitch, roll' in groups[0].method


def test_ankle_lists_all_assemblies_its_rods_allow():
    """A library's method from a grid of starts, with turned points, finds no more."""
    closure = closure_of('ankle_motors')
    points = {name: np.array(place) for name, place in closure.linkage.points.items()}
    at = np.array(closure.linkage.hinges['roll'].at)

    def misses(joints):
        pitch, roll = (Rotation.from_euler(axis, x) for axis, x in zip('yx', joints, strict=True))
        return [
            dist(pitch.apply(at + roll.apply(points[foot] - at)), points[bar])
            - dist(points[foot], points[bar])
            for bar, foot in (('b1', 'c1'), ('b2', 'c2'))
        ]

    ends = set()
    for start in product(np.linspace(-3.0, 3.0, 9), repeat=2):
        joints, _, status, _ = fsolve(misses, start, full_output=True)
        if status == 1 and max(map(abs, misses(joints))) < 1e-12:
            ends.add(tuple(round(remainder(x, tau), 6) + 0.0 for x in joints))
    ((group, found),) = closure.other_assemblies(64).items()
    assert closure.groups[group].kind == 'knot'
    others = {tuple(round(x, 6) + 0.0 for x in joints.values()) for joints in found}
    assert others | {(0.0, 0.0)} == ends
    assert all(max(map(abs, misses([*joints.values()]))) < 1e-11 for joints in found)


def test_two_ankles_are_solved_by_their_own_motors():
    """Two legs: each knot depends on its own motors."""
    closure = closure_of('two_ankles')
    kinds = [group.kind for group in closure.groups]
    assert kinds.count('knot') == 2
    knots = [step for step in closure.steps if step.grid]
    assert [step.inputs for step in knots] == [(0, 1), (2, 3)]
    one = closure_of('ankle_motors')
    found = closure.position(0.1, -0.2, 0.3, 0.1)
    assert found.joints[:2] == pytest.approx(one.position(0.1, -0.2).joints, abs=1e-15)
    assert found.joints[2:] == pytest.approx(one.position(0.3, 0.1).joints, abs=1e-13)
    assert remainder(found.joints[0], tau) == found.joints[0]
    assert dist(found.points['c1'], found.points['left_c1']) > 0.1


@pytest.mark.parametrize(
    ('name', 'unknown'), [('three_arms', ('b1', 'c1')), ('three_elbows', ('a1', 'a2', 'a3'))]
)
def test_hinge_closed_group_solves_and_inverts(name, unknown):
    closure = closure_of(name)
    (knot,) = (group for group in closure.groups if group.kind == 'knot')
    # A coupler or a platform is a rod between its hinges, though these hold it.
    assert f'{len(unknown)} equations' in knot.method
    assert all(joint in knot.method for joint in unknown)
    other = closure_of('three_arms' if name == 'three_elbows' else 'three_elbows')
    for inputs in random_inputs(closure, 20, 0.1):
        position = closure.position(*inputs)
        assert position.status is Status.CLOSED
        back = other.close_unlimited(*(position[joint] for joint in other.input_names))
        for joint, value in zip(closure.input_names, inputs, strict=True):
            assert back[joint] == pytest.approx(value, abs=1e-13)


def hexapod_on_offset_joints(rng):
    """
    Return the hinges and slides of six legs, in any order: name to parent, child, place, axis.

    Each leg is a hinge, a universal joint beside it, a strut that may spin, and the same again.
    The dimensions are those of a published model of a Stewart platform.
    """
    hinges, slides = {}, {}
    for leg in range(6):
        side = 1.0 if leg % 2 else -1.0
        ends, tangents = [], []
        for radius, degrees, height in ((1.8, 30.0, 0.0), (1.44, 45.0, 2.0)):
            angle = tau / 3 * (leg // 2) + side * np.radians(degrees)
            ends.append(np.array([radius * np.cos(angle), radius * np.sin(angle), height]))
            tangents.append(np.array([-np.sin(angle), np.cos(angle), 0.0]))
        low, high = ends[0] + [0.0, 0.0, 0.075], ends[1] - [0.0, 0.0, 0.075]
        along = high - low
        across = np.cross(along, np.cross([0.0, 0.0, 1.0], along))
        base, cross, cylinder, rod, fork, end = (
            f'{part}{leg}' for part in ('base', 'cross', 'cylinder', 'rod', 'fork', 'end')
        )
        hinges |= {
            f'a{leg}': ('ground', base, ends[0], tangents[0]),
            f'b{leg}': (base, cross, low, across),
            f'c{leg}': (cross, cylinder, low, along),
            f'd{leg}': (rod, fork, high, along),
            f'e{leg}': (fork, end, high, across),
            f'f{leg}': (end, 'platform', ends[1], tangents[1]),
        }
        slides[f'p{leg}'] = cylinder, rod, low, along
    names = [*hinges]
    rng.shuffle(names)
    return {name: hinges[name] for name in names}, slides


def six_legs_text(hinges, slides):
    """Return a linkage file."""

    def numbers(vector):
        return [round(float(value), 6) for value in vector]

    lines = ['points: {}', 'hinges:']
    for name, (parent, child, at, axis) in hinges.items():
        where = f'at: {numbers(at)}, axis: {numbers(axis)}'
        lines.append(f'  {name}: {{parent: {parent}, child: {child}, {where}}}')
    lines.append('slides:')
    for name, (parent, child, _, axis) in slides.items():
        lines.append(f'  {name}: {{parent: {parent}, child: {child}, axis: {numbers(axis)}}}')
    return '\n'.join((*lines, f'input: [{", ".join(slides)}]', ''))


@pytest.mark.sample(1)
@pytest.mark.parametrize('seed', range(4))
def test_hexapod_is_solved_in_any_order_of_its_joints(tmp_path, seed):
    """Each leg alone places the platform, by the library's rotations: all at the same place."""
    hinges, slides = hexapod_on_offset_joints(Random(seed))
    file = tmp_path / 'six_legs.yaml'
    file.write_text(six_legs_text(hinges, slides))
    closure = load(file)
    pose = closure.linkage.pose.inputs
    for inputs in random_inputs(closure, 10, 0.5):
        position = closure.position(*inputs)
        assert position.status is Status.CLOSED
        values = dict.fromkeys(hinges, 0.0)
        values |= dict(zip(closure.joint_names, position.joints, strict=True))
        values |= {
            f'p{leg}': x - start for leg, (x, start) in enumerate(zip(inputs, pose, strict=True))
        }
        places = []
        for leg in range(6):
            turn, origin = Rotation.identity(), np.zeros(3)
            for joint in 'abcpdef':
                *_, at, axis = (hinges | slides)[f'{joint}{leg}']
                at, axis = np.round(at, 6), np.round(axis, 6)
                way, value = axis / np.linalg.norm(axis), values[f'{joint}{leg}']
                if joint == 'p':
                    origin = origin + turn.apply(way * value)
                    continue
                origin = origin + turn.apply(at)
                turn = turn * Rotation.from_rotvec(way * value)
                origin = origin - turn.apply(at)
            places.append([*origin, *turn.as_matrix().ravel()])
        assert places == pytest.approx(np.array([places[0]] * 6), abs=1e-11)
