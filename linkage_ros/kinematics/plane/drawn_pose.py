# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The assembly of a drawn pose: rough places of points, and rough angles of links.

At the inputs of the pose every dyad is closed on both of its sides, one dyad after the other. Of
the assemblies that close, the one nearest to the drawing is meant. It must be clearly nearer than
any other, as far as the two differ in what the pose names.

`read_drawn_pose` is the inverse: it returns a pose that determines the assembly.
"""

from __future__ import annotations

from cmath import phase, rect
from collections.abc import Iterator, Sequence
from math import remainder, tau
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.errors import DefinitionError, list_names
from linkage_ros.kinematics.analysis.point_tracker import PointTracker
from linkage_ros.kinematics.plane.linkage import AssemblyPose, Linkage
from linkage_ros.kinematics.plane.sides import closes_in_two_ways, telling_part, TwoWays
from linkage_ros.kinematics.plane.topology import Dyad, Iterated, links_of
from linkage_ros.kinematics.step import LinkState

if TYPE_CHECKING:
    from linkage_ros.kinematics.plane.closure import PlanarClosure
    from linkage_ros.kinematics.plane.solved_links import SolvedLinks
    from linkage_ros.kinematics.results import Position

_SAME = 1e-9
"""Places nearer to each other than this, in lengths, count as one."""

_CLEARLY = 1.5
"""How many times as far from the drawing as the nearest assembly every other one must be."""

_MOST_EXPLORED = 8
"""With more dyads, only those whose side is not written are closed on both sides."""

_MOST_KEPT = 256
"""Most assemblies that are followed; a pose that fits more of them equally well is refused."""

_MOST_LISTED = 4


class _Sight(NamedTuple):
    """What a pose names, a point or the angle of a link, as a place to compare."""

    tracker: PointTracker | None
    # Of a link whose angle is named: its coordinate and constant, and its length in [m].
    coordinate: int = 0
    constant: float = 0.0
    length: float = 0.0

    def place_at(self, state: LinkState) -> complex:
        """Return the place in a state, in [m]."""
        if self.tracker is not None:
            return self.tracker.places_in(state)[self.tracker.indices[0]]
        return rect(self.length, state.coordinates[self.coordinate] + self.constant)


class _Target(NamedTuple):
    """What a pose names, and where it is drawn."""

    sight: _Sight
    drawn: complex


class _DrawnAssembly(NamedTuple):
    """An assembly, as far as its dyads are closed."""

    state: LinkState
    square: float = 0.0  # Sum of the squares of the distances from the drawing, in [m²]
    places: tuple[complex, ...] = ()  # What the pose names
    # Of each dyad that closes in two ways the sign of its step, and the sign of its side.
    signs: tuple[int, ...] = ()
    sides: tuple[float, ...] = ()

    def add_targets(self, targets: Sequence[_Target]) -> _DrawnAssembly:
        """Return it with further things that the pose names."""
        places = tuple(target.sight.place_at(self.state) for target in targets)
        away = [abs(at - target.drawn) for at, target in zip(places, targets, strict=True)]
        square = self.square + sum(distance * distance for distance in away)
        return self._replace(square=square, places=self.places + places)

    def on_both_sides(self, step: Any) -> Iterator[_DrawnAssembly]:
        """Yield it with a dyad on each of its sides, as far as it closes."""
        for sign in (1, -1):
            state = LinkState([*self.state.coordinates], [*self.state.pins])
            way = step.with_sign(sign)
            pose = way.close(state)
            if pose.status.has_pose:
                signs, sides = (*self.signs, sign), (*self.sides, way.side_of(pose))
                yield self._replace(state=state, signs=signs, sides=sides)

    def is_written(self, ways: Sequence[TwoWays]) -> bool:
        """Return whether its sides are those that the file writes."""
        return all(
            not way.written
            or way.written * side > 0.0
            or (not side and sign == way.written * way.upright)
            for way, sign, side in zip(ways, self.signs, self.sides, strict=False)
        )


def drawn_signs(
    linkage: Linkage, plan: SolvedLinks, ways: Sequence[TwoWays]
) -> list[tuple[TwoWays, int]]:
    """
    Return the signs with which dyads close as drawn; none if the pose does not determine them.

    ``plan`` has the links and steps up to these dyads, those before in their assembly. A pose that
    contradicts a side, fits two assemblies or does not close raises DefinitionError.
    """
    pose = linkage.pose
    assert pose is not None, 'the caller has one'
    groups = [_pose_targets(plan, pose, way.dyad) for way in ways]
    targets = [target for group in groups for target in group]
    missing = any(not way.written for way in ways)
    if not targets and (missing or not any(way.crosses for way in ways)):
        return []
    assemblies = sorted(
        _closing_assemblies(linkage, plan, ways, groups), key=lambda assembly: assembly.square
    )
    written = [assembly for assembly in assemblies if assembly.is_written(ways)]
    if not targets:
        # Where it starts, the linkage need not close: then the sides hold as without a pose.
        return list(zip(ways, written[0].signs, strict=True)) if written else []
    if not assemblies:
        raise DefinitionError(
            'pose.inputs',
            'do not close the loops in any assembly',
            'give inputs that the linkage can have',
        )
    drawn = [target.drawn for target in targets]
    if not written or _is_nearer(assemblies[0], written[0], drawn, plan.scale):
        raise _contradiction_error(ways, assemblies[0])
    best, *others = written
    alike = [assembly for assembly in others if not _is_nearer(best, assembly, drawn, plan.scale)]
    if alike:
        raise _ambiguity_error(plan, ways, [best, *alike])
    return list(zip(ways, best.signs, strict=True))


def _pose_targets(plan: SolvedLinks, pose: AssemblyPose, dyad: Dyad) -> list[_Target]:
    """Return what a pose names of the links of a dyad."""
    links = links_of(dyad)
    known = list(plan.angles)
    before = known[: min(map(known.index, links))]
    targets = []
    for name, place in pose.points.items():
        carrier = next((link for link in links if name in plan.points[link]), None)
        if carrier and not any(name in plan.points[link] for link in before):
            targets.append(_Target(_point_sight(plan, carrier, name), complex(*place)))
    for link, angle in pose.angles.items():
        if link in links:
            sight = _angle_sight(plan, link)
            targets.append(_Target(sight, rect(sight.length, angle)))
    return targets


def _point_sight(plan: SolvedLinks, link: str, name: str) -> _Sight:
    return _Sight(PointTracker(plan, [(link, plan.points[link][name] * plan.scale)]))


def _angle_sight(plan: SolvedLinks, link: str) -> _Sight:
    first, *others = plan.points[link].values()
    length = max((abs(point - first) for point in others), default=1.0)
    angle = plan.angles[link]
    return _Sight(None, angle.coordinate, angle.constant, length * plan.scale)


def _closing_assemblies(
    linkage: Linkage,
    plan: SolvedLinks,
    ways: Sequence[TwoWays],
    groups: Sequence[Sequence[_Target]],
) -> list[_DrawnAssembly]:
    """Return the assemblies in which the loops close, those near to the drawing."""
    assert linkage.pose is not None, 'the caller has one'
    inputs = (
        value / plan.scale if driven.slider else value
        for value, driven in zip(linkage.pose.inputs, linkage.inputs, strict=True)
    )
    assemblies = [_DrawnAssembly(LinkState([0.0, *inputs], []))]
    both = len(ways) <= _MOST_EXPLORED
    numbers = {two_way.step: index for index, two_way in enumerate(ways)}
    closed: Sequence[_Target] = ()
    for step, way in enumerate(plan.steps):
        if step not in numbers:
            assemblies = [
                assembly for assembly in assemblies if way.close(assembly.state).status.has_pose
            ]
            continue
        # Steps behind a dyad have placed the other links of its bodies, which inputs hold.
        assemblies = [assembly.add_targets(closed) for assembly in assemblies]
        number = numbers[step]
        closed = groups[number]
        if len(assemblies) > _MOST_KEPT:
            assemblies.sort(key=lambda assembly: assembly.square)
            if assemblies[_MOST_KEPT].square <= _CLEARLY * _CLEARLY * assemblies[0].square:
                names = list_names(repr(earlier.assembly_key) for earlier in ways[:number])
                raise DefinitionError(
                    'pose', f'does not determine the sides of {names}', 'name a point of each'
                )
            del assemblies[_MOST_KEPT:]
        assemblies = [
            second
            for first in assemblies
            for second in first.on_both_sides(way)
            if both or second.is_written(ways)
        ]
    return [assembly.add_targets(closed) for assembly in assemblies]


def _is_nearer(
    first: _DrawnAssembly, second: _DrawnAssembly, drawn: Sequence[complex], size: float
) -> bool:
    """Return whether an assembly is clearly nearer to the drawing, where the two differ."""
    near = far = 0.0
    for place, elsewhere, target in zip(first.places, second.places, drawn, strict=True):
        if abs(place - elsewhere) > _SAME * size:
            near += abs(place - target) ** 2
            far += abs(elsewhere - target) ** 2
    return _CLEARLY * _CLEARLY * near < far


def _contradiction_error(ways: Sequence[TwoWays], drawn: _DrawnAssembly) -> DefinitionError:
    """Return the error for the first side that is not the drawn one."""
    for way, side in zip(ways, drawn.sides, strict=True):
        if way.written * side < 0.0:
            break
    words = way.side_word(way.written), way.side_word(side)
    return DefinitionError(
        f'assembly.{way.assembly_key}',
        f'is {words[0]!r}, and {words[1]!r} as pose draws it',
        f'leave {way.assembly_key} out of assembly, write {words[1]}, or draw the other pose',
    )


def _ambiguity_error(
    plan: SolvedLinks, ways: Sequence[TwoWays], alike: Sequence[_DrawnAssembly]
) -> DefinitionError:
    """Return the error for a pose that fits several assemblies."""
    first = alike[0]
    differ = [
        index
        for index in range(len(ways))
        if any(assembly.signs[index] != first.signs[index] for assembly in alike)
    ]
    sides = []
    for assembly in alike[:_MOST_LISTED]:
        words = [
            f'{ways[i].assembly_key}: {ways[i].side_word(assembly.sides[i] or assembly.signs[i])}'
            for i in differ
        ]
        sides.append(f'{{{list_names(words)}}}')
    if len(alike) > _MOST_LISTED:
        sides.append(f'{len(alike) - _MOST_LISTED} more')
    telling = []
    for i in differ:
        second = next(assembly for assembly in alike if assembly.signs[i] != first.signs[i])
        telling.append(_telling_text(plan, ways[i].dyad, (first.state, second.state)))
    return DefinitionError(
        'pose',
        f'does not distinguish {list_names(sides, " from ")}',
        f'name {list_names(telling, "; ")}',
    )


def _telling_text(plan: SolvedLinks, dyad: Dyad, states: Sequence[LinkState]) -> str:
    """Return what determines the side of a dyad, with its value in two states."""
    link, point = telling_part(plan.points, dyad)
    if point:
        places = [_point_sight(plan, link, point).place_at(state) for state in states]
        texts = [f'[{place.real + 0.0:.4g}, {place.imag + 0.0:.4g}] m' for place in places]
    else:
        turned = [phase(_angle_sight(plan, link).place_at(state)) for state in states]
        texts = [f'{angle:.4g} rad' for angle in turned]
    return f'{point or f"the angle of {link}"}: {texts[0]} or {texts[1]}'


def read_drawn_pose(closure: PlanarClosure, position: Position) -> AssemblyPose:
    """
    Return the pose that determines the assembly of a position.

    It names a point or an angle for each dyad that closes in two ways, and of links that are
    iterated what the file's pose names of them.
    """
    places, angles = closure.points(position), closure.link_angles(position)
    points: dict[str, tuple[float, float]] = {}
    turned: dict[str, float] = {}

    def add_point(link: str, point: str) -> None:
        place = places[link, point]
        points[point] = (place.real + 0.0, place.imag + 0.0)

    drawn = closure.linkage.pose
    for group in closure.structure.groups:
        if isinstance(group, Iterated) and drawn is not None:
            links = closure.structure.links
            for link in group.links:
                for point in links[link]:
                    if point in drawn.points:
                        add_point(link, point)
                if link in drawn.angles:
                    turned[link] = remainder(angles[link], tau)
        elif closes_in_two_ways(group):
            link, point = telling_part(closure.structure.links, group)
            if point:
                add_point(link, point)
            else:
                turned[link] = remainder(angles[link], tau)
    return AssemblyPose(position.inputs, points, turned)
