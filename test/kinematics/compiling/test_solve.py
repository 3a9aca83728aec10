# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Any linkage is solved for many states at once as it is for one: the same statuses and values."""

from dataclasses import replace
from importlib import import_module
from math import inf, nan, pi, tau
from pkgutil import iter_modules
import random
import re
import tracemalloc
from types import ModuleType
from typing import Any
import warnings

from campaigns.topologies.families import FAMILIES
from hypothesis import assume, given, settings, strategies as st
from linkage_ros.description import load
from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics import (
    Batch,
    Closure,
    CODES,
    Input,
    Linkage,
    Position,
    Ratio,
    RevoluteJoint,
    SlideJoint,
    Slider,
    Status,
    step,
    usual_inputs,
)
from linkage_ros.kinematics.compiling import BLOCK, Compiled, CompiledAnswer
import numpy as np
from numpy.typing import NDArray
import pytest

from ..defects import defect
from ..linkages import four_bar_linkage, Frame, inverted_slider_crank_linkage, placed, PLAIN
from ..test_gallery import closure_of, EXPECTED, KINDS

SEED = 20261122
"""Not that of the campaign of topologies."""

STATUSES = tuple(Status)
CLOSED, TOGGLED, OPEN, INDETERMINATE = (
    CODES[s] for s in (Status.CLOSED, Status.TOGGLE, Status.OPEN, Status.INDETERMINATE)
)

Array = NDArray[np.float64]
Inputs = tuple[tuple[float, float], ...]
"""For each input from where to where it is tried."""

GROUND = {'O': (0.0, 0.0), 'E': (0.9, 0.1)}
CRANKS = {'one': {'O': (0.0, 0.0), 'A': (0.4, 0.0)}, 'two': {'E': (0.0, 0.0), 'D': (0.3, 0.0)}}
DRIVEN = (Input('j1', 'ground', 'one'), Input('j2', 'ground', 'two'))
TWO_TURNS: Inputs = ((-4.0, 4.0), (-4.0, 4.0))


def slider_crank_linkage(
    a: float, b: float, offset: float, side: Any, frames: dict[str, Frame] | None = None
) -> Linkage:
    """Return a slider-crank: crank a, rod b, the line at an offset from the crankshaft."""
    frames = frames or {}
    turn = frames.get('ground', PLAIN)[2]
    plain = {
        'ground': {'O': (0.0, 0.0), 'G': (0.0, offset)},
        'crank': {'O': (0.0, 0.0), 'A': (a, 0.0)},
        'rod': {'A': (0.0, 0.0), 'B': (b, 0.0)},
    }
    direction = complex(np.exp(1j * turn))
    return Linkage(
        links={name: placed(frames.get(name, PLAIN), points) for name, points in plain.items()},
        inputs=(Input('crank_joint', 'ground', 'crank'),),
        assembly={'line': side},
        joints={'rod_joint': RevoluteJoint('crank', 'rod'), 'slide': SlideJoint('line')},
        sliders={'line': Slider('B', 'ground', 'G', (direction.real, direction.imag))},
    )


