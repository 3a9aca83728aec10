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

"""A linkage that cannot be built is refused in one line: where, what is wrong, what would help."""

from __future__ import annotations

from copy import deepcopy

from linkage_ros.errors import DefinitionError, LinkageError
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.linkage import Linkage
import pytest

from .edits import Fields
from .malformed import FOUR_BAR, MALFORMED, SLIDER_CRANK


@pytest.mark.parametrize('name', MALFORMED)
def test_a_malformed_linkage_is_refused_with_its_key_and_a_remedy(name: str) -> None:
    sound, change, key, remedy = MALFORMED[name]
    linkage = deepcopy(sound)
    change(linkage)
    with pytest.raises(DefinitionError) as caught:
        Closure(Linkage(**linkage))
    error = caught.value
    assert error.where == key
    assert remedy in error.remedy
    assert str(error) == f'{error.where}: {error.reason}; {error.remedy}'
    assert '\n' not in str(error)
    assert isinstance(error, LinkageError)


@pytest.mark.parametrize('sound', [FOUR_BAR, SLIDER_CRANK], ids=['four-bar', 'slider-crank'])
def test_what_the_table_makes_malformed_is_sound_before(sound: Fields) -> None:
    Closure(Linkage(**deepcopy(sound)))


def test_links_may_stand_in_any_order_and_bear_any_names() -> None:
    expected = Closure(Linkage(**deepcopy(FOUR_BAR))).position(1.0).joints
    turned = deepcopy(FOUR_BAR)
    turned['links'] = dict(reversed(list(turned['links'].items())))
    assert Closure(Linkage(**turned)).position(1.0).joints == expected


def test_points_that_only_one_link_names_are_no_pins() -> None:
    expected = Closure(Linkage(**deepcopy(FOUR_BAR))).position(1.0).joints
    traced = deepcopy(FOUR_BAR)
    traced['links']['coupler']['P'] = (0.06, 0.03)
    traced['links']['rocker']['Q'] = (0.0, 0.0)
    assert Closure(Linkage(**traced)).position(1.0).joints == expected
