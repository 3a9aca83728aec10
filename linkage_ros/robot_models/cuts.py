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
What a tree of frames leaves open: the pins and sliders that close its loops, as pairs of frames.

Frames named PIN_on_LINK lie where a link has the pin: that they meet is the proof that the model
is right. So do those of a slider, where its slide is published; else SLIDER_line_on_LINK has its x
axis along the line.
"""

from __future__ import annotations

from cmath import phase
from typing import NamedTuple

from linkage_ros.kinematics.linkage import Linkage, RevoluteJoint
from linkage_ros.robot_models.orientation_part import named_joints
from linkage_ros.robot_models.part import PrefixedNames
from linkage_ros.robot_models.tree import Tree, TreeJoint


class Cut(NamedTuple):
    """
    A pin or slider that the tree leaves open.

    Attributes
    ----------
    kind
        ``pin``, ``slide`` (whose frames meet too) or ``line`` (the second lies on the x axis of
        the first).
    name
        Of the point or of the slider.
    frames
        Two or more.

    """

    kind: str
    name: str
    frames: tuple[str, ...]


def add_frames(tree: Tree, names: PrefixedNames) -> list[Cut]:
    """Add to a tree the frames of all cuts, of joints that no link needs, and of traced points."""
    adding = _Adding(tree, names)
    cuts = [*adding.pins(), *adding.sliders()]
    adding.spare()
    adding.traced()
    return cuts


class _Adding:
    def __init__(self, tree: Tree, names: PrefixedNames) -> None:
        self._tree = tree
        self._names = names
        self._joints = named_joints(tree.linkage)
        self._spare = list(tree.spare)

    def pins(self) -> list[Cut]:
        cuts = []
        for point, carriers in _carriers(self._tree.linkage).items():
            apart = {link: link for link in carriers}
            for pin, on, link in self._tree.pins:
                if pin == point:
                    joined, kept = apart[link], apart[on]
                    apart = {a: kept if of == joined else of for a, of in apart.items()}
            # The first link of each part that holds together stands for it.
            ends = list({of: link for link, of in reversed(apart.items())}.values())[::-1]
            if len(ends) > 1:
                frames = tuple(self._fixed(point, link, point) for link in ends)
                cuts.append(Cut('pin', point, frames))
        return cuts

    def sliders(self) -> list[Cut]:
        linkage, cuts = self._tree.linkage, []
        carriers = _carriers(linkage)
        for name, slider in linkage.sliders.items():
            if name in self._tree.slides:
                continue
            shown = f'{name}_slider' if name in carriers else name
            end = slider.block or carriers[slider.point][0]
            slides = [s for s in self._spare if getattr(self._joints[s], 'slider', '') == name]
            if slides:
                self._spare.remove(slides[0])
                line = self._slide(slides[0], self._names.on(shown, slider.along))
            else:
                turn = phase(complex(*slider.direction))
                line = self._fixed(f'{shown}_line', slider.along, slider.through, turn)
            frames = (line, self._fixed(shown, end, slider.point))
            cuts.append(Cut('slide' if slides else 'line', name, frames))
        return cuts

    def spare(self) -> None:
        """Give a frame of its own to every published joint that no link hangs by."""
        links, names = self._tree.linkage.links, self._names
        for name in self._spare:
            frame, joint = names.frame(f'{name}_frame'), self._joints[name]
            if isinstance(joint, RevoluteJoint):
                pins = [p for p in links[joint.parent] if p in links[joint.child]]
                place = self._tree.place(joint.parent, pins[0]) if pins else 0j
                parent = names.own(joint.parent)
                self._add(TreeJoint(names.own(name), 'revolute', parent, frame, place))
            else:
                self._slide(name, frame)

    def traced(self) -> None:
        carriers = _carriers(self._tree.linkage)
        there = {joint.child for joint in self._tree.joints}
        for point in self._tree.linkage.traced:
            if not any(self._names.text_on(point, link) in there for link in carriers[point]):
                self._fixed(point, carriers[point][0], point)

    def _slide(self, name: str, frame: str) -> str:
        joint = self._joints[name]
        assert not isinstance(joint, RevoluteJoint)
        slider = self._tree.linkage.sliders[joint.slider]
        unit = complex(*slider.direction) / abs(complex(*slider.direction))
        place = self._tree.place(slider.along, slider.through)
        parent = self._names.own(slider.along)
        own = self._names.own(name)
        return self._add(TreeJoint(own, 'prismatic', parent, frame, place, 0.0, unit))

    def _fixed(self, name: str, link: str, point: str, turn: float = 0.0) -> str:
        frame = self._names.on(name, link)
        joint = self._names.joint(f'{name}_on_{link}_fixed')
        place = self._tree.place(link, point)
        return self._add(TreeJoint(joint, 'fixed', self._names.own(link), frame, place, turn))

    def _add(self, joint: TreeJoint) -> str:
        self._tree.joints.append(joint)
        return joint.child


def _carriers(linkage: Linkage) -> dict[str, list[str]]:
    """Return the links that carry each point, in the order of the file."""
    carriers: dict[str, list[str]] = {}
    for link, points in linkage.links.items():
        for point in points:
            carriers.setdefault(point, []).append(link)
    return carriers
