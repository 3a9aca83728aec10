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


"""Points of bodies, by where they are: a pin is one point that several bodies have."""

from __future__ import annotations

from collections.abc import Collection

from linkage_ros.robot_models.part import free_name


class Points:
    """
    Points as they are found, one after the other.

    Parameters
    ----------
    near
        Places on a body that are nearer to each other are one, in [m].

    """

    def __init__(self, near: float) -> None:
        self._near = near
        self._same: list[int] = []
        self._found: list[tuple[str, complex]] = []
        self._hints: list[tuple[int, int, str]] = []

    def at(self, body: str, place: complex, hint: str = '', rank: int = 9) -> int:
        """Return the number of the point of a body at a place; a hint may become its name."""
        number = self.there(body, place)
        if number is None:
            number = len(self._found)
            self._found.append((body, place))
            self._same.append(number)
        if hint:
            self._hints.append((rank, number, hint))
        return number

    def there(self, body: str, place: complex) -> int | None:
        """Return the number of a point, if there is one."""
        for number, (other, there) in enumerate(self._found):
            if other == body and abs(there - place) <= self._near:
                return number
        return None

    def hint(self, number: int, name: str, rank: int) -> None:
        """Say what a point may be called; the lowest rank wins."""
        self._hints.append((rank, number, name))

    def join(self, one: int, other: int) -> int:
        """Make two points one pin."""
        kept, gone = self._same[one], self._same[other]
        self._same = [kept if of == gone else of for of in self._same]
        return one

    def named(self, bodies: Collection[str]) -> tuple[dict[str, dict[str, complex]], list[str]]:
        """Return the points of each body by name, and for each number the name."""
        taken: dict[int, str] = {}
        for _, number, hint in sorted(self._hints, key=lambda hint: hint[:2]):
            point = self._same[number]
            if point not in taken:
                taken[point] = free_name(hint, taken.values())
        names = [taken.setdefault(number, f'point_{number + 1}') for number in self._same]
        links: dict[str, dict[str, complex]] = {body: {} for body in bodies}
        for name, (body, place) in zip(names, self._found, strict=True):
            if body in links:
                links[body][name] = place
        return links, names
