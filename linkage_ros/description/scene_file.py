# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Read a scene file into a `Scene`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from os import PathLike
from os.path import isfile
from pathlib import Path
from typing import Any, Literal, TYPE_CHECKING
from zlib import crc32

from linkage_ros.description.confinement import Confinement
from linkage_ros.description.linkage_file import (
    looks_like_linkage,
    read_any_closure,
    read_content,
    robot_content,
)
from linkage_ros.description.parameters import Kind, Parts
from linkage_ros.description.scene import parts_of, Scene, SceneLinkage
from linkage_ros.description.scene_grammar import (
    DRIVE,
    drive_name,
    drive_section,
    effect_types,
    EFFECTS_BY_NAME,
    effects_section,
    OF_A_LINKAGE,
    SCENE,
)
from linkage_ros.description.section import Section
from linkage_ros.description.units import Units
from linkage_ros.description.yaml_file import parse_yaml
from linkage_ros.errors import (
    DefinitionError,
    did_you_mean,
    FileError,
    list_names,
    quote,
    read_each,
)
from linkage_ros.kinematics import Closure, Linkage
from linkage_ros.resources import linkage_names, linkage_of_scene, named_file
from linkage_ros.stages.drives import drive_class

if TYPE_CHECKING:
    from linkage_ros.stages.effects import Effect

SCENE_FILE, LINKAGE_FILE = 'scene.yaml', 'linkage.yaml'
"""Names of a scene's files in a bag; further linkage files are numbered."""

_MOST_LINKAGES = 400
"""A hundred linkages at 1 kHz fill a core."""

_SCENE_KEYS = {*SCENE.entries} - {'units', 'angles'}
"""Keys that tell a scene from a linkage, other than its linkages."""

Open = Callable[[Section], tuple[Section, bytes]]
"""Opens the linkage file that a section names under ``linkage``."""


@dataclass(frozen=True)
class _SceneSource:
    """Where a scene comes from."""

    name: str
    folder: str
    open_linkage: Open
    seed: int | None = None  # Seed if the scene names none; None to derive it from the name
    trust_effects: bool = True  # Whether user-defined effects are imported
    confinement: Confinement | None = None  # What the scene may name; None for anything
    publishes_model_joints: bool = False  # Whether all joints of a robot model are published
    closed: Closure | None = None  # Of its only linkage, if there is one already


def load_scene(
    file: str | PathLike[str],
    settings: Sequence[str] = (),
    confinement: Confinement | None = None,
) -> Scene:
    """
    Read a scene and the linkages that it names; for a linkage file, a default scene.

    Parameters
    ----------
    file
        The scene file; paths in it are relative to its folder. Or a linkage file; or the name of
        a scene or a linkage that comes with the package, such as ``'demo'``.
    settings
        Keys to set, without editing the file, as ``drive.sine.amplitude=0.3``; they are part of
        `Scene.files`.
    confinement
        What the scene may name, where another process asks for it; None for anything.

    Raises
    ------
    FileError
        The file is wrong; the error has file, line, key, value and remedy.
    TypeError
        The argument is neither a path nor a name.

    """
    file = named_file(file, 'scenes', 'linkages')
    if confinement is not None:
        confinement.refuse_file(file, None, '')
    content, data = read_content(file)

    def check_file(where: Section, key: str, named: Path) -> Path:
        if confinement is not None:
            confinement.refuse_file(named, where, key)
        return named

    def open_linkage(where: Section) -> tuple[Section, bytes]:
        if isinstance(where.mapping.get('linkage'), dict):
            robot = where.section('linkage')
            robot_content(robot, check_file(robot, 'urdf', file.parent / robot.text('urdf')))
            return robot, robot.named_data
        named = linkage_of_scene(where.text('linkage'), file.parent)
        linkage = check_file(where, 'linkage', named)
        if not isfile(linkage):  # noqa: PTH113 (Path's raises where a name is too long)
            raise where.error(
                'linkage',
                f'{quote(str(linkage))} is not a file',
                did_you_mean(
                    linkage.name,
                    linkage_names(),
                    'name one relative to the scene, or one that linkage gallery lists',
                ),
            )
        return read_content(linkage)

    source = _SceneSource(
        file.stem,
        str(file.parent),
        open_linkage,
        trust_effects=confinement is None or confinement.trusts_effects,
        confinement=confinement,
    )
    if kind_of(content) == 'linkage':
        return _stand_in(content, data, source, settings)
    return _build_scene(content, data, source, settings)


