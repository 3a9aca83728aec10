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

"""One case, made again and shown in full."""

from __future__ import annotations

from campaigns.accuracy.condition import exact_condition_numbers, FACTORIALS
from campaigns.accuracy.judge import QUANTITIES
from campaigns.accuracy.limits import margins, UNIT_ROUNDOFF
from campaigns.accuracy.reference import Outcome, Reference
from campaigns.accuracy.run import examine, make
from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics.closure import Closure


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
        print(
            f'{type(dyad).__name__}: reaches {margin:.3g} farther than it must (± {tolerance:.1g})'
        )
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
    kappa = exact_condition_numbers(reference, phi, alpha)
    unit = 2.0 ** reference.constants().exponent
    for j, (name, joint) in enumerate(reference.mechanism.joints.items()):
        for k, quantity in enumerate(QUANTITIES):
            size = unit if isinstance(joint, str) else 1.0
            exact = float(truth.joints[j][k]) * FACTORIALS[k] * size
            text = f'{name} {quantity}: truth {exact!r}'
            if k < len(found) and found[k]:
                text += f', package {found[k][j]!r}'
            if kappa is not None:
                text += f', u·κ {UNIT_ROUNDOFF * kappa[j, k] * size:.3g}'
            print(text)
