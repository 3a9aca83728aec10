# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A dyad that closes in two ways, one on each side."""

from __future__ import annotations

from copy import copy
from typing import Any

from linkage_ros.kinematics.step import Step


class TwoSided(Step):
    """A dyad that closes in two ways; its sign, +1 or −1, is its assembly."""

    __slots__ = ('_sign',)

    has_transmission_angle = True

    def __init__(self, sign: int) -> None:
        self._sign = float(sign)

    @property
    def sign(self) -> int:
        """Return the assembly, +1 or −1."""
        return int(self._sign)

    def with_sign(self, sign: int) -> Any:
        """Return the same dyad in the assembly of a sign."""
        if sign == self._sign:
            return self
        mirrored = copy(self)
        TwoSided.__init__(mirrored, sign)
        return mirrored
