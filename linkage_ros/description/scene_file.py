# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Read a scene file into a `Scene`."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from os import PathLike
from os.path import isfile
from pathlib import Path
from re import fullmatch
from typing import Any, Literal, TYPE_CHECKING
from zlib import crc32

from linkage_ros.description.linkage_file import looks_like_linkage, read_closure
from linkage_ros.description.parameters import declared_fields, is_required, Parts, read_parameters
from linkage_ros.description.scene import (
    AS_THE_RUN_GOES,
    LEASTS,
    parts_of,
    RecordParameters,
    Scene,
    SceneLinkage,
    SPLITS,
    StorageParameters,
)
from linkage_ros.description.section import Section
from linkage_ros.description.units import ANGLES, LENGTHS, Units
from linkage_ros.description.yaml_file import parse_yaml, read_yaml
from linkage_ros.dynamics import AppliedLoads, GREATEST_LOAD, Loads, Spring, STIFFEST
from linkage_ros.errors import DefinitionError, did_you_mean, FileError, list_names, quote
from linkage_ros.kinematics import Closure, Linkage
from linkage_ros.resources import linkage_names, linkage_of_scene, named_file
from linkage_ros.stages.drives import DRIVES
from linkage_ros.stages.effects import EFFECTS, in_order, module_of

if TYPE_CHECKING:
    from linkage_ros.stages.faults import Fault

SCENE_FILE, LINKAGE_FILE = 'scene.yaml', 'linkage.yaml'
"""Names of a scene's files in a bag; further linkage files are numbered."""

LOWEST_RATE, HIGHEST_RATE = 0.01, 20_000.0
"""Bounds of the tick rate, in [Hz]; the higher was measured as what one core sustains."""

_MOST_LINKAGES = 400
"""A hundred linkages at 1 kHz fill a core."""

PUBLISHED_ANGLES = ('continuous', 'wrapped')
"""How angles are published; see `Scene.wrapped`."""

_WHEN = ('at', 'seconds')

Open = Callable[[Section], tuple[Section, bytes]]
"""Opens the linkage file that a section names under ``linkage``."""

_LINKAGE_KEYS = (
    'prefix',
    'publish_input',
    'drive',
    'effects',
    'loads',
    'beyond_limits',
)
"""Keys of an entry of ``linkages``; the scene has them for the entries without."""

_SCENE_KEYS = ('rate', 'seed', 'faults', 'record', 'robot_description', *_LINKAGE_KEYS)
"""Keys of a scene beside the linkages."""


@dataclass(frozen=True)
class _SceneSource:
    """Where a scene comes from."""

    name: str
    folder: str
    open_linkage: Open
    seed: int | None = None  # Seed if the scene names none; None to derive it from the name
    trust_effects: bool = True  # Whether user-defined effects are imported
    closed: Closure | None = None  # Closure of its only linkage, if there is one already


def load_scene(file: str | PathLike[str], settings: Sequence[str] = ()) -> Scene:
    """
    Read a scene and the linkages that it names; for a linkage file, a default scene.

    Parameters
    ----------
    file
        The scene file; paths in it are relative to its folder. Or a linkage file; or the name of
        a scene or a linkage that comes with the package, such as ``'demo'``.
    settings
        Keys to set beside the file, as ``drive.sine.amplitude=0.3``; they are part of
        `Scene.files`.

    Raises
    ------
    FileError
        The file is wrong; the error has file, line, key, value and remedy.
    TypeError
        The argument is neither a path nor a name.

    """
    file = named_file(file, 'scenes', 'linkages')
    content, data = read_yaml(file)
    name, folder = file.stem, str(file.parent)
    if kind_of(content) == 'linkage':
        return _stand_in(name, content, data, folder, settings)

    def open_linkage(where: Section) -> tuple[Section, bytes]:
        linkage = linkage_of_scene(where.text('linkage'), file.parent)
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
        return read_yaml(linkage)

    return _build_scene(content, data, _SceneSource(name, folder, open_linkage), settings)


