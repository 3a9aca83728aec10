# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

# Each cell imports what it shows.
# flake8: noqa: E402, I100


"""A tutorial in cells, which the documentation site runs and shows."""

# %% [markdown]
# # Tutorial: a four-bar in Python
#
# You can solve a linkage, run a scene tick by tick and look at the result of an effect from
# Python, without ROS. This page is a Python file, `docs/tutorial.py`; the output below each cell
# is from a run while the page was built. Open it as a notebook
# with jupytext, or run it with Python. It needs `pip install 'linkage_ros[report]'`.
#
# ## A linkage
#
# A linkage has links with named points. A point on two links is a pin. Here the crank O2–A turns,
# the coupler A–B follows, and the rocker B–O4 swings.

# %%
from pathlib import Path

Path('mine.yaml').write_text("""
links:
  ground:  {O2: [0, 0], O4: [0.100, 0]}
  crank:   {O2: [0, 0], A: [0.040, 0]}
  coupler: {A: [0, 0], B: [0.120, 0], P: [0.060, 0.040]}
  rocker:  {O4: [0, 0], B: [0.080, 0]}
input: {joint: crank_joint, parent: ground, child: crank}
assembly: {B: left}
joints:
  coupler_joint: {parent: crank, child: coupler}
  rocker_joint:  {parent: ground, child: rocker}
traced: [P]
""")

import linkage_ros as lr

closure = lr.load('mine.yaml')
closure

# %% [markdown]
# ## One position
#
# A position has a status, the [closure error](glossary.md) of a loop that does not close, and the
# published joints by their names. Angles are in radians.

# %%
from math import degrees

position = closure.position(0.7)
print(position.status)
for name, angle in position.items():
    print(f'{name:<14}{degrees(angle):8.3f}°')

# %% [markdown]
# Velocities start from a position, accelerations from both. At 3 rad/s of the crank:

# %%
velocity = closure.velocity(position, 3.0)
acceleration = closure.acceleration(position, velocity, 0.0)
velocity['rocker_joint'], acceleration['rocker_joint']

# %% [markdown]
# Check it: the rate is the slope of the angle, so two nearby positions must give the same value:

# %%
step = 1e-6
before, after = closure.position(0.7 - step).joints, closure.position(0.7 + step).joints
slopes = [3.0 * (b - a) / (2 * step) for a, b in zip(before, after)]
assert all(abs(slope - rate) < 1e-8 for slope, rate in zip(slopes, velocity.joints))
slopes

# %% [markdown]
# Points are complex numbers, x + iy, in metres in the frame of the ground:

# %%
position.points['P']

# %% [markdown]
# A notebook draws a position, and a closure:

# %%
position

# %% [markdown]
# ## A loop that does not close
#
# An open loop is an answer, not an exception. With a longer ground, some angles have no pose:

# %%
from dataclasses import replace

stretched = replace(
    closure.linkage,
    links={**closure.linkage.links, 'ground': {'O2': (0.0, 0.0), 'O4': (0.190, 0.0)}},
)
wide = lr.Closure(stretched)
for angle in (0.2, 2.0):
    found = wide.position(angle)
    print(f'{angle:.1f} rad: {found.status.name}, gap {found.gap * 1000:.2f} mm')

# %%
for reachable in wide.input_ranges:
    print(
        f'the crank can turn from {degrees(reachable.lowest):.2f}° to '
        f'{degrees(reachable.highest):.2f}°'
    )

# %% [markdown]
# ## A whole turn at once
#
# `solve` takes arrays, tens of millions of states a second.

# %%
from matplotlib import pyplot as plt
import numpy as np

crank = np.linspace(0.0, 2 * np.pi, 721)
batch = closure.solve(crank, rates=3.0)

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.5))
for name, angles in zip(closure.joint_names, batch.positions):
    left.plot(np.degrees(crank), np.degrees(np.unwrap(angles)), label=name)
left.set(xlabel='crank [°]', ylabel='joint [°]', xticks=range(0, 361, 90))
left.legend()
path = np.array([closure.position(angle).points['P'] for angle in crank])
right.plot(1000 * path.real, 1000 * path.imag)
right.set(xlabel='x [mm]', ylabel='y [mm]', aspect='equal', title='the path of P')
figure.tight_layout()

# %% [markdown]
# ## A scene, tick by tick
#
# A scene names the drive of the linkage and the effects beyond positions. The node builds a
# `Pipeline` from it and calls it at every tick; you can do the same. Times are whole nanoseconds.

# %%
Path('scene.yaml').write_text("""
linkage: mine.yaml
rate: 100
seed: 1
drive: {constant_rate: {rate: 6.2832}}
effects:
  velocity: {}
  noise: {joints: {rocker_joint: {white: 0.004}}}
  encoder: {joints: {rocker_joint: {counts: 256}}}
""")

pipeline = lr.Pipeline(lr.load_scene('scene.yaml'))
pipeline.linkages[0].effect_names

# %%
ticks = [pipeline.tick(index * 10_000_000) for index in range(101)]
ticks[0].message[:12].hex(' ')  # the bytes that the node would publish, header first

# %% [markdown]
# A tick has, for every linkage of the scene, the crank, the exact position, and the reading of the
# sensors.

# %%
looks = [tick.states[0] for tick in ticks]
column = pipeline.closures[0].joint_names.index('rocker_joint')
true = np.array([look.position['rocker_joint'] for look in looks])
read = np.array([look.reading.joints[column] for look in looks])
error = np.angle(np.exp(1j * (read - true)))

figure, axes = plt.subplots(figsize=(9, 2.5))
axes.step(np.arange(101) / 100, np.degrees(error), where='post')
axes.set(xlabel='time [s]', ylabel='read − true [°]', title='noise, then whole counts')
figure.tight_layout()

# %% [markdown]
# One count is 1.41°. The same scene gives the same bytes again, including the noise. So a bag
# replays to the last bit.

# %%
again = lr.Pipeline(lr.load_scene('scene.yaml'))
assert [again.tick(index * 10_000_000).message for index in range(101)] == [
    tick.message for tick in ticks
]

# %% [markdown]
# ## Design one
#
# Three pairs of crank and rocker angles determine a four-bar. The closure that the node uses
# checks the design.

# %%
from linkage_ros.tools.design import exact_four_bar, prove

angles = np.radians([[25, 30], [35, 40], [50, 60]])
design, conditioning = exact_four_bar(angles[:, 0], angles[:, 1], ground=1.0)
print('crank, coupler, rocker, ground:', *(f'{length:.6f}' for length in design.four_bar.lengths))
for wanted, met in zip(design.wanted, prove(design)):
    print(f'crank {degrees(wanted.crank):.0f}°: rocker misses by {degrees(met.angle):.1e}°')

# %% [markdown]
# Next: [concepts](concepts.md), [all effects](effects.md), [the Python API](reference/python.md).
