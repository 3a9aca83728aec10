# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A linkage as a tree of frames whose joints are those that messages name.

The frame of a link is parallel to the link's own. Its origin lies where the link is attached: at a
pin, or at the point whose position its slider measures. Every published joint is a joint of the
tree once, with its own sign and zero. If the angle of a link relative to its parent is not
published itself, it is a sum of published joints: each term has a frame without a body, and a
term that is in the tree already has a joint that mimics it.
"""

from __future__ import annotations

from cmath import rect
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple

from linkage_ros.errors import DefinitionError, list_names, quote
from linkage_ros.kinematics import GROUND, Linkage, RevoluteJoint, SlideJoint
from linkage_ros.names import free_name
from linkage_ros.tools.models.orientation import Orientations, Turn
from linkage_ros.tools.models.part import ModelNames, PrefixedNames

Kind = Literal['revolute', 'prismatic', 'fixed']

_DEAR = 9
"""Cost of using a joint that another link may need."""


def suggest_joint(
    linkage: Linkage, placed: Collection[str]
) -> tuple[str, str, RevoluteJoint | SlideJoint]:
    """Return a link that is joined to placed ones, and a joint that would determine its place."""
    known = {*Orientations(linkage).known_from(GROUND)}
    links = linkage.links
    for link in links:
        if link in placed:
            continue
        pinned = [on for on in placed if {*links[on]} & {*links[link]}]
        for on in pinned:
            if link not in known:
                return link, f'{link}_joint', RevoluteJoint(on, link)
        for name, slider in linkage.sliders.items():
            ends = (slider.along, *(link for link in links if slider.point in links[link]))
            held = [end for end in ends if end in placed]
            if link in ends and held and (link == slider.along or slider.along in placed):
                if link not in known:
                    return link, f'{link}_joint', RevoluteJoint(held[0], link)
                return link, f'{name}_slide', SlideJoint(name)
    raise AssertionError('every link is joined to the ground')


def joint_text(name: str, joint: RevoluteJoint | SlideJoint) -> str:
    """Return a joint as it is written in a linkage file."""
    if isinstance(joint, SlideJoint):
        return f'{name}: {{slider: {joint.slider}}}'
    return f'{name}: {{parent: {joint.parent}, child: {joint.child}}}'


class TreeJoint(NamedTuple):
    """A joint of the tree."""

    name: str  # Name in messages, if it moves and does not mimic another
    kind: Kind  # Type of the joint
    # Frames, by name.
    parent: str
    child: str
    place: complex  # Position of the child's frame in the parent's with the joint at 0, in [m]
    turn: float = 0.0  # Angle of the child's frame in the parent's with the joint at 0, in [rad]
    # For a slide a unit vector in the child's frame; for a pin +1 or −1, about z.
    axis: complex = 1 + 0j
    mimics: str = ''  # The joint that it mimics; '' if none


@dataclass(slots=True)
class Tree:
    """A linkage as a tree."""

    linkage: Linkage  # The linkage
    # All joints, each after the one that moves its parent.
    joints: list[TreeJoint] = field(default_factory=list)
    # For each link the origin of its frame in the link's own frame, in [m].
    origins: dict[str, complex] = field(default_factory=lambda: {GROUND: 0j})
    # Pins of the tree: the point, and the two links that it holds together.
    pins: list[tuple[str, str, str]] = field(default_factory=list)
    slides: list[str] = field(default_factory=list)  # Sliders of the tree
    # Joints with a name in messages that attach no link.
    spare: list[str] = field(default_factory=list)

    def point_position(self, link: str, point: str) -> complex:
        """Return the position of a point of a link in the tree's frame of the link, in [m]."""
        return complex(*self.linkage.links[link][point]) - self.origins[link]


class _LinkAttachment(NamedTuple):
    """A way to attach a link to another that is in the tree."""

    # The two links.
    link: str
    on: str
    # Point at which they meet: on ``on``; for a slider that ``on`` carries, its ``through``.
    at: str
    point: str  # Point of ``link`` that becomes its origin
    turns: tuple[Turn, ...]  # Angle of ``link`` relative to ``on``
    slider: str = ''  # Slider between them; '' for a pin
    slide: str = ''  # Joint that measures the slide


def grow_tree(linkage: Linkage, names: PrefixedNames) -> Tree:
    """
    Attach all links of a linkage to its ground.

    ``names`` provides names for frames and joints without a name in messages. A DefinitionError is
    raised if the published joints do not determine a link's position; it names a joint that would.
    """
    growth = _Growth(linkage, names)
    if len(growth.attach_links()) < len(linkage.links):
        raise _missing_error(linkage)
    growth.tree.spare += growth.unused
    return growth.tree


