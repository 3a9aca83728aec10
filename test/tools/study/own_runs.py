# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Runs of scenes and exact motions that share nothing with the code that measures.

A scene ticks as in the node, and its messages are read. The four-bar of the gallery has its
angles in closed form and its equation of motion by differences of its energy; it is
integrated by LSODA. A crank of constant inertia moves in parabolas, whose meetings are roots.
"""

from cmath import rect
from math import copysign, inf, sin, sqrt

from linkage_ros.messages import JOINT_STATE_TYPE, JointStateWriter, MessageValues, POSITION, RATE
from linkage_ros.tick import Pipeline
from scipy.integrate import solve_ivp

from ...support.four_bar import four_bar_angles, GALLERY

BEGIN = 10**9


def run_scene(scene, ticks, messages=()):
    """Yield time, positions and rates by joint, of each tick, in [ns] since the first one."""
    pipeline = Pipeline(scene)
    reader = MessageValues(JOINT_STATE_TYPE, scene.dependent_joints)
    waiting = list(messages)
    for index in range(ticks):
        now = round(index * 1e9 / scene.rate)
        while waiting and waiting[0][0] <= now:
            time, message = waiting.pop(0)
            pipeline.offer(message, BEGIN + time)
        message = pipeline.tick(BEGIN + now).message
        if message:
            values = reader.read(message)
            numbers = dict(zip(values.keys, values.numbers, strict=True))
            yield (
                now,
                *(
                    {name: v for (name, kind), v in numbers.items() if kind == wanted}
                    for wanted in (POSITION, RATE)
                ),
            )


def command_messages(commands, *joints):
    """Return the messages of commands, by their times in [ns]."""
    write, zeros = JointStateWriter([*joints]).write, (0.0,) * len(joints)
    return [(each.time, write(BEGIN, zeros, zeros, each.efforts)) for each in commands]


A, B, C, D = GALLERY

_MASSES = (  # Mass, centre, inertia of crank, coupler and rocker.
    (0.025, 0.020 + 0j, 4.2e-6),
    (0.100, 0.060 + 0.005j, 1.05e-4),
    (0.050, 0.040 + 0j, 2.8e-5),
)


def four_bar_joints(theta):
    """Return the published joints."""
    coupler, rocker = four_bar_angles(theta)
    return {'crank_joint': theta, 'coupler_joint': coupler - theta, 'rocker_joint': rocker}


def four_bar_ratios(theta):
    """Return the rates of crank, coupler and rocker, as factors of the crank's."""
    coupler, rocker = four_bar_angles(theta)
    return (
        1.0,
        A * sin(rocker - theta) / (B * sin(coupler - rocker)),
        A * sin(theta - coupler) / (C * sin(rocker - coupler)),
    )


class FourBar:
    """The equation of motion of the gallery's four-bar: I·q̈ + ½·I'·q̇² + V' + F = τ."""

    def __init__(self, drive_inertia=0.0, gravity=0.0, viscous=0.0, dry=(0.0, 0.0, 0.0, 0.0)):
        self.drive_inertia, self.gravity, self.viscous, self.dry = (
            drive_inertia, gravity, viscous, dry
        )  # fmt: skip

    def inertia(self, theta):
        coupler, _ = four_bar_angles(theta)
        ratios = four_bar_ratios(theta)
        directions = (theta, coupler, four_bar_angles(theta)[1])
        pin_rate = 1j * rect(A, theta)
        total = self.drive_inertia
        for index, (mass, center, inertia) in enumerate(_MASSES):
            speed = 1j * ratios[index] * center * rect(1.0, directions[index])
            if index == 1:
                speed += pin_rate
            total += mass * abs(speed) ** 2 + inertia * ratios[index] ** 2
        return total

    def potential(self, theta):
        coupler, rocker = four_bar_angles(theta)
        places = (
            _MASSES[0][1] * rect(1.0, theta),
            rect(A, theta) + _MASSES[1][1] * rect(1.0, coupler),
            D + _MASSES[2][1] * rect(1.0, rocker),
        )
        return sum(
            mass * self.gravity * place.imag
            for (mass, _, _), place in zip(_MASSES, places, strict=True)
        )

    def dry_friction(self, theta):
        _, coupler, rocker = four_bar_ratios(theta)
        slips = (1.0, coupler - 1.0, rocker - coupler, rocker)
        return sum(t * abs(slip) for t, slip in zip(self.dry, slips, strict=True))

    def push(self, theta, effort):
        h = 1e-5
        return effort - (self.potential(theta + h) - self.potential(theta - h)) / (2.0 * h)

    def acceleration(self, theta, rate, effort, sense):
        h = 1e-5
        slope = (self.inertia(theta + h) - self.inertia(theta - h)) / (2.0 * h)
        resisted = self.viscous * rate + sense * self.dry_friction(theta)
        push = self.push(theta, effort) - resisted - 0.5 * slope * rate * rate
        return push / self.inertia(theta)

    def moved(self, start, commands, times):
        """Return the crank at some times in [s], under commands of (time, effort)."""
        found, state, now = [], [start, 0.0], 0.0
        ends = [*(time for time, _ in commands[1:]), times[-1]]
        for (_, effort), end in zip(commands, ends, strict=True):
            while now < end:
                passed = len(found)
                wanted = [time for time in times[passed:] if now < time <= end]
                now, state, values = self._piece(state, effort, now, end, wanted)
                found += values
        return found

    def _piece(self, state, effort, now, end, wanted):
        sense = copysign(1.0, state[1])
        if not any(self.dry):
            sense = 0.0
        elif not state[1]:
            push = self.push(state[0], effort)
            if abs(push) <= self.dry_friction(state[0]):
                return end, state, [state[0]] * len(wanted)
            sense = copysign(1.0, push)

        def turns(_, y):
            return sense * y[1] if sense else 1.0

        turns.terminal, turns.direction = True, -1.0
        solved = solve_ivp(
            lambda _, y: (y[1], self.acceleration(*y, effort, sense)), (now, end), state,
            method='LSODA', rtol=1e-11, atol=1e-12, events=turns, dense_output=True,
        )  # fmt: skip
        stop = solved.t[-1]
        values = [solved.sol(time)[0] for time in wanted if time <= stop]
        if solved.status == 1:
            return stop, [solved.y[0, -1], 0.0], values
        return end, solved.y[:, -1].tolist(), values