def kind_of(content: Section) -> Literal['scene', 'linkage']:
    """Return whether a file holds a scene or a linkage; FileError for neither, or both."""
    if not ('linkage' in content or 'linkages' in content):
        if looks_like_linkage(content):
            for key in content:
                if key in _SCENE_KEYS:
                    raise content.error(
                        key,
                        'is a key of scenes, and this is a linkage',
                        f'write it beside linkage: {Path(content.file).name} into another file',
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
    name: str, content: Section, data: bytes, folder: str, settings: Sequence[str]
) -> Scene:
    """Return the default scene of a linkage file."""
    from linkage_ros.description.linkage_writer import (
        scene_text_for,  # local import: not for scenes
    )

    try:
        closure = read_closure(content, publish_inputs=True)
        text = scene_text_for(closure, LINKAGE_FILE).encode()
    except DefinitionError as error:
        raise content.locate_error(error) from None

    def open_linkage(where: Section) -> tuple[Section, bytes]:
        where.text('linkage')
        return content, data

    scene = parse_yaml(text, f'{content.file}, as a scene')
    # A drive moves one input, which is then published; several inputs come from a topic.
    closed = closure if len(closure.linkage.inputs) == 1 and not settings else None
    return _build_scene(
        scene, text, _SceneSource(name, folder, open_linkage, closed=closed), settings
    )


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
        within.text('linkage')
        part = next(linkages, None)
        if part is None:
            raise within.error('linkage', 'is not among the files', 'name another bag')
        return parse_yaml(files[part], f'{where}: {part}'), files[part]

    source = _SceneSource(name, folder, open_linkage, seed, trust_effects=trust_effects)
    return _build_scene(content, files[SCENE_FILE], source, settings)


def seed_of(name: str) -> int:
    """Return the seed of a scene that names none: different scenes get different noise."""
    return crc32(name.encode())


def _build_scene(
    content: Section, data: bytes, source: _SceneSource, settings: Sequence[str] = ()
) -> Scene:
    """Read a scene with settings beside its file."""
    if not settings:
        return _read_scene(content, data, source)
    from linkage_ros.description import scene_settings as given  # local import: few scenes need it

    data = given.apply_settings(content, settings)
    try:
        return _read_scene(content, data, source)
    except FileError as error:
        raise given.blame_setting(error, content, settings) from None


def _read_scene(content: Section, data: bytes, source: _SceneSource) -> Scene:
    wrapped = _read_units(content)
    members, linkage_files = _read_linkages(content, source)
    seed = seed_of(source.name) if source.seed is None else source.seed
    scene = Scene(
        name=source.name,
        linkages=tuple(members),
        rate=_read_rate(content),
        wrapped=wrapped,
        seed=content.whole_number('seed', seed, least=0, most=2**53),
        faults=_read_faults(content, members),
        record=_read_record(content.section('record')) if 'record' in content else None,
        files={SCENE_FILE: data, **linkage_files},
        folder=source.folder,
        robot_description=content.flag('robot_description', False),
    )
    for key in _LINKAGE_KEYS:
        if key in content:
            content.remove_key(key)
    content.finish(('record', 'linkages', *_LINKAGE_KEYS))
    for scene_linkage in members:
        drive, _ = scene_linkage.drive
        if scene.rate == 0.0 and drive != 'topic':
            raise content.error(
                'rate',
                f'0 is one tick for every crank sample, and {drive} has none',
                'name a rate',
            )
    return scene


def _read_linkages(
    content: Section, source: _SceneSource
) -> tuple[list[SceneLinkage], dict[str, bytes]]:
    """Return the linkages of a scene, and their files."""
    if 'linkages' not in content:
        linkage_content, data = source.open_linkage(content)
        scene_linkage = _read_scene_linkage(
            '', linkage_content, content, content, source, source.closed
        )
        return [scene_linkage], {LINKAGE_FILE: data}
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
        linkage_content, files[f'linkage_{index}.yaml'] = source.open_linkage(entry)
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
        entry.finish(_LINKAGE_KEYS)
    return members, files


def _read_scene_linkage(
    name: str,
    linkage_content: Section,
    own: Section,
    scene: Section,
    source: _SceneSource,
    closure: Closure | None = None,
) -> SceneLinkage:
    def section_with(key: str) -> Section:
        return own if key in own else scene

    drives = section_with('drive').section('drive', required=False)
    drive = _drive_name(drives)
    effects = section_with('effects').section('effects', required=False)
    loads = section_with('loads').section('loads') if 'loads' in section_with('loads') else None
    default = drive != 'topic' or 'effort' in effects
    published = section_with('publish_input').flag('publish_input', default)
    if closure is None:
        closure = read_closure(linkage_content, publish_inputs=published)
    linkage = closure.linkage
    _refuse_effects(effects, drive, published)
    parts = parts_of(linkage)
    _set_slide_units((drives, effects, *([] if loads is None else [loads]), own, scene), linkage)
    not_imported = () if source.trust_effects else tuple(name for name in effects if '.' in name)
    for effect in not_imported:
        effects.section(effect)
    types = _effect_types(effects, not_imported)
    parameters = import_module(DRIVES[drive]).PARAMETERS
    driven = drives.section(drive, required=False)
    scene_linkage = SceneLinkage(
        name=name,
        linkage=linkage,
        closure=closure,
        drive=(drive, read_parameters(driven, parameters, parts, source.folder)),
        effects={e: read_parameters(effects.section(e), of, parts) for e, of in types.items()},
        loads=_read_loads(loads, parts) if loads is not None else None,
        prefix=_read_prefix(section_with('prefix'), f'{name}_' if name else ''),
        content=own,
        linkage_content=linkage_content,
        silent_beyond_limits=_is_silent_beyond(section_with('beyond_limits'), linkage),
        not_imported=not_imported,
    )
    effects.finish(tuple(EFFECTS))
    return scene_linkage


