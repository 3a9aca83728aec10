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


"""
A linkage as MJCF, MuJoCo's format: nested bodies, and equality constraints where pins are cut.

The axes of a body are parallel to its link's own; its origin lies at the pin or slider that it
hangs by. Springs are spatial tendons, which pull as those of `linkage_ros.dynamics` do.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from xml.etree import ElementTree as ET

from linkage_ros.robot_models.bodies import bar_width
from linkage_ros.robot_models.mjcf import Bodies, DENSITY, LIGHT
from linkage_ros.robot_models.part import prefixed
from linkage_ros.robot_models.part_part import Part, PartError
from linkage_ros.robot_models.xml import comment, document, number, numbers, rough

_STEP = 5e-4
"""Of the integration, in [s]."""

_STIFF = {'solref': f'{number(4.0 * _STEP)} 1', 'solimp': '0.9999 0.9999 0.001 0.5 2'}
"""How cut pins are held: errors die away within 2 ms, and loads open them next to nothing."""

_PACE = 30.0
"""Of the position servo of an input, in [rad/s]."""

_HEAD = f"""\
A planar linkage in the plane z = 0. Bodies hang by their pins and sliders; pins that close loops
are equality constraints between sites. A hinge or slide that is a published joint has its name,
sign and zero; others are CHILD_at_PIN. Lengths in [m], angles in [rad].
Links with a mass are thin plates; others are steel bars of {DENSITY:g} kg/m3, as they are drawn. A
pin in a slot has a block of {LIGHT:g} kg/m3. Inputs have position servos. Nothing collides.
Friction, tolerances and other effects of a scene are not here; its gravity and springs are."""


def mjcf(name: str, parts: Sequence[Part]) -> bytes:
    """
    Return a model for MuJoCo.

    Parameters
    ----------
    name
        Of the model.
    parts
        Its linkages.

    Raises
    ------
    PartError
        Where one has another gravity than the first, or names that are taken.

    """
    model = ET.Element('mujoco', model=name)
    model.append(comment(_HEAD.splitlines()))
    ET.SubElement(model, 'compiler', angle='radian', autolimits='true')
    gravity = numbers(*_gravity(parts), 0.0)
    option = {'timestep': number(_STEP), 'gravity': gravity, 'integrator': 'implicitfast'}
    ET.SubElement(model, 'option', option, solver='Newton', iterations='200', tolerance='1e-12')
    default = ET.SubElement(model, 'default')
    ET.SubElement(default, 'geom', contype='0', conaffinity='0', density=number(DENSITY))
    ET.SubElement(default, 'equality', _STIFF)
    width = max(bar_width(part.closure) for part in parts)
    ET.SubElement(default, 'site', size=rough(0.2 * width), group='4')
    sections = {
        key: ET.SubElement(model, key)
        for key in ('worldbody', 'equality', 'tendon', 'actuator', 'keyframe')
    }
    start: list[float] = []
    commands: list[float] = []
    layers = 0
    _, names = prefixed([(part.prefix, part.closure.linkage) for part in parts])
    for part, own in zip(parts, names, strict=True):
        bodies = Bodies(sections['worldbody'], part, own, layers)
        _close(sections, part, bodies)
        _drive(sections['actuator'], part, bodies)
        start += bodies.start
        commands += bodies.inputs
        layers += len(part.closure.linkage.links)
    values = {'qpos': numbers(*start), 'ctrl': numbers(*commands)}
    ET.SubElement(sections['keyframe'], 'key', attrib={'name': 'start', **values})
    for key, section in sections.items():
        if not len(section) and key != 'worldbody':
            model.remove(section)
    return document(model)


def _gravity(parts: Sequence[Part]) -> tuple[float, float]:
    found = [part.loads.gravity if part.loads else (0.0, 0.0) for part in parts]
    for count, gravity in enumerate(found):
        if gravity != found[0]:
            raise PartError(
                count,
                'loads.gravity',
                f'[{numbers(*gravity)}] is another than that of the first linkage',
                'give all linkages one gravity: MuJoCo has one',
                of_linkage=False,
            )
    return found[0]


def _close(sections: Mapping[str, ET.Element], part: Part, bodies: Bodies) -> None:
    """Write what joins bodies beside their joints: cut pins, and springs."""
    linkage = part.closure.linkage
    for point in linkage.traced:
        bodies.site(next(a for a, points in linkage.links.items() if point in points), point)
    for point, one, other in bodies.cuts:
        ends = {'site1': bodies.site(one, point), 'site2': bodies.site(other, point)}
        name = f'{ends["site1"]} = {ends["site2"]}'
        ET.SubElement(sections['equality'], 'connect', {'name': name, **ends})
    for spring in part.loads.springs if part.loads else ():
        tendon = ET.SubElement(
            sections['tendon'],
            'spatial',
            name=part.prefix + spring.name,
            stiffness=number(spring.stiffness),
            springlength=number(spring.free_length),
            damping=number(spring.damping),
            width=rough(0.15 * bar_width(part.closure)),
        )
        for end in spring.ends:
            ET.SubElement(tendon, 'site', site=bodies.site(*end))


def _drive(actuators: ET.Element, part: Part, bodies: Bodies) -> None:
    """Drive the inputs by servos, as stiff as what they move asks for."""
    motor = part.loads.drive_inertia if part.loads else 0.0
    for count, given in enumerate(part.closure.linkage.inputs):
        inertia = bodies.inertia(count) + motor
        joint = bodies.joints[given.joint]
        if motor:
            joint.set('armature', number(motor))
        servo = ET.SubElement(
            actuators,
            'position',
            name=joint.get('name', ''),
            joint=joint.get('name', ''),
            kp=rough(inertia * _PACE * _PACE),
            kv=rough(2.0 * inertia * _PACE),
        )
        if given.limits.bounded:
            servo.set('ctrlrange', joint.get('range', ''))
