# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Set keys of a scene without editing its file: ``rate=500``, ``drive.sine.amplitude=0.3``."""

from __future__ import annotations

from collections.abc import Sequence
import re
from typing import Any

from linkage_ros.description.section import LinedDict, Section
from linkage_ros.description.yaml_file import BoundedLoader, parse_yaml
from linkage_ros.errors import did_you_mean, FileError, list_names, quote
import yaml

_PART = re.compile(r'"[^"]+"|[^".]+')
"""A part of a key; in quotes it may contain dots."""


class _Dumper(yaml.SafeDumper):
    """A dumper that quotes what our reader would not take for a text."""

    yaml_implicit_resolvers = BoundedLoader.yaml_implicit_resolvers


_Dumper.add_representer(LinedDict, yaml.SafeDumper.represent_dict)


def apply_settings(content: Section, settings: Sequence[str]) -> bytes:
    """
    Set keys of a scene, in place; return the scene as text, which a bag then holds.

    A setting is ``KEY=VALUE``, a dotted key and a value in YAML. With several linkages the key
    names one: ``linkages.left.drive.sine.amplitude=0.3``. A new part with a dot stands in quotes:
    ``loads.forces."coupler.P".constant=5``. A FileError names a wrong setting.
    """
    for setting in settings:
        key, equal, text = setting.partition('=')
        parts = _PART.findall(key)
        # On one line no value can add further keys.
        if not (equal and parts) or '.'.join(parts) != key or not setting.isprintable():
            raise _setting_error(
                setting, f'{quote(setting)} is not a setting', 'write KEY=VALUE: rate=500'
            )
        within: Any = content.mapping
        outer = ''
        while (part := _next_part(within, parts)) and parts:
            within, outer = _inner_value(setting, within, part), part
        within, last = _require_mapping(setting, outer, within), part
        within.lines.setdefault(last, 0)
        within[last] = _parse_value(setting, text)
    head = ''.join(f'# --set {setting}\n' for setting in settings)
    return (head + yaml.dump(content.mapping, Dumper=_Dumper, sort_keys=False)).encode()


def _next_part(within: Any, parts: list[str]) -> str:
    """Remove the next part of a key, and return it: the longest that is there, dots included."""
    count = 1
    for more in range(2, len(parts) + 1):
        if isinstance(within, LinedDict) and '.'.join(parts[:more]) in within:
            count = more
    part = '.'.join(parts[:count])
    del parts[:count]
    return part.strip('"')


def _inner_value(setting: str, within: Any, part: str) -> Any:
    """Return what a key of a mapping holds, or the linkage of a name in a list."""
    if isinstance(within, list):
        names = _linkage_names(within)
        if part not in names:
            raise _setting_error(
                setting,
                f'there is no linkage {quote(part)}',
                did_you_mean(part, names, f'there are: {list_names(names)}'),
            )
        return within[names.index(part)]
    within.lines.setdefault(part, 0)
    inner = within.setdefault(part, LinedDict())
    return (
        inner
        if part == 'linkages' and _linkage_names(inner)
        else _require_mapping(setting, part, inner)
    )


def _require_mapping(setting: str, part: str, inner: Any) -> LinedDict:
    if not isinstance(inner, LinedDict):
        raise _setting_error(setting, f'{part} is {quote(inner)}', 'name a key in a mapping')
    return inner


def _linkage_names(entries: Any) -> list[str]:
    """Return the names of the linkages in a list; [] for anything else."""
    if not isinstance(entries, list):
        return []
    return [str(entry.get('name')) if isinstance(entry, LinedDict) else '' for entry in entries]


def _parse_value(setting: str, text: str) -> Any:
    try:
        return parse_yaml(f'value: {text}'.encode(), setting).mapping['value']
    except FileError as error:
        raise _setting_error(setting, error.reason, 'write its value as YAML') from None


def blame_setting(error: FileError, content: Section, settings: Sequence[str]) -> FileError:
    """Return an error of a scene; it names the setting that it is about instead of the file."""
    blamed = _blame(error, content, settings)
    blamed.others = [_blame(further, content, settings) for further in error.others]
    return blamed


def _blame(error: FileError, content: Section, settings: Sequence[str]) -> FileError:
    for setting in reversed(settings):
        key = setting.partition('=')[0].replace('"', '')
        if error.file == content.file and _is_within(error.key, _counted_key(content, key)):
            remedy = error.remedy
            mapping = remedy.removeprefix(f'write {key.rpartition(".")[2]}: ')
            if mapping != remedy:  # as in a file
                remedy = f"write --set '{key}={mapping}'"
            return _setting_error(setting, f'{error.key}: {error.reason}', remedy)
    return error


def _counted_key(content: Section, key: str) -> str:
    """Return a key as errors have it, which count the linkages: ``linkages[1].drive``."""
    first, _, rest = key.partition('.')
    names = _linkage_names(content.mapping.get(first)) if first == 'linkages' else []
    name, dot, last = rest.partition('.')
    return f'{first}[{names.index(name) + 1}]{dot}{last}' if name in names else key


def _is_within(key: str, other_key: str) -> bool:
    """Return whether one key lies within the other, or is the same."""
    short, long = sorted((key, other_key), key=len)
    return bool(key) and f'{long}.'.startswith(f'{short}.')


def _setting_error(setting: str, reason: str, remedy: str) -> FileError:
    return FileError(f'--set {setting}', '', reason, remedy)
