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


"""A scene file, read into a `Scene`."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from importlib import import_module
from os import PathLike
from os.path import isfile
from pathlib import Path
from typing import Any, Literal
from zlib import crc32

from linkage_ros.drives.drive import DRIVES
from linkage_ros.effects.stage import EFFECTS, in_order, module_of
from linkage_ros.errors import DefinitionError, quoted
from linkage_ros.kinematics.checks import check
from linkage_ros.kinematics.linkage import Linkage, RevoluteJoint, SlideJoint
from linkage_ros.scene.faults import read_faults
from linkage_ros.scene.linkage_file import looks_like_linkage, read_linkage
from linkage_ros.scene.loads import read_loads
from linkage_ros.scene.read import parts_of, read_parameters
from linkage_ros.scene.scene import Member, RecordParameters, Scene
from linkage_ros.scene.section import Section
from linkage_ros.scene.solving import read_solver, read_solving
from linkage_ros.scene.storage import read_storage
from linkage_ros.scene.yaml_file import parse_yaml, read_yaml
from linkage_ros.shipped import named_file

SCENE_FILE, LINKAGE_FILE = 'scene.yaml', 'linkage.yaml'
"""Names of the files of a scene where a bag carries them; further linkages are numbered."""

LOWEST_RATE, HIGHEST_RATE = 0.01, 20_000.0
"""Ticks a second, in [Hz]: of these the higher is what a core was measured to hold."""

_MOST_LINKAGES = 400
"""A hundred take a core at 1 kHz."""

Open = Callable[[Section], tuple[Section, bytes]]
"""Opens the linkage file that a section names under ``linkage``."""


def load_scene(file: str | PathLike[str]) -> Scene:
    """
    Read a scene and the linkages that it names; a linkage file stands for one that moves it.

    Parameters
    ----------
    file
        The scene file; paths in it are relative to its folder. Or a linkage file; or the name of
        a scene that comes with the package, such as ``'demo'``.

    Raises
    ------
    FileError
        With file, line, key, value and remedy.
    TypeError
        Where it is neither a path nor a name.

    """
    file = named_file(file, 'scenes')
    content, data = read_yaml(file)
    name, folder = file.stem, str(file.parent)
    if kind_of(content) == 'linkage':
        return _stand_in(name, content, data, folder)

    def open_linkage(where: Section) -> tuple[Section, bytes]:
        linkage = file.parent / where.text('linkage')
        if not isfile(linkage):  # noqa: PTH113 (Path's raises where a name is too long)
            raise where.error(
                'linkage',
                f'{quoted(str(linkage))} is not a file',
                'name one, relative to the scene',
            )
        return read_yaml(linkage)

    return _scene(name, content, open_linkage, data, folder)


def kind_of(content: Section) -> Literal['scene', 'linkage']:
    """
    Return what a file holds that may be a scene or a linkage.

    Raises
    ------
    FileError
        Where it is neither, or where keys of both are mixed.

    """
    if not ('linkage' in content or 'linkages' in content):
        if looks_like_linkage(content):
            for key in content:
                if key in _OF_A_SCENE:
                    raise content.error(
                        key,
                        'is a key of scenes, and this is a linkage',
                        f'write it beside linkage: {Path(content.file).name} into another file',
                    )
            return 'linkage'
        if not any(key in _OF_A_SCENE for key in content):
            raise content.error(
                '',
                'is neither a scene nor a linkage',
                'write linkage: FILE for a scene, links: {…} for a linkage',
            )
    return 'scene'


def _stand_in(name: str, content: Section, data: bytes, folder: str) -> Scene:
    """Return the scene that a linkage file stands for."""
    from linkage_ros.scene.stand_in import scene_text_for  # local import: not for scenes

    try:
        text = scene_text_for(read_linkage(content), LINKAGE_FILE).encode()
    except DefinitionError as error:
        raise content.error(error.where, error.reason, error.remedy) from None

    def open_linkage(where: Section) -> tuple[Section, bytes]:
        where.text('linkage')
        return content, data

    return _scene(
        name, parse_yaml(text, f'{content.file}, as a scene'), open_linkage, text, folder
    )


def parse_scene(
    name: str,
    where: str,
    files: Mapping[str, bytes],
    folder: str = '',
    solvers: Mapping[str, Any] | None = None,
    seed: int | None = None,
    *,
    trust_effects: bool = False,
) -> Scene:
    """
    Read a scene out of the files that a bag carries.

    Parameters
    ----------
    name
        Name of the scene.
    where
        Where the files come from, for messages.
    files, folder
        As in `Scene`.
    solvers
        By the name of each linkage whose scene asks for an accuracy what was chosen: a solver, as
        the scene could have said it.
    seed
        The seed where the scene names none; None for one that follows from its name.
    trust_effects
        Whether the effects of one's own that the scene names are imported, which runs them. Where
        they are not, `Member.not_imported` names them.

    Raises
    ------
    FileError
        As `load_scene`.

    """
    content = parse_yaml(files[SCENE_FILE], f'{where}: {SCENE_FILE}')
    linkages = iter([part for part in files if part != SCENE_FILE])

    def open_linkage(within: Section) -> tuple[Section, bytes]:
        within.text('linkage')
        part = next(linkages, None)
        if part is None:
            raise within.error('linkage', 'is not among the files', 'name another bag')
        return parse_yaml(files[part], f'{where}: {part}'), files[part]

    scene = _scene(
        name, content, open_linkage, files[SCENE_FILE], folder, seed, trust_effects=trust_effects
    )
    if not solvers:
        return scene
    return replace(scene, members=tuple(_as_chosen(one, solvers) for one in scene.members))


def _as_chosen(member: Member, solvers: Mapping[str, Any]) -> Member:
    """Return a linkage with the solver that was chosen for it, where one was."""
    if member.accuracy is None or member.name not in solvers:
        return member
    where = Section(member.content.file, '', {'solver': solvers[member.name]})
    return replace(member, solver=read_solver(where, {}), accuracy=None)


def seed_of(name: str) -> int:
    """Return the seed of a scene that names none: two scenes do not share their noise."""
    return crc32(name.encode())


def _scene(
    name: str,
    content: Section,
    open_linkage: Open,
    scene_bytes: bytes,
    folder: str,
    seed: int | None = None,
    *,
    trust_effects: bool = True,
) -> Scene:
    files = {SCENE_FILE: scene_bytes}
    members: list[Member] = []
    if 'linkages' in content:
        if 'linkage' in content:
            raise content.error('linkage', 'stands beside linkages', 'write one of the two')
        entries = content.sections('linkages')
        if len(entries) > _MOST_LINKAGES:
            raise content.error(
                'linkages', f'there are {len(entries)}', f'write at most {_MOST_LINKAGES}'
            )
        for entry in entries:
            linkage_content, data = open_linkage(entry)
            files[f'linkage_{len(files)}.yaml'] = data
            own = entry.ros_name(entry.text('name'))
            if own in [member.name for member in members]:
                raise entry.error('name', f'{quoted(own)} is taken', 'give each its own')
            members.append(_member(own, linkage_content, entry, content, folder, trust_effects))
            entry.finish(_OF_A_MEMBER)
    else:
        linkage_content, files[LINKAGE_FILE] = open_linkage(content)
        members.append(_member('', linkage_content, content, content, folder, trust_effects))
    scene = Scene(
        name=name,
        members=tuple(members),
        rate=_rate(content),
        wrapped=content.choice('angles', ('continuous', 'wrapped'), 'continuous') == 'wrapped',
        seed=content.whole('seed', seed_of(name) if seed is None else seed, least=0, most=2**53),
        faults=read_faults(content, members),
        record=_record(content.section('record')) if 'record' in content else None,
        files=files,
        folder=folder,
        robot_description=content.flag('robot_description', False),
    )
    for key in _OF_A_MEMBER:
        if key in content:
            content.taken(key)
    content.finish(('record', 'linkages', *_OF_A_MEMBER))
    for member in members:
        drive, _ = member.drive
        if scene.rate == 0.0 and drive != 'topic':
            raise content.error(
                'rate',
                f'0 is one tick for every crank sample, and {drive} has none',
                'name a rate',
            )
    return scene


_OF_A_MEMBER = (
    'publish_input',
    'drive',
    'effects',
    'loads',
    'solver',
    'accuracy',
    'beyond_limits',
)
"""What an entry of ``linkages`` may say for itself, and the scene for all that do not."""

_OF_A_SCENE = ('rate', 'angles', 'seed', 'faults', 'record', 'robot_description', *_OF_A_MEMBER)
"""What a scene may say beside the linkages that it names."""


def _member(
    name: str,
    linkage_content: Section,
    own: Section,
    scene: Section,
    folder: str,
    trust_effects: bool,
) -> Member:
    linkage = read_linkage(linkage_content)

    def where(key: str) -> Section:
        return own if key in own else scene

    drives = where('drive').section('drive', required=False)
    named = list(drives) or ['topic']
    if len(named) > 1:
        raise drives.error(named[1], 'is a second drive', f'leave it, or {named[0]}, out')
    drive = named[0]
    if drive not in DRIVES:
        drives.finish(tuple(DRIVES))
    effects = where('effects').section('effects', required=False)
    loads = where('loads').section('loads') if 'loads' in where('loads') else None

    published = where('publish_input').flag(
        'publish_input', drive != 'topic' or 'effort' in effects
    )
    if published:
        linkage = _with_inputs(linkage, linkage_content)
    elif 'effort' in effects:
        raise effects.error(
            'effort', 'is that of the input joint', 'set publish_input: true, or name pin_forces'
        )
    if drive == 'torque' and 'backlash' in effects:
        raise effects.error(
            'backlash',
            'needs a model of motor and crank as two masses, and torque moves them as one',
            'leave backlash out, or name another drive than torque',
        )
    parts = parts_of(linkage)
    not_imported = () if trust_effects else tuple(name for name in effects if '.' in name)
    for effect in not_imported:
        effects.section(effect)
    types = _effects(effects, not_imported)
    member = Member(
        name=name,
        linkage=linkage,
        drive=(
            drive,
            read_parameters(
                drives.section(drive, required=False),
                import_module(DRIVES[drive]).PARAMETERS,
                parts,
                folder,
            ),
        ),
        effects={e: read_parameters(effects.section(e), of, parts) for e, of in types.items()},
        loads=read_loads(loads) if loads is not None else None,
        content=own,
        linkage_content=linkage_content,
        silent_beyond_limits=_silent(where('beyond_limits'), linkage),
        not_imported=not_imported,
        **read_solving(own, scene, parts),
    )
    effects.finish(tuple(EFFECTS))
    return member


def _effects(effects: Section, left_out: Collection[str]) -> dict[str, Any]:
    """Return the types of parameters of the effects that are named, in the order of physics."""
    known = [name for name in effects if name in EFFECTS or '.' in name]
    try:
        named = in_order([name for name in known if name not in left_out])
        return {name: module_of(name).PARAMETERS for name in named}
    except DefinitionError as error:
        raise effects.error(error.where, error.reason, error.remedy) from None


def _with_inputs(linkage: Linkage, content: Section) -> Linkage:
    """Return a linkage that publishes its input joints too, before the others."""
    inputs: dict[str, RevoluteJoint | SlideJoint] = {
        given.joint: SlideJoint(given.slider)
        if given.slider
        else RevoluteJoint(given.parent, given.child)
        for given in linkage.inputs
    }
    changed = replace(linkage, joints=inputs | dict(linkage.joints))
    try:
        check(changed)
    except DefinitionError as error:
        raise content.error(error.where, error.reason, error.remedy) from None
    return changed


def _silent(content: Section, linkage: Linkage) -> bool:
    """Return whether nothing is published beyond the limits of a linkage."""
    said = content.choice('beyond_limits', ('publish', 'silent'), 'publish')
    if (
        'beyond_limits' in content
        and 'linkages' not in content
        and not any(limits.bounded for limits in linkage.limits.values())
    ):
        raise content.error(
            'beyond_limits',
            'no joint of the linkage has limits',
            'leave it out, or write limits: [low, high] into the linkage file',
        )
    return said == 'silent'


def _rate(content: Section) -> float:
    rate = content.number('rate', 1000.0, least=0.0, most=HIGHEST_RATE, unit='Hz')
    if 0.0 < rate < LOWEST_RATE:
        raise content.error(
            'rate',
            f'{rate:g} is out of bounds',
            f'write {LOWEST_RATE:g} to {HIGHEST_RATE:g} [Hz], or 0 for once for every sample',
        )
    return rate


def _record(content: Section) -> RecordParameters:
    record = RecordParameters(
        directory=content.text('directory', 'runs'),
        name=content.text('name', ''),
        queue=content.whole('queue', 20_000, least=100, most=10_000_000),
        storage=read_storage(content),
    )
    if record.name != Path(record.name).name or record.name == '..':
        raise content.error(
            'name', f'{record.name!r} is not a plain name', 'leave out the folders'
        )
    return record