def _drive_name(drives: Section) -> str:
    """Return the name of the drive in its section."""
    named = list(drives) or ['topic']
    if len(named) > 1:
        raise drives.error(named[1], 'is a second drive', f'leave it, or {named[0]}, out')
    if named[0] not in DRIVES:
        drives.finish(tuple(DRIVES))
    return named[0]


def _refuse_effects(effects: Section, drive: str, published: bool) -> None:
    """Refuse effects that do not fit to the drive, or to what is published."""
    if 'effort' in effects and not published:
        raise effects.error(
            'effort',
            'is the effort of the input joint, which is not published',
            'set publish_input: true, or name pin_forces',
        )
    if drive == 'torque' and 'backlash' in effects:
        raise effects.error(
            'backlash',
            'is play without masses, and torque moves masses',
            'write drive.torque.play: {width: …, inertia: …} instead',
        )


def _set_slide_units(sections: Collection[Section], linkage: Linkage) -> None:
    """Tell sections whether the inputs slide or turn; None where some do this and some that."""
    kinds = {bool(given.slider) for given in linkage.inputs}
    slides = kinds.pop() if len(kinds) == 1 else None
    for section in sections:
        section.units = replace(section.units, slides=slides)


def _read_prefix(content: Section, default: str) -> str:
    """Return the prefix of the names of a linkage; '' is one too."""
    prefix = content.text('prefix', '') if 'prefix' in content else default
    if not fullmatch('[A-Za-z0-9_/.-]*', prefix):
        raise content.error(
            'prefix', f'{quote(prefix)} cannot begin a joint name', 'use letters, digits and _/.-'
        )
    return prefix


def _effect_types(effects: Section, left_out: Collection[str]) -> dict[str, Any]:
    """Return the parameter types of the named effects, in physical order."""
    known = [name for name in effects if name in EFFECTS or '.' in name]
    try:
        named = in_order([name for name in known if name not in left_out])
        return {name: module_of(name).PARAMETERS for name in named}
    except DefinitionError as error:
        raise effects.locate_error(error) from None


def _is_silent_beyond(content: Section, linkage: Linkage) -> bool:
    """Return whether nothing is published while a joint is beyond its limits."""
    policy = content.choice('beyond_limits', ('publish', 'silent'), 'publish')
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
    return policy == 'silent'


def _read_units(content: Section) -> bool:
    """Set the units of a scene; return whether it publishes wrapped angles."""
    words = content.choose_words('angles', (PUBLISHED_ANGLES, ANGLES))
    content.units = Units(content.choice('units', tuple(LENGTHS), 'm'), words[1])
    return words[0] == 'wrapped'


def _read_rate(content: Section) -> float:
    rate = content.number('rate', 1000.0, least=0.0, most=HIGHEST_RATE, unit='Hz')
    if 0.0 < rate < LOWEST_RATE:
        raise content.error(
            'rate',
            f'{rate:g} is out of bounds',
            f'write {LOWEST_RATE:g} to {HIGHEST_RATE:g} [Hz], or 0 for once for every sample',
        )
    return rate


def _read_record(content: Section) -> RecordParameters:
    record = RecordParameters(
        directory=content.text('directory', 'runs'),
        name=content.text('name', ''),
        queue=content.whole_number('queue', 20_000, least=100, most=10_000_000),
        storage=_read_storage(content),
    )
    if record.name != Path(record.name).name or record.name == '..':
        raise content.error(
            'name', f'{record.name!r} is not a plain name', 'leave out the folders'
        )
    return record


def _read_loads(content: Section, parts: Parts) -> Loads:
    """Read gravity, springs, the inertia of the drive, and the loads on joints and points."""
    springs = content.section('springs', required=False)
    loads = Loads(
        gravity=content.point('gravity', most=1e3, unit='m/s²')
        if 'gravity' in content
        else (0.0, 0.0),
        springs=tuple(_read_spring(name, springs.section(name)) for name in springs),
        drive_inertia=content.number(
            'drive_inertia', 0.0, least=0.0, most=GREATEST_LOAD, unit='kg·m², or kg of a slide'
        ),
    )
    # Only here: what is read below refuses the keys that it does not know.
    content.remove_key('gravity')
    return replace(loads, applied=read_parameters(content, AppliedLoads, parts))