def kind_of(content: Section) -> Literal['scene', 'linkage']:
    """Return whether a file holds a scene or a linkage; FileError for neither, or both."""
    if not ('linkage' in content or 'linkages' in content):
        if looks_like_linkage(content):
            for key in content:
                if key in _SCENE_KEYS:
                    raise content.error(
                        key,
                        'is a key of scenes, and this is a linkage',
                        f'write it next to linkage: {Path(content.file).name} into another file',
                    )
            return 'linkage'
        if not any(key in _SCENE_KEYS for key in content):
            raise content.error(
                '',
                'is neither a scene nor a linkage',
                'write linkage: FILE for a scene, links: {…} for a linkage',
            )
    return 'scene'


def _stand_in(
    content: Section, data: bytes, source: _SceneSource, settings: Sequence[str]
) -> Scene:
    """Return the default scene of a linkage file."""
    from linkage_ros.description.linkage_writer import (
        scene_text_for,  # local import: not for scenes
    )

    try:
        closure: Any = read_any_closure(content, publish_inputs=True)
        text = scene_text_for(closure, LINKAGE_FILE).encode()
    except DefinitionError as error:
        raise content.locate_error(error) from None

    def open_linkage(where: Section) -> tuple[Section, bytes]:
        where.text('linkage')
        return content, data

    scene = parse_yaml(text, f'{content.file}, as a scene')
    # A drive moves one input, which is then published; several inputs come from a topic.
    closed = closure if len(closure.linkage.inputs) == 1 and not settings else None
    source = replace(source, open_linkage=open_linkage, closed=closed)
    return _build_scene(scene, text, source, settings)


def parse_scene(
    name: str,
    where: str,
    files: Mapping[str, bytes],
    folder: str = '',
    seed: int | None = None,
    *,
    trust_effects: bool = False,
    settings: Sequence[str] = (),
) -> Scene:
    """
    Read a scene from the files in a bag.

    Parameters
    ----------
    name
        Name of the scene.
    where
        Origin of the files, for error messages.
    files, folder
        As in `Scene`.
    seed
        Seed if the scene names none; None to derive it from the name.
    trust_effects
        Whether to import user-defined effects, which executes them. If not, their names are in
        `SceneLinkage.not_imported`.
    settings
        As for `load_scene`.

    Raises
    ------
    FileError
        As `load_scene`.

    """
    content = parse_yaml(files[SCENE_FILE], f'{where}: {SCENE_FILE}')
    linkages = iter([part for part in files if part != SCENE_FILE])

    def open_linkage(within: Section) -> tuple[Section, bytes]:
        is_told = isinstance(within.mapping.get('linkage'), dict)
        robot = within.section('linkage') if is_told else None
        named = within.text('linkage') if robot is None else ''
        part = next(linkages, None)
        if part is None:
            raise within.error('linkage', 'is not among the files', 'name another bag')
        if robot is None and not part.endswith('.urdf'):
            return parse_yaml(files[part], f'{where}: {part}'), files[part]
        robot = robot or Section(f'{where}: {part}', '', {'urdf': named})
        robot.named_data = files[part]
        return robot, files[part]

    source = _SceneSource(name, folder, open_linkage, seed, trust_effects=trust_effects)
    return _build_scene(content, files[SCENE_FILE], source, settings)


def files_of_scene(file: Path) -> Iterator[Path]:
    """Yield the files that a scene names; none for another file, or one that cannot be read."""
    try:
        scene = read_content(file)[0].mapping
    except FileError:
        return
    linkages = scene.get('linkages')
    for entry in (scene, *(linkages if isinstance(linkages, list) else ())):
        match entry:
            case {'linkage': str(name)}:
                yield linkage_of_scene(name, file.parent)
            case {'linkage': {'urdf': str(name)}}:
                yield file.parent / name
        match entry:
            case {'drive': {'bag': {'file': str(name)}}}:
                yield file.parent / name


def seed_of(name: str) -> int:
    """Return the seed of a scene that names none: different scenes get different noise."""
    return crc32(name.encode())