# Cases that the gallery lacks: diagonals and rails between links that share no pin, two lines
# that cross, a link that a motor on another one turns, a motor within a dyad, change points that
# are not passed.
OTHERS: dict[str, tuple[Linkage, Inputs]] = {
    'arm on a crank that a ratio turns': (
        Linkage(
            links={
                'ground': {'O': (0.0, 0.0), 'D': (1.0, 0.0)},
                'crank': {'O': (0.0, 0.0), 'A': (0.2, 0.0), 'P': (0.1, 0.1)},
                'coupler': {'A': (0.0, 0.0), 'B': (0.9, 0.0)},
                'rocker': {'D': (0.0, 0.0), 'B': (0.6, 0.0)},
                'arm': {'P': (0.0, 0.0), 'E': (0.3, 0.0)},
            },
            inputs=(Input('theta', 'ground', 'crank'),), assembly={'B': 'left'},
            joints={
                'hinge': RevoluteJoint('crank', 'arm'), 'arm': RevoluteJoint('ground', 'arm'),
                'rocker': RevoluteJoint('ground', 'rocker'),
            },
            sliders={}, ratios={'hinge': Ratio('arm', 3.0)}
        ),
        ((-7.0, 7.0),),
    ),
    'rod in a swivel on two cranks': (
        Linkage(
            links={'ground': GROUND, **CRANKS, 'rod': {'A': (0.0, 0.0), 'T': (0.0, 0.05)}},
            inputs=DRIVEN, assembly={'swivel': 'ahead'},
            joints={'rod': RevoluteJoint('two', 'rod'), 'slide': SlideJoint('swivel')},
            sliders={'swivel': Slider('D', 'rod', 'T', (1.0, 0.2))}
        ),
        TWO_TURNS,
    ),
    'yoke on two cranks': (
        Linkage(
            links={'ground': GROUND, **CRANKS, 'yoke': {'U': (0.1, 0.0)}}, inputs=DRIVEN,
            assembly={}, joints={'stroke': SlideJoint('way'), 'slot': SlideJoint('slot')},
            sliders={
                'slot': Slider('A', 'yoke', 'U', (0.3, 1.0)),
                'way': Slider('U', 'two', 'D', (1.0, 0.5), 'yoke', 0.3),
            }
        ),
        TWO_TURNS,
    ),
    'pin in two slots': (
        Linkage(
            links={'ground': GROUND, **CRANKS, 'b1': {'P': (0.0, 0.0)}, 'b2': {'P': (0.1, 0.0)}},
            inputs=DRIVEN, assembly={},
            joints={'first': SlideJoint('s1'), 'second': SlideJoint('s2')},
            sliders={
                's1': Slider('P', 'one', 'A', (1.0, 0.5), 'b1'),
                's2': Slider('P', 'two', 'D', (0.0, 1.0), 'b2', 0.2),
            }
        ),
        TWO_TURNS,
    ),
    'pin in a slot of the crank and one of the ground': (
        Linkage(
            links={
                'ground': {'O': (0.0, 0.0), 'G': (0.1, 0.2)},
                'crank': {'O': (0.1, -0.2), 'S': (0.4, 0.1)}, 'b1': {'P': (0.0, 0.0)},
                'b2': {'P': (0.1, 0.0)},
            },
            inputs=(Input('crank_joint', 'ground', 'crank'),), assembly={},
            joints={'first': SlideJoint('s1'), 'second': SlideJoint('s2')},
            sliders={
                's1': Slider('P', 'crank', 'S', (1.0, 0.5), 'b1'),
                's2': Slider('P', 'ground', 'G', (0.0, 1.0), 'b2', 0.2),
            }
        ),
        ((-7.0, 7.0),),
    ),
    'arm on an arm': (
        Linkage(
            links={
                'ground': GROUND,
                'one': CRANKS['one'],
                'arm': {'A': (0.0, 0.0), 'T': (0.1, 0.3)},
                'rod': {'T': (0.0, 0.0), 'B': (0.5, 0.0)},
                'rocker': {'E': (0.0, 0.0), 'B': (0.45, 0.1)},
            },
            inputs=(DRIVEN[0], Input('elbow', 'arm', 'one')), assembly={'B': 'left'},
            joints={'rod': RevoluteJoint('arm', 'rod'), 'rocker': RevoluteJoint('one', 'rocker')},
            sliders={}
        ),
        TWO_TURNS,
    ),
    'motor within a dyad': (
        Linkage(
            links={
                'ground': GROUND, 'one': {'O': (0.0, 0.0), 'M': (0.5, 0.1)},
                'two': {'M': (0.1, 0.0), 'B': (0.5, 0.0)},
                'rocker': {'E': (0.0, 0.0), 'B': (0.7, 0.0)},
            },
            inputs=(Input('elbow', 'one', 'two'),), assembly={'B': 'left'},
            joints={'one': RevoluteJoint('ground', 'one'), 'rod': RevoluteJoint('rocker', 'two')},
            sliders={}
        ),
        ((-4.0, 4.0),),
    ),
    'change points on a rocker': (
        Linkage(
            links={
                'ground': {'O': (0.0, 0.0), 'D': (1.0, 0.0), 'E': (1.1, 0.0)},
                'crank': {'O': (0.0, 0.0), 'A': (0.4, 0.0)},
                'coupler': {'A': (0.0, 0.0), 'B': (1.2, 0.0)},
                'rocker': {'D': (0.0, 0.0), 'B': (0.8, 0.0), 'C': (-0.3, 0.0)},
                'rod': {'C': (0.0, 0.0), 'F': (0.2, 0.0)},
                'arm': {'E': (0.0, 0.0), 'F': (0.4, 0.0)},
            },
            inputs=(Input('crank_joint', 'ground', 'crank'),), assembly={'B': 'left', 'F': 'left'},
            joints={'rod': RevoluteJoint('rocker', 'rod'), 'arm': RevoluteJoint('ground', 'arm')},
            sliders={}
        ),
        ((-4.0, 4.0),),
    ),
    'rod as long as the ground, on a rocker': (
        Linkage(
            links={
                'ground': {'O': (0.0, 0.0), 'D': (1.0, 0.0), 'E': (1.3, 0.0)},
                'crank': {'O': (0.0, 0.0), 'A': (0.4, 0.0)},
                'coupler': {'A': (0.0, 0.0), 'B': (1.2, 0.0)},
                'rocker': {'D': (0.0, 0.0), 'B': (0.8, 0.0), 'C': (0.2, 0.0)},
                'rod': {'C': (0.0, 0.0), 'T': (0.0, 0.1)},
            },
            inputs=(Input('crank_joint', 'ground', 'crank'),),
            assembly={'B': 'left', 'swivel': 'behind'},
            joints={'rod': RevoluteJoint('rocker', 'rod'), 'slide': SlideJoint('swivel')},
            sliders={'swivel': Slider('E', 'rod', 'T', (1.0, 0.0))}
        ),
        ((-4.0, 4.0),),
    ),
    'coupler and rocker short beside crank and ground': (
        four_bar_linkage((40.0, 3.0, 2.5, 41.0), 'left'), ((-0.2, 0.2),),
    ),
    'parallelogram on the right': (four_bar_linkage((0.04, 0.12, 0.04, 0.12), 'right'),
                                   ((-9.0, 9.0),)),
    'rod through the crankshaft': (inverted_slider_crank_linkage((0.2, 0.2, 0.0), 'ahead'),
                                   ((-9.0, 9.0),)),
    'rod as long as the crank': (slider_crank_linkage(0.2, 0.2, 0.0, 'ahead'), ((-9.0, 9.0),)),
    'nearly a parallelogram': (four_bar_linkage((0.04, 0.12, 0.0400002, 0.12), 'left'),
                               ((-9.0, 9.0),)),
    'rod nearly as long as the crank, by tolerance': (
        replace(
            slider_crank_linkage(0.2, 0.200001, 0.0, 'ahead'),
            nominal=slider_crank_linkage(0.2, 0.2, 0.0, 'ahead'),
        ),
        ((-9.0, 9.0),),
    ),
}  # fmt: skip

