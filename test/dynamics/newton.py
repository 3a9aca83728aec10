# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A linkage whose joints do not meet exactly, solved in the poses of all its links.

Nothing of the package's ways is used but the list of joints: unknown are the place and the angle
of every link, the equations are the joints' own, the Jacobian is differences, and Newton's method
starts from a pose close by.
"""

from cmath import rect
from math import hypot, tau

from linkage_ros.kinematics import Closure, GROUND, RevoluteJoint
import numpy as np


def displaced(closure: Closure, inputs: tuple[float, ...], offsets) -> np.ndarray:
    """Return the published joints where pins miss by offsets: the place on `link` less `to`'s."""
    linkage, structure = closure.linkage, closure.structure
    position = closure.position(*inputs)
    points, angles = closure.points(position), closure.link_angles(position)
    moving = [link for link in structure.links if link != GROUND]
    starts = []
    for link in moving:
        name, place = next(iter(structure.links[link].items()))
        origin = points[link, name] - rect(1.0, angles[link]) * complex(*place)
        starts += [origin.real, origin.imag, angles[link]]

    def frame(x, link):
        if link == GROUND:
            return 0j, 0.0
        i = 3 * moving.index(link)
        return complex(x[i], x[i + 1]), x[i + 2]

    def place(x, link, name):
        origin, angle = frame(x, link)
        return origin + rect(1.0, angle) * complex(*structure.links[link][name])

    def seen(x, name):
        """Return where a slider's point lies from its line's start: along it and across it."""
        slider, block = linkage.sliders[name], structure.blocks[name]
        line = complex(*slider.direction) / hypot(*slider.direction)
        line *= rect(1.0, frame(x, slider.along)[1])
        return place(x, block, slider.point) - place(x, slider.along, slider.through), line

    def residual(x):
        open_by = []
        for joint, offset in zip(structure.joints, offsets, strict=True):
            if joint.kind == 'R':
                gap = place(x, joint.link, joint.name) - place(x, joint.to, joint.name) - offset
                open_by += [gap.real, gap.imag]
            else:
                between, line = seen(x, joint.name)
                open_by.append(((between - offset) * line.conjugate()).imag)
                turned = frame(x, joint.link)[1] - frame(x, joint.to)[1]
                open_by.append(turned - linkage.sliders[joint.name].angle - blocks[joint.name])
        for given, value in zip(linkage.inputs, inputs, strict=True):
            if given.slider:
                between, line = seen(x, given.slider)
                open_by.append((between * line.conjugate()).real - value)
            else:
                turned = frame(x, given.child)[1] - frame(x, given.parent)[1]
                open_by.append(turned - value)
        return np.array(open_by)

    # Whole turns that the angles have at the start.
    blocks = {
        name: np.round((angles[structure.blocks[name]] - angles[s.along] - s.angle) / tau) * tau
        for name, s in linkage.sliders.items()
    }
    x = np.array(starts)
    for _ in range(8):
        step = 1e-6
        jacobian = np.array(
            [
                (residual(x + step * e) - residual(x - step * e)) / (2 * step)
                for e in np.eye(len(x))
            ]
        ).T
        x = x - np.linalg.solve(jacobian, residual(x))
    assert np.abs(residual(x)).max() < 1e-13
    return np.array(
        [
            frame(x, joint.child)[1] - frame(x, joint.parent)[1]
            if isinstance(joint, RevoluteJoint)
            else (seen(x, joint.slider)[0] * seen(x, joint.slider)[1].conjugate()).real
            for joint in linkage.joints.values()
        ]
    )