def _read_spring(name: str, content: Section) -> Spring:
    spring = Spring(
        *_read_spring_end(content, 'from'),
        *_read_spring_end(content, 'to'),
        content.number('stiffness', least=0.0, most=STIFFEST, unit='N/m'),
        content.number('free_length', 0.0, least=0.0, most=GREATEST_LOAD, unit='m'),
        content.number('damping', 0.0, least=0.0, most=STIFFEST, unit='N·s/m'),
        name,
    )
    content.finish()
    return spring


def _read_spring_end(content: Section, key: str) -> tuple[str, str]:
    """Return link and point of a spring's end."""
    link, dot, point = content.text(key).rpartition('.')
    if not dot or not link or not point:
        raise content.error(key, f'{content.text(key)!r} is not a point', 'write LINK.POINT')
    return link, point


def _read_faults(content: Section, members: Sequence[SceneLinkage]) -> dict[str, Fault]:
    """Return the faults of a scene, by name."""
    section = content.section('faults', required=False)
    parts: dict[str, tuple[str, ...]] = {}
    for scene_linkage in members:
        for kind, names in parts_of(scene_linkage.linkage).items():
            parts[kind] = (*parts.get(kind, ()), *(scene_linkage.prefix + name for name in names))
    return {
        section.ros_name(name): _read_fault(name, section.section(name), parts) for name in section
    }


def kinds_of_fault(name: str, kinds: Sequence[str]) -> tuple[str, str]:
    """Return reason and remedy for a fault that names no kind, or several."""
    from linkage_ros.stages.faults import (
        FAULTS,  # local import: only section_with a scene has faults
    )

    if kinds:
        return (
            f'names {len(kinds)} kinds of fault',
            f'leave all but one of {list_names(kinds)} out',
        )
    kind = name if name in FAULTS else 'freeze'
    needed = declared_fields(FAULTS[kind])
    parameters = ', '.join(f'{entry.name}: …' for entry, _ in needed if is_required(entry))
    shape = f'{name}: {{{kind}: {{{parameters}}}, at: [1], seconds: 2}}'
    return 'names no kind of fault', f'write {shape}; kinds: {list_names(FAULTS)}'


def _read_fault(name: str, content: Section, parts: Mapping[str, tuple[str, ...]]) -> Fault:
    from linkage_ros.stages.faults import Fault, FAULTS  # local import: as above

    kinds = [key for key in content if key in FAULTS]
    for key in () if kinds else content:
        if remedy := did_you_mean(key, FAULTS, ''):
            raise content.error(key, 'unknown key', remedy)
    if len(kinds) != 1:
        raise content.error('', *kinds_of_fault(name, kinds))
    parameters: Any = read_parameters(content.section(kinds[0]), FAULTS[kinds[0]], parts)
    at = content.numbers('at', most=1e9) if 'at' in content else []
    if any(time < 0.0 for time in at):
        raise content.error(
            'at', f'{at} has a negative time', 'write seconds after the first tick'
        )
    seconds = content.number('seconds', least=1e-6, most=1e9, unit='s') if at else 0.0
    content.finish(_WHEN)
    return Fault(kinds[0], parameters, tuple(at), seconds)


def _read_storage(content: Section) -> StorageParameters:
    """Read the storage of a bag from the ``record`` section."""
    storage: StorageParameters = read_parameters(content, StorageParameters, {})
    for key, least in LEASTS.items():
        value = getattr(storage, key)
        if 0 < value < least:
            raise content.error(key, f'{value:g} is too small', f'write {least:.9g} or more, or 0')
    if storage.snapshot_seconds:
        _refuse_what_is_for_a_run(content)
    elif 'snapshot_bytes' in content:
        raise content.error(
            'snapshot_bytes', 'nothing is kept in memory', 'write snapshot_seconds too'
        )
    if storage.keep_files and not any(getattr(storage, key) for key in SPLITS):
        raise content.error(
            'keep_files', 'the bag has only one file', f'write {" or ".join(SPLITS)} too'
        )
    return storage


def _refuse_what_is_for_a_run(content: Section) -> None:
    """Raise FileError for a key that has no effect on a snapshot, unless its value is 0."""
    for key in AS_THE_RUN_GOES:
        if content.mapping.get(key, 0) != 0:
            raise content.error(
                key,
                'is for a bag that is written as the run goes, and snapshot_seconds keeps the run '
                'in memory',
                'leave one of the two out',
            )