class _Growth:
    """The growing tree, and the joints that are not in it yet."""

    def __init__(self, linkage: Linkage, names: PrefixedNames) -> None:
        self._linkage = linkage
        self._names = names
        self.tree = Tree(linkage)
        self.unused = dict.fromkeys(linkage.named_joints)
        self._angles = Orientations(linkage)
        self._known = {link: self._angles.angle_between(GROUND, link) for link in linkage.links}
        self._slides: dict[str, list[str]] = {name: [] for name in linkage.sliders}
        for name, joint in linkage.named_joints.items():
            if isinstance(joint, SlideJoint):
                self._slides[joint.slider].append(name)

    def attach_links(self) -> Collection[str]:
        """Attach link after link while possible; return the attached links."""
        while ways := list(self._possible_attachments()):
            self._attach_link(min(ways, key=self._attachment_cost))
        return self.tree.origins

    def _possible_attachments(self) -> Iterator[_LinkAttachment]:
        links = self._linkage.links
        for link in links:
            if link in self.tree.origins:
                continue
            for on in self.tree.origins:
                turns = (
                    self._angles.angle_between(on, link) if self._known[link] is not None else None
                )
                if turns is None:
                    continue
                for pin in links[link]:
                    if pin in links[on]:
                        yield _LinkAttachment(link, on, pin, pin, turns)
                yield from self._sliding_attachments(link, on, turns)

    def _sliding_attachments(
        self, link: str, on: str, turns: tuple[Turn, ...]
    ) -> Iterator[_LinkAttachment]:
        links = self._linkage.links
        for name, slider in self._linkage.sliders.items():
            if not self._slides[name]:
                continue
            slide = next((s for s in self._slides[name] if s in self.unused), '')
            slide = slide or self._slides[name][0]
            if on == slider.along and slider.point in links[link]:
                yield _LinkAttachment(link, on, slider.through, slider.point, turns, name, slide)
            elif link == slider.along and slider.point in links[on]:
                yield _LinkAttachment(link, on, slider.point, slider.through, turns, name, slide)

    def _attachment_cost(self, attachment: _LinkAttachment) -> tuple[int, int]:
        """
        Return the cost of a way: frames without a body, and joints that another link may need.

        Ways of equal cost are tried in the order of the file.
        """
        turning = [turn.joint for turn in attachment.turns if turn.joint]
        moving = turning + [attachment.slide] * bool(attachment.slider)
        mimics = sum(joint not in self.unused for joint in moving)
        taken = sum(joint in self.unused for joint in turning[:-1])
        return max(0, len(moving) - 1) + mimics + _DEAR * taken, mimics

    def _attach_link(self, attachment: _LinkAttachment) -> None:
        tree, names = self.tree, self._names
        tree.origins[attachment.link] = complex(
            *self._linkage.links[attachment.link][attachment.point]
        )
        if attachment.slider:
            tree.slides.append(attachment.slider)
        else:
            tree.pins.append((attachment.at, attachment.on, attachment.link))
        moves = list(self._attachment_joints(attachment))
        parent, place = (
            names.own_name(attachment.on),
            tree.point_position(attachment.on, attachment.at),
        )
        for number, move in enumerate(moves, 1):
            last = number == len(moves)
            child = (
                names.own_name(attachment.link)
                if last
                else names.free_frame(f'{attachment.link}_{number}')
            )
            joint = move._replace(parent=parent, child=child, place=place)
            if move.kind == 'fixed':
                joint = joint._replace(
                    name=names.free_joint(f'{attachment.link}_at_{attachment.at}')
                )
            elif move.name in self.unused:
                del self.unused[move.name]
                joint = joint._replace(name=names.own_name(move.name))
            else:
                own = names.free_joint(f'{move.name}_in_{attachment.link}')
                joint = joint._replace(name=own, mimics=names.own_name(move.name))
            tree.joints.append(joint)
            parent, place = child, 0j

    def _attachment_joints(self, attachment: _LinkAttachment) -> Iterator[TreeJoint]:
        """Yield joints from parent to link; their frames are not yet assigned."""
        turning = [i for i, turn in enumerate(attachment.turns) if turn.joint]
        # A constant precedes the next joint, and the last ones precede the last joint: all turn
        # about one axis, so the order does not matter.
        constant = 0.0 if turning else sum(turn.constant for turn in attachment.turns)
        slide = None
        if attachment.slider:
            slider = self._linkage.sliders[attachment.slider]
            along = attachment.on == slider.along
            axis = slider.unit * rect(1.0, -constant) if along else -slider.unit
            slide = TreeJoint(attachment.slide, 'prismatic', '', '', 0j, constant, axis)
            if along:
                yield slide
        behind = turning[-1] + 1 if turning else 0
        before, after = 0.0, sum(turn.constant for turn in attachment.turns[behind:])
        for i, turn in enumerate(attachment.turns):
            before += turn.constant
            if turn.joint:
                if i == turning[-1]:
                    before += after
                yield TreeJoint(turn.joint, 'revolute', '', '', 0j, before, complex(turn.sign))
                before = 0.0
        if slide is not None and not along:
            yield slide
        if slide is None and not turning:
            yield TreeJoint('', 'fixed', '', '', 0j, constant)


def _missing_error(linkage: Linkage) -> DefinitionError:
    """Return the error that names the joints that a complete tree would need."""
    whole, lost, added = linkage, dict[str, None](), dict[str, RevoluteJoint | SlideJoint]()
    while True:
        growth = _Growth(whole, ModelNames().add_linkage('', whole))
        placed = growth.attach_links()
        if len(placed) == len(linkage.links):
            break
        link, name, joint = suggest_joint(whole, placed)
        lost[link] = None
        added[free_name(name, whole.named_joints)] = joint
        whole = replace(linkage, joints=dict(linkage.joints) | added)
    several = len(lost) > 1
    return DefinitionError(
        'joints',
        f'the published joints do not determine where link{"s" if several else ""} '
        f'{list_names(map(quote, lost), " and ")} {"stand" if several else "stands"}',
        f'add to joints: {", ".join(joint_text(name, joint) for name, joint in added.items())}',
    )
