# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The bodies and joints of a linkage, and the Assur groups in which it is solved.

Links that driven joints hold together are one body, whose shape the inputs determine. Two bodies
that are joined to each other, and each to the known part, are a dyad (an Assur group of class II):
both become known, and so on outwards from the ground. Where no dyad is left, the smallest set of
bodies with as many unknowns as constraints is solved by iteration.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from itertools import combinations

from linkage_ros.errors import DefinitionError, list_names
from linkage_ros.kinematics.plane.linkage import (
    GROUND,
    Input,
    Linkage,
    links_by_point,
    Point,
    RevoluteJoint,
)

_BLOCK = 'block of '
"""Prefix of the name of a slider: the block of a pin in a slot."""

_LARGEST_GROUP = 8
"""Most bodies of a group that is searched for by trial; a larger group is solved as a whole."""


@dataclass(frozen=True, slots=True)
class Joint:
    """
    A pin ('R') or slider ('P') between two links.

    ``name`` is the name of the point or of the slider; ``link`` belongs to the group, ``to`` is
    the link that it is joined to.
    """

    kind: str
    name: str
    link: str
    to: str


@dataclass(frozen=True, slots=True)
class Driven:
    """
    A driven joint that places ``joint.link`` once ``joint.to`` is known.

    ``index`` is its number among `Linkage.driven_joints`: an input, or a joint that follows
    another.
    """

    joint: Joint
    index: int


@dataclass(frozen=True, slots=True)
class Dyad:
    """Two bodies joined to each other, and each to the known part."""

    # RRR, RRP, RPR, PRP or RPP: outer joint of the first body, inner joint, outer joint of the
    # second body.
    kind: str
    # The links of each body; several if driven joints hold them together.
    bodies: tuple[tuple[str, ...], tuple[str, ...]]
    outer: tuple[Joint, Joint]  # Joint of each body to the known part
    inner: Joint  # Joint from the first body to the second


@dataclass(frozen=True, slots=True)
class Iterated:
    """Links that no dyad covers; their joints are those among them and to the known part."""

    links: tuple[str, ...]
    ratios: tuple[str, ...] = ()  # The joints whose ratios are solved with them


@dataclass(frozen=True, slots=True)
class GearedLinks:
    """Links that pins hold, and as many ratios turn: their angles are sums of known angles."""

    links: tuple[str, ...]
    ratios: tuple[str, ...]  # The joints that follow others


Group = Driven | Dyad | GearedLinks | Iterated


@dataclass(frozen=True, slots=True)
class Structure:
    """A linkage as bodies and joints."""

    # The links and their points; a pin in a slot has an additional block.
    links: Mapping[str, Mapping[str, Point]]
    blocks: Mapping[str, str]  # For each slider the link that slides
    groups: tuple[Group, ...]  # The groups in the order in which they are solved
    joints: tuple[Joint, ...]  # All joints; a pin of three links is two
    ratios: int = 0  # Number of joints that follow others

    @property
    def mobility(self) -> int:
        """Degrees of freedom by Grübler's count, with the inputs free."""
        return 3 * (len(self.links) - 1) - 2 * len(self.joints) - self.ratios

    def joints_of(self, group: GearedLinks | Iterated) -> tuple[Joint, ...]:
        """
        Return the joints that hold a group: among its links, and to the links known before it.

        ``link`` of each joint belongs to the group. Joints to links solved later are left out.
        """
        known = {GROUND}
        for before in self.groups[: self.groups.index(group)]:
            known.update(links_of(before))
        joints: list[Joint] = []
        pins: set[str] = set()
        for joint in self.joints:
            if joint.kind == 'P':
                ends = {joint.link, joint.to}
                if ends & set(group.links) and ends <= known | set(group.links):
                    joints.append(joint)
            elif joint.name not in pins:
                pins.add(joint.name)
                carriers = [link for link, points in self.links.items() if joint.name in points]
                held = [link for link in carriers if link in group.links]
                base = [*(link for link in carriers if link in known), *held]
                joints += [
                    Joint('R', joint.name, link, base[0]) for link in held if link != base[0]
                ]
        return tuple(joints)


