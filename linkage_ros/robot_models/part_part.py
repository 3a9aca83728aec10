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


"""A linkage that is to stand in a robot model."""

from __future__ import annotations

from typing import NamedTuple

from linkage_ros.dynamics.loads import Loads
from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics.closure import Closure


class Part(NamedTuple):
    """
    A linkage of a model.

    Attributes
    ----------
    closure
        The linkage.
    prefix
        What its links and joints have before their names.
    loads
        What acts on it; nothing where nobody says.
    wrapped
        Whether its angles are published in (−π, π].

    """

    closure: Closure
    prefix: str = ''
    loads: Loads | None = None
    wrapped: bool = False


class PartError(DefinitionError):
    """
    A linkage of which no model can be made.

    Parameters
    ----------
    number
        Of the linkage, from 0.
    where, reason, remedy
        As in `DefinitionError`.
    of_linkage
        Whether its own file is at fault, and not that of the scene.

    """

    def __init__(
        self, number: int, where: str, reason: str, remedy: str, *, of_linkage: bool = True
    ) -> None:
        self.number = number
        self.of_linkage = of_linkage
        super().__init__(where, reason, remedy)