def first_root(c, b, a, end):
    """Return the first t in (0, end] at which c + b·t + a·t²/2 falls through 0, or None."""
    if a == 0.0:
        roots = [-c / b] if b else []
    else:
        inner = b * b - 2.0 * a * c
        roots = [(-b + sign * sqrt(inner)) / a for sign in (1.0, -1.0)] if inner >= 0.0 else []
    good = [t for t in roots if 1e-13 < t <= end and b + a * t < 0.0]
    return min(good, default=None)


def parabolas(start, inertia, commands, times, stops=(-inf, inf), restitution=0.0):
    """Return a crank of constant inertia at some times, that bounces from its stops."""
    found, q, w, now = [], start, 0.0, 0.0
    low, high = stops
    ends = [*(time for time, _ in commands[1:]), times[-1]]
    for (_, effort), end in zip(commands, ends, strict=True):
        a = effort / inertia
        while now < end:
            hits = (first_root(high - q, -w, -a, end - now), first_root(q - low, w, a, end - now))
            rests = not w and ((q >= high and a >= 0.0) or (q <= low and a <= 0.0))
            t = end - now if rests else min([t for t in hits if t is not None], default=end - now)
            passed = len(found)
            for time in times[passed:]:
                if time > now + t:
                    break
                s = time - now
                found.append(q if rests else q + w * s + 0.5 * a * s * s)
            if rests:
                now = end
                break
            hit = next((k for k, each in enumerate(hits) if each == t), None)
            q, w, now = q + w * t + 0.5 * a * t * t, w + a * t, now + t
            if hit is not None:
                q = (high, low)[hit]
                w = -restitution * w if abs(w) > 1e-7 else 0.0
    return found


def parabolas_with_play(start, inertia, motor, play, commands, times):
    """Return a crank behind the play of a motor, that never bounce off each other."""
    found, now, side = [], 0.0, 0
    q = p = start
    w = v = 0.0
    ends = [*(time for time, _ in commands[1:]), times[-1]]
    for (_, effort), end in zip(commands, ends, strict=True):
        while now < end:
            if side and side * effort < 0.0:
                side = 0
            a = effort / (inertia + motor) if side else 0.0
            b = a if side else effort / motor
            r, u = p - q, v - w
            meets = None
            if not side:
                half = 0.5 * play
                each = (
                    first_root(half - r, -u, -b, end - now),
                    first_root(half + r, u, b, end - now),
                )
                meets = min([t for t in each if t is not None], default=None)
            t = end - now if meets is None else meets
            passed = len(found)
            for time in times[passed:]:
                if time > now + t:
                    break
                s = time - now
                found.append(q + w * s + 0.5 * a * s * s)
            q, w = q + w * t + 0.5 * a * t * t, w + a * t
            p, v, now = p + v * t + 0.5 * b * t * t, v + b * t, now + t
            if meets is not None:
                side = 1 if p > q else -1
                w = v = (inertia * w + motor * v) / (inertia + motor)
    return found
