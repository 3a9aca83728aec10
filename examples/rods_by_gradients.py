# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Change the rods of an ankle until its foot is level at given motors, by gradients in JAX."""

from pathlib import Path

import jax
import jax.numpy as jnp
import linkage_ros as lr

jax.config.update('jax_enable_x64', True)
closure = lr.load(Path(__file__).parent / 'ankle_rods.yaml')
position, jacobian = map(jax.jit, (closure.as_jax().position, closure.as_jax().jacobian))
motors, wanted = jnp.array([0.10, -0.04]), jnp.zeros(2)


def foot(rods):
    """Return pitch and roll at the motors: the closed form leads from the foot to the motors."""
    at = wanted
    for _ in range(6):
        # The gradient is that of the last step alone: it starts at the solution.
        inputs = jnp.concatenate([jax.lax.stop_gradient(at), rods])
        slopes = jacobian(jax.lax.stop_gradient(inputs))[:, :2]
        at = inputs[:2] - jnp.linalg.solve(slopes, position(inputs)[1] - motors)
    return at


def loss(rods):
    """Return how far the foot is from where it is wanted, squared."""
    return ((foot(rods) - wanted) ** 2).sum()


rods = jnp.array(closure.linkage.pose.inputs[2:])
print('foot before:', *foot(rods))
print('gradient:   ', *jax.grad(loss)(rods))
for _ in range(4):
    rods -= jnp.linalg.solve(jax.jacobian(foot)(rods), foot(rods) - wanted)
print('rods:       ', *rods)
print('foot after: ', *foot(rods))
