# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The longest step of an integration.

Beyond one length a stiff load makes the motion grow without end. A shorter one is needed where
the fast motion itself counts, as in the blow on a stop, which a stable step may swallow.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf

from linkage_ros.errors import DefinitionError

STABLE = {'semi_implicit_euler': 1.5, 'rk4': 2.5, 'gauss_legendre': 1.5}
"""
Greatest |s|·h of a motion e^{s·t} for a step h.

The explicit methods are stable up to 2 and 2.78 (E. Hairer, G. Wanner, Solving Ordinary
Differential Equations II, 2nd ed., 1996, IV.2); the stages of the implicit one converge.
"""

EXACT = {'semi_implicit_euler': 0.04, 'rk4': 0.5, 'gauss_legendre': 1.5}
"""
The same for a fast motion that counts: it is right to the share of `_SHARES`.

Measured: the rate after a blow on a stop, as a share of that before it, over dampings and places
of the blow within a step (`test/dynamics/test_longest_step.py`).
"""

_SHARES = {'semi_implicit_euler': '1 %', 'rk4': '0.1 %', 'gauss_legendre': '0.01 %'}

_SHORTEST = 1e-6


def check_step(
    where: str,
    fastest: float,
    method: str,
    step: float,
    fault: str,
    otherwise: str,
    limits: Mapping[str, float] = STABLE,
) -> None:
    """
    Refuse what is too stiff for the step of the integration; the remedy is the longest step.

    ``where`` is the key of what is stiff, and ``fastest`` the greatest |s| of the motion e^{s·t}
    that it causes, in [1/s]. The step of the method is in [s]. ``fault`` says what is wrong, as
    'it is too stiff', ``otherwise`` is the remedy if no step is short enough, and ``limits`` is
    `STABLE` or `EXACT`.
    """
    carried = limits[method] / fastest if fastest else inf
    if step > carried:
        gives = f'follows it to {_SHARES[method]}'
        if limits is STABLE:
            gives = f'is stable; {_in_short(EXACT[method] / fastest)} s {gives}'
        raise DefinitionError(
            where,
            f'{fault} for a step of {step:g} s: motion changes at {fastest:.3g}/s there',
            f'write a step of {_in_short(carried)} s or less in drive.torque, which {gives}'
            if carried >= _SHORTEST
            else otherwise,
        )


def _in_short(seconds: float) -> str:
    """Return a time in two digits, rounded down."""
    near = f'{seconds:.1e}'
    return near if float(near) <= seconds else f'{0.95 * seconds:.1e}'