LIMITS = ((4e-15, 1), (4e-15, 2), (2e-14, 2))
"""
What positions, velocities and accelerations may differ by, and the power of 1/conditioning in it.

As a part of themselves, or of 1 where smaller, and of what they change by as the inputs do.
"""


RATES, PULLS = (1.3, 0.7, 0.4), (0.3, -0.4, 0.2)
EXCHANGED = 'four_bar from its rocker'

REACHES = {'ankle_motors': 0.5, 'hexapod': 0.01}
"""How far inputs go from the pose, of links in space that close only together."""


def case_of(name: str) -> tuple[Closure, Inputs]:
    """Return a linkage, and inputs that go a fifth beyond its range."""
    if name == EXCHANGED:
        return closure_of('four_bar').driven_by('rocker_joint', branch=2), ((0.7, 2.5),)
    if name in REACHES:
        closure, reach = load(name), REACHES[name]
        return closure, tuple((x - reach, x + reach) for x in closure.linkage.pose.inputs)
    if name in OTHERS:
        linkage, inputs = OTHERS[name]
        return Closure(linkage), inputs
    low, high = (np.atleast_1d(end) for end in EXPECTED[f'{name}.yaml']['range'])
    beyond = 0.2 * (high - low)
    return closure_of(name), tuple(zip(low - beyond, high + beyond, strict=True))


def samples(inputs: Inputs, count: int) -> list[Array]:
    rng = np.random.default_rng(count)
    return [rng.uniform(low, high, count) for low, high in inputs]


