# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The four-bar worked out by hand, in 30 digits: pose, energy, and balance with play in its pins.

Nothing here is the package's own: the pose is that of two circles, rates are differences, and
forces come from the balance of each link.
"""

from typing import NamedTuple

from mpmath import MPContext

from ...support.four_bar import meeting_point

mp = MPContext()
mp.dps = 30
mpc, mpf = mp.mpc, mp.mpf


class Body(NamedTuple):
    """A link: mass, centre of mass from its first pin in its own frame, moment of inertia."""

    mass: mpf
    center: mpc
    inertia: mpf


class FourBar:
    """The four-bar of a linkage, with θ, ω, α of its crank and the gravity downwards in [m/s²]."""

    def __init__(self, linkage, motion, gravity):
        points = linkage.links
        self.a = mpf(points['crank']['A'][0])
        self.b = mpf(points['coupler']['B'][0])
        self.c = mpf(points['rocker']['B'][0])
        self.d = mpf(points['ground']['O4'][0])
        self.bodies = [
            Body(mpf(m.mass), mpc(*m.center), mpf(m.inertia))
            for m in (linkage.masses[link] for link in ('crank', 'coupler', 'rocker'))
        ]
        self.motion = [mpf(value) for value in motion]
        self.gravity = mpf(gravity)

    def crank(self, t):
        theta, omega, alpha = self.motion
        return theta + omega * t + alpha * t * t / 2

    def angles(self, t):
        """Return the angles of crank, coupler and rocker at a time: B is left of A→O4."""
        theta = self.crank(t)
        at_a = self.a * turn(theta)
        at_b = meeting_point(at_a, self.d, self.b, self.c)
        return theta, mp.arg(at_b - at_a), mp.arg(at_b - self.d)

    def centers(self, t):
        turns = [turn(angle) for angle in self.angles(t)]
        first_pins = (0, self.a * turns[0], self.d)
        return [
            pin + turned * body.center
            for pin, turned, body in zip(first_pins, turns, self.bodies, strict=True)
        ]

    def energy(self, t, drive_inertia=0):
        """Return kinetic and potential energy, in [J]."""
        energy = mpf(drive_inertia) * mp.diff(self.crank, t) ** 2 / 2
        for i, body in enumerate(self.bodies):
            speed = mp.diff(lambda u, i=i: self.centers(u)[i], t)
            spin = mp.diff(lambda u, i=i: self.angles(u)[i], t)
            energy += (body.mass * abs(speed) ** 2 + body.inertia * spin**2) / 2
            energy += body.mass * self.gravity * self.centers(t)[i].imag
        return energy

    def borne(self):
        """Return for each link weight and inertia: force at its centre, and moment, at t = 0."""
        return [
            (
                -body.mass
                * (1j * self.gravity + mp.diff(lambda u, i=i: self.centers(u)[i], 0, 2)),
                -body.inertia * mp.diff(lambda u, i=i: self.angles(u)[i], 0, 2),
            )
            for i, body in enumerate(self.bodies)
        ]

    def balance(self, plays=(0, 0, 0, 0)):
        """
        Return the pose, and the forces, in balance with what the links bear without play.

        In each of the pins O2, A, B and O4 a massless link as long as the play joins the two
        links, and is pulled, so that it lies along the force: at any play, not to first order.

        Returns
        -------
        phi, psi
            Angles of coupler and rocker.
        forces
            At O2 of the ground on the crank, at A of the crank on the coupler, at B of the coupler
            on the rocker, at O4 of the ground on the rocker.

        """
        theta, phi0, psi0 = self.angles(0)
        borne = self.borne()
        (crank, _), (coupler, coupler_moment), (rocker, rocker_moment) = borne
        crank_turn = turn(theta)

        def forces(at_b):
            at_a = at_b - coupler
            return at_a - crank, at_a, at_b, -at_b - rocker

        def leaning(at_b, lengths):
            return [
                -length * force / abs(force) if length else 0
                for length, force in zip(lengths, forces(at_b), strict=True)
            ]

        def unbalanced(lengths, phi, psi, x, y):
            at_b = mpc(x, y)
            e2, ea, eb, e4 = leaning(at_b, lengths)
            bar, arm = turn(phi), turn(psi)
            b_of_coupler = e2 + self.a * crank_turn + ea + self.b * bar
            loop = self.d + e4 + self.c * arm - b_of_coupler - eb
            on_coupler = (
                cross(self.bodies[1].center * bar, coupler)
                + coupler_moment
                + cross(self.b * bar, -at_b)
            )
            on_rocker = (
                cross(self.bodies[2].center * arm, rocker)
                + rocker_moment
                + cross(self.c * arm, at_b)
            )
            return [loop.real, loop.imag, on_coupler, on_rocker]

        start = (phi0, psi0, 1, 1)
        for lengths in ((0, 0, 0, 0), tuple(map(mpf, plays))):
            found = mp.findroot(lambda *at, lengths=lengths: unbalanced(lengths, *at), start)
            start = tuple(found)
        phi, psi, x, y = start
        return phi, psi, forces(mpc(x, y))


def cross(one, other):
    return one.real * other.imag - one.imag * other.real


def turn(angle):
    """Return e^{iθ} of a real angle; mpmath's own refuses to be complex within a root finder."""
    return mpc(mp.cos(angle), mp.sin(angle))
