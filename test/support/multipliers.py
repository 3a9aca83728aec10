# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Rigid bodies in absolute coordinates with Lagrange multipliers: the reference of forces in space.

Each link has six velocities, and each joint equations between those of two links. All rates and
accelerations follow from these equations by least squares, and the efforts of the inputs are the
multipliers of the equations that drive them. Of a closure only the places of links and points in a
position are used.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation


def matrix_of(tensor):
    """Return six moments of inertia as a matrix."""
    xx, xy, xz, yy, yz, zz = tensor
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def cross_matrix(vector):
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


class AbsoluteMotion:
    """
    The motion of all links of a closure at inputs, their rates and their accelerations.

    Parameters
    ----------
    closure
        A spatial closure.
    inputs, rates, changes
        In [rad] or [m], per second and per second squared.

    """

    def __init__(self, closure, inputs, rates, changes):
        self.closure, self.inputs = closure, inputs
        self.linkage = linkage = closure.linkage
        self.moving = [link for link in linkage.link_names if link != 'ground']
        drawn = closure.frames(closure.close_unlimited(*linkage.pose.inputs))
        now = closure.frames(closure.close_unlimited(*inputs))
        # For each link a point in the pose, its place now, and the rotation since the pose.
        self.frames = {
            link: (np.array(drawn[link][0]), np.array(place), Rotation.from_quat(turn).as_matrix())
            for link, (place, turn) in now.items()
        }
        self.size = 6 * len(self.moving)
        self.velocity = self.spin = None
        rows, self.owners = [], []
        for name, joint in linkage.pair_joints.items():
            rows += self._joint(name)
            self.owners += [(joint.child, joint.parent)] * (len(rows) - len(self.owners))
        for point in linkage.points:
            carriers = [link for link, points in linkage.links.items() if point in points]
            for other in carriers[1:]:
                rows += self._meet(carriers[0], other, self.place(other, linkage.points[point]))
                self.owners += [(other, carriers[0])] * 3
        for name, ratio in linkage.ratios.items():
            own, of = self._rate(name), self._rate(ratio.of)
            rows.append((own[0] - ratio.ratio * of[0], lambda own=own, of=of, k=ratio.ratio:
                         own[1]() - k * of[1]()))  # fmt: skip
        driven = [self._rate(name) for name in linkage.driven]
        self.equations = np.array([row for row, _ in (*rows, *driven)])
        still = np.zeros(len(rows))
        self.rates = self._solve([*still, *rates])
        bias = np.array([curved() for _, curved in (*rows, *driven)])
        self.changes = self._solve(np.array([*still, *changes]) - bias)

    def _solve(self, right):
        found, *_ = np.linalg.lstsq(self.equations, right, rcond=1e-11)
        off = np.abs(self.equations @ found - right).max()
        assert off < 1e-8 * (1.0 + np.abs(right).max()), 'the joints contradict each other'
        return found

    def place(self, link, drawn):
        """Return where a point of a link is, by its place in the pose."""
        at, now, turn = self.frames[link]
        return now + turn @ (np.array(drawn) - at)

    def turned(self, link, vector):
        return self.frames[link][2] @ np.array(vector)

    def columns(self, link, place):
        """Return the matrices that give velocity at a place and spin of a link from all rates."""
        velocity, spin = np.zeros((3, self.size)), np.zeros((3, self.size))
        if link != 'ground':
            first = 6 * self.moving.index(link)
            middle, last = first + 3, first + 6
            velocity[:, first:middle] = spin[:, middle:last] = np.eye(3)
            velocity[:, middle:last] = -cross_matrix(place - self.frames[link][1])
        return velocity, spin

    def motion(self, link, place):
        """Return velocity, spin, acceleration and its change of a link at a place."""
        at, turns = self.columns(link, place)
        spin = turns @ self.rates
        whirl = np.cross(spin, np.cross(spin, place - self.frames[link][1]))
        return at @ self.rates, spin, at @ self.changes + whirl, turns @ self.changes

    def _whirl(self, link, place):
        """Return the acceleration of a point of a link from its spin alone."""
        spin = self.columns(link, place)[1] @ self.rates
        return np.cross(spin, np.cross(spin, place - self.frames[link][1]))

    def _meet(self, one, other, place):
        """Return the equations of a ball: rows, and what of their derivative the rates give."""
        rows = self.columns(other, place)[0] - self.columns(one, place)[0]
        return [
            (rows[k], lambda k=k: (self._whirl(other, place) - self._whirl(one, place))[k])
            for k in range(3)
        ]

    def _ends(self, name):
        joint = self.linkage.pair_joints[name]
        at = joint.at if name in self.linkage.hinges else self.frames[joint.child][0]
        place = self.place(joint.child, at)
        axis = self.turned(joint.parent, np.array(joint.axis) / np.linalg.norm(joint.axis))
        return joint.parent, joint.child, place, axis

    def _joint(self, name):
        parent, child, place, axis = self._ends(name)
        (on, turn_on), (at, turn) = self.columns(parent, place), self.columns(child, place)

        def spin(link):
            return self.columns(link, place)[1] @ self.rates

        if name in self.linkage.hinges:
            # The axes of both links stay the same: of the three rows one says nothing.
            rows = -cross_matrix(axis) @ (turn - turn_on)

            def curved(k):
                return (
                    np.cross(spin(child), np.cross(spin(child), axis))
                    - np.cross(spin(parent), np.cross(spin(parent), axis))
                )[k]

            turned = [(rows[k], lambda k=k: curved(k)) for k in range(3)]
            return [*self._meet(parent, child, place), *turned]
        beside = np.eye(3) - np.outer(axis, axis)
        rows = beside @ (at - on)
        return [
            *((row, lambda: 0.0) for row in turn - turn_on),
            *(
                (rows[k], lambda k=k: (beside @ self._relative(parent, child, place, at - on))[k])
                for k in range(3)
            ),
        ]

    def _relative(self, parent, child, place, rows):
        """Return the acceleration of a point along a moving slide from the rates alone."""
        spin = self.columns(parent, place)[1] @ self.rates
        return (
            self._whirl(child, place)
            - self._whirl(parent, place)
            - 2.0 * np.cross(spin, rows @ self.rates)
        )

    def _rate(self, name):
        """Return the row of a joint's rate, and what of its derivative the rates give."""
        linkage = self.linkage
        if name in linkage.struts:
            ends = []
            for point in linkage.struts[name]:
                link = next(link for link, points in linkage.links.items() if point in points)
                ends.append((link, self.place(link, linkage.points[point])))
            (one, start), (other, end) = ends
            along = end - start
            length = np.linalg.norm(along)
            rows = self.columns(other, end)[0] - self.columns(one, start)[0]

            def stretched():
                apart = rows @ self.rates
                beside = apart - along * (along @ apart) / length**2
                whirl = self._whirl(other, end) - self._whirl(one, start)
                return (along @ whirl + beside @ beside) / length

            return along @ rows / length, stretched
        parent, child, place, axis = self._ends(name)
        (on, turn_on), (at, turn) = self.columns(parent, place), self.columns(child, place)
        if name in linkage.hinges:
            return axis @ (turn - turn_on), lambda: 0.0
        return axis @ (at - on), lambda: axis @ self._relative(parent, child, place, at - on)

    def efforts(self, gravity=(0.0, 0.0, 0.0), loads=()):
        """
        Return the efforts of the inputs.

        ``loads`` are forces and moments on links: link, place now, force, moment.
        """
        multipliers = self._multipliers(gravity, loads)
        return multipliers[-len(self.linkage.driven):]  # fmt: skip

    def wrenches(self, gravity=(0.0, 0.0, 0.0), loads=()):
        """
        Return the force, and the moment about the origin, that two links exert on each other.

        They are by the names of the two, and act on the first one: through all joints between
        them, without drives and ratios.
        """
        multipliers = self._multipliers(gravity, loads)
        found = {}
        for (one, other), row, size in zip(self.owners, self.equations, multipliers, strict=False):
            link, to = sorted((one, other), key=lambda name: (name == 'ground', name))
            first = 6 * self.moving.index(link)
            force, moment = size * row.reshape(-1, 2, 3)[first // 6]
            moment = moment + np.cross(self.frames[link][1], force)
            before = found.get((link, to), np.zeros((2, 3)))
            found[link, to] = before + np.array([force, moment])
        return found

    def _multipliers(self, gravity, loads):
        needed = np.zeros(self.size)
        for link, body in self.linkage.masses.items():
            place = self.place(link, body.center)
            at, turns = self.columns(link, place)
            _, spin, pull, change = self.motion(link, place)
            turn = self.frames[link][2]
            tensor = turn @ matrix_of(body.inertia) @ turn.T
            needed += at.T @ (body.mass * (pull - np.array(gravity)))
            needed += turns.T @ (tensor @ change + np.cross(spin, tensor @ spin))
        for link, place, force, moment in loads:
            at, turns = self.columns(link, place)
            needed -= at.T @ np.array(force) + turns.T @ np.array(moment)
        multipliers, *_ = np.linalg.lstsq(self.equations.T, needed, rcond=1e-11)
        off = np.abs(self.equations.T @ multipliers - needed).max()
        assert off < 1e-7 * (1.0 + np.abs(needed).max()), 'the joints do not hold the links'
        return multipliers

    def joint_loads(self, name, effort):
        """Yield the loads of an effort on a joint: on its child and, reversed, on its parent."""
        none = np.zeros(3)
        if name in self.linkage.struts:
            ends = []
            for point in self.linkage.struts[name]:
                carriers = self.linkage.links.items()
                link = next(link for link, points in carriers if point in points)
                ends.append((link, self.place(link, self.linkage.points[point])))
            (one, start), (other, end) = ends
            along = effort * (end - start) / np.linalg.norm(end - start)
            yield one, start, -along, none
            yield other, end, along, none
            return
        parent, child, place, axis = self._ends(name)
        force, moment = (none, axis) if name in self.linkage.hinges else (axis, none)
        yield child, place, effort * force, effort * moment
        yield parent, place, -effort * force, -effort * moment

    def joint_rate(self, name):
        """Return the rate of a joint."""
        return self._rate(name)[0] @ self.rates