def check(closure: Closure, inputs: list[Array], slenderness: float = 1.0) -> set[Status]:
    """Hold every state against the scalar closure within roundings; return the statuses met."""
    rates, pulls = ([*values, *values][: len(inputs)] for values in (RATES, PULLS))
    batch = closure.solve(*inputs, rates=rates, accelerations=pulls)
    for i, state in enumerate(zip(*(values.tolist() for values in inputs), strict=True)):
        position = closure.position(*state)
        code = CODES[position.status]
        found = [array[:, i] for array in batch[1:] if array is not None]
        if batch.status[i] != code:
            # Which float next to a limit is the last that closes, or toggles, may differ.
            near_by = {CODES[other.status] for other in neighbours(closure, state)}
            assert batch.status[i] in near_by, state
            continue
        status = position.status
        missing = [not status.has_pose, not status.has_rates, not status.has_rates]
        assert [bool(np.isnan(row).any()) for row in found] == missing, state
        assert [bool(np.isnan(row).all()) for row in found] == missing, state
        if not status.has_rates:
            continue
        turns = np.round((found[0] - position.joints) / tau) * closure.turning
        if turns.any():
            # Which float is the last before an angle jumps by a turn may differ likewise.
            jumps = np.ptp([other.joints for other in neighbours(closure, state)], axis=0)
            assert (jumps[turns != 0.0] > 6.0).all(), state
            found[0] = found[0] - turns * tau
        values = motion(closure, position, rates, pulls)
        near = max(closure.singularity_margin(position).conditioning, 1e-100) / slenderness
        step = [1e-7 * (1.0 + abs(x)) for x in state]
        beside = [
            closure.position(*(x + side * h for x, h in zip(state, step, strict=True)))
            for side in (-1.0, 1.0)
        ]
        slopes = [np.zeros(len(found[0]))] * 3
        if all(other.status is Status.CLOSED for other in beside):
            ends_of = zip(*(motion(closure, p, rates, pulls) for p in beside), strict=True)
            slopes = [np.abs(end - begin) / 2e-7 for begin, end in ends_of]
            # Between the two an angle may jump by a turn.
            slopes[0] = np.minimum(slopes[0], np.abs(tau / 2e-7 - slopes[0]))
        for one, other, slope, (limit, power) in zip(found, values, slopes, LIMITS, strict=True):
            size = (np.maximum(1.0, np.abs(other).max()) / near**power + slope.max()) * limit
            assert np.abs(one - other).max() <= size, state
    return {STATUSES[code] for code in set(batch.status.tolist())}


def motion(
    closure: Closure, position: Position, rates: list[float], pulls: list[float]
) -> list[Array]:
    """Return values, rates and accelerations of the joints at a closed position."""
    velocity = closure.velocity(position, *rates)
    acceleration = closure.acceleration(position, velocity, *pulls)
    return [np.array(found.joints) for found in (position, velocity, acceleration)]


def neighbours(closure: Closure, state: tuple[float, ...]) -> list[Position]:
    """Return positions within rounding of a state."""
    return [
        closure.position(*(x + side * (1.0 + abs(x)) for x in state))
        for side in (-1e-14, -1e-15, 1e-15, 1e-14)
    ]


@pytest.mark.sample(5)
@pytest.mark.parametrize('name', [*KINDS, *OTHERS, EXCHANGED])
def test_batch_equals_single_states_inside_and_beyond_the_range(name):
    closure, inputs = case_of(name)
    met = check(closure, samples(inputs, 500))
    assert Status.CLOSED in met
    (interval, *_) = closure.input_ranges or (None,)
    if interval is not None and not interval.is_whole and name != 'class_3':
        # A parallelogram closes everywhere, also beyond the limits of a gripper's motor.
        assert (Status.LIMITED if name == 'gripper' else Status.OPEN) in met


@pytest.mark.parametrize('name', REACHES)
def test_batch_equals_single_states_of_iterated_spatial_linkages(name):
    closure, inputs = case_of(name)
    assert check(closure, samples(inputs, 100)) == {Status.CLOSED}
    (low, high), *others = inputs
    # One input goes beyond the reach of the links.
    beyond = [((low + high) / 2.0 - 0.9, (low + high) / 2.0 + 0.9), *others]
    assert {Status.CLOSED} < check(closure, samples(beyond, 30))


