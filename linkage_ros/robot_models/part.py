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

"""Names of frames and joints in a robot model: those of links and messages, and free ones."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

from linkage_ros.dynamics.loads import Loads
from linkage_ros.errors import DefinitionError, quoted
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.linkage import Linkage
from linkage_ros.robot_models.orientation import named_joints

# A linkage that is to stand in a robot model.


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


class Names:
    """
    The names of a model that one or more linkages stand in.

    What links and messages name is named so, with the linkage's prefix; whatever else there is
    gets a name that is free, with a number where it has to.
    """

    def __init__(self) -> None:
        self._frames: set[str] = set()
        self._joints: set[str] = set()
        self._count = 0

    def of(self, prefix: str, linkage: Linkage) -> PrefixedNames:
        """
        Return the names of one of its linkages; all are to be asked for before any is used.

        Raises
        ------
        PartError
            Where two linkages come to the same name.

        """
        for kind, taken, found in (
            ('link', self._frames, linkage.links),
            ('joint', self._joints, named_joints(linkage)),
        ):
            for name in found:
                if prefix + name in taken:
                    raise PartError(
                        self._count,
                        'name',
                        f'a second linkage has a {kind} {quoted(prefix + name)} with it',
                        'give one of them another name',
                        of_linkage=False,
                    )
            taken |= {prefix + name for name in found}
        self._count += 1
        return PrefixedNames(prefix, self)

    def frame(self, name: str) -> str:
        """Return a free name for a frame, like this one."""
        free = free_name(name, self._frames)
        self._frames.add(free)
        return free

    def joint(self, name: str) -> str:
        """Return a free name for a joint, like this one."""
        free = free_name(name, self._joints)
        self._joints.add(free)
        return free


class PrefixedNames:
    """The names of one linkage in a model."""

    def __init__(self, prefix: str, names: Names) -> None:
        self.prefix = prefix
        self._names = names

    def own(self, name: str) -> str:
        """Return the name of a link, or of a joint that messages name."""
        return self.prefix + name

    def frame(self, name: str) -> str:
        """Return a free name for a frame, like this one."""
        return self._names.frame(self.prefix + name)

    def text_on(self, name: str, link: str) -> str:
        """Return NAME_on_LINK, both as they are named here."""
        return f'{self.prefix}{name}_on_{self.prefix}{link}'

    def on(self, name: str, link: str) -> str:
        """Return a free name for a frame, like NAME_on_LINK."""
        return self._names.frame(self.text_on(name, link))

    def joint(self, name: str) -> str:
        """Return a free name for a joint, like this one."""
        return self._names.joint(self.prefix + name)


def prefixed(linkages: Sequence[tuple[str, Linkage]]) -> tuple[Names, list[PrefixedNames]]:
    """Return the names of a model and of each of its linkages, given with their prefixes."""
    names = Names()
    return names, [names.of(prefix, linkage) for prefix, linkage in linkages]


def free_name(name: str, taken: Collection[str]) -> str:
    """Return a name that is not taken: this one, or with a number behind it."""
    free, number = name, 1
    while free in taken:
        number += 1
        free = f'{name}_{number}'
    return free
