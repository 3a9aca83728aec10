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


"""How far along a curve its points are; lengths are those of the chords."""

from __future__ import annotations

from linkage_ros.kinematics.batch import Array, Complex
import numpy as np


def along(curves: Complex) -> Array:
    """Return how far along its curve every point is, from 0 to 1, (n, M)."""
    steps = np.abs(np.diff(curves, axis=1))
    way = np.zeros(curves.shape)
    np.cumsum(steps, axis=1, out=way[:, 1:])
    way /= np.maximum(way[:, -1:], 1e-300)
    return way


def fractions(points: Complex) -> Array:
    """Return how far along a path its points are, from 0 to 1, (N,)."""
    return along(points[None, :]).ravel()


def theta_at(way: Array, wanted: Array) -> Array:
    """
    Return where curves are so far along, as a fraction of their steps.

    Parameters
    ----------
    way
        As from `along`, (n, M).
    wanted
        From 0 to 1, (N,), or (n, N).

    """
    before, part = _segment(way, wanted)
    part += before
    part /= way.shape[1] - 1
    return part


def resampled(curves: Complex, way: Array, wanted: Array) -> Complex:
    """Return the places of curves (n, M) that are so far along, (n, N), on their chords."""
    before, part = _segment(way, wanted)
    start = np.take_along_axis(curves, before, axis=1)
    end = np.take_along_axis(curves, before + 1, axis=1)
    places: Complex = start + part * (end - start)
    return places


def _segment(
    way: Array, wanted: Array
) -> tuple[np.ndarray[tuple[int, int], np.dtype[np.int64]], Array]:
    """Return the step that each is in, and how far in it, (n, N) both."""
    rows, last = len(way), way.shape[1] - 1
    wanted = np.broadcast_to(wanted, (rows, wanted.shape[-1]))
    # One search for all rows: each has a range of its own.
    offset = 2.0 * np.arange(rows)[:, None]
    found = np.searchsorted((way + offset).ravel(), (wanted + offset).ravel(), side='right')
    before = found.reshape(wanted.shape) - np.arange(rows)[:, None] * (last + 1) - 1
    before = np.clip(before, 0, last - 1)
    low = np.take_along_axis(way, before, axis=1)
    high = np.take_along_axis(way, before + 1, axis=1)
    return before, np.clip((wanted - low) / np.maximum(high - low, 1e-300), 0.0, 1.0)
