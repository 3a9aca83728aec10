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
How wrong a result may be, in units of u·κ (`reference`), and a record of the worst that was met.

Each limit stands with what was measured over 220,000 random loops of other seeds.
"""

from __future__ import annotations

from linkage_ros.kinematics.status import Status

from .reference import UNIT_ROUNDOFF

ANGLE = 4.0
"""Limit for angles; 2.6 was measured. κ counts an angle as at least π."""

LENGTH = 4.0
"""Limit for slides and for gaps, the latter in u times all lengths; 2.4 and 3.5 were measured."""

RATE = 4.0
"""Limit for rates; `docs/accuracy/campaign.md` has what millions of cases reach."""

TOGGLE = 32.0
"""
Limit for angles at a toggle.

What is within 16 u of a limit position is reported as lying there. With δ the distance, the angle
is off by √δ and κ is 1/(2·√δ), which makes 32 of it; 25 was measured.
"""


class Worst:
    """The worst errors of a sweep, each with the case that it was met in."""

    def __init__(self) -> None:
        self._met: dict[str, tuple[float, float, object]] = {}

    def note(self, quantity: str, error: float, limit: float, case: object) -> None:
        """Remember an error, where it is nearer to its limit than what was seen before."""
        ratio, _, _ = self._met.get(quantity, (-1.0, 0.0, None))
        # Written so that what is not a number counts as worst.
        if not error / limit <= ratio:
            self._met[quantity] = (error / limit, error, case)

    def note_status(
        self, status: Status, gap: float, true_gap: float, size: float, case: object
    ) -> None:
        """
        Check status and gap against the true gap, of which the size is the sum of all lengths.

        A toggle is right where the gap is rounding; how far inside, the limit of its angles says.
        """
        assert (status is not Status.OPEN) or true_gap > 0.0, f'no missed closure: {case}'
        assert (status is not Status.CLOSED) or true_gap <= 0.0, f'no false closure: {case}'
        error = abs(gap - max(true_gap, 0.0)) / (UNIT_ROUNDOFF * size)
        self.note('gap', error, LENGTH, case)

    def check(self) -> None:
        """Fail where an error was above its limit."""
        beyond = {k: v for k, v in self._met.items() if not v[0] <= 1.0}
        assert not beyond, '\n'.join(
            f'{quantity}: {error:.3g} u·κ at {case}'
            for quantity, (_, error, case) in beyond.items()
        )
