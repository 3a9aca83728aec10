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


"""
What holds two bodies of a URDF together: the joints between them, through frames without a body.

URDF gives a frame to whatever a joint leads to. Joints that follow each other at one place, with
nothing between them that can be seen or weighed, are one pin, or a pin in a slot::

    R+  a pin      P  a block on its line      P R+  a pin in a slot      R+ P  a rod in a swivel
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from re import fullmatch
from typing import NamedTuple

from linkage_ros.robot_models.planar import Planar, PlanarJoint

Symbol = tuple[tuple[tuple[str, float], ...], float]
"""An angle as a sum of joints with their factors, and a constant, in [rad]."""

_PATTERNS = 'R+|P|PR+|R+P'


class Chain(NamedTuple):
    """Joints from a body to another, with nothing between them."""

    parent: str
    child: str
    joints: tuple[PlanarJoint, ...]

    @property
    def kinds(self) -> str:
        """R for each turn, P for each slide."""
        return ''.join(joint.kind for joint in self.joints)

    @property
    def slide(self) -> PlanarJoint | None:
        """Return the slide of the chain, if it has one."""
        return next((joint for joint in self.joints if joint.kind == 'P'), None)


def chains(planar: Planar, marked: Collection[str], near: float) -> list[Chain]:
    """
    Return what holds the bodies together.

    Parameters
    ----------
    planar
        The URDF.
    marked
        Bodies with something at which a loop closes: they stay.
    near
        What places may be apart by and be one, in [m].

    """
    hung: dict[str, list[PlanarJoint]] = {}
    for joint in planar.joints:
        hung.setdefault(joint.parent, []).append(joint)

    def grown(start: PlanarJoint) -> Iterator[tuple[PlanarJoint, ...]]:
        """Yield the chain from a joint on, longer and longer."""
        found = [start]
        yield tuple(found)
        while True:
            body = found[-1].child
            onward = hung.get(body, [])
            if body in planar.bodied or body in marked or len(onward) != 1:
                return
            if abs(onward[0].place) > near:
                return
            found.append(onward[0])
            yield tuple(found)

    made, ahead = [], [planar.root]
    for body in ahead:
        for joint in hung.get(body, []):
            whole = [
                found
                for found in grown(joint)
                if fullmatch(_PATTERNS, ''.join(each.kind for each in found))
            ]
            made.append(Chain(body, whole[-1][-1].child, whole[-1]))
            ahead.append(made[-1].child)
    return made


def symbols(planar: Planar) -> dict[str, Symbol]:
    """Return the angle of every body as a sum of joints."""
    found: dict[str, Symbol] = {planar.root: ((), 0.0)}
    for joint in planar.joints:
        found[joint.child] = found[joint.parent]
        if joint.kind == 'R':
            found[joint.child] = plus(found[joint.parent], joint)
    return found


def plus(symbol: Symbol, joint: PlanarJoint) -> Symbol:
    """Return the angle behind a joint that turns."""
    terms: Mapping[str, float] = dict(symbol[0])
    sign = joint.axis.real
    factor = sign * (joint.multiplier if joint.mimics else 1.0)
    name = joint.mimics or joint.name
    more = {**terms, name: terms.get(name, 0.0) + factor}
    constant = symbol[1] + (sign * joint.offset if joint.mimics else 0.0)
    return tuple(sorted((each, of) for each, of in more.items() if of)), constant
