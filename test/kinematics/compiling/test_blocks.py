# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Compiled linkages in Python and in numpy: their bits, and what they ask."""

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from math import inf, nan, nextafter, pi
from pathlib import Path
import random
import re
from typing import Any

from campaigns.topologies.families import FAMILIES
from linkage_ros.description import read_linkage, read_yaml
from linkage_ros.dynamics import Loads, Mechanics
from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics import Closure, Limits, sin, sqrt, Status
from linkage_ros.kinematics.compiling import (
    ArrayForm,
    BlockFunction,
    compile_line,
    Compiled,
    python_source,
    Tape,
    TracedMotion,
)
import numpy as np
import pytest

from ...support.sampling import sample_count

# Code of a path for arrays: what it computes, what it keeps, and how it writes constants.


def written(root: object, condition: object = True, **given: int) -> BlockFunction:
    form = ArrayForm(given)
    held = form.rewrite_number(condition)
    return BlockFunction(['q0', 'w0'], ['q0'], [form.rewrite_number(root)], held)


def values_of(function: BlockFunction, x: np.ndarray, rate: float = 1.0) -> np.ndarray:
    found = np.empty_like(x)
    rows = np.empty((function.rows, len(x)))
    function([x, rate], [found], rows, np.empty((function.masks, len(x)), bool))
    return found


def passes(function: BlockFunction) -> int:
    return function.source.count('out=')


def test_compiler_omits_conditions_that_value_bounds_decide():
    tape = Tape()
    sine = sin(tape.add_input('q0', 0.3))
    assert written(sine.operation, (sine * sine + 0.5 > 0.4).operation).masks == 0
    assert written(sine.operation, (sine * sine + 0.5 > 0.6).operation).masks > 0
    for part in (sine + 2.0, sine - 2.0):
        assert written(sine.operation, (part * part > 0.9).operation).masks == 0
        assert written(sine.operation, (part * part > 1.1).operation).masks > 0


def test_compiler_merges_constants_and_skips_products_with_zero():
    tape = Tape()
    x, rate = tape.add_input('q0', 0.3), tape.add_input('w0', 1.25)
    function = written((2.0 * (3.0 * x) / 4.0).operation)
    assert passes(function) == 1
    assert values_of(function, np.array([2.0])).tolist() == [3.0]
    assert passes(written((rate * (x * x + 1.0)).operation, w0=0)) == 0
    assert passes(written((rate * (x * x)).operation, w0=1)) == 1


@pytest.mark.parametrize('constant', [0.5, np.float64(0.5), -0.0, inf, -inf, nan, 3])
def test_compiler_writes_every_constant_bit_for_bit(constant):
    found = values_of(written(constant), np.zeros(4))
    np.testing.assert_array_equal(found, np.full(4, constant))
    assert np.signbit(found).all() == np.signbit(constant)


def test_compiled_block_reuses_rows_of_values_no_longer_needed():
    tape = Tape()
    total = x = tape.add_input('q0', 0.3)
    for k in range(30):
        total = sqrt(total + float(k)) * x
    assert written(total.operation).rows <= 2


# Compiled code agrees with the plain steps to the last bit, and computes nothing unasked.


LINKAGES = sorted((Path(__file__).parents[3] / 'config' / 'linkages').glob('*.yaml'))
ITERATED = {'class_3'}
STATES = sample_count(10_000, 3_000)
"""Of a linkage of the gallery; one that is iterated takes a hundred times as long for each."""


@cache
def closure_of(name: str) -> Closure:
    (path,) = (path for path in LINKAGES if path.stem == name)
    return Closure(read_linkage(read_yaml(path)[0]))


def states(closure: Closure, count: int) -> Iterator[tuple[float, ...]]:
    """Yield inputs over all ranges and a little beyond, with rates and accelerations."""
    rng = random.Random(7)
    driven = len(closure.linkage.inputs)
    ranges = closure.input_ranges
    low = min((r.lowest for r in ranges), default=-pi)
    high = max((r.highest for r in ranges), default=pi)
    beyond = 0.02 * (high - low)
    for _ in range(count):
        inputs = [rng.uniform(low - beyond, high + beyond) for _ in range(driven)]
        yield (*inputs, *(rng.uniform(-3.0, 3.0) for _ in range(2 * driven)))


