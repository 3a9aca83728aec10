# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What `make test` takes of many cases is spread, and has every value as soon as it can."""

from itertools import product

import pytest

from .sampling import choose_covering


@pytest.mark.parametrize('sizes', [(21,), (7, 3), (4, 5, 6), (20, 5, 3)])
def test_covering_sample_takes_every_value_and_no_case_twice(sizes):
    cases = [dict(enumerate(values)) for values in product(*map(range, sizes))]
    assert len(choose_covering(cases, len(cases) + 1)) == len(cases)
    chosen = [cases[index] for index in choose_covering(cases, max(sizes))]
    for axis, size in enumerate(sizes):
        assert len({case[axis] for case in chosen}) == size
    pairs = {tuple(case.items()) for case in chosen}
    assert len(pairs) == len(chosen)


def test_small_covering_sample_is_spread():
    chosen = sorted(choose_covering([{'name': index} for index in range(100)], 5))
    assert max(b - a for a, b in zip([0, *chosen], [*chosen, 99], strict=True)) < 40


def test_covering_sample_of_size_0_is_empty():
    assert choose_covering([{}], 0) == set()