def links_of(group: Group) -> tuple[str, ...]:
    """Return the links that a group places."""
    if isinstance(group, Driven):
        return (group.joint.link,)
    if isinstance(group, Dyad):
        return tuple(link for body in group.bodies for link in body)
    return group.links


def assur_groups(linkage: Linkage) -> Structure:
    """
    Find the order in which a linkage is solved.

    A DefinitionError is raised if a link is free, over-constrained, or not joined to the ground.
    """
    links, blocks, joints = _links_and_joints(linkage)
    _check_connected(linkage, links, joints)
    search = _GroupSearch(linkage, links, blocks, joints)
    structure = Structure(links, blocks, tuple(search.find_groups()), joints, len(linkage.ratios))
    freedom, inputs = structure.mobility, len(linkage.inputs)
    if freedom != inputs:
        raise DefinitionError(
            'links',
            f'{freedom} degree(s) of freedom and {inputs} input(s)',
            (_same_pin(linkage) or 'add an input, a link or a pin')
            if freedom > inputs
            else f'take away a link{", a ratio" if linkage.ratios else ""} or a pin',
        )
    return structure


def _links_and_joints(
    linkage: Linkage,
) -> tuple[dict[str, Mapping[str, Point]], dict[str, str], tuple[Joint, ...]]:
    """Return the links with the blocks of slots, the links that slide, and the joints."""
    links: dict[str, Mapping[str, Point]] = dict(linkage.links)
    blocks: dict[str, str] = {}
    for name, slider in linkage.sliders.items():
        blocks[name] = slider.block or f'{_BLOCK}{name}'
        if not slider.block:
            links[blocks[name]] = {slider.point: (0.0, 0.0)}
    return links, blocks, tuple(_find_joints(linkage, links, blocks))


def _find_joints(
    linkage: Linkage, links: Mapping[str, Mapping[str, Point]], blocks: Mapping[str, str]
) -> Iterator[Joint]:
    for point, (first, *others) in links_by_point(links).items():
        for link in others:
            yield Joint('R', point, link, first)
    for name, slider in linkage.sliders.items():
        yield Joint('P', name, blocks[name], slider.along)


def _check_connected(
    linkage: Linkage, links: Mapping[str, Mapping[str, Point]], joints: tuple[Joint, ...]
) -> None:
    reached, before = {GROUND}, 0
    while len(reached) > before:
        before = len(reached)
        for joint in joints:
            if joint.link in reached or joint.to in reached:
                reached |= {joint.link, joint.to}
    for link in linkage.links:
        if link not in reached:
            raise DefinitionError(
                f'links.{link}',
                'no chain of pins and sliders joins it to the ground',
                _same_pin(linkage)
                or 'name one of its points on another link too, or leave it out',
            )


