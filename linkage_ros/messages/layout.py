# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Compiler for CDR version 1: each message is declared once, for reading and writing.

Numbers are aligned to multiples of their size, counted after the four bytes of the encapsulation;
a sequence or a string is a count followed by its content. `pack_message` and `parse_message`
process a message field by field. For many messages of the same layout, one is compiled:
`compile_pattern` then reads the numbers of the next ones in one call of `struct`, and
`compile_packing` writes them in one call.

Source: OMG, DDS-XTypes 1.3, section 7.4.1.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from itertools import combinations, zip_longest
from operator import itemgetter
from struct import calcsize, error as StructError, pack, Struct, unpack
from typing import Any, NamedTuple

from linkage_ros.generated_code import define_function, Lines

NANOSECONDS = 1_000_000_000
"""A second, in [ns]."""

ENCAPSULATION = b'\x00\x01\x00\x00'
"""First bytes of a message written here: little-endian, no options."""

STAMP_END = 12
"""End of the stamp at the start of a message: two numbers of four bytes."""

_TEXT = 's'
_COUNT = 'I'
_COUNTS = {b'\x00\x00': Struct('>I'), b'\x00\x01': Struct('<I')}
"""Reader of a count, by encapsulation."""

_KINDS = {
    'bool': 'B',
    'uint8': 'B',
    'int32': 'i',
    'float64': 'd',
    'Time': 'iI',
    'Duration': 'iI',
    'Point': '3d',
    'Vector3': '3d',
    'Pose': '7d',
    'Transform': '7d',
    'Twist': '6d',
    'Wrench': '6d',
    'ColorRGBA': '4f',
    'UVCoordinate': '2f',
    'string': _TEXT,
}
"""Content of a type: numbers of one size, by their `struct` format, or a string."""


class Field(NamedTuple):
    """A field of a message: its name, its type, and whether it is a sequence of this type."""

    name: str
    kind: str | tuple[Field, ...]
    many: bool


def parse_declaration(text: str, **nested: tuple[Field, ...]) -> tuple[Field, ...]:
    """
    Parse a declaration of fields: types and names as in a ``.msg`` file, separated by commas.

    ``nested`` are the declarations of nested message types.
    """
    fields = []
    for field in text.split(','):
        kind, name = field.split()
        element = kind.removesuffix('[]')
        fields.append(Field(name, nested.get(element) or _KINDS[element], kind != element))
    return tuple(fields)


class MalformedError(ValueError):
    """Bytes that are not a message of the declared type."""


class NumberArray(NamedTuple):
    """Place of a sequence: its count, and its first number; a single number has no count."""

    count_at: int
    length: int
    first: int


def byte_order(data: bytes) -> str:
    """Return the byte order of a message for `struct`; raise MalformedError if it has none."""
    if data[:2] not in _COUNTS:
        raise MalformedError('unknown encapsulation')
    return _COUNTS[data[:2]].format[0]


def parse_message(data: bytes, fields: Iterable[Field], most: int = 2**32) -> dict[str, Any]:
    """
    Return the declared fields of a message by name; bytes after its end are ignored.

    A string is returned as bytes, numbers as their places: `NumberArray`. A MalformedError says
    that it is not of this type, incomplete, or has more than ``most`` elements in a sequence of
    strings or nests.
    """
    byte_order(data)
    try:
        values, end = _parse_fields(data, 4, fields, _COUNTS[data[:2]], most)
    except StructError:
        raise MalformedError('ends too early') from None
    if end > len(data):
        raise MalformedError('ends too early')
    return values


