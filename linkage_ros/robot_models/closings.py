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
The pins that close the loops of a URDF, and what of it is in these loops.

Closed by pins that were asked for, and by frames that are named PIN_on_LINK.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from linkage_ros.errors import did_you_mean, FileError, listed, quoted
from linkage_ros.robot_models.urdf_robot import MOVING, UrdfFile

_LINE = '_line'


class Closing(NamedTuple):
    """
    Frames that are to meet.

    Attributes
    ----------
    name
        Of the pin or slider.
    frames
        Links of the URDF, two or more.
    line
        Whether the second need only be on the x axis of the first.

    """

    name: str
    frames: tuple[str, ...]
    line: bool = False


def find_closings(
    urdf: UrdfFile, asked: Sequence[tuple[str, str]]
) -> tuple[list[Closing], dict[str, str]]:
    """
    Return what closes the loops, and the frames that stand alone: points, with their names.

    Parameters
    ----------
    urdf
        The robot.
    asked
        Pairs of links whose origins are to meet.

    Raises
    ------
    FileError
        Where a link that is named is not there.

    """
    found: dict[str, list[str]] = {}
    for joint in urdf.joints.values():
        name, on, parent = joint.child.rpartition(f'_on_{joint.parent}')
        if on and name and not parent:
            found.setdefault(name, []).append(joint.child)
    closings = []
    for name in list(found):
        slider = name.removesuffix(_LINE)
        if name != slider and len(found[name]) == 1 and len(found.get(slider, ())) == 1:
            closings.append(Closing(slider, (*found.pop(name), *found.pop(slider)), line=True))
    alone = {frames[0]: name for name, frames in found.items() if len(frames) == 1}
    closings += [Closing(name, tuple(of)) for name, of in found.items() if len(of) > 1]
    for pair in asked:
        for link in pair:
            if link not in urdf.links:
                raise FileError(
                    urdf.file,
                    f'--close {"=".join(pair)}',
                    f'there is no link {quoted(link)}',
                    did_you_mean(link, urdf.links, f'name two of {listed(urdf.links)}'),
                )
        if pair[0] == pair[1]:
            raise FileError(
                urdf.file, f'--close {"=".join(pair)}', 'names one link twice', 'name two'
            )
        closings.append(Closing(pair[0], pair))
    return closings, alone


class Loops(NamedTuple):
    """
    What of a URDF is in its loops.

    Attributes
    ----------
    ground
        The link that all of it hangs on.
    joints
        The joints that move in it, or are driven.
    left_out
        All others, and the links that hang on them alone, in words.

    """

    ground: str
    joints: frozenset[str]
    left_out: tuple[str, ...]


def find_loops(urdf: UrdfFile, closings: Sequence[Closing], inputs: Sequence[str]) -> Loops:
    """Leave out what hangs by one joint alone that is not driven: at the ends, and at the root."""
    body_of = {urdf.root: urdf.root}
    edges: list[tuple[str, str, str]] = []
    for joint in urdf.joints.values():
        moves = joint.kind in MOVING
        body_of[joint.child] = joint.child if moves else body_of[joint.parent]
        if moves:
            edges.append((body_of[joint.parent], joint.child, joint.name))
    for closing in closings:
        first, *others = (body_of[frame] for frame in closing.frames)
        edges += [(first, other, '') for other in others]
    bodies = list(dict.fromkeys(body_of.values()))
    left_out = []
    while len(bodies) > 1:
        for body in bodies:
            held = [edge for edge in edges if body in edge[:2]]
            if len(held) < 2 and not any(edge[2] in inputs for edge in held):
                break
        else:
            break
        bodies.remove(body)
        edges = [edge for edge in edges if edge not in held]
        left_out.append(f'link {body}')
    kept = frozenset(edge[2] for edge in edges if edge[2])
    return Loops(bodies[0], kept, tuple(left_out))