def _build_scene(
    content: Section, data: bytes, source: _SceneSource, settings: Sequence[str] = ()
) -> Scene:
    """Read a scene with settings of its keys."""
    if not settings:
        return _read_scene(content, data, source)
    from linkage_ros.description import scene_settings as given  # local import: few scenes need it

    data = given.apply_settings(content, settings)
    try:
        return _read_scene(content, data, source)
    except FileError as error:
        raise given.blame_setting(error, content, settings) from None


def _read_scene(content: Section, data: bytes, source: _SceneSource) -> Scene:
    published, angle = SCENE.read_key(content, 'angles', {})
    content.units = Units(SCENE.read_key(content, 'units', {}), angle)
    has_description = SCENE.read_key(content, 'robot_description', {})
    all_joints = SCENE.read_key(content, 'model_joints', {})
    all_joints = has_description if all_joints is None else all_joints
    source = replace(source, publishes_model_joints=all_joints)
    for key in (*SCENE.entries, *OF_A_LINKAGE.entries, 'linkage', 'linkages'):
        content.remove_key(key)

    def read(key: str, parts: Parts) -> Callable[[], Any]:
        return partial(SCENE.read_key, content, key, parts)

    readers: dict[str, Callable[[], Any]] = {
        'linkages': partial(_read_linkages, content, source),
        **{key: read(key, {}) for key in ('rate', 'seed', 'record')},
        '': content.finish,
    }
    of_scene = read_each(readers)
    members, linkage_files = of_scene['linkages']
    rate, seed = of_scene['rate'], of_scene['seed']
    if seed is None:
        seed = seed_of(source.name) if source.seed is None else source.seed
    scene = Scene(
        name=source.name,
        linkages=tuple(members),
        rate=rate,
        wrapped=published == 'wrapped',
        seed=seed,
        faults=read('faults', _prefixed_parts(members))() or {},
        record=of_scene['record'],
        files={SCENE_FILE: data, **linkage_files},
        folder=source.folder,
        robot_description=has_description,
        units=_table_units(content, members),
    )
    for scene_linkage in members:
        drive, parameters = scene_linkage.drive
        if scene.rate == 0.0 and not parameters.is_measured:
            raise content.error(
                'rate',
                f'0 is one tick for every crank sample, and {drive} has none',
                'name a rate',
            )
    if source.confinement is not None:
        source.confinement.refuse_scene(scene, content)
    return scene


def _table_units(content: Section, members: Sequence[SceneLinkage]) -> Units:
    """Return the units of a scene's tables: its own, or those that its linkages share."""
    shared = {member.linkage_content.units for member in members}
    return shared.pop() if content.units.is_si and len(shared) == 1 else content.units


def _prefixed_parts(members: Sequence[SceneLinkage]) -> Parts:
    """Return the parts of all linkages, with their prefixes, which faults name."""
    parts: dict[str, tuple[str, ...]] = {}
    for scene_linkage in members:
        for kind, names in parts_of(scene_linkage.linkage).items():
            parts[kind] = (*parts.get(kind, ()), *(scene_linkage.prefix + name for name in names))
    return parts


def _read_linkages(
    content: Section, source: _SceneSource
) -> tuple[list[SceneLinkage], dict[str, bytes]]:
    """Return the linkages of a scene, and their files."""
    if 'linkages' not in content:
        linkage_content, data = source.open_linkage(content)
        scene_linkage = _read_scene_linkage(
            '', linkage_content, content, content, source, source.closed
        )
        return [scene_linkage], {_file_name(LINKAGE_FILE, linkage_content): data}
    if 'linkage' in content:
        raise content.error('linkage', 'cannot be combined with linkages', 'write one of the two')
    entries = content.sections('linkages')
    if len(entries) > _MOST_LINKAGES:
        raise content.error(
            'linkages', f'there are {len(entries)}', f'write at most {_MOST_LINKAGES}'
        )
    members: list[SceneLinkage] = []
    files = {}
    for index, entry in enumerate(entries, 1):
        linkage_content, data = source.open_linkage(entry)
        files[_file_name(f'linkage_{index}.yaml', linkage_content)] = data
        name = entry.ros_name(entry.text('name'))
        if name in [scene_linkage.name for scene_linkage in members]:
            raise entry.error('name', f'{quote(name)} is taken', 'give each its own')
        taken = {joint for scene_linkage in members for joint in scene_linkage.joint_names}
        members.append(_read_scene_linkage(name, linkage_content, entry, content, source))
        if twice := taken.intersection(members[-1].joint_names):
            raise entry.error(
                'prefix' if 'prefix' in entry else '',
                f'a second linkage publishes {list_names(sorted(twice))}',
                'give each linkage its own prefix, or its joints other names',
            )
        entry.finish(tuple(OF_A_LINKAGE.entries))
    return members, files


