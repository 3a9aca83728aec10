# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Numbers from a caller as doubles, whatever their type; what is not a number is refused.

A number has ``__float__`` or ``__index__``, as for `math`: a text has neither, and so has a date.
A number beyond the doubles is infinite, as the literal ``1e400`` is in Python.
"""

from __future__ import annotations

from math import inf
from typing import Any, TYPE_CHECKING

from linkage_ros.errors import quote

if TYPE_CHECKING:
    from linkage_ros.kinematics.batch import Array

HUGE = 2.0**400
"""
Rates from here on are scaled by `SHRINK`, lest a square or a product overflow.

So are accelerations from its square on. They are scaled by the square of `SHRINK`: accelerations
of joints are linear in the accelerations of the inputs, and quadratic in the rates.
"""

SHRINK = 2.0**-700
"""A power of two: it changes no digit."""


def to_double(what: str, value: Any, remedy: str = '') -> float:
    """
    Return a number as a double.

    What is not a number raises TypeError, and a masked number ValueError; the line begins with
    ``what`` and ends with the remedy.
    """
    try:
        if hasattr(value, 'dtype'):
            array = to_doubles(what, value)
            if not array.ndim:
                return float(array)
        elif hasattr(type(value), '__float__') or hasattr(type(value), '__index__'):
            return float(value)
    except OverflowError:
        return inf if value > 0 else -inf
    except (TypeError, ValueError) as error:
        if str(error).startswith(what):
            raise
    raise TypeError(f'{what}: {quote(value)} is not a number{remedy}')


def columns_of(what: str, values: Any) -> list[Any] | None:
    """Return the columns of an array (N, joints); None if it has another number of dimensions."""
    array = to_doubles(what, values)
    return [*array.T] if array.ndim == 2 else None


def to_doubles(what: str, values: Any) -> Array:
    """Return an array of numbers, of any shape, as doubles; errors as `to_double`."""
    import numpy as np  # local import: a single number needs none

    if type(values) not in (np.ndarray, list, float) and np.ma.is_masked(values):
        raise ValueError(f'{what}: some values are masked; fill them, for example with numpy.nan')
    try:
        array = np.asarray(values)
    except OverflowError:
        array = np.asarray(values, object)
    except ValueError:
        raise ValueError(f'{what}: rows of different lengths form no array') from None
    if array.dtype == np.float64:
        return np.asarray(array)
    kind = array.dtype.kind
    if kind in 'biuf':
        with np.errstate(over='ignore'):
            return array.astype(np.float64)
    if kind != 'O':
        first = array.ravel()[:1].tolist()
        raise TypeError(f'{what}: {quote(first[0] if first else values)} is not a number')
    doubles = [to_double(what, value) for value in array.ravel().tolist()]
    return np.array(doubles, np.float64).reshape(array.shape)
