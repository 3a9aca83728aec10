# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Tolerance: the linkage as manufactured, with points that deviate from the drawing.

Each link is a separate part with its own holes: the two holes of a pin, one in each link, deviate
independently, in both coordinates, and so do the pivots of the ground. For a link with two pins
only the length matters, which deviates by √2 of the deviation of a coordinate.

A deviation is normal; one beyond three standard deviations is rejected and drawn again. The
parameter is the standard deviation of the accepted parts, so a limit of ±t on a drawing, which no
part exceeds, means a standard deviation of t/3. Truncation reduces the standard deviation, so that
of the normal distribution before truncation is larger by a factor w, with c = 3/w::

    w²·(1 − 2·c·φ(c)/(2·Φ(c) − 1)) = 1        w = 1.01539

(N. L. Johnson, S. Kotz and N. Balakrishnan, Continuous Univariate Distributions, vol. 1, 2nd ed.,
1994, ch. 13, 10.1). For three standard deviations as the limits of a drawing see JCGM 100:2008,
Guide to the expression of uncertainty in measurement, 4.3.

In space the holes are points and the places of hinges, on both links; those of hinges that meet in
one place do not deviate, nor do directions. The parts are put together anew at the inputs of the
pose, see `linkage_ros.kinematics.space.deviating_parts`. Where a linkage has more equations than
it needs, as with parallel axes, parts that deviate may not fit, which is an error.

All coordinates are drawn, link by link and point by point in the order of the linkage file, x
before y and z, and then scaled. So neither the deviation nor the choice of links changes the draws
of the others, and a doubled deviation gives the same mechanism with doubled errors. The direction
of a slider does not deviate.

The altered linkage stays on the branch of the one in the file: where that passes a change point,
it changes its side too, although its own lengths make none.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from random import Random
from typing import Any, TYPE_CHECKING

from linkage_ros.description import Components, each_part, number, part_names
from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics import Closure, Linkage
from linkage_ros.stages.effects.effect import LinkageEffect

if TYPE_CHECKING:
    from linkage_ros.kinematics import SpaceLinkage

TRUNCATED = 3.0
"""A deviation is at most this many standard deviations."""

BEFORE = 1.0153869850528114
"""w: standard deviation before truncation that gives 1 after it."""

_KEY = 'effects.tolerance'
_FARTHEST = 1e9


@dataclass(frozen=True, slots=True)
class ToleranceEffect(LinkageEffect):
    """Points of links, including pivots, that deviate from the linkage file."""

    standard_deviation: float = number(
        'of each coordinate of each point, drawn with the seed; no deviation exceeds three times '
        'this value',
        0.0,
        unit='m',
        least=0.0,
        most=_FARTHEST,
    )
    links: tuple[str, ...] = part_names(
        'links with such deviations, which may include the ground', 'body'
    )
    given: Mapping[str, tuple[float, ...]] = each_part(
        'known deviations, in the frame of the link, in space in that of the ground in the pose; '
        'they replace the drawn ones',
        'hole',
        Components('from the place in the file to the real one', 'm', _FARTHEST),
    )

    sample = '{standard_deviation: 2.0e-5}'

    def alter(self, linkage: Linkage | SpaceLinkage, random: Random) -> Linkage | SpaceLinkage:
        """Return the linkage as manufactured; raise `DefinitionError` if it does not close."""
        altered: Linkage | SpaceLinkage
        if not isinstance(linkage, Linkage):
            from linkage_ros.kinematics import put_together  # local import: loads numpy

            holes = linkage.holes
            deviations: Any = {hole: self._deviation_of(hole, 3, random) for hole in holes}
            if not any(map(any, deviations.values())):
                return linkage
            try:
                altered = put_together(linkage, deviations)
            except DefinitionError as error:
                raise _closing_error(error) from None
        else:
            links = {}
            for link, points in linkage.links.items():
                made = {}
                for point, (px, py) in points.items():
                    dx, dy = self._deviation_of((link, point), 2, random)
                    made[point] = (px + dx, py + dy)
                links[link] = made
            altered = replace(linkage, links=links, nominal=linkage.nominal or linkage)
        _check_closes(altered)
        return altered

    def _deviation_of(self, hole: tuple[str, str], axes: int, random: Random) -> tuple[float, ...]:
        """Return by how much a hole deviates; each is drawn, whether it is wanted or not."""
        is_wanted = not self.links or hole[0] in self.links
        scale = self.standard_deviation if is_wanted else 0.0
        drawn = tuple(scale * _draw_deviation(random) for _ in range(axes))
        return self.given.get('.'.join(hole), drawn)


def _draw_deviation(random: Random) -> float:
    """Draw a deviation from the truncated normal distribution of standard deviation 1."""
    while True:
        value = random.gauss(0.0, BEFORE)
        if abs(value) <= TRUNCATED:
            return value


def _check_closes(linkage: Linkage | SpaceLinkage) -> None:
    try:
        closure = Closure(linkage)
        if len(linkage.inputs) > 1 or closure.input_ranges:
            return
    except DefinitionError as error:
        raise _closing_error(error) from None
    raise _closing_error(DefinitionError('', 'at no value of the input', ''))


def _closing_error(error: DefinitionError) -> DefinitionError:
    reason = f'{error.where}: {error.reason}' if error.where else error.reason
    return DefinitionError(
        _KEY,
        f'with its deviations the linkage does not close: {reason}',
        'let it deviate less, or by another seed',
    )
