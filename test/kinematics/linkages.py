# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Linkage objects for the tests: textbook shapes, in any frames, and dyads alone on a crank."""

from math import cos, sin
from typing import Any

from linkage_ros.kinematics import (
    AssemblyPose,
    crank_diagonal,
    Input,
    Linkage,
    LinkState,
    Point,
    RevoluteJoint,
    RPRDyad,
    RPRPose,
    RRRDyad,
    RRRPose,
    Side,
    SlideJoint,
    Slider,
    swivel_diagonal,
)

# Linkage objects for the tests: textbook shapes, in plain or arbitrary frames.


Frame = tuple[float, float, float]
"""Where a link's plain frame lies in the frame that the linkage file uses: x, y and angle."""

PLAIN: Frame = (0.0, 0.0, 0.0)


def placed(frame: Frame, points: dict[str, Point]) -> dict[str, Point]:
    """Return a link's points in another frame."""
    x0, y0, angle = frame
    return {
        name: (x0 + x * cos(angle) - y * sin(angle), y0 + x * sin(angle) + y * cos(angle))
        for name, (x, y) in points.items()
    }


def four_bar_linkage(
    lengths: tuple[float, float, float, float], side: Side, frames: dict[str, Frame] | None = None
) -> Linkage:
    """Return a four-bar: crank a, coupler b, rocker c, ground d, links along their x axes."""
    a, b, c, d = lengths
    plain: dict[str, dict[str, Point]] = {
        'ground': {'O': (0.0, 0.0), 'D': (d, 0.0)},
        'crank': {'O': (0.0, 0.0), 'A': (a, 0.0)},
        'coupler': {'A': (0.0, 0.0), 'B': (b, 0.0)},
        'rocker': {'D': (0.0, 0.0), 'B': (c, 0.0)},
    }
    return Linkage(
        links={
            name: placed(frames.get(name, PLAIN), points) if frames else points
            for name, points in plain.items()
        },
        inputs=(Input('crank_joint', 'ground', 'crank'),),
        assembly={'B': side},
        joints={
            'coupler_joint': RevoluteJoint('crank', 'coupler'),
            'rocker_joint': RevoluteJoint('ground', 'rocker'),
        },
        sliders={},
    )


def inverted_slider_crank_linkage(
    lengths: tuple[float, float, float],
    side: Side,
    frames: dict[str, Frame] | None = None,
    along: float = 0.0,
) -> Linkage:
    """Return an inverted slider-crank; its slide counts from `along` [m] past the pin's foot."""
    a, d, offset = lengths
    frames = frames or {}
    _, _, angle = frames.get('rod', PLAIN)
    plain: dict[str, dict[str, Point]] = {
        'ground': {'O': (0.0, 0.0), 'C': (d, 0.0)},
        'crank': {'O': (0.0, 0.0), 'A': (a, 0.0)},
        'rod': {'A': (0.0, 0.0), 'T': (along, offset)},
    }
    return Linkage(
        links={
            name: placed(frames.get(name, PLAIN), points) if frames else points
            for name, points in plain.items()
        },
        inputs=(Input('crank_joint', 'ground', 'crank'),),
        assembly={'swivel': side},
        joints={
            'rod_joint': RevoluteJoint('crank', 'rod'),
            'slide_joint': SlideJoint('swivel'),
        },
        sliders={'swivel': Slider('C', 'rod', 'T', (3.0 * cos(angle), 3.0 * sin(angle)))},
    )


def scotch_yoke_linkage(a: float) -> Linkage:
    """Return a Scotch yoke: a crank pin in the upright slot of a yoke that slides along x."""
    return Linkage(
        links={
            'ground': {'O': (0.0, 0.0)},
            'crank': {'O': (0.0, 0.0), 'A': (a, 0.0)},
            'yoke': {'U': (0.0, 0.0)},
        },
        inputs=(Input('crank_joint', 'ground', 'crank'),),
        assembly={},
        joints={'stroke': SlideJoint('way'), 'slot_joint': SlideJoint('slot')},
        sliders={
            'slot': Slider('A', 'yoke', 'U', (0.0, 1.0)),
            'way': Slider('U', 'ground', 'O', (1.0, 0.0), 'yoke'),
        },
    )


def class_3_linkage() -> Linkage:
    """Return a platform on three arms, one of them on the crank: no dyad covers it."""
    return Linkage(
        links={
            'ground': {'O': (0.0, 0.0), 'E': (1.8, 0.6), 'F': (0.5, 1.6)},
            'crank': {'O': (0.0, 0.0), 'A': (0.4, 0.0)},
            'platform': {'P1': (0.0, 0.0), 'P2': (0.8, 0.0), 'P3': (0.4, 0.5)},
            'arm_1': {'A': (0.0, 0.0), 'P1': (0.6, 0.0)},
            'arm_2': {'E': (0.0, 0.0), 'P2': (0.7, 0.0)},
            'arm_3': {'F': (0.0, 0.0), 'P3': (0.6, 0.0)},
        },
        inputs=(Input('crank_joint', 'ground', 'crank'),),
        assembly={},
        joints={
            name: RevoluteJoint('ground', name) for name in ('platform', 'arm_1', 'arm_2', 'arm_3')
        },
        sliders={},
        pose=AssemblyPose((1.0,), {'P1': (0.4, 0.7), 'P2': (1.2, 0.8), 'P3': (0.8, 1.2)}),
    )


# A single dyad on a crank and the ground: its coordinates are those of the loop's own frame.


class _OnCrank:
    """Directions are measured from the ground O→D, the crank's direction is φ."""

    def __init__(self, dyad: Any) -> None:
        self._dyad = dyad
        self.diagonal = dyad.diagonal

    def rates(self, pose: Any, crank_rate: float) -> tuple[float, float]:
        """Return the rates of both coordinates."""
        speeds = LinkState([0.0, crank_rate], [])
        self._dyad.rates(pose, LinkState([], []), speeds)
        first, second = speeds.coordinates[2:]
        return first, second

    def accelerations(
        self, pose: Any, crank_rate: float, crank_acceleration: float
    ) -> tuple[float, float]:
        """Return the accelerations of both coordinates."""
        known, speeds = LinkState([], []), LinkState([0.0, crank_rate], [])
        rates = self._dyad.rates(pose, known, speeds)
        changes = LinkState([0.0, crank_acceleration], [])
        self._dyad.accelerations(pose, rates, known, speeds, changes)
        first, second = changes.coordinates[2:]
        return first, second


class FourBar(_OnCrank):
    """Crank a, coupler b, rocker c, ground d; B on the side of A→D that the sign says."""

    def __init__(self, a: float, b: float, c: float, d: float, sign: int) -> None:
        super().__init__(RRRDyad(crank_diagonal(a, b, c, d), b, c, sign))

    def close(self, phi: float) -> RRRPose:
        """Return the pose at a crank direction."""
        return self._dyad.close(LinkState([0.0, phi], []))  # type: ignore[no-any-return]


class InvertedSliderCrank(_OnCrank):
    """Crank a, ground d, a rod whose line passes the crank pin at an offset."""

    def __init__(self, a: float, d: float, offset: float, sign: int) -> None:
        super().__init__(RPRDyad(swivel_diagonal(a, d, offset), offset, sign))

    def close(self, phi: float) -> RPRPose:
        """Return the pose at a crank direction."""
        return self._dyad.close(LinkState([0.0, phi], []))  # type: ignore[no-any-return]
