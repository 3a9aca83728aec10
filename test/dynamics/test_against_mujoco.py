# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Efforts and pin reactions against MuJoCo, which knows nothing of closed loops here.

The linkage is cut at as many pins as it has loops. What is left is a tree, whose coordinates are
the crank's angle and the published joints. MuJoCo's inverse dynamics gives the generalised forces
Q that the tree's motion takes; the motion is differences of the closed positions. They come from
the drive and from the forces λ on the cut pins, through the pins' Jacobian J, again MuJoCo's::

    Q = (τ, 0, …, 0) + Jᵀ·λ

a linear system for τ and λ. Without λ, τ = Kᵀ·Q with the ratios K = dq/dθ of the closed linkage
(virtual work). With τ and λ known, MuJoCo also gives the forces in the pins of the tree.
"""

from linkage_ros.dynamics import Loads, Mechanics, Reactions
from linkage_ros.kinematics import Closure
import numpy as np
import pytest

from .loaded import shipped, slope, weighed

mujoco = pytest.importorskip('mujoco')
GRAVITY = (1.5, -9.81)

# The links of each tree with their parents and pins, in the order of the published joints, and
# the pins that are cut, each with the two links that it joined: joint.link and joint.to.
TREES = {
    'four_bar': (
        (('crank', 'ground', 'O2'), ('coupler', 'crank', 'A'), ('rocker', 'ground', 'O4')),
        (('B', 'rocker', 'coupler'),),
    ),
    'watt_1': (
        (
            ('crank', 'ground', 'O2'), ('coupler', 'crank', 'A'), ('rocker', 'ground', 'O4'),
            ('upper_link', 'coupler', 'C'), ('output_link', 'rocker', 'D'),
        ),
        (('B', 'rocker', 'coupler'), ('E', 'output_link', 'upper_link')),
    ),
}  # fmt: skip
RATE, PULL = 2.3, -4.0


def model_of(linkage, bodies):
    """Return MuJoCo's model of a tree: each link a body whose frame is the link's."""

    def body(link, parent, pin):
        # MuJoCo turns a body about a joint at `pos`, so the frames are parallel at zero.
        (x, y), (px, py) = linkage.links[link][pin], linkage.links[parent][pin]
        mass = linkage.masses[link]
        sites = ''.join(
            f'<site name="{link}/{name}" pos="{sx!r} {sy!r} 0"/>'
            for name, (sx, sy) in linkage.links[link].items()
        )
        children = ''.join(body(*child) for child in bodies if child[1] == link)
        j = repr(mass.inertia)
        return (
            f'<body name="{link}" pos="{px - x!r} {py - y!r} 0">'
            f'<joint type="hinge" axis="0 0 1" pos="{x!r} {y!r} 0" damping="0"/>'
            f'<inertial mass="{mass.mass!r}" pos="{mass.center[0]!r} {mass.center[1]!r} 0" '
            f'diaginertia="{j} {j} {j}"/>{sites}{children}</body>'
        )

    tree = ''.join(body(*child) for child in bodies if child[1] == 'ground')
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><compiler inertiafromgeom="false" boundmass="0" boundinertia="0"/>'
        f'<option gravity="{GRAVITY[0]} {GRAVITY[1]} 0"/><worldbody>{tree}</worldbody></mujoco>'
    )
    # Joints stand in the order of the tree, depth first, not in ours.
    order = [model.body(link).jntadr[0] for link, _, _ in bodies]
    return model, order


def tree_motion(closure, angle):
    """Return the coordinates of the tree, their rates and accelerations, and the ratios dq/dθ."""

    def at(q):
        return np.array([q, *closure.position(q).joints])

    first = np.array(slope(at, angle))
    second = np.array(slope(lambda q: np.array(slope(at, q)), angle))
    return at(angle), RATE * first, PULL * first + RATE**2 * second, first


@pytest.fixture(
    params=[(name, make) for name in TREES for make in (shipped, weighed)],
    ids=lambda case: f'{case[0]} {case[1].__name__}',
)
def case(request):
    name, make = request.param
    linkage = make(name)
    bodies, cuts = TREES[name]
    return Closure(linkage), bodies, cuts, *model_of(linkage, bodies)


def ours(closure, angle):
    """Return the effort and, by pin, the reactions."""
    mechanics = Mechanics(closure, Loads(GRAVITY))
    reactions = Reactions(mechanics)
    position = closure.position(angle)
    velocity = closure.velocity(position, RATE)
    acceleration = closure.acceleration(position, velocity, PULL)
    (effort,) = mechanics.drive_efforts(position, velocity, acceleration)
    found = reactions.solve(position, velocity, acceleration)
    return effort, {
        joint.name: (joint, np.array(reaction[:2]))
        for joint, reaction in zip(reactions.joints, found, strict=True)
    }


def engine(closure, model, order, angle):
    """Return MuJoCo's state after inverse dynamics, Q in our order, and the ratios."""
    data = mujoco.MjData(model)
    q, rates, pulls, ratios = tree_motion(closure, angle)
    data.qpos[order], data.qvel[order], data.qacc[order] = q, rates, pulls
    mujoco.mj_inverse(model, data)
    return data, data.qfrc_inverse[order].copy(), ratios


def cut_jacobian(model, data, order, cuts):
    """Return the rows that the forces on the cut pins act through."""
    rows = []
    for pin, link, to in cuts:
        both = []
        for name in (link, to):
            jacobian = np.zeros((3, model.nv))
            mujoco.mj_jacSite(model, data, jacobian, None, model.site(f'{name}/{pin}').id)
            both.append(jacobian[:2, order])
        rows.append(both[0] - both[1])
    return np.vstack(rows)


ANGLES = (0.3, 1.9, -2.0)


@pytest.mark.parametrize('angle', ANGLES)
def test_drive_effort_equals_mujoco(case, angle):
    closure, _, _, model, order = case
    _, forces, ratios = engine(closure, model, order, angle)
    effort, _ = ours(closure, angle)
    assert effort == pytest.approx(ratios @ forces, rel=1e-7)


@pytest.mark.parametrize('angle', ANGLES)
def test_pin_reactions_equal_mujoco(case, angle):
    closure, bodies, cuts, model, order = case
    data, forces, _ = engine(closure, model, order, angle)
    jacobian = cut_jacobian(model, data, order, cuts)
    drive = np.zeros((len(order), 1))
    drive[0] = 1.0
    solution = np.linalg.solve(np.hstack([drive, jacobian.T]), forces)
    effort, reactions = ours(closure, angle)
    assert solution[0] == pytest.approx(effort, rel=1e-7)
    loads = solution[1:].reshape(-1, 2)
    size = np.abs(loads).max()
    for (pin, link, to), load in zip(cuts, loads, strict=True):
        joint, force = reactions[pin]
        assert (joint.link, joint.to) == (link, to)
        assert force == pytest.approx(load, abs=1e-7 * size)
        for name, sign in ((link, 1.0), (to, -1.0)):
            place = data.site(f'{name}/{pin}').xpos
            body = model.body(name).id
            push = np.array([*(sign * load), 0.0])
            # MuJoCo wants the wrench at the body's centre of mass.
            data.xfrc_applied[body, :3] += push
            data.xfrc_applied[body, 3:] += np.cross(place - data.xipos[body], push)
    mujoco.mj_rnePostConstraint(model, data)
    for link, parent, pin in bodies:
        joint, force = reactions[pin]
        assert (joint.link, joint.to) == (link, parent)
        carried = data.cfrc_int[model.body(link).id, 3:5]
        assert force == pytest.approx(carried, abs=1e-7 * size)
