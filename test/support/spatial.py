# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Linkages that lie in one plane, solved in space all the same."""

from __future__ import annotations

from unittest import mock

from linkage_ros import load

_IN_PLANE = 'linkage_ros.kinematics.space.one_plane.linkage_in_plane'


def load_in_space(*given):
    """Return what `load` does, as a closure in space."""
    with mock.patch(_IN_PLANE, return_value=None):
        return load(*given)