def _file_name(name: str, content: Section) -> str:
    """Return the name of a linkage's file in a bag, which is a URDF for a robot."""
    return name.replace('.yaml', '.urdf') if 'urdf' in content else name


def _read_scene_linkage(
    name: str,
    linkage_content: Section,
    own: Section,
    scene: Section,
    source: _SceneSource,
    closure: Any = None,
) -> SceneLinkage:
    def section_with(key: str) -> Section:
        return own if key in own else scene

    drive = drive_name(drive_section(section_with('drive')))
    effects = effects_section(
        section_with('effects'), lambda: parts_of(read_any_closure(linkage_content).linkage)
    )
    published = OF_A_LINKAGE.read_key(section_with('publish_input'), 'publish_input', {})
    not_imported = () if source.trust_effects else tuple(name for name in effects if '.' in name)
    types = effect_types(effects, not_imported)
    if published is None:
        published = not drive_class(drive).is_measured or any(
            effect.without_inputs for effect in types.values()
        )
    if closure is None:
        closure = read_any_closure(
            linkage_content,
            publish_inputs=published,
            publish_model_joints=source.publishes_model_joints,
        )
    linkage = closure.linkage
    _refuse_effects(effects, types, drive, published)
    kinds = {bool(driven.slider) for driven in linkage.inputs}
    for section in (own, scene):
        section.units = replace(section.units, slides=kinds == {True} if len(kinds) == 1 else None)
    parts = {**parts_of(linkage), 'left_out': not_imported}

    def read(kind: Kind, key: str, folder: str = '') -> Callable[[], Any]:
        return partial(kind.read, section_with(key), key, parts, folder)

    def read_key(key: str) -> Callable[[], Any]:
        return partial(OF_A_LINKAGE.read_key, section_with(key), key, parts)

    values = read_each(
        {
            'drive': read(DRIVE, 'drive', source.folder),
            'effects': read(EFFECTS_BY_NAME, 'effects'),
            'prefix': read_key('prefix'),
            'loads': read_key('loads'),
        }
    )
    driven = values['drive']
    if driven[0] == 'topic' and driven[1].joint:
        _check_sampled(section_with('drive'), closure, driven[1].joint)
    if source.confinement is not None:
        source.confinement.refuse_drive(section_with('drive'), driven)
    prefix = values['prefix']
    return SceneLinkage(
        name=name,
        linkage=linkage,
        closure=closure,
        drive=driven,
        effects=values['effects'],
        loads=values['loads'],
        prefix=prefix if prefix is not None else f'{name}_' if name else '',
        content=own,
        linkage_content=linkage_content,
        silent_beyond_limits=_is_silent_beyond(section_with('beyond_limits'), linkage),
        not_imported=not_imported,
    )


def _refuse_effects(
    effects: Section, types: Mapping[str, type[Effect]], drive: str, published: bool
) -> None:
    """Refuse effects that do not fit to the drive, or to what is published."""
    for name, effect in types.items():
        if effect.without_inputs and not published:
            raise effects.error(name, *effect.without_inputs)
        if drive in effect.refused_drives:
            raise effects.error(name, *effect.refused_drives[drive])


def _check_sampled(drives: Section, closure: Closure, joints: Sequence[str]) -> None:
    """Refuse samples of what is neither a joint nor measures the linkage."""
    try:
        closure.measuring(*joints)
    except DefinitionError as error:
        reason = f'{error.where}: {error.reason}'
        raise drives.error('drive.topic.joint', reason, error.remedy) from None


def _is_silent_beyond(content: Section, linkage: Linkage) -> bool:
    """Return whether nothing is published while a joint is beyond its limits."""
    policy = OF_A_LINKAGE.read_key(content, 'beyond_limits', {})
    if (
        'beyond_limits' in content
        and 'linkages' not in content
        and not any(limits.is_bounded for limits in linkage.limits.values())
    ):
        raise content.error(
            'beyond_limits',
            'no joint of the linkage has limits',
            'leave it out, or write limits: [low, high] into the linkage file',
        )
    return bool(policy == 'silent')