class _GroupSearch:
    """The search for the next group, given the known links."""

    def __init__(
        self,
        linkage: Linkage,
        links: Mapping[str, Mapping[str, Point]],
        blocks: Mapping[str, str],
        joints: tuple[Joint, ...],
    ) -> None:
        self._linkage = linkage
        self._links = links
        self._joints = joints
        self._sliders = {j.name: j for j in joints if j.kind == 'P'}
        self._rank = {GROUND: 0}
        self._order = {link: i for i, link in enumerate(links)}
        self._drives = tuple(
            self._driven_joint(driven, blocks) for driven in linkage.driven_joints
        )
        # Of the ratios those whose other joint is not known yet; and that joint.
        self._waiting = {
            index: (ratio.of, find_followed_links(linkage, blocks, ratio.of))
            for index, ratio in enumerate(linkage.ratios.values(), len(linkage.inputs))
        }
        self._turning = {GROUND}
        """The links whose angles are sums of inputs, so that their whole turns are known."""
        self._bodies: list[tuple[str, ...]] = []
        self._start_following()

    def find_groups(self) -> Iterator[Group]:
        """Yield group after group until all links are known."""
        yield from self._mark_body_solved(GROUND)
        while True:
            for index in self._start_following():
                known = [end for end in self._drive_links(index) if end in self._rank]
                if len(known) == 2:
                    raise self._held_error(index, 'are joined without it')
                if known:
                    yield from self._mark_body_solved(known[0])
            unknown = [body for body in self._bodies if body[0] not in self._rank]
            if not unknown:
                break
            dyad = self._next_dyad(unknown)
            if dyad is not None:
                yield dyad
                for outer in dyad.outer:
                    yield from self._mark_body_solved(outer.link)
                continue
            chosen = self._smallest_group(unknown)
            ratios = self._solved_with(chosen)
            for index in ratios:
                del self._waiting[index]
            names = tuple(self._linkage.driven_joints[index].joint for index in ratios)
            links = tuple(link for body in chosen for link in body)
            if self._are_geared(chosen, names):
                self._turning.update(links)
                yield GearedLinks(links, names)
            else:
                yield Iterated(links, names)
            for body in chosen:
                for link in body:
                    self._rank[link] = len(self._rank)

    def _are_geared(self, bodies: Collection[tuple[str, ...]], ratios: Collection[str]) -> bool:
        """Return whether ratios alone turn bodies, against links whose turns are known."""
        links = {link for body in bodies for link in body}
        if not len(links) == len(bodies) == len(ratios):
            return False
        if any(joint.kind == 'P' and {joint.link, joint.to} & links for joint in self._joints):
            return False
        ends: set[str] = set()
        for name in ratios:
            for joint in (name, self._linkage.ratios[name].of):
                driven = self._linkage.joints.get(joint)
                if not isinstance(driven, RevoluteJoint):
                    return False
                ends |= {driven.parent, driven.child}
        return ends <= links | self._turning

    def _driven_joint(self, driven: Input, blocks: Mapping[str, str]) -> Joint:
        if driven.slider:
            return self._sliders[driven.slider]
        (pin,) = set(self._links[driven.parent]) & set(self._links[driven.child])
        return Joint('R', pin, driven.child, driven.parent)

    def _drive_links(self, index: int) -> tuple[str, str]:
        drive = self._drives[index]
        return drive.link, drive.to

    def _held_error(self, index: int, how: str) -> DefinitionError:
        """Return the error for a driven joint whose two links are held already."""
        first, second = self._drive_links(index)
        kind = 'input' if index < len(self._linkage.inputs) else 'ratio'
        key = f'{"ratios" if kind == "ratio" else kind}.{self._linkage.driven_joints[index].joint}'
        return DefinitionError(
            key, f'{first!r} and {second!r} {how}', f'leave one of the {kind}s out'
        )

    def _start_following(self) -> list[int]:
        """Merge the bodies anew if ratios have become known; return these."""
        known_ratios: list[int] = []
        while True:
            names = {self._linkage.driven_joints[index].joint for index in self._waiting}
            new = [
                index
                for index, (of, links) in self._waiting.items()
                if links <= {*self._rank} or (of in self._linkage.ratios and of not in names)
            ]
            if not new:
                break
            for index in new:
                del self._waiting[index]
            known_ratios += new
        if known_ratios or not self._bodies:
            self._bodies = self._merge_bodies()
        return known_ratios

    def _solved_with(self, bodies: Collection[tuple[str, ...]]) -> list[int]:
        """Return the ratios that wait and whose two joints are known with these bodies."""
        known = {*self._rank, *(link for body in bodies for link in body)}
        return [
            index
            for index, (_, links) in self._waiting.items()
            if links <= known and known.issuperset(self._drive_links(index))
        ]

    def _merge_bodies(self) -> list[tuple[str, ...]]:
        """Return the bodies; links that driven joints hold together are one."""
        body_of: dict[str, tuple[str, ...]] = {link: (link,) for link in self._links}
        for index, drive in enumerate(self._drives):
            if index in self._waiting:
                continue
            first, second = body_of[drive.link], body_of[drive.to]
            if first == second:
                raise self._held_error(index, 'are held by other driven joints already')
            both = tuple(sorted(first + second, key=self._order.__getitem__))
            for link in both:
                body_of[link] = both
        return sorted(set(body_of.values()), key=lambda body: self._order[body[0]])

    def _mark_body_solved(self, first: str) -> Iterator[Driven]:
        """Mark the links of a body as known, by its driven joints from the first known one."""
        self._rank.setdefault(first, len(self._rank))
        body = next(known for known in self._bodies if first in known)
        learnt = True
        while learnt:
            learnt = False
            for index, drive in enumerate(self._drives):
                ends = (drive.link, drive.to)
                known = [end for end in ends if end in self._rank]
                if index not in self._waiting and drive.link in body and len(known) == 1:
                    (new,) = set(ends) - set(known)
                    yield Driven(Joint(drive.kind, drive.name, new, known[0]), index)
                    self._rank[new] = len(self._rank)
                    if drive.kind == 'R' and known[0] in self._turning and self._turns(index):
                        self._turning.add(new)
                    learnt = True

    def _turns(self, index: int) -> bool:
        """Return whether the whole turns of a driven joint are known."""
        count = len(self._linkage.inputs)
        if index < count:
            return True
        of = tuple(self._linkage.ratios.values())[index - count].of
        names = [driven.joint for driven in self._linkage.driven_joints]
        if of in names:
            return self._turns(names.index(of))
        followed = self._linkage.joints[of]
        return isinstance(followed, RevoluteJoint) and (
            {followed.parent, followed.child} <= self._turning
        )

    def _outer_joints(self, body: tuple[str, ...]) -> list[Joint]:
        """Return the joints of a body to the known part."""
        pins: dict[str, Joint] = {}
        for link in body:
            for point in self._links[link]:
                carriers = [k for k in self._rank if point in self._links[k]]
                if carriers:
                    pins.setdefault(point, Joint('R', point, link, carriers[0]))
        joints = list(pins.values())
        for joint in self._sliders.values():
            for first, second in ((joint.link, joint.to), (joint.to, joint.link)):
                if first in body and second in self._rank:
                    joints.append(Joint('P', joint.name, first, second))
        return joints

    def _inner_joints(self, first: tuple[str, ...], second: tuple[str, ...]) -> list[Joint]:
        """Return the joints between two bodies, without pins that are known already."""
        known = {point for link in self._rank for point in self._links[link]}
        pins: dict[str, Joint] = {}
        for link in first:
            for to in second:
                for point in self._links[link]:
                    if point in self._links[to] and point not in known:
                        pins.setdefault(point, Joint('R', point, link, to))
        joints = list(pins.values())
        for joint in self._sliders.values():
            if joint.link in first and joint.to in second:
                joints.append(Joint('P', joint.name, joint.link, joint.to))
            if joint.link in second and joint.to in first:
                joints.append(Joint('P', joint.name, joint.to, joint.link))
        return joints

    def _next_dyad(self, unknown: list[tuple[str, ...]]) -> Dyad | None:
        outer = {body: self._outer_joints(body) for body in unknown}
        for body, joints in outer.items():
            if len(joints) > 1:
                raise DefinitionError(
                    _file_key(body, self._linkage),
                    f'is over-constrained by {" and ".join(_joint_text(j) for j in joints)}',
                    'take one of them away: with both it cannot move',
                )
        for first, second in combinations(unknown, 2):
            if not (outer[first] and outer[second]):
                continue
            inner = self._inner_joints(first, second)
            if len(inner) > 1:
                raise DefinitionError(
                    _file_key(second, self._linkage),
                    f'is joined to {first[0]!r} twice: by '
                    f'{" and ".join(_joint_text(j) for j in inner)}',
                    'take one of them away, or make one link of the two',
                )
            if inner:
                dyad = self._make_dyad(
                    (first, second), (outer[first][0], outer[second][0]), inner[0]
                )
                if dyad is not None:
                    return dyad
        return None

    def _make_dyad(
        self,
        bodies: tuple[tuple[str, ...], tuple[str, ...]],
        outer: tuple[Joint, Joint],
        inner: Joint,
    ) -> Dyad | None:
        """Return a dyad with its bodies in order, or None if it needs iteration."""
        kind = outer[0].kind + inner.kind + outer[1].kind
        composite = len(bodies[0]) > 1 or len(bodies[1]) > 1
        if kind == 'PPP':
            raise DefinitionError(
                f'sliders.{inner.name}',
                f'with {outer[0].name!r} and {outer[1].name!r} it forms a dyad of three sliders',
                'they leave a link free and over-constrain an angle; make one of them a pin',
            )
        if composite and kind != 'RRR':
            return None
        if kind == 'RPR':
            # The body with the rail comes first.
            turn = inner.link != self._linkage.sliders[inner.name].along
        elif outer[0].kind != outer[1].kind:
            # The body with the pin comes first.
            turn = outer[0].kind == 'P'
        else:
            # The body on the link that is known later comes first, so that on the ground last.
            ranks = [self._rank[joint.to] for joint in outer]
            turn = ranks[0] < ranks[1]
        if turn:
            bodies = (bodies[1], bodies[0])
            outer = (outer[1], outer[0])
            inner = Joint(inner.kind, inner.name, inner.to, inner.link)
            kind = kind[::-1]
        return Dyad(kind, bodies, outer, inner)

    def _smallest_group(self, unknown: list[tuple[str, ...]]) -> list[tuple[str, ...]]:
        """Return the smallest set of bodies that has as many unknowns as constraints."""
        constrained = {body: len(self._outer_joints(body)) for body in unknown}
        between = {
            frozenset((first, second)): self._inner_joints(first, second)
            for first, second in combinations(unknown, 2)
        }
        largest = len(unknown) if len(unknown) <= 14 else 0
        for size in range(1, min(largest, _LARGEST_GROUP) + 1):
            for chosen in combinations(unknown, size):
                if self._count_mobility(list(chosen), constrained, between) == 0:
                    return list(chosen)
        everything = self._count_mobility(unknown, constrained, between)
        if everything == 0:
            return unknown
        if everything > 0:
            loose = min(
                unknown,
                key=lambda body: (
                    constrained[body]
                    + sum(len(joints) for ends, joints in between.items() if body in ends)
                ),
            )
            raise DefinitionError(
                _file_key(loose, self._linkage),
                'is free: its pins and sliders do not hold it, '
                f'{everything} degree(s) of freedom too many',
                _same_pin(self._linkage) or 'join it to one more link, or name one more input',
            )
        raise DefinitionError(
            _file_key(unknown[-1], self._linkage),
            f'belongs to over-constrained links, {-everything} degree(s) of freedom too few',
            'take away a link or a pin',
        )

    def _count_mobility(
        self,
        bodies: list[tuple[str, ...]],
        constrained: Mapping[tuple[str, ...], int],
        between: Mapping[frozenset[tuple[str, ...]], list[Joint]],
    ) -> int:
        """Count the degrees of freedom of bodies; a pin of three links counts twice."""
        joints = sum(constrained[body] for body in bodies)
        pins: dict[str, set[tuple[str, ...]]] = {}
        for first, second in combinations(bodies, 2):
            for joint in between[frozenset((first, second))]:
                if joint.kind == 'P':
                    joints += 1
                else:
                    pins.setdefault(joint.name, set()).update((first, second))
        joints += sum(len(carriers) - 1 for carriers in pins.values())
        return 3 * len(bodies) - 2 * joints - len(self._solved_with(bodies))


