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
Where the links stand by what messages say of their joints, for many instants at once.

Links hang on each other by the joints that are published, as those of a robot model do
(`linkage_ros.models.tree`), and each is turned by the recorded value of its own. Nothing is
solved: where a sensor is wrong, or late against another, links that share a pin come apart there,
and by how much is told. Where what is published does not tell where a link stands, the loops are
closed at the recorded inputs instead.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from linkage_ros.drawing.link_frames import blocks, link_frames
from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.linkage import GROUND
from linkage_ros.models.names import prefixed
from linkage_ros.models.tree import grow, Tree
from linkage_ros.report.arrays import Numbers
import numpy as np

_FARTHEST = 1e30
"""In [m] or [rad]: what is beyond it is none of a machine, and no number of the page's."""

Places = Any
"""Array of complex numbers: places in [m], or directions."""


class Poses(NamedTuple):
    """
    Where the links stand.

    Attributes
    ----------
    links
        Those that move, and the blocks of sliders that are none.
    frames
        Of shape (instants, links, 3): where the frame of a link is, in [m], and its angle, in
        [rad], in (−π, π]; NaN where it is not told.
    apart
        The farthest that two links miss a pin, or a point its line, in [m]; NaN likewise.
    untold
        Why the loops were closed instead; '' where every link stands by recorded joints.

    """

    links: tuple[str, ...]
    frames: Numbers
    apart: Numbers
    untold: str


_Found = dict[str, tuple[Places, Places]]
"""Of each link the place of its frame, and its direction."""


def poses(
    closure: Closure, prefix: str, values: Mapping[str, Numbers], inputs: Sequence[str]
) -> Poses:
    """
    Return where the links stand.

    Parameters
    ----------
    closure
        The linkage.
    prefix
        What its joints have before their own names in messages.
    values
        By the names in messages what the joints are at, in [rad] or [m]; NaN where not told. All
        of one length; the inputs are among them.
    inputs
        Names of the driven joints in messages.

    """
    told = {
        name: np.where(np.abs(given) < _FARTHEST, given, np.nan) for name, given in values.items()
    }
    linkage = closure.linkage
    _, (names,) = prefixed([(prefix, linkage)])
    try:
        found, untold = _by_joints(grow(linkage, names), prefix, told), ''
    except DefinitionError as error:
        found, untold = _by_closing(closure, [told[name] for name in inputs]), error.reason
    for block, along, point in blocks(closure):
        link = next(link for link, named in linkage.links.items() if point in named)
        found.setdefault(block, (_at(found, link, linkage.links[link][point]), found[along][1]))
    links = tuple(link for link in found if link != GROUND)
    count = len(next(iter(values.values()), np.empty(0)))
    frames = np.full((count, len(links), 3), np.nan)
    for number, link in enumerate(links):
        place, way = found[link]
        frames[:, number, 0] = place.real
        frames[:, number, 1] = place.imag
        frames[:, number, 2] = np.angle(way)
    # A link is drawn with the others of its linkage, or not at all.
    frames[np.isnan(frames).any(axis=(1, 2))] = np.nan
    apart = _apart(closure, found, count)
    apart[np.isnan(frames).any(axis=(1, 2))] = np.nan
    return Poses(links, frames, apart, untold)


def _by_joints(tree: Tree, prefix: str, values: Mapping[str, Numbers]) -> _Found:
    count = len(next(iter(values.values()), np.empty(0)))
    frames: _Found = {prefix + GROUND: (np.zeros(count, complex), np.ones(count, complex))}
    for joint in tree.joints:
        place, way = frames[joint.parent]
        place = place + joint.place * way
        turned = np.exp(1j * joint.turn) * way
        moved = values.get(joint.mimics or joint.name)
        if joint.kind == 'fixed':
            frames[joint.child] = place, turned
            continue
        if moved is None:
            moved = np.full(count, np.nan)
        if joint.kind == 'revolute':
            frames[joint.child] = place, turned * np.exp(1j * joint.axis.real * moved)
        else:
            frames[joint.child] = place + joint.axis * moved * turned, turned
    found = {}
    for link in tree.linkage.links:
        place, way = frames[prefix + link]
        found[link] = place - tree.origins[link] * way, way
    return found


def _by_closing(closure: Closure, inputs: Sequence[Numbers]) -> _Found:
    links = (*closure.linkage.links, *(block for block, _, _ in blocks(closure)))
    count = len(inputs[0])
    found = {link: (np.full(count, np.nan + 0j), np.full(count, np.nan + 0j)) for link in links}
    for i, given in enumerate(zip(*(values.tolist() for values in inputs), strict=True)):
        if not all(np.isfinite(given)):
            continue
        position = closure.position(*given)
        if not position.joints:
            continue
        for link, frame in link_frames(closure, position).items():
            place, way = found[link]
            place[i], way[i] = frame.place, np.exp(1j * frame.angle)
    return found


def _at(found: _Found, link: str, point: tuple[float, float]) -> Places:
    place, way = found[link]
    return place + complex(*point) * way


def _apart(closure: Closure, found: _Found, count: int) -> Numbers:
    linkage = closure.linkage
    worst = np.zeros(count)
    carriers: dict[str, list[str]] = {}
    for link, named in linkage.links.items():
        for point in named:
            carriers.setdefault(point, []).append(link)
    for point, (first, *others) in carriers.items():
        place = _at(found, first, linkage.links[first][point])
        for link in others:
            worst = np.maximum(worst, np.abs(_at(found, link, linkage.links[link][point]) - place))
    for slider in linkage.sliders.values():
        unit = complex(*slider.direction) / abs(complex(*slider.direction))
        through = _at(found, slider.along, linkage.links[slider.along][slider.through])
        carrier = carriers[slider.point][0]
        between = _at(found, carrier, linkage.links[carrier][slider.point]) - through
        across = between / (unit * found[slider.along][1])
        worst = np.maximum(worst, np.abs(across.imag))
    return worst