def _parse_fields(
    data: bytes, at: int, fields: Iterable[Field], number: Struct, most: int
) -> tuple[dict[str, Any], int]:
    """Return the fields from a position on, and the position of their end."""
    values: dict[str, Any] = {}
    for name, kind, many in fields:
        count, count_at = 1, at
        if many:
            count_at = at + -at % 4
            (count,) = number.unpack_from(data, count_at)
            at = count_at + 4
        if isinstance(kind, str) and kind != _TEXT:
            size, total = _type_sizes(kind)
            first = at + (4 - at) % size if count else at
            at = first + total * count
            values[name] = NumberArray(count_at if many else first, count, first)
            continue
        if count > most:
            raise MalformedError(f'more than {most:,} elements')
        elements: list[Any] = []
        # Each element takes bytes, so the message limits the loop whatever the count says.
        for _ in range(count):
            if isinstance(kind, str):
                at += -at % 4
                (length,) = number.unpack_from(data, at)
                start, at = at + 4, at + 4 + length
                end = at - 1
                elements.append(data[start:end])
            else:
                element, at = _parse_fields(data, at, kind, number, most)
                elements.append(element)
        values[name] = elements if many else elements[0]
    return values, at


@cache
def _type_sizes(kind: str) -> tuple[int, int]:
    """Return the size of each number of a type, and of all of them."""
    return calcsize(f'<{kind[-1]}'), calcsize(f'<{kind}')


def pack_message(fields: Iterable[Field], values: Mapping[str, Any]) -> bytes:
    """
    Serialize a message, little-endian.

    A value is a string, a number or a tuple of numbers, the values of a nested message, or a
    sequence of these. A field without a value is zero, or empty.
    """
    data = bytearray(ENCAPSULATION)
    _pack_fields(data, fields, values)
    return bytes(data)


def _pack_fields(data: bytearray, fields: Iterable[Field], values: Mapping[str, Any]) -> None:
    def add_numbers(kind: str, *numbers: float) -> None:
        size, _ = _type_sizes(kind)
        data.extend(bytes((4 - len(data)) % size))
        data.extend(pack(f'<{kind}', *numbers))

    for name, kind, many in fields:
        value = values.get(name)
        if many:
            add_numbers(_COUNT, len(value or ()))
        for element in (value or ()) if many else (value,):
            if not isinstance(kind, str):
                _pack_fields(data, kind, element or {})
            elif kind == _TEXT:
                text = (element or '').encode() + b'\0'
                add_numbers(_COUNT, len(text))
                data.extend(text)
            elif element is None:
                add_numbers(kind, *unpack(f'<{kind}', bytes(_type_sizes(kind)[1])))
            else:
                add_numbers(kind, *(element if isinstance(element, tuple) else (element,)))


class Pattern(NamedTuple):
    """
    Layout of a message; all messages of one publisher usually share it.

    A message has the layout if it has at least `size` bytes, and `pick_fixed` returns `fixed` from
    the values of `unpack_from`: byte order, counts and strings. Values 1 and 2 are the stamp, in
    [s] and [ns]; each of `picks` returns a group of numbers from the values.
    """

    size: int
    unpack_from: Callable[[bytes], tuple[Any, ...]]
    pick_fixed: Callable[[tuple[Any, ...]], tuple[Any, ...]]
    fixed: tuple[Any, ...]
    picks: tuple[Callable[[tuple[Any, ...]], tuple[Any, ...]], ...]


def compile_pattern(
    data: bytes, arrays: Iterable[NumberArray], groups: Sequence[Sequence[int]], width: int = 1
) -> Pattern:
    """
    Compile the layout of a message whose first field is a header.

    ``arrays`` are its consecutive sequences of 8-byte numbers, with ``width`` numbers in an
    element; all data before and between them is part of the layout, except padding. ``groups`` are
    the places of the wanted numbers.
    """
    parts = [(0, 2, '2s'), (4, STAMP_END, 'iI')]
    end = STAMP_END
    for count_at, length, first in arrays:
        after = count_at + 4
        parts.append((end, after, f'{after - end}s'))
        end = first + 8 * width * length
    parts += [(first, first + 8, 'd') for group in groups for first in group]
    fields, at, number = byte_order(data), 0, 0
    fixed, places = [], {}
    for first, after, kind in sorted(parts):
        fields += f'{first - at}x{kind}'
        at = after
        if kind == 'd':
            places[first] = number
        elif kind != 'iI':
            fixed.append(number)
        number += len(kind) if kind == 'iI' else 1
    fields += f'{end - at}x'
    struct, pick_fixed = Struct(fields), _make_picker(fixed)
    return Pattern(
        size=struct.size,
        unpack_from=struct.unpack_from,
        pick_fixed=pick_fixed,
        fixed=pick_fixed(struct.unpack_from(data)),
        picks=tuple(_make_picker([places[first] for first in group]) for group in groups),
    )


