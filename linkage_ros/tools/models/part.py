# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Linkages as parts of a robot model, of a scene too, and the names of frames and joints there."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

from linkage_ros.description import Scene
from linkage_ros.dynamics import Loads
from linkage_ros.errors import DefinitionError, quote
from linkage_ros.kinematics import Closure, Linkage, SpaceLinkage
from linkage_ros.names import free_name


class ModelPart(NamedTuple):
    """A linkage of a model, whose links and joints get a prefix; wrapped angles are in (−π, π]."""

    closure: Any  # A PlanarClosure; for a URDF also a SpaceClosure
    prefix: str = ''
    loads: Loads | None = None
    wrapped: bool = False


class PartError(DefinitionError):
    """
    A linkage, by its number from 0, that cannot be written as a model; see `DefinitionError`.

    ``of_linkage`` tells whether its own file is at fault, not the scene's.
    """

    def __init__(
        self, number: int, where: str, reason: str, remedy: str, *, of_linkage: bool = True
    ) -> None:
        self.number = number
        self.of_linkage = of_linkage
        super().__init__(where, reason, remedy)


class ModelNames:
    """
    The names of a model of one or more linkages.

    Links, and joints with a name in messages, keep their names, after the linkage's prefix. Other
    items get a free name, with a number if needed.
    """

    def __init__(self) -> None:
        self._frames: set[str] = set()
        self._joints: set[str] = set()
        self._count = 0

    def add_linkage(self, prefix: str, linkage: Linkage | SpaceLinkage) -> PrefixedNames:
        """
        Return the names of one of its linkages; call it for all linkages before using any.

        A PartError says that two linkages lead to the same name.
        """
        joints: Iterable[str] = (
            linkage.pair_joints if isinstance(linkage, SpaceLinkage) else linkage.named_joints
        )
        links = linkage.link_names
        for kind, taken, names in (('link', self._frames, links), ('joint', self._joints, joints)):
            for name in names:
                if prefix + name in taken:
                    raise PartError(
                        self._count,
                        'name',
                        f'a second linkage has a {kind} {quote(prefix + name)} with it',
                        'give one of them another name',
                        of_linkage=False,
                    )
            taken |= {prefix + name for name in names}
        self._count += 1
        return PrefixedNames(prefix, self)

    def free_frame(self, name: str) -> str:
        """Return a free name for a frame, similar to this one."""
        return _take_name(name, self._frames)

    def free_joint(self, name: str) -> str:
        """Return a free name for a joint, similar to this one."""
        return _take_name(name, self._joints)


class PrefixedNames:
    """The names of one linkage in a model."""

    def __init__(self, prefix: str, names: ModelNames) -> None:
        self.prefix = prefix
        self._names = names

    def own_name(self, name: str) -> str:
        """Return the name of a link, or of a joint with a name in messages."""
        return self.prefix + name

    def free_frame(self, name: str) -> str:
        """Return a free name for a frame, similar to this one."""
        return self._names.free_frame(self.prefix + name)

    def text_on(self, name: str, link: str) -> str:
        """Return NAME_on_LINK, with both names as in the model."""
        return f'{self.prefix}{name}_on_{self.prefix}{link}'

    def frame_on(self, name: str, link: str) -> str:
        """Return a free name for a frame, similar to NAME_on_LINK."""
        return self._names.free_frame(self.text_on(name, link))

    def free_joint(self, name: str) -> str:
        """Return a free name for a joint, similar to this one."""
        return self._names.free_joint(self.prefix + name)


def prefix_names(
    linkages: Sequence[tuple[str, Linkage | SpaceLinkage]],
) -> tuple[ModelNames, list[PrefixedNames]]:
    """Return the names of a model and of each of its linkages, given with their prefixes."""
    names = ModelNames()
    return names, [names.add_linkage(prefix, linkage) for prefix, linkage in linkages]


def _take_name(name: str, taken: set[str]) -> str:
    free = free_name(name, taken)
    taken.add(free)
    return free


Write = Callable[[str, Sequence[ModelPart]], bytes]
"""Writes the robot model of some linkages, with a name."""


def make_scene_model(scene: Scene, closures: Sequence[Closure], write: Write) -> bytes:
    """
    Return the robot model of a scene, with joint names as in its messages.

    The closures have the deviations of their parts; ``write`` is `urdf_model` or the writer of
    MJCF. A FileError with a remedy is raised if a linkage cannot be a robot model.
    """
    parts = [
        ModelPart(closure, scene_linkage.prefix, scene_linkage.loads, scene.wrapped)
        for scene_linkage, closure in zip(scene.linkages, closures, strict=True)
    ]
    try:
        return write(scene.name, parts)
    except PartError as error:
        scene_linkage = scene.linkages[error.number]
        content = scene_linkage.linkage_content if error.of_linkage else scene_linkage.content
        raise content.locate_error(error) from None