def answered(call: Any, *numbers: float) -> str:
    """Return all bits of an answer, the sign of each zero too; or the error."""
    try:
        return repr(call(*numbers))
    except ValueError as error:
        return f'{type(error).__name__}: {error}'


@pytest.mark.sample(3)
@pytest.mark.parametrize('name', [path.stem for path in LINKAGES])
def test_compiled_gallery_linkages_equal_the_steps_bit_for_bit(name):
    closure = closure_of(name)
    compiled = Compiled(closure, 2)
    closed = left = 0
    for numbers in states(closure, STATES // 100 if name in ITERATED else STATES):
        plain = compiled.run_interpreted(*numbers)
        assert repr(compiled(*numbers)) == repr(plain)
        if plain.status is Status.CLOSED:
            closed += 1
            left += compiled.fast(*numbers) is None
    assert closed
    assert left < 0.01 * closed, 'so many states leave the compiled way'


@pytest.mark.sample(8)
@pytest.mark.parametrize('family', FAMILIES)
def test_compiled_random_linkages_equal_the_steps_bit_for_bit(family):
    seen = set()
    for index in range(3):
        rng = random.Random(f'{family}/{index}')
        topology = FAMILIES[family].make(rng)
        try:
            closure = Closure(topology.linkage)
        except DefinitionError:  # it closes nowhere, or has two pins in one place
            continue
        iterated = any(step.follows_branch for step in closure.steps)
        compiled = Compiled(closure, 2)
        for _ in range(3 if iterated else 40):
            inputs = [start + rng.uniform(-1.0, 1.0) for start in topology.start]
            motion = [rng.uniform(-2.0, 2.0) for _ in range(2 * len(inputs))]
            plain = compiled.run_interpreted(*inputs, *motion)
            assert repr(compiled(*inputs, *motion)) == repr(plain)
            seen.add(plain.status)
    assert seen


SPECIAL = (0.0, -0.0, pi, -pi, 2 * pi, 0.5 * pi, -0.5 * pi, nextafter(pi, 4.0), 1e-300, 1e6, 1e300)


@pytest.mark.sample(7)
@pytest.mark.parametrize('name', [path.stem for path in LINKAGES if path.stem not in ITERATED])
def test_compiled_linkages_equal_the_steps_at_singular_inputs(name):
    closure = closure_of(name)
    driven = len(closure.linkage.inputs)
    compiled = Compiled(closure, 2)
    singular = [found.value for found in closure.singular_inputs]
    beside = [x for value in singular for x in (nextafter(value, -9.0), nextafter(value, 9.0))]
    for value in (*SPECIAL, *singular, *beside):
        for rate in (0.0, -0.0, 1.5):
            numbers = [value] * driven + [rate] * driven + [0.25] * driven
            assert answered(compiled, *numbers) == answered(compiled.run_interpreted, *numbers)


@pytest.mark.parametrize('wrong', [nan, inf, -inf])
@pytest.mark.parametrize('place', range(3))
def test_plain_steps_answer_inputs_that_are_not_finite(wrong, place):
    compiled = Compiled(closure_of('four_bar'), 2)
    numbers = [1.0, 2.0, 3.0]
    numbers[place] = wrong
    assert compiled.fast(*numbers) is None
    assert answered(compiled, *numbers) == answered(compiled.run_interpreted, *numbers)


def test_compiled_linkage_returns_limited_beyond_a_joint_limit():
    closure = closure_of('four_bar')
    joint = next(iter(closure.linkage.joints))
    at = closure.position(1.0).joints[0]
    limits = replace(closure.linkage.joints[joint], limits=Limits(at - 0.2, at + 0.2))
    linkage = replace(closure.linkage, joints={**closure.linkage.joints, joint: limits})
    compiled = Compiled(Closure(linkage), 1)
    found = {compiled(0.1 * i, 1.0).status for i in range(63)}
    assert found == {Status.CLOSED, Status.LIMITED}
    for i in range(63):
        assert repr(compiled(0.1 * i, 1.0)) == repr(compiled.run_interpreted(0.1 * i, 1.0))


def source(closure: Closure, derivatives: int, wanted: Any = None) -> str:
    compiled = Compiled(closure, derivatives, *([wanted] if wanted else []))
    return python_source(compiled.paths[0])[0]


def operations(text: str) -> int:
    return len(re.findall(r'[-+*/]|\b(?:sin|cos|sqrt|atan2)\b', text))


@pytest.mark.parametrize('name', ['four_bar', 'jansen_leg', 'andrews_squeezer', 'slider_crank'])
def test_compiled_line_omits_joints_and_derivatives_not_requested(name):
    closure = closure_of(name)

    def last(motion: TracedMotion) -> list[list[float]]:
        return [[motion.position.joints[-1]]]

    sizes = [operations(source(closure, 0, last))]
    sizes += [operations(source(closure, derivatives)) for derivatives in range(3)]
    assert sizes == sorted(sizes)
    assert len(set(sizes)) == len(sizes)
    assert 'w0' not in source(closure, 0)
    assert 'a0' not in source(closure, 1)


def test_compiled_joint_angle_costs_one_arc_tangent_more():
    closure = closure_of('four_bar')
    counts = [
        source(closure, 0, lambda motion, n=n: [motion.position.joints[:n]]).count('atan2(')
        for n in range(3)
    ]
    # The diagonal's direction and the coupler's; then the rocker's.
    assert counts == [0, 2, 3]


def test_simplified_operations_keep_their_bits():
    def done(x: float, y: float) -> list[float]:
        return [
            x + 0.0, 0.0 + x, x - 0.0, 0.0 - x, x * 1.0, 1.0 * x, x / 1.0, -1.0 * x, 0.0 - (-x),
            (0.0 + x) + 0.0, 0.0 + (0.0 + x), abs(x) + 0.0, (-x) + y, x + (-y), x - (-y),
            (x + y) + 0.0, 0.0 + (x - y), 0.0 + (0.5 + x), abs(abs(x)), x - y, x * y,
            -x * y, x * -y, -x * -y, -1.0 * (-x), y + -x * y, y - x * (-y), 2.0 * -x, x - 2.0 * -y,
            -x / 7.0, 7.0 / -(x * x + 1.0), y - -x / 7.0,
        ]  # fmt: skip

    line = compile_line(done, (1.0, 2.0))
    values = (0.0, -0.0, 1.0, -1.5, 5e-324, -1e300, 3.0)
    for x in values:
        for y in values:
            expected = done(x, y)
            assert repr(line(x, y)) == repr((tuple(expected),))


def test_compiler_folds_negated_products_into_sums():
    tape = Tape()
    x, y = tape.add_input('x', 0.3), tape.add_input('y', 0.7)
    for one, other in (
        (x + -x * -y, x + x * y),
        (x - y * (-1.0 * x), x + x * y),
        (x + y / -x, x - y / x),
    ):
        assert one.operation is other.operation


@pytest.mark.parametrize('name', ['four_bar', 'slider_crank', 'watt_1', 'excavator_bucket'])
def test_compiled_equation_of_motion_equals_the_plain_steps(name):
    closure = closure_of(name)
    mechanics = Mechanics(closure, Loads(gravity=(0.5, -9.81), drive_inertia=1e-4))
    for value, *_ in states(closure, 500):
        assert repr(mechanics.motion_equation(value)) == repr(
            mechanics.motion_terms(closure.position(value))
        )


def test_compiled_line_returns_none_for_another_path():
    line = compile_line(lambda x: [x if x > 0.0 else -x], (1.0,))
    assert [line(2.0), line(-2.0)] == [((2.0,),), None]
