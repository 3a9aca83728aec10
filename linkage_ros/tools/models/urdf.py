# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A linkage as URDF: the tree of its published joints, and frames where pins close its loops.

The root is the ground. If several linkages share a model, the root is a frame without a body that
holds their grounds, since a scene does not position them.

Of a spatial linkage each joint keeps its name, sign and zero. A joint that closes a loop moves a
frame of its own, which a fixed loop joint welds to the link. Balls are loop joints too, in the
form of Isaac Sim, which robot_state_publisher passes over and `linkage check` reads. Links that no
joint leads to hang on joints of their own, see `with_rod_joints`.
"""

from __future__ import annotations

from cmath import phase
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import pi
import re
from typing import NamedTuple
from xml.etree import ElementTree as ET

from linkage_ros.description import roll_pitch_yaw, Scene
from linkage_ros.errors import DefinitionError, quote
from linkage_ros.kinematics import (
    Closure,
    direction_of,
    GROUND,
    GROUND_FRAME,
    Linkage,
    links_by_point,
    minus,
    NO_LIMITS,
    PlanarClosure,
    Ratio,
    RevoluteJoint,
    scale,
    SpaceFrame,
    SpaceLinkage,
    SpatialJoint,
    turn_about,
    turned_tensor,
    usual_inputs,
    Vector,
    with_rod_joints,
)
from linkage_ros.names import free_name
from linkage_ros.tools.models.bodies import link_bodies, LinkBody
from linkage_ros.tools.models.orientation import AngleSpan, joint_spans, ROUND
from linkage_ros.tools.models.part import (
    make_scene_model,
    ModelPart,
    PartError,
    prefix_names,
    PrefixedNames,
)
from linkage_ros.tools.models.tree import grow_tree, Tree, TreeJoint
from linkage_ros.tools.models.urdf_elements import (
    add_inertial,
    add_joint,
    add_start,
    EFFORT,
    mimic_of,
    VELOCITY,
    WrittenJoint,
)
from linkage_ros.tools.models.xml import (
    format_numbers,
    format_rough,
    xml_comment,
    xml_document,
)

_ROOT = 'world'

_FLAT = ('x', 'y')
_STANDING = {
    _FLAT: (0.0, 0.0, 0.0),
    ('x', 'z'): (0.5 * pi, 0.0, 0.0),
    ('y', 'z'): (0.5 * pi, 0.0, 0.5 * pi),
}
"""How planes stand in the world: roll, pitch and yaw, in [rad]."""

_EXPRESSION = re.compile(r'\$[{(]')
"""Text that xacro evaluates (https://wiki.ros.org/xacro)."""

_HEAD = f"""\
A planar linkage, cut open to a tree. Names, axes, signs and zeroes of the joints are as in the
published joint states. Lengths in [m], angles in [rad]; the plane of the links is z = 0.
Links are bars in layers, of no particular shape; those with a mass are thin plates, with ixx =
iyy = izz/2.
A limit is as the linkage gives it; else what the joint comes to over the range of the input that
the linkage starts in, and 0.001 rad, or of the reach, on either side; with several inputs none for
angles, the reach for slides. An angle that passes pi has none either, since it is published as it
begins in (-pi, pi], or wrapped. Efforts not given are {EFFORT:g}, velocities {VELOCITY:g}."""

_SPACE_HEAD = """\
A spatial linkage, cut open to a tree. Names, axes, signs and zeroes of the joints are as in the
published joint states. Lengths in [m], angles in [rad]. Limits that the linkage does not give are
made up. Each loop_joint says where two links meet."""


# The loop joints: pins and sliders that the tree leaves open, as pairs of frames.
#
# Frames named PIN_on_LINK mark the pin on each of its links: in a correct model they coincide. So
# do those of a slider whose slide is published; otherwise the x axis of SLIDER_line_on_LINK lies
# along the line.


class LoopJoint(NamedTuple):
    """A pin or slider that the tree leaves open."""

    # ``pin``, ``slide`` (the frames coincide as well) or ``line`` (the second lies on the x axis
    # of the first).
    kind: str
    name: str  # Name of the point or slider
    frames: tuple[str, ...]  # Two or more


def add_frames(tree: Tree, names: PrefixedNames) -> list[LoopJoint]:
    """Add frames of all cuts, of joints that attach no link, and of traced points to a tree."""
    adding = _FrameAdding(tree, names)
    cuts = [*adding.cut_pins(), *adding.cut_sliders()]
    adding.add_spare()
    adding.add_traced()
    return cuts


class _FrameAdding:
    def __init__(self, tree: Tree, names: PrefixedNames) -> None:
        self._tree = tree
        self._names = names
        self._joints = tree.linkage.named_joints
        self._spare = list(tree.spare)

    def cut_pins(self) -> list[LoopJoint]:
        cuts = []
        for point, links in links_by_point(self._tree.linkage.links).items():
            apart = {link: link for link in links}
            for pin, on, link in self._tree.pins:
                if pin == point:
                    joined, kept = apart[link], apart[on]
                    apart = {a: kept if of == joined else of for a, of in apart.items()}
            # The first link of each connected part represents it.
            ends = list({of: link for link, of in reversed(apart.items())}.values())[::-1]
            if len(ends) > 1:
                frames = tuple(self._add_fixed(point, link, point) for link in ends)
                cuts.append(LoopJoint('pin', point, frames))
        return cuts

    def cut_sliders(self) -> list[LoopJoint]:
        linkage, cuts = self._tree.linkage, []
        links = links_by_point(linkage.links)
        for name, slider in linkage.sliders.items():
            if name in self._tree.slides:
                continue
            shown = f'{name}_slider' if name in links else name
            end = slider.block or links[slider.point][0]
            slides = [s for s in self._spare if getattr(self._joints[s], 'slider', '') == name]
            if slides:
                self._spare.remove(slides[0])
                line = self._add_slide(slides[0], self._names.frame_on(shown, slider.along))
            else:
                turn = phase(complex(*slider.direction))
                line = self._add_fixed(f'{shown}_line', slider.along, slider.through, turn)
            frames = (line, self._add_fixed(shown, end, slider.point))
            cuts.append(LoopJoint('slide' if slides else 'line', name, frames))
        return cuts

    def add_spare(self) -> None:
        """Give a frame to every published joint that attaches no link."""
        links, names = self._tree.linkage.links, self._names
        for name in self._spare:
            frame, joint = names.free_frame(f'{name}_frame'), self._joints[name]
            if isinstance(joint, RevoluteJoint):
                pins = [p for p in links[joint.parent] if p in links[joint.child]]
                place = self._tree.point_position(joint.parent, pins[0]) if pins else 0j
                parent = names.own_name(joint.parent)
                self._add_joint(TreeJoint(names.own_name(name), 'revolute', parent, frame, place))
            else:
                self._add_slide(name, frame)

    def add_traced(self) -> None:
        links = links_by_point(self._tree.linkage.links)
        there = {joint.child for joint in self._tree.joints}
        for point in self._tree.linkage.traced:
            if not any(self._names.text_on(point, link) in there for link in links[point]):
                self._add_fixed(point, links[point][0], point)

    def _add_slide(self, name: str, frame: str) -> str:
        joint = self._joints[name]
        assert not isinstance(joint, RevoluteJoint)
        slider = self._tree.linkage.sliders[joint.slider]
        place = self._tree.point_position(slider.along, slider.through)
        parent = self._names.own_name(slider.along)
        own = self._names.own_name(name)
        return self._add_joint(TreeJoint(own, 'prismatic', parent, frame, place, 0.0, slider.unit))

    def _add_fixed(self, name: str, link: str, point: str, turn: float = 0.0) -> str:
        frame = self._names.frame_on(name, link)
        joint = self._names.free_joint(f'{name}_on_{link}_fixed')
        place = self._tree.point_position(link, point)
        return self._add_joint(
            TreeJoint(joint, 'fixed', self._names.own_name(link), frame, place, turn)
        )

    def _add_joint(self, joint: TreeJoint) -> str:
        self._tree.joints.append(joint)
        return joint.child


class _Model(NamedTuple):
    """A linkage with its tree, ready to be written."""

    part: ModelPart
    names: PrefixedNames
    tree: Tree
    cuts: Sequence[LoopJoint]
    spans: Mapping[str, AngleSpan]
    bodies: Mapping[str, LinkBody]


def urdf_model(name: str, parts: Sequence[ModelPart]) -> bytes:
    """
    Return a robot model of some linkages.

    A PartError is raised if the published joints of a linkage do not determine all its links, or
    xacro would evaluate one of its names.
    """
    names, own = prefix_names([(part.prefix, part.closure.linkage) for part in parts])
    models: list[_Model | SpaceTree] = []
    layers = 0
    for count, (part, its) in enumerate(zip(parts, own, strict=True)):
        linkage = part.closure.linkage
        if isinstance(linkage, SpaceLinkage):
            models.append(SpaceTree(linkage, its, part.wrapped))
            continue
        try:
            tree = grow_tree(linkage, its)
        except DefinitionError as error:
            raise PartError(count, error.where, error.reason, error.remedy) from None
        cuts = add_frames(tree, its)
        ranges = joint_spans(part.closure)
        models.append(
            _Model(part, its, tree, cuts, ranges, link_bodies(part.closure, ranges, layers))
        )
        layers += len(linkage.links)
    robot = ET.Element('robot', name=name)
    robot.append(xml_comment(list(_head_lines(models))))
    linkages = [part.closure.linkage for part in parts]
    planes = [linkage.axes if isinstance(linkage, Linkage) else _FLAT for linkage in linkages]
    if len(models) > 1 or planes != [_FLAT]:
        root = names.free_frame(_ROOT)
        ET.SubElement(robot, 'link', name=root)
        for its, axes in zip(own, planes, strict=True):
            mount = ET.SubElement(robot, 'joint', name=its.free_joint('mount'), type='fixed')
            ET.SubElement(mount, 'origin', xyz='0 0 0', rpy=format_numbers(*_STANDING[axes]))
            ET.SubElement(mount, 'parent', link=root)
            ET.SubElement(mount, 'child', link=its.own_name(GROUND))
    _refuse_expressions(0, robot, of_linkage=False)
    for count, model in enumerate(models):
        before = len(robot)
        if isinstance(model, SpaceTree):
            model.write(robot)
        else:
            _write_linkage(robot, model)
        for element in robot[before:]:
            _refuse_expressions(count, element)
    return xml_document(robot)


def scene_urdf(scene: Scene, closures: Sequence[Closure]) -> bytes:
    """Return the URDF of a scene; see `make_scene_model`."""
    return make_scene_model(scene, closures, urdf_model)


def _refuse_expressions(number: int, element: ET.Element, *, of_linkage: bool = True) -> None:
    """
    Refuse names that xacro would evaluate.

    A launch file may read a URDF with or without xacro: a name that is escaped for one is a
    different name for the other.
    """
    for part in element.iter():
        for text in part.attrib.values():
            if _EXPRESSION.search(text):
                raise PartError(
                    number,
                    '',
                    f'xacro would evaluate the name {quote(text)}',
                    'choose a name without ${ and $(',
                    of_linkage=of_linkage,
                )


def _head_lines(models: Sequence[_Model | SpaceTree]) -> Iterator[str]:
    planar = [model for model in models if isinstance(model, _Model)]
    if planar:
        yield from _HEAD.splitlines()
    if len(planar) < len(models):
        yield from _SPACE_HEAD.splitlines()
    if len(models) > 1:
        yield 'A scene does not say where its linkages stand. Change the origin of NAME_mount.'
    if any(joint.mimics for model in planar for joint in model.tree.joints):
        yield 'Frames without a body between joints at one pin turn with joints that they mimic,'
        yield 'so that a published joint starts from the link that it is measured from.'
    for model in planar:
        yield ''
        if not model.cuts:
            yield 'Nothing is cut.'
        for cut in model.cuts:
            first, *others = cut.frames
            met = ' and '.join(others)
            what = 'pin' if cut.kind == 'pin' else 'slider'
            line = f'{met} is on the x axis of {first}'
            how = line if cut.kind == 'line' else f'{first} meets {met}'
            yield f'{what} {cut.name} is cut, {how}'
        if spare := ', '.join(map(model.names.own_name, model.tree.spare)):
            yield f'no link hangs by {spare}'


def _write_linkage(robot: ET.Element, model: _Model) -> None:
    names, linkage = model.names, model.part.closure.linkage
    for link in linkage.links:
        element = ET.SubElement(robot, 'link', name=names.own_name(link))
        origin = model.tree.origins[link]
        mass = linkage.masses.get(link)
        if mass and mass.mass:  # without an inertial a link is massless
            (x, y), flat, about = mass.center, 0.5 * mass.inertia, mass.inertia
            center = x - origin.real, y - origin.imag, 0.0
            add_inertial(element, mass.mass, center, (flat, 0.0, 0.0, flat, 0.0, about))
        _write_visuals(element, names.own_name(link), model.bodies[link], origin)
    links = {names.own_name(link) for link in linkage.links}
    for joint in model.tree.joints:
        if joint.child not in links:
            ET.SubElement(robot, 'link', name=joint.child)
    spans = {names.own_name(name): span for name, span in model.spans.items()}
    limits_of = {names.own_name(name): limits for name, limits in linkage.limits.items()}
    computed: dict[str, dict[str, str]] = {}
    followed = {
        names.own_name(name): replace(mimic, of=names.own_name(mimic.of))
        for name in linkage.ratios
        if (mimic := mimic_of(linkage.ratios, name))
    }
    for joint in model.tree.joints:
        of = joint.mimics or joint.name
        mimic = followed.get(of, Ratio(of, 1.0) if joint.mimics else None)
        turns, (x, y) = joint.kind == 'revolute', (joint.axis.real, joint.axis.imag)
        placed = WrittenJoint(
            *joint[:4],
            (joint.place.real, joint.place.imag, 0.0),
            (0.0, 0.0, joint.turn),
            (0.0, 0.0, x) if turns else (x, y, 0.0),
        )
        limits, span = limits_of.get(of, NO_LIMITS), spans.get(of, ROUND)
        computed[of] = add_joint(robot, placed, limits, span, mimic, wrapped=model.part.wrapped)
    _write_start(robot, model.part.closure, names, computed)


def _write_visuals(link: ET.Element, name: str, body: LinkBody, origin: complex) -> None:
    for count, solid in enumerate(body.solids):
        visual = ET.SubElement(link, 'visual')
        if solid.name and solid.kind in ('disc', 'block'):
            visual.set('name', solid.name)
        centre = solid.centre - origin
        seen = {
            'xyz': format_rough(centre.real, centre.imag, solid.z),
            'rpy': format_rough(0, 0, solid.angle),
        }
        ET.SubElement(visual, 'origin', seen)
        geometry = ET.SubElement(visual, 'geometry')
        if solid.kind == 'disc':
            radius = format_rough(0.5 * solid.width)
            ET.SubElement(geometry, 'cylinder', radius=radius, length=format_rough(solid.height))
        else:
            size = format_rough(solid.length, solid.width, solid.height)
            ET.SubElement(geometry, 'box', size=size)
        material = ET.SubElement(visual, 'material', name=f'colour of {name}')
        if not count:
            ET.SubElement(material, 'color', rgba=format_numbers(*body.colour))


def _write_start(
    robot: ET.Element,
    closure: PlanarClosure,
    names: PrefixedNames,
    computed: Mapping[str, Mapping[str, str]],
) -> None:
    """Write where the model starts, unless several inputs do not close where each is in range."""
    values = dict(zip(closure.input_names, usual_inputs(closure), strict=True))
    position = closure.position(*values.values())
    if position.joints:
        values |= dict(zip(closure.joint_names, position.joints, strict=True))
        own = {names.own_name(name): values[name] for name in closure.linkage.named_joints}
        add_start(robot, [*map(names.own_name, closure.input_names)], own, computed)


class SpaceTree:
    """A spatial linkage, to be written as URDF; its names are as in `PrefixedNames`."""

    def __init__(self, linkage: SpaceLinkage, names: PrefixedNames, wrapped: bool) -> None:
        self.names = names
        self._linkage = with_rod_joints(linkage)
        self._wrapped = wrapped
        self._computed: dict[str, dict[str, str]] = {}
        self._frames = {GROUND: GROUND_FRAME}
        """Frames in the pose of the links that are written."""

    def write(self, robot: ET.Element) -> None:
        """Add the tree and the loop joints to a robot."""
        self._robot = robot
        self._add_link(GROUND)
        links, names = self._linkage.links, self._linkage.link_names
        left = dict(self._linkage.pair_joints)
        while any(self._grow(name, joint, left) for name, joint in [*left.items()]):
            pass
        for name, joint in left.items():
            frame = free_name(f'{name}_frame', {*names, *self._frames})
            self._add_joint(name, joint, joint.parent, frame)
            self._add_loop(name, 'fixed', (frame, joint.child), self._frames[frame].origin)
        for point, place in self._linkage.points.items():
            on = [link for link, points in links.items() if point in points]
            for number, link in enumerate(on[1:]):
                name = f'{point}_{number + 1}' if number else point
                self._add_loop(name, 'spherical', (on[0], link), place)
        own_name, linkage = self.names.own_name, self._linkage
        order = dict.fromkeys((*linkage.driven, *self._computed))
        values = {own_name(name): linkage.pose_value(name) for name in order}
        computed = {own_name(name): made_up for name, made_up in self._computed.items()}
        add_start(robot, [*map(own_name, linkage.driven)], values, computed)

    def _grow(self, name: str, joint: SpatialJoint, left: dict[str, SpatialJoint]) -> bool:
        """Write a joint that leads from the tree to another link."""
        ends = sorted((joint.parent, joint.child), key=lambda link: link not in self._frames)
        if ends[0] not in self._frames or ends[1] in self._frames:
            return False
        del left[name]
        self._add_joint(name, joint, *ends)
        return True

    def _add_joint(self, name: str, joint: SpatialJoint, parent: str, child: str) -> None:
        linkage, on = self._linkage, self._frames[parent]
        # The tree may lead the other way.
        axis = scale(-1.0 if parent == joint.child else 1.0, direction_of(joint.axis))
        slides, at = name in linkage.slides, joint.at
        if slides:
            at = next((linkage.points[point] for point in linkage.links.get(child, ())), on.origin)
            self._frames[child] = on._replace(origin=at)
            at = minus(at, scale(joint.value, axis))
        else:
            x, y, z = (turn_about(axis, joint.value, way) for way in on[:3])
            self._frames[child] = SpaceFrame(x, y, z, at)
        self._add_link(child)
        own_name = self.names.own_name
        placed = WrittenJoint(
            own_name(name),
            'prismatic' if slides else 'revolute',
            own_name(parent),
            own_name(child),
            on.locate(at),
            axis=on.resolve(axis),
        )
        # URDF has no sums.
        mimic = mimic_of(linkage.ratios, name)
        if mimic:
            mimic = replace(mimic, of=own_name(mimic.of))
        self._computed[name] = add_joint(
            self._robot, placed, joint.limits, ROUND, mimic, wrapped=self._wrapped
        )

    def _add_link(self, link: str) -> None:
        """Write a link, with its mass if it has some."""
        element = ET.SubElement(self._robot, 'link', name=self.names.own_name(link))
        body, frame = self._linkage.masses.get(link), self._frames[link]
        if body and body.mass:
            axes = [frame.resolve(axis) for axis in GROUND_FRAME[:3]]
            tensor = turned_tensor(axes, body.inertia)
            add_inertial(element, body.mass, frame.locate(body.center), tensor)

    def _add_loop(self, name: str, kind: str, links: tuple[str, str], place: Vector) -> None:
        """Write that two links meet at a place, which is given in the pose."""
        own_name = self.names.own_name
        loop = ET.SubElement(self._robot, 'loop_joint', name=own_name(name), type=kind)
        first_frame = self._frames[links[0]]
        for tag, link in zip(('link1', 'link2'), links, strict=True):
            frame = self._frames[link]
            rpy = format_numbers(*roll_pitch_yaw(*map(frame.resolve, first_frame[:3])))
            xyz = format_numbers(*frame.locate(place))
            ET.SubElement(loop, tag, link=own_name(link), xyz=xyz, rpy=rpy)
