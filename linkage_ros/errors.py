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
Every error that a user can meet: one root, and one line of text each.

``str(error)`` is exactly what the user reads: where (file, key or topic), what is wrong with the
value, and the remedy. It is printable, on one line, and not without end, whatever it is about.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from copyreg import __newobj__  # type: ignore[attr-defined]
from difflib import get_close_matches
from os import PathLike
from typing import Any

_LONGEST_VALUE = 80
_LONGEST_LIST = 800
_LONGEST_PART = 2000

_PYTHON_PACKAGES = {'mcap': 'mcap', 'numpy': 'numpy', 'yaml': 'PyYAML'}
"""What every installation needs beside ROS: name of the import, and of the package."""


class LinkageError(Exception):
    """
    The root of all errors that this package raises on purpose.

    Parameters
    ----------
    where
        The file, key, folder or topic that is at fault.
    reason
        What is wrong, with the value.
    remedy
        What would help.

    """

    def __init__(self, where: str | PathLike[str], reason: str, remedy: str) -> None:
        self.where, self.reason, self.remedy = (
            shortened(clean(' '.join(text.split())), _LONGEST_PART)
            for text in (str(where), reason, remedy)
        )
        super().__init__(f'{self.where}: {self.reason}; {self.remedy}')

    def __reduce__(self) -> tuple[Any, ...]:
        # An exception is else made anew from its text alone, which none of these is: what a
        # process of workers raises would not come back.
        return __newobj__, (type(self), *self.args), vars(self)


class DefinitionError(LinkageError):
    """A linkage or scene that cannot be built; ``where`` is the dotted key within its file."""


class SynthesisError(LinkageError):
    """A linkage that was asked for and does not exist; ``where`` is what was asked, in words."""


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
        As in `LinkageError`.
    line
        Line of the key in the file, counted from 1; 0 where there is none.

    """

    def __init__(
        self, file: str | PathLike[str], key: str, reason: str, remedy: str, line: int = 0
    ) -> None:
        self.file = str(file)
        self.key = key
        self.line = line
        place = f'{self.file}:{line}' if line else self.file
        super().__init__(f'{place}: {key}' if key else place, reason, remedy)


class RecordingError(LinkageError):
    """A recording that could not be started or could not go on; ``where`` is the bag's folder."""


class BagError(LinkageError):
    """A bag that cannot be read; ``where`` is its folder or file."""


@contextmanager
def missing_packages_reported() -> Iterator[None]:
    """
    Raise an error of one line where a package that cannot be done without is not installed.

    Packages of one kind of work alone are looked for where that work begins, with their own
    remedies: so what is missing here is one of Python's that all installations need, or ROS.

    Raises
    ------
    LinkageError
        Where an import within finds no such package.

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


def did_you_mean(name: str, names: Iterable[str], otherwise: str) -> str:
    """Return the remedy for a name that is none of these: the nearest, or what else there is."""
    near = get_close_matches(name, list(names), n=1)
    return f'did you mean {near[0]!r}?' if near else otherwise


def quoted(value: Any) -> str:
    """
    Return a value as an error message shows it: on one line, and not without end.

    What is too long loses its middle: a path ends with the name that matters.
    """
    return shortened(repr(value), _LONGEST_VALUE)


def listed(names: Iterable[str], between: str = ', ') -> str:
    """Return names as an error message lists them: not without end, whoever has made them."""
    names, shown, letters = list(names), [], 0
    for name in names:
        shown.append(shortened(clean(name), _LONGEST_VALUE))
        letters += len(shown[-1]) + len(between)
        if letters > _LONGEST_LIST:
            break
    more = len(names) - len(shown)
    return between.join(shown) + (f' and {more} more' if more else '')


def shortened(text: str, most: int) -> str:
    """Return a text of no more than so many letters, without its middle where it is longer."""
    half = (most - 1) // 2
    return text if len(text) <= most else f'{text[:half]}…{text[-half:]}'


def clean(text: str) -> str:
    r"""
    Return a text without what a terminal would obey: names come from anywhere.

    Whatever is not printable, line breaks and letters that turn the direction of writing among it,
    is written as Python writes it in a text: ``\x1b``, ``\u202e``.
    """
    if text.isprintable():
        return text
    return ''.join(
        letter if letter.isprintable() else letter.encode('unicode_escape').decode()
        for letter in text
    )
