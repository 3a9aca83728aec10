# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""One closure from several threads, and its copies: from processes, by pickle and by copy."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
import copy
from functools import partial
import multiprocessing
import pickle
import sys
from threading import Barrier, Thread

import linkage_ros as lr
from linkage_ros.description import parse_yaml, read_closure
from linkage_ros.kinematics import Status, usual_inputs
import numpy as np
import pytest

from .test_gallery import KINDS

LIMITED = b'four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1, input: {limits: [-0.5, 0.5]}}'


def limited():
    return read_closure(parse_yaml(LIMITED, 'x.yaml'))


CLOSURES = {
    **{name: partial(lr.load, name) for name in KINDS},
    'limited': limited,
}

COPIES = {
    'copy': copy.copy,
    'deepcopy': copy.deepcopy,
    **{
        f'pickle {n}': lambda one, n=n: pickle.loads(pickle.dumps(one, n))
        # Before 2 an object without a dictionary cannot be pickled as it is.
        for n in (0, 2, pickle.HIGHEST_PROTOCOL)
    },
}


def inputs_of(closure):
    return [0.1] if closure.bounds else list(usual_inputs(closure))


def motion(closure, position=None):
    """Return position, velocity and acceleration at one state, as plain numbers."""
    position = position or closure.position(*inputs_of(closure))
    ones = [1.0] * len(closure.input_names)
    velocity = closure.velocity(position, *ones)
    acceleration = closure.acceleration(position, velocity, *ones)
    return position.status, position.joints, velocity.joints, acceleration.joints


def use(closure):
    """Build all that is built at its first use."""
    closure.solve(*([x] * 3 for x in inputs_of(closure)), rates=[1.0] * len(closure.input_names))
    closure.compile_linkage(2)
    _ = closure.input_ranges, closure.singular_inputs, closure.link_frames
    motion(closure)


USED = ('four_bar', 'jansen_leg', 'class_3', 'limited')
CASES = [*((name, False) for name in CLOSURES), *((name, True) for name in USED)]


@pytest.mark.sample(11)
@pytest.mark.parametrize('way', COPIES)
@pytest.mark.parametrize(('name', 'used'), CASES)
def test_copied_closure_gives_the_same_bits(name, used, way):
    """It takes the positions of its original, and the original takes those of the copy."""
    closure = CLOSURES[name]()
    if used:
        use(closure)
    other = COPIES[way](closure)
    assert type(other) is type(closure)
    assert (other.name, other.linkage) == (closure.name, closure.linkage)
    position, expected = closure.position(*inputs_of(closure)), motion(closure)
    assert motion(other) == expected
    assert motion(other, position) == expected
    assert motion(closure, other.position(*inputs_of(closure))) == expected
    if closure.bounds:
        assert other.position(0.9).status is Status.LIMITED


@pytest.mark.parametrize('way', COPIES)
def test_copied_results_keep_their_closure(way):
    closure = lr.load('class_3')
    position = closure.position(*usual_inputs(closure))
    velocity = closure.velocity(position, 1.0)
    found = COPIES[way]([position, velocity, closure.acceleration(position, velocity, 1.0)])
    assert [one.joints for one in found] == list(motion(closure)[1:])
    assert found[0].status is Status.CLOSED
    assert motion(found[0].closure, found[0]) == motion(closure)


def test_copied_closure_refuses_positions_of_another_linkage():
    other = lr.load('jansen_leg').position(1.0)
    with pytest.raises(TypeError, match='is not from'):
        copy.deepcopy(lr.load('four_bar')).velocity(other, 1.0)


def many(calls, repeat):
    """Call functions at once, each ``repeat`` times; return their results, or raise."""
    count = repeat * len(calls)
    barrier = Barrier(count)
    with ThreadPoolExecutor(count) as pool:
        futures = [
            pool.submit(lambda c=call: barrier.wait() is not None and c())
            for call in calls
            for _ in range(repeat)
        ]
        return [future.result(120.0) for future in futures]


@pytest.fixture
def busy():
    """Let threads take turns as often as they can."""
    usual = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(usual)


@pytest.mark.sample(2)
@pytest.mark.usefixtures('busy')
@pytest.mark.parametrize('name', ['four_bar', 'excavator_bucket', 'jansen_leg'])
def test_concurrent_first_solutions_are_equal(name):
    expected = lr.load(name).solve(np.linspace(0.0, 6.0, 50))
    for _ in range(10):
        closure = lr.load(name)
        for found in many([lambda c=closure: c.solve(np.linspace(0.0, 6.0, 50))], 4):
            for one, other in zip(found, expected, strict=True):
                np.testing.assert_array_equal(one, other)


@pytest.mark.usefixtures('busy')
@pytest.mark.parametrize('derivatives', [(0, 1, 2)])
def test_concurrent_threads_compile_each_order_once(derivatives):
    for _ in range(20):
        closure = lr.load('four_bar')
        calls = [lambda d=d, c=closure: (d, c.compile_linkage(d)) for d in derivatives]
        found = many(calls, 3)
        assert all(one.derivatives == asked for asked, one in found)
        assert len({id(one) for _, one in found}) == len(derivatives)


@pytest.mark.usefixtures('busy')
def test_concurrent_first_uses_give_equal_results():
    """Also a branch, which is followed farther on demand."""
    expected = motion(lr.load('class_3'))
    for _ in range(3):
        closure = lr.load('class_3')
        calls = [
            lambda c=closure: motion(c),
            lambda c=closure: c.input_ranges and motion(c),
            lambda c=closure: c.solve([1.0]) and motion(c),
            lambda c=closure: c.singular_inputs is not None and motion(c),
            lambda c=closure: c.compile_linkage(1) and motion(c),
        ]
        assert many(calls, 2) == [expected] * 10


def test_process_forked_during_a_build_can_build():
    """A lock that another thread holds is never released in a forked process."""
    closure = lr.load('class_3')
    thread = Thread(target=closure.position, args=usual_inputs(closure))
    thread.start()
    context = multiprocessing.get_context('fork')
    for _ in range(3):
        process = context.Process(target=lr.load('jansen_leg').solve, args=([1.0],))
        process.start()
        process.join(60.0)
        assert process.exitcode == 0
    thread.join()