@pytest.mark.sample(3)
@pytest.mark.parametrize('family', FAMILIES)
def test_batch_equals_single_states_of_random_linkages(family):
    topology = FAMILIES[family].make(random.Random(f'{SEED}/{family}/0'))
    closure = Closure(topology.linkage)
    rng = np.random.default_rng(SEED)
    inputs = [
        at + 4.0 * step * rng.uniform(-1.0, 1.0, 60) ** 3
        for at, step in zip(topology.start, topology.step, strict=True)
    ]
    assert Status.CLOSED in check(closure, inputs, slenderness=3.0)


@pytest.mark.parametrize('name', [*KINDS, *REACHES])
def test_batch_rarely_falls_back_to_the_plain_steps(name, monkeypatch):
    closure, inputs = case_of(name)
    asked = []
    answer_of = Compiled.__call__

    def answer(linkage: Compiled, *numbers: float) -> CompiledAnswer:
        asked.append(numbers)
        return answer_of(linkage, *numbers)

    monkeypatch.setattr(Compiled, '__call__', answer)
    batch = closure.solve(*samples(inputs, 10_000), rates=[1.0] * len(inputs))
    assert len(asked) < 100
    assert (batch.status == CLOSED).sum() > 5000


def test_cases_cover_every_kind_of_step():
    steps = [step for name in (*KINDS, *OTHERS, EXCHANGED) for step in case_of(name)[0].steps]
    diagonals, dyads, iterated_step, rail = (
        import_module(f'linkage_ros.kinematics.{name}')
        for name in ('plane.diagonals', 'plane.dyads', 'iterated.iterated_step', 'plane.rail')
    )
    kinds = [
        import_module(f'{dyads.__name__}.{name}') for _, name, _ in iter_modules(dyads.__path__)
    ]
    assert {type(step) for step in steps} == classes_with('close', step, iterated_step, *kinds)
    parts = [one.span for one in steps if one.span is not one]
    wanted = classes_with('diagonal_at', diagonals) | classes_with('pin_at', rail)
    assert {type(part) for part in parts if part is not None} == wanted


def classes_with(method: str, *modules: ModuleType) -> set[type[Any]]:
    return {
        one
        for module in modules
        for one in vars(module).values()
        if isinstance(one, type)
        and one.__module__ == module.__name__
        and getattr(one, method, None) not in (None, getattr(step.Step, method, None))
        and not getattr(one, '_is_protocol', False)
    }


length = st.floats(0.05, 5.0)
crank_angles = st.lists(st.floats(-20.0, 20.0), min_size=1, max_size=12)
odd = st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(-pi, pi))


@st.composite
def linkages(draw: Any) -> tuple[Linkage, float]:
    """Draw a four-bar, a slider-crank or an inverted one, in odd frames, and its slenderness."""
    names = ('ground', 'crank', 'coupler', 'rocker', 'rod')
    frames = {name: draw(odd) for name in names} if draw(st.booleans()) else None
    lengths = a, b, c, d = draw(length), draw(length), draw(length), draw(length)
    slenderness = max(lengths) / min(lengths)
    kind = draw(st.sampled_from(('four-bar', 'slider-crank', 'inverted slider-crank')))
    if kind == 'four-bar':
        side = draw(st.sampled_from(('left', 'right')))
        return four_bar_linkage(lengths, side, frames), slenderness
    side = draw(st.sampled_from(('ahead', 'behind')))
    offset = draw(st.sampled_from((0.0, 0.3 * c, -0.3 * c)))
    if kind == 'slider-crank':
        return slider_crank_linkage(a, b, offset, side, frames), slenderness
    return inverted_slider_crank_linkage((a, d, offset), side, frames, along=0.1), slenderness


@settings(derandomize=True)
@given(linkages(), crank_angles)
def test_batch_equals_single_states_of_one_loop_linkages(drawn, angles):
    linkage, slenderness = drawn
    try:
        closure = Closure(linkage)
    except DefinitionError:
        assume(False)
    check(closure, [np.array(angles)], slenderness)


