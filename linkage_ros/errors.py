# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The errors that a user can meet: one root class, and one line of text each.

``str(error)`` is exactly what the user reads: where (file, key or topic), what is wrong with the
value, and the remedy. The line is printable and of bounded length.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from copyreg import __newobj__  # type: ignore[attr-defined]
from difflib import get_close_matches
from importlib.util import find_spec
from os import PathLike
import re
from typing import Any, TypeVar

K = TypeVar('K')
V = TypeVar('V')

_LONGEST_VALUE = 80
_LONGEST_LIST = 800
_LONGEST_PART = 2000

_PYTHON_PACKAGES = {'mcap': 'mcap', 'numpy': 'numpy', 'yaml': 'PyYAML'}
"""Packages that every installation needs beside ROS: import name and package name."""


_named: dict[str, str] = {}


def name_instead(temporary: str | PathLike[str], named: str | PathLike[str]) -> None:
    """
    Let errors name what the user named instead of a temporary file or folder made from it.

    The user cannot look into it: it is gone when the error is read.
    """
    _named[str(temporary)] = str(named)


def _as_named(text: str) -> str:
    for temporary, named in _named.items():
        text = text.replace(temporary, named)
    return text


class LinkageError(Exception):
    """
    Root of all errors that this package raises on purpose.

    Parameters
    ----------
    where
        The file, key, folder or topic that is at fault.
    reason
        The fault, with the value.
    remedy
        The action that would help.

    """

    def __init__(self, where: str | PathLike[str], reason: str, remedy: str) -> None:
        self.where, self.reason, self.remedy = (
            shorten(escape_unprintable(' '.join(_as_named(text).split())), _LONGEST_PART)
            for text in (str(where), reason, remedy)
        )
        super().__init__(f'{self.where}: {self.reason}; {self.remedy}')

    def __reduce__(self) -> tuple[Any, ...]:
        # By default an exception is unpickled from its text alone, which does not fit these
        # constructors: an error raised in a worker process would not reach its parent.
        return __newobj__, (type(self), *self.args), vars(self)


class DefinitionError(LinkageError):
    """A linkage or scene that cannot be built; ``where`` is the dotted key within its file."""


class SynthesisError(LinkageError):
    """A linkage that does not exist; ``where`` is the task in words."""


class FileError(LinkageError):
    """
    A file that cannot be used as it stands.

    Parameters
    ----------
    file
        The file as the user named it.
    key
        Dotted key of the offending value, '' for the file as a whole.
    reason, remedy
        See `LinkageError`.
    line
        Line of the key in the file, counted from 1; 0 if there is none.

    """

    def __init__(
        self, file: str | PathLike[str], key: str, reason: str, remedy: str, line: int = 0
    ) -> None:
        self.file = str(file)
        self.key = key
        self.line = line
        self.others: Sequence[FileError] = ()
        place = f'{self.file}:{line}' if line else self.file
        super().__init__(f'{place}: {key}' if key else place, reason, remedy)

    @property
    def in_file(self) -> list[FileError]:
        """Return this error and all ``others`` that were found in the file, by line."""
        return sorted((self, *self.others), key=lambda error: error.line)


def read_each(readers: Mapping[K, Callable[[], V]]) -> dict[K, V]:
    """
    Return what each reader returns, all of which are called.

    Where they raise FileErrors, these are raised at the end, as by `raise_each`.
    """
    values: dict[K, V] = {}
    found: list[FileError] = []
    for key, read in readers.items():
        try:
            values[key] = read()
        except FileError as error:  # noqa: PERF203 (few files are wrong)
            found += (error, *error.others)
    raise_each(found)
    return values


def raise_each(errors: Iterable[FileError]) -> None:
    """Raise the first of some errors, with the others; none if there is none."""
    for first in (found := iter(errors)):
        first.others = tuple(found)
        raise first


class RecordingError(LinkageError):
    """A recording that could not be started or could not go on; ``where`` is the bag's folder."""


class BagError(LinkageError):
    """A bag that cannot be read; ``where`` is its folder or file."""


@contextmanager
def missing_packages_reported() -> Iterator[None]:
    """
    Raise an error of one line if a required package is not installed.

    Packages that only one kind of work needs are imported where that work begins, with their own
    remedies. So a missing package here is ROS, or a Python package that all installations need.

    A LinkageError is raised if an import within the context finds no such package.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        name = (error.name or '').partition('.')[0]
        if name in {'', 'linkage_ros'}:
            raise
        if package := _PYTHON_PACKAGES.get(name):
            remedy = (
                f'python3 -m pip install {package} '
                "(into the system's Python with --user --break-system-packages)"
            )
        else:
            remedy = "source the setup.bash of ROS 2, or pip install 'linkage_ros[ros]'"
        raise LinkageError(name, 'is not installed', remedy) from None


def check_installed(package: str, remedy: str = "pip install 'linkage_ros[report]'") -> None:
    """Raise LinkageError if a Python package is not installed that only some users need."""
    if find_spec(package) is None:
        raise LinkageError(package, 'is not installed', remedy)


def did_you_mean(name: str, names: Iterable[str], otherwise: str) -> str:
    """Return the remedy for an unknown name: the nearest known name, or ``otherwise``."""
    near = get_close_matches(name, list(names), n=1)
    return f'did you mean {near[0]!r}?' if near else otherwise


def decimal_comma(typed: str) -> str:
    """Return what to say where a number may have been typed with a decimal comma; or ''."""
    maybe = re.fullmatch(r'[-+]?\d+,\d+', typed)
    return '; a decimal has a point, not a comma' if maybe else ''


def quote(value: Any) -> str:
    """
    Return a value as an error message shows it: on one line of bounded length.

    A text that is too long loses its middle: a path ends with the name that matters.
    """
    return shorten(repr(value), _LONGEST_VALUE)


def list_names(names: Iterable[str], between: str = ', ') -> str:
    """Return names as an error message lists them, with a bounded length."""
    names, shown, letters = list(names), [], 0
    for name in names:
        shown.append(shorten(escape_unprintable(name), _LONGEST_VALUE))
        letters += len(shown[-1]) + len(between)
        if letters > _LONGEST_LIST:
            break
    more = len(names) - len(shown)
    return between.join(shown) + (f' and {more} more' if more else '')


def shorten(text: str, most: int) -> str:
    """Return a text of at most ``most`` characters; a longer one loses its middle."""
    half = (most - 1) // 2
    return text if len(text) <= most else f'{text[:half]}…{text[-half:]}'


def escape_unprintable(text: str) -> str:
    r"""
    Escape characters that a terminal would obey: names can come from anywhere.

    Characters that are not printable, among them line breaks and those that change the direction
    of writing, are written as Python escapes: ``\x1b``, ``\u202e``.
    """
    if text.isprintable():
        return text
    return ''.join(
        letter if letter.isprintable() else letter.encode('unicode_escape').decode()
        for letter in text
    )