def find_followed_links(linkage: Linkage, blocks: Mapping[str, str], joint: str) -> frozenset[str]:
    """Return the links of a joint that another one follows; of an input none."""
    if joint in (driven.joint for driven in linkage.inputs):
        return frozenset()
    of = linkage.joints[joint]
    if isinstance(of, RevoluteJoint):
        return frozenset((of.parent, of.child))
    return frozenset((linkage.sliders[of.slider].along, blocks[of.slider]))


def _same_pin(linkage: Linkage) -> str:
    """Return the remedy for a pin that has another name on each of its links; '' if none has."""
    used = {*linkage.traced}
    for slider in linkage.sliders.values():
        used |= {slider.point, slider.through}
    single = {
        point: links[0]
        for point, links in links_by_point(linkage.links).items()
        if len(links) == 1 and point not in used
    }
    if len({*single.values()}) < 2:
        return ''
    points = list_names((f'{point} ({link})' for point, link in single.items()), ' and ')
    return f'{points} each stand on one link only; the same pin? then give it one name'


def _file_key(body: tuple[str, ...], linkage: Linkage) -> str:
    """Return the key of a body in the linkage file: a link, or the slider of a slot."""
    for link in body:
        if link in linkage.links:
            return f'links.{link}'
    return f'sliders.{body[0].removeprefix(_BLOCK)}'


def _joint_text(joint: Joint) -> str:
    return f'{"pin" if joint.kind == "R" else "slider"} {joint.name!r}'
