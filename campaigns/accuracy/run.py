# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The work of the campaign, in parts that any number of processes share.

Each linkage has a random generator of its own, seeded by the campaign's seed, its family and its
number. So the result does not depend on how the work is shared, and any linkage can be made again.
"""

from __future__ import annotations

from collections.abc import Callable
from math import ceil
import random

from campaigns.accuracy.adversarial import ADVERSARIAL
from campaigns.accuracy.dyads import is_nearly_paired
from campaigns.accuracy.judge import Findings, judge, QUANTITIES, Tally
from campaigns.accuracy.mechanism import Mechanism
from campaigns.accuracy.random_families import ANGLES, RANDOM
from campaigns.accuracy.reference import condition_numbers, margins, Outcome, Reference
from campaigns.campaign import Part, parts_of, tallies_of
from campaigns.series import FACTORIALS, UNIT_ROUNDOFF
from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics import Closure

_PART = 20
"""Number of linkages in a part: about a tenth of a second's work."""


def make(seed: int, family: str, index: int) -> tuple[Mechanism, list[float], list[float]]:
    """
    Return a linkage of a family with its input angles and accelerations.

    A four-bar that is nearly a parallelogram or a kite passes the change points of that linkage,
    not those of its lengths (docs/conventions.md). The reference knows only lengths, so another
    linkage is drawn; about one in a thousand.
    """
    rng = random.Random(f'{seed}/{family}/{index}')
    generate = RANDOM[family][1] if family in RANDOM else ADVERSARIAL[family].make
    mechanism, phi = generate(rng)
    while is_nearly_paired(mechanism):
        mechanism, phi = generate(rng)
    return mechanism, phi, [rng.gauss(0.0, 1.0) for _ in phi]


def examine(seed: int, family: str, index: int) -> Findings:
    """Judge one linkage."""
    return judge(*make(seed, family, index))


def parts(cases: int, adversarial: int, seed: int) -> list[Part]:
    """Return the work for at least so many random and so many adversarial cases."""
    shares = sum(share for share, _ in RANDOM.values())
    wanted = {
        family: ceil(cases * share / shares / ANGLES) for family, (share, _) in RANDOM.items()
    }
    for family in ADVERSARIAL:
        # All linkages of a family have as many angles as its first one.
        angles = len(make(seed, family, 0)[1])
        wanted[family] = ceil(adversarial / len(ADVERSARIAL) / angles)
    return parts_of(seed, wanted, _PART)


def do(part: Part) -> tuple[Part, Tally]:
    """Do one part."""
    tally = Tally()
    for index in part.numbers:
        tally.add(index, examine(part.seed, part.family, index))
    return part, tally


def run(
    work: list[Part], jobs: int, progress: Callable[[int], None] = lambda _: None
) -> dict[str, Tally]:
    """Run all parts as `tallies_of` does, and return the tally of each family with cases."""
    tallies = tallies_of(do, work, jobs, Tally, progress)
    families = ((family, tallies.get(('', family))) for family in (*RANDOM, *ADVERSARIAL))
    return {family: tally for family, tally in families if tally and tally.counts}


def show_case(seed: int, family: str, place: str) -> None:
    """Print a linkage and, where the place is ``linkage:case``, all of a case."""
    index, _, case = place.partition(':')
    mechanism, phi, alpha = make(seed, family, int(index))
    for link, points in mechanism.links.items():
        print(f'{link}: {points}')
    for name, slide in mechanism.sliders.items():
        print(f'{name}: {slide}')
    for dyad in mechanism.dyads:
        print(dyad)
    findings = examine(seed, family, int(index))
    print(dict(findings.counts))
    for number, note in findings.notes:
        print(f'case {number}: {note}')
    for quantity, errors in findings.errors.items():
        number, joint, error = max(errors, key=lambda e: e[2])
        print(f'worst {quantity}: {error:.3g} u·κ in case {number}, joint {joint}')
    if case:
        _show_angle(Reference(mechanism), phi[int(case)], alpha[int(case)])


def _show_angle(reference: Reference, phi: float, alpha: float) -> None:
    print(f'\nφ = {phi!r}, α = {alpha!r}')
    for dyad, (margin, tolerance) in zip(
        reference.mechanism.dyads, margins(reference, phi), strict=False
    ):
        print(f'{type(dyad).__name__}: margin to the next toggle {margin:.3g} (± {tolerance:.1g})')
    found: list[tuple[float, ...]] = []
    try:
        closure = Closure(reference.mechanism.linkage())
        position = closure.position(phi)
        print(f'package: {position.status.name}')
        found.append(position.joints)
        velocity = closure.velocity(position, 1.0)
        found.append(velocity.joints)
        found.append(closure.acceleration(position, velocity, alpha).joints)
    except (DefinitionError, ArithmeticError, ValueError) as error:
        print(f'package: {error!r}')
    truth = reference.solve(phi, alpha)
    print(f'truth: {truth.outcome.name} at {truth.precision} bits')
    if truth.outcome is not Outcome.CLOSED:
        return
    kappa = condition_numbers(truth)
    unit = 2.0**truth.motion.exponent
    for j, (name, joint) in enumerate(reference.mechanism.joints.items()):
        for k, quantity in enumerate(QUANTITIES):
            size = unit if isinstance(joint, str) else 1.0
            exact = float(truth.joints[j][k]) * FACTORIALS[k] * size
            text = f'{name} {quantity}: truth {exact!r}'
            if k < len(found) and found[k]:
                text += f', package {found[k][j]!r}'
            print(f'{text}, u·κ {UNIT_ROUNDOFF * kappa[j, k] * size:.3g}')