def _make_picker(places: Sequence[int]) -> Callable[[tuple[Any, ...]], tuple[Any, ...]]:
    """Return a function that picks values of a tuple, as a tuple, in one C call."""
    if len(places) > 1:
        return itemgetter(*places)
    return itemgetter(slice(places[0], places[0] + 1) if places else slice(0))


def compile_packing(
    message: bytes, arrays: Iterable[tuple[int, str]]
) -> tuple[Callable[..., bytes], list[bytes]]:
    """
    Compile a writer of messages that differ from a given one in stamps and arrays of numbers only.

    The message begins with a stamp; ``arrays`` are the start and the format of each array. The
    writer takes bytes, the stamp in [s] and [ns], bytes, the first array, bytes, and so on; the
    bytes are the second result.
    """
    fields, constants, at = '<', [], 0
    for first, kind in ((4, 'iI'), *arrays):
        constants.append(message[at:first])
        fields += f'{first - at}s{kind}'
        at = first + calcsize(f'<{kind}')
    if at < len(message):
        constants.append(message[at:])
        fields += f'{len(message) - at}s'
    return Struct(fields).pack, constants


class ArrayWriter:
    """
    Writes messages with a stamp and arrays of numbers, for a fixed list of joints.

    ``names`` are the joints by the field that holds them, ``arrays`` the field of each array by
    its name as a parameter of `write`. ``within`` is the sequence, with one element, that contains
    the arrays; '' if none does.
    """

    __slots__ = ('_arrays', '_fields', '_names', '_within', 'write')

    write: Callable[..., bytes]

    def __init__(
        self,
        fields: tuple[Field, ...],
        names: Mapping[str, Sequence[str]],
        arrays: Mapping[str, str],
        within: str = '',
    ) -> None:
        self._fields, self._names, self._arrays, self._within = fields, names, arrays, within
        first, *others = arrays
        lines = [
            f'def write(stamp, {first}, {", ".join(f"{name}=()" for name in others)}):',
            f'    seconds, nanoseconds = divmod(stamp, {NANOSECONDS})',
        ]
        bound: dict[str, Any] = {}
        for size in range(len(others), -1, -1):
            for index, filled in enumerate(combinations(others, size)):
                numbers = {name: f'*{name}' for name in (first, *filled)}
                call = self.message_expression(numbers, f'pack{size}{index}_')
                condition = f'if {" and ".join(filled)}: ' if filled else ''
                lines.append(f'    {condition}return {call.lines[0]}')
                bound |= call.bound
        # Returns a message from its stamp in [ns] and, for each array, a number per joint. All
        # arrays but the first may be empty, which is their default.
        self.write = define_function('\n'.join(lines), 'write', bound)

    def message_expression(self, numbers: Mapping[str, str], name: str = 'pack') -> Lines:
        """
        Return an expression for a message from ``seconds``, ``nanoseconds`` and numbers.

        ``numbers`` are the expressions of the numbers, separated by commas, by the name of each
        array that is not empty. ``name`` is the prefix of the names that the expression binds.
        """
        (joints,) = self._names.values()
        values = dict.fromkeys((self._arrays[array] for array in numbers), (0.0,) * len(joints))
        within = {self._within: [values]} if self._within else values
        message = pack_message(self._fields, {**self._names, **within})
        places_by_name = parse_message(message, self._fields)
        places = places_by_name[self._within][0] if self._within else places_by_name
        pack, constants = compile_packing(
            message, [(places[field].first, f'{len(joints)}d') for field in values]
        )
        bound = {f'{name}{i}': constant for i, constant in enumerate(constants)}
        encapsulation, head, *behind = bound
        parts = [encapsulation, 'seconds', 'nanoseconds', head]
        for expression, constant in zip_longest(numbers.values(), behind):
            parts += [expression, *([constant] if constant else [])]
        return Lines([f'{name}({", ".join(parts)})'], {name: pack, **bound})
