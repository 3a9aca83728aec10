# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The border between PythonFMU3 and a scene: no exception crosses it, and calls keep FMI's order.

PythonFMU3's wrapper (0.3.4) answers an exception with the status `fatal`, frees the instance and
keeps its pointers, so that the importer's next call crashes it. The wrapper passes on a status of
ours from fmi3DoStep alone. So a call that is refused is logged with the status `error`, and from
then on every step has that status, until the instance is reset.
"""

from __future__ import annotations

from collections.abc import Callable
from ctypes import c_uint64
from enum import Enum
from functools import wraps
from math import nan
from typing import Any

from linkage_ros.errors import escape_unprintable, LinkageError
from pythonfmu3 import Fmi3Causality, Fmi3Slave, Fmi3Status

_UNKNOWN = {
    'Float64': nan,
    'Int32': 0,
    'Int64': 0,
    'UInt64': c_uint64(0),
    'Boolean': False,
    'String': '',
}
"""Kinds of values that the wrapper reads and sets, and what an unknown reference reads as."""

_REFUSED: dict[str, tuple[str, Any]] = {
    '_get_fmu_state': ('fmi3GetFMUState', {}),
    '_set_fmu_state': ('fmi3SetFMUState', None),
    'set_time': ('fmi3SetTime', None),
    'update_discrete_states': ('fmi3UpdateDiscreteStates', None),
    'get_continuous_states': ('fmi3GetContinuousStates', []),
    'set_continuous_states': ('fmi3SetContinuousStates', None),
    'get_continuous_state_derivatives': ('fmi3GetContinuousStateDerivatives', []),
    'get_nominals_of_continuous_states': ('fmi3GetNominalsOfContinuousStates', []),
    'get_event_indicators': ('fmi3GetEventIndicators', []),
}
"""Methods that the wrapper calls for what this FMU cannot do, and what it is given."""


class SlaveState(Enum):
    """A state of an instance, in which FMI 3 allows some of the calls."""

    INSTANTIATED = 'not initialized'
    INITIALIZING = 'in initialization mode'
    INITIALIZED = 'initialized'
    TERMINATED = 'terminated'
    FAILED = 'failed'


BEFORE_STEPS = (SlaveState.INSTANTIATED, SlaveState.INITIALIZING)


def guard_call(
    call: str, states: tuple[SlaveState, ...], otherwise: Callable[..., Any]
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """
    Make a method of `GuardedSlave` that PythonFMU3 calls, and which never raises.

    ``call`` is the name of the function of FMI, ``states`` are the states that allow it. After a
    failure PythonFMU3 gets the result of ``otherwise`` for the arguments of the call.
    """

    def decorate(method: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(method)
        def guard(self: GuardedSlave, *arguments: Any) -> Any:
            try:
                self.check_state(call, states)
                return method(self, *arguments)
            # Ctrl-C of an importer in Python is raised here, too.
            except BaseException as error:  # noqa: BLE001 (the wrapper cannot take any)
                self.set_failed(call, error)
                return otherwise(*arguments)

        return guard

    return decorate


class GuardedSlave(Fmi3Slave):
    """An instance whose variables are read and set by their references, in FMI's order."""

    def __init__(self, **arguments: Any) -> None:
        super().__init__(**arguments)
        self.state = SlaveState.INSTANTIATED

    def check_state(self, call: str, states: tuple[SlaveState, ...]) -> None:
        """Raise LinkageError if the state does not allow a call."""
        if self.state not in states:
            raise LinkageError(
                call,
                f'the instance is {self.state.value}, and must be '
                + ' or '.join(state.value for state in states),
                'reset it',
            )

    def set_failed(self, call: str, error: BaseException) -> None:
        """Let all further steps fail; log the first reason."""
        if self.state is not SlaveState.FAILED:
            text = str(error) if isinstance(error, LinkageError) else f'{call}: {error!r}'
            self.log(escape_unprintable(text), Fmi3Status.error)
        self.state = SlaveState.FAILED

    def terminate(self) -> None:
        """End the steps, in any state: importers call it when they give up."""
        self.state = SlaveState.TERMINATED

    def find_variable(self, call: str, reference: int) -> Any:
        """Return the variable of a value reference; raise LinkageError if there is none."""
        variable = self.vars.get(reference)
        if variable is None:
            raise LinkageError(
                call,
                f'there is no value reference {reference}',
                f'use 0 to {len(self.vars) - 1}, as in the model description',
            )
        return variable


def _make_reader(kind: str, unknown: Any) -> Callable[..., Any]:
    call, read = f'fmi3Get{kind}', getattr(Fmi3Slave, f'get_{kind.lower()}')

    @guard_call(call, tuple(SlaveState), lambda references: [unknown] * len(references))
    def get_values(self: GuardedSlave, references: list[int]) -> list[Any]:
        for reference in references:
            self.find_variable(call, reference)
        values: list[Any] = read(self, references)
        return values

    return get_values


def _make_writer(kind: str) -> Callable[..., Any]:
    call, write = f'fmi3Set{kind}', getattr(Fmi3Slave, f'set_{kind.lower()}')

    @guard_call(call, (*BEFORE_STEPS, SlaveState.INITIALIZED), lambda *_: None)
    def set_values(self: GuardedSlave, references: list[int], values: list[Any]) -> None:
        if len(values) != len(references):
            raise LinkageError(
                call,
                f'{len(values)} values for {len(references)} references',
                'every variable has one value',
            )
        for reference in references:
            variable = self.find_variable(call, reference)
            causality = variable.causality
            if causality is Fmi3Causality.parameter:
                self.check_state(f'{call} of {variable.name}', BEFORE_STEPS)
            elif causality is not Fmi3Causality.input:
                raise LinkageError(
                    call, f'{variable.name} is not an input', 'set inputs and parameters only'
                )
        write(self, references, values)

    return set_values


def _make_refusal(call: str, result: Any) -> Callable[..., Any]:
    @guard_call(call, tuple(SlaveState), lambda *_: result)
    def refuse_call(_self: GuardedSlave, *_: Any) -> None:
        raise LinkageError(
            call, 'is not supported', 'keep to the capabilities in the model description'
        )

    return refuse_call


for _kind, _value in _UNKNOWN.items():
    setattr(GuardedSlave, f'get_{_kind.lower()}', _make_reader(_kind, _value))
    setattr(GuardedSlave, f'set_{_kind.lower()}', _make_writer(_kind))
for _name, (_call, _result) in _REFUSED.items():
    setattr(GuardedSlave, _name, _make_refusal(_call, _result))