@pytest.mark.parametrize('name', ['four_bar', 'jansen_leg', 'elliptic_trammel', 'five_bar'])
def test_batch_results_do_not_depend_on_block_boundaries(name):
    closure, limits = case_of(name)
    inputs = samples(limits, 2 * BLOCK + 77)
    rates = [1.3] * len(inputs)
    whole = closure.solve(*inputs, rates=rates)
    for part in (slice(0, 1), slice(BLOCK - 3, BLOCK + 4), slice(5, None)):
        found = closure.solve(*(values[part] for values in inputs), rates=rates)
        for one, other in zip(found, whole, strict=True):
            # A vector's last elements may be worked out by other instructions.
            np.testing.assert_allclose(one, other[..., part], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize('name', ['four_bar', 'five_bar', 'class_3', 'excavator_bucket'])
def test_batch_of_zero_states_returns_empty_arrays(name):
    closure, limits = case_of(name)
    joints = len(closure.linkage.joints)
    batch = closure.solve(*samples(limits, 0), rates=[1.0] * len(limits))
    assert batch.status.shape == (0,)
    assert all(array.shape == (joints, 0) for array in batch[1:])


def test_batch_solves_a_single_state_without_a_cell():
    batch = load('ankle_motors').solve(np.array([[3.5, -0.5]]), rates=[1.0, 0.0], derivatives=1)
    assert batch.status.tolist() == [CODES[load('ankle_motors').position(3.5, -0.5).status]]


def test_solve_accepts_rates_as_numbers_or_arrays():
    closure, _ = case_of('four_bar')
    phi = np.linspace(0.0, 6.0, 40)
    rates, pulls = np.linspace(-2.0, 3.0, 40), np.linspace(4.0, -1.0, 40)
    one = closure.solve(phi)
    assert one.status.dtype == np.uint8
    assert not one.status.any()
    for given_rates in (2.0, [2.0], (np.full(40, 2.0),), np.full((1, 40), 2.0)):
        two = closure.solve(phi, rates=given_rates)
        np.testing.assert_array_equal(two.positions, one.positions)
        np.testing.assert_allclose(two.velocities, 2.0 * one.velocities, rtol=1e-14)
        np.testing.assert_allclose(two.accelerations, 4.0 * one.accelerations, rtol=1e-13)
    varied = closure.solve(phi, rates=rates, accelerations=pulls)
    np.testing.assert_allclose(varied.velocities, rates * one.velocities, rtol=1e-13, atol=1e-14)
    expected = rates**2 * one.accelerations + pulls * one.velocities
    np.testing.assert_allclose(varied.accelerations, expected, rtol=1e-12, atol=1e-13)


def test_solve_broadcasts_a_scalar_input():
    closure, _ = case_of('five_bar')
    phi = np.linspace(1.0, 2.0, 30)
    one = closure.solve(phi, 0.5, rates=(1.0, 0.0))
    other = closure.solve(phi, np.full(30, 0.5), rates=(np.ones(30), 0.0), accelerations=(0, 0))
    for mine, theirs in zip(one, other, strict=True):
        np.testing.assert_array_equal(mine, theirs)


@pytest.mark.parametrize('name', ['four_bar', 'five_bar', 'ankle', 'ankle_motors', 'hexapod'])
def test_solve_accepts_one_array_of_input_columns(name):
    closure = load(name)
    count = len(closure.linkage.inputs)
    rng = np.random.default_rng(SEED)
    start = np.array(usual_inputs(closure))
    inputs, rates, accelerations = (
        start + 0.01 * rng.random((5, count)),
        *rng.random((2, 5, count)),
    )
    wanted = closure.solve(*inputs.T, rates=[*rates.T], accelerations=[*accelerations.T])
    found = closure.solve(inputs, rates=rates, accelerations=accelerations)
    for one, other in zip(found, wanted, strict=True):
        assert one.tobytes() == other.tobytes()
    for same in (2.0, [2.0]) if count == 1 else ([0.5 * n for n in range(count)],):
        found = closure.solve(inputs.tolist(), rates=same)
        wanted = closure.solve(*inputs.T, rates=same)
        assert found.velocities.tobytes() == wanted.velocities.tobytes()
    with pytest.raises(
        ValueError, match=f'^inputs: {count + 1} given; give {count}, one for each'
    ):
        closure.solve(np.zeros((4, count + 1)), derivatives=0)


def test_inverse_solve_accepts_one_column_of_inputs():
    inverse = load('four_bar').driven_by('rocker_joint', near=1.0)
    values = inverse.position(1.0).inputs[0] + np.linspace(0.0, 0.1, 4)
    wanted = inverse.solve(values)
    assert inverse.solve(values[:, None]).positions.tobytes() == wanted.positions.tobytes()


def test_solve_returns_none_for_derivatives_not_requested():
    for name in ('four_bar', 'whitworth_quick_return', 'class_3'):
        closure, limits = case_of(name)
        inputs = samples(limits, 50)
        whole = closure.solve(*inputs)
        for derivatives in (0, 1):
            batch = closure.solve(*inputs, derivatives=derivatives)
            assert [array is None for array in batch[2:]] == [derivatives < 1, True]
            for one, other in zip(batch, whole, strict=True):
                if one is not None:
                    np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize('name', ['four_bar', 'slider_crank'])
def test_solve_writes_results_into_given_arrays(name):
    closure, limits = case_of(name)
    inputs = samples(limits, 100)
    expected = closure.solve(*inputs)
    table = np.full((100, 7), 777.0)
    out = Batch(np.empty(100, np.uint8), table[:, :2].T, table[:, 2:4].T, table[:, 4:6].T)
    batch = closure.solve(*inputs, out=out)
    assert all(one is other for one, other in zip(batch, out, strict=True))
    for one, other in zip(batch, expected, strict=True):
        np.testing.assert_array_equal(one, other)
    assert (table[:, 6] == 777.0).all()
    # Rows that nothing is asked of are left alone, and missing ones are made.
    table.fill(777.0)
    part = closure.solve(*inputs, derivatives=1, out=out._replace(velocities=None))
    assert part.positions is out.positions
    assert part.accelerations is None
    np.testing.assert_array_equal(part.velocities, expected.velocities)
    assert (table[:, 2:] == 777.0).all()


def test_batch_marks_only_the_nan_states_indeterminate():
    for name in ('four_bar', 'slider_crank', 'class_3', 'jansen_leg', 'excavator_bucket'):
        closure, ((low, high),) = case_of(name)
        values = np.array([0.5 * (low + high), nan, inf, -inf, 0.5 * (low + high)])
        batch = closure.solve(values)
        assert batch.status.tolist() == [CLOSED, *[INDETERMINATE] * 3, CLOSED]
        for array in batch[1:]:
            assert np.isnan(array).tolist() == [[False, True, True, True, False]] * len(array)


def test_batch_toggle_has_a_position_and_no_rate():
    # Stretched: the bar of the trammel lies in the driven slot.
    closure, _ = case_of('elliptic_trammel')
    batch = closure.solve(np.array([0.12, 0.1, 0.13]))
    assert batch.status.tolist() == [TOGGLED, CLOSED, OPEN]
    for array, lost in zip(batch[1:], ([0, 0, 1], [1, 0, 1], [1, 0, 1]), strict=True):
        assert np.isnan(array).tolist() == [list(map(bool, lost))] * 2
    position = closure.position(0.12)
    assert batch.positions[:, 0].tolist() == pytest.approx(position.joints, abs=1e-15)


def test_batch_handles_parallel_and_coincident_slide_lines():
    linkage, _ = OTHERS['pin in two slots']
    sliders = {
        's1': Slider('P', 'one', 'A', (1.0, 0.0), 'b1'),
        's2': Slider('P', 'two', 'D', (2.0, 0.0), 'b2'),
    }
    links = {**linkage.links, 'ground': {'O': (0.0, 0.0), 'E': (0.9, 0.0)}}
    closure = Closure(replace(linkage, links=links, sliders=sliders))
    one, two = np.array([0.0, 0.3, pi, 0.3]), np.array([0.0, 0.3, pi, 0.2])
    batch = closure.solve(one, two, rates=(1.0, 1.0))
    assert batch.status.tolist() == [INDETERMINATE, OPEN, INDETERMINATE, CLOSED]
    assert check(closure, [one, two]) == {Status.INDETERMINATE, Status.OPEN, Status.CLOSED}


# Shorter ones than 2⁻⁵¹¹ m are refused.
@pytest.mark.parametrize('exponent', [-500, -300, 3, 900])
def test_length_unit_does_not_change_batch_bits(exponent):
    unit = 2.0**exponent
    phi = np.linspace(-3.0, 3.0, 50)
    for lengths in ((0.04, 0.12, 0.08, 0.1), (4.0, 2.0, 4.5, 5.0), (0.04, 0.12, 0.04, 0.12)):
        one, other = (
            Closure(four_bar_linkage(tuple(x * scale for x in lengths), 'left')).solve(phi)
            for scale in (1.0, unit)
        )
        for array, same in zip(one, other, strict=True):
            np.testing.assert_array_equal(array, same)


@pytest.mark.parametrize('name', [*KINDS, *OTHERS, EXCHANGED])
def test_solve_emits_no_numpy_warning(name):
    closure, limits = case_of(name)
    angles = np.array([0.0, -0.0, pi, 1e-310, -1e5, nan, inf, limits[0][0], limits[0][1]])
    with warnings.catch_warnings(), np.errstate(all='warn'):
        warnings.simplefilter('error')
        closure.solve(*[angles] * len(limits), rates=[1.0] * len(limits))


@pytest.mark.parametrize(
    ('name', 'inputs', 'more', 'text'),
    [
        ('four_bar', 2, {}, 'inputs: 2 given; give 1, one for each driven joint'),
        ('five_bar', 1, {}, 'inputs: 1 given; give 2, one for each driven joint'),
        ('five_bar', 2, {}, 'rates: give one for each of the 2 driven joints'),
        ('five_bar', 2, {'rates': 1.0}, 'rates: 1 given; give 2, one for each driven joint'),
        ('four_bar', 1, {'rates': [1.0, 2.0]}, 'rates: shapes (2,) do not broadcast to (5,)'),
        ('four_bar', 1, {'accelerations': np.ones(4)},
         'accelerations: shapes (4,) do not broadcast to (5,)'),
        ('four_bar', 1, {'derivatives': 3}, 'derivatives: 3 is not one of 0, 1, 2'),
        ('four_bar', 1, {'out': Batch(np.empty(5), np.empty((2, 5)))},
         'out.status: is float64 (5,), not uint8 (5,)'),
        ('four_bar', 1, {'out': Batch(np.empty(5, np.uint8), np.empty((5, 2)))},
         'out.positions: is float64 (5, 2), not float64 (2, 5)'),
    ],
)  # fmt: skip
def test_solve_refuses_wrong_argument_shapes_in_one_line(name, inputs, more, text):
    with pytest.raises(ValueError, match=f'^{re.escape(text)}$'):
        case_of(name)[0].solve(*[np.ones(5)] * inputs, **more)


@pytest.mark.parametrize(
    ('arrays', 'text'),
    [
        ((np.ones(3), np.ones(4)), 'inputs: shapes (3,), (4,) do not broadcast to one (N,)'),
        ((1.0, 2.0), 'inputs: shapes (), () do not broadcast to one (N,)'),
        ((np.ones((2, 3)), 1.0), 'inputs: shapes (2, 3), () do not broadcast to one (N,)'),
    ],
)
def test_solve_refuses_input_arrays_of_different_lengths(arrays, text):
    with pytest.raises(ValueError, match=f'^{re.escape(text)}$'):
        case_of('five_bar')[0].solve(*arrays, rates=(1.0, 1.0))


def test_solve_memory_does_not_grow_with_the_states():
    for name in ('four_bar', 'klann_leg', 'slider_crank'):
        closure, limits = case_of(name)
        peaks = []
        for blocks in (2, 20):
            inputs = samples(limits, blocks * BLOCK)
            out = closure.solve(*inputs)
            tracemalloc.start()
            closure.solve(*inputs, out=out)
            peaks.append(tracemalloc.get_traced_memory()[1])
            tracemalloc.stop()
        # Of 18 blocks more, an array of each would be 1.2 MB.
        assert peaks[1] < peaks[0] + 100_000


@pytest.mark.sample(1)
@pytest.mark.parametrize('name', ['rail_on_coupler', 'standing_rpr'])
def test_batch_solves_rails_on_moving_and_non_turning_links(name):
    closure = defect(name)
    (interval,) = closure.input_ranges
    check(closure, [np.linspace(interval.lowest, interval.highest, 97)[1:-1]])
