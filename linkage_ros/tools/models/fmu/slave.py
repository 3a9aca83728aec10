# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The scene within an FMU: what PythonFMU3 calls, on the importer's machine."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
import json
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element

from linkage_ros import __version__
from linkage_ros.description import parse_scene, read_regular
from linkage_ros.errors import LinkageError
from linkage_ros.tools.models.fmu.border import guard_call, GuardedSlave, SlaveState
from linkage_ros.tools.models.fmu.stepped_scene import (
    LARGEST_SEED,
    LinkageOutputs,
    NO_CRANK,
    STATUS_NUMBERS,
    SteppedScene,
    Variable,
)
from pythonfmu3 import (
    Boolean,
    Enumeration,
    EnumerationType,
    Float64,
    Fmi3Causality,
    Fmi3Status,
    Fmi3StepResult,
    Fmi3Variability,
    Int64,
    Unit,
)

CONTENT_FILE = 'fmu.json'
"""File in an FMU with the fields of `Content`."""

_LARGEST_FILE = 100_000_000

_EXPONENTS: dict[str, dict[str, int]] = {
    's': {'s': 1},
    'rad': {'rad': 1},
    'rad/s': {'rad': 1, 's': -1},
    'rad/s2': {'rad': 1, 's': -2},
    'm': {'m': 1},
    'm/s': {'m': 1, 's': -1},
    'm/s2': {'m': 1, 's': -2},
    'N': {'kg': 1, 'm': 1, 's': -2},
    'N.m': {'kg': 1, 'm': 2, 's': -2},
    'A': {'A': 1},
    'V': {'kg': 1, 'm': 2, 's': -3, 'A': -1},
}
"""The units, as products of base units."""

_STATUS_TEXTS = {
    'closed': 'every loop closes; position and rates are valid',
    'change point': 'all links of a loop are collinear; position and rates are valid',
    'limited': 'every loop closes, but a joint is beyond its limits',
    'toggle': 'a dyad is stretched or folded: the position is valid, its rate is not',
    'open': 'links do not reach each other: there is no position',
    'indeterminate': 'two pins coincide: the position is undefined',
}

_loaded: set[str] = set()
"""Folders of FMUs that could be instantiated."""


class Content(NamedTuple):
    """
    What an FMU holds with the files of the scene, which it names in their order.

    The ``version`` of linkage_ros made it; the identifier is the name, as one of C; the token
    identifies the content.
    """

    version: str
    name: str
    identifier: str
    seed: int
    files: tuple[str, ...]
    token: str


class _Enumeration(Enumeration):
    """An enumeration of PythonFMU3, which asks every integer for its dimensions, with none."""

    dimensions = ()


class SceneSlave(GuardedSlave):
    """
    An instance of the FMU.

    A LinkageError is raised if another version of linkage_ros made the FMU, or its files are
    damaged.
    """

    def __init__(self, **arguments: Any) -> None:
        super().__init__(**arguments)
        folder = arguments['resources']
        try:
            self._load_content(Path(folder))
        except Exception as error:
            if folder not in _loaded:
                raise
            self.set_failed('fmi3Reset', error)
        _loaded.add(folder)

    def _load_content(self, folder: Path) -> None:
        """Read the scene, and declare its variables."""
        content = Content(**json.loads(read_regular(folder / CONTENT_FILE, _LARGEST_FILE)))
        if content.version != __version__:
            raise LinkageError(
                f'{content.name}.fmu',
                f'is of linkage_ros {content.version}, and this Python has {__version__}',
                'install that version, or make the FMU again',
            )
        self.modelName = content.identifier
        self.guid = content.token
        self.version = content.version
        self.description = f'The linkage_ros scene {content.name}'
        self._seed = content.seed
        files = {name: read_regular(folder / name, _LARGEST_FILE) for name in content.files}
        self._scene = SteppedScene(
            parse_scene(content.name, f'{content.name}.fmu', files, seed=content.seed)
        )
        self._inputs = [0.0] * len(self._scene.inputs)
        self._begin: float | None = None
        self._logged: set[str] = set()
        self.time = 0.0
        self._declare_variables()

    def _declare_variables(self) -> None:
        """Declare the variables."""
        self._add_variable(
            Float64(
                'time',
                causality=Fmi3Causality.independent,
                variability=Fmi3Variability.continuous,
                unit='s',
                description='simulated time',
                getter=lambda: self.time,
            )
        )
        self._add_variable(
            Int64(
                'seed',
                causality=Fmi3Causality.parameter,
                variability=Fmi3Variability.fixed,
                description='seed of all random numbers; without effect if the scene has none',
                getter=lambda: self._seed,
                setter=partial(setattr, self, '_seed'),
            )
        )
        self._declare_numbers(
            self._scene.inputs, self._inputs, Fmi3Causality.input, Fmi3Variability.continuous
        )
        for outputs in self._scene.outputs:
            self._declare_outputs(outputs)
        for motor in self._scene.motors:
            self._declare_numbers(motor.variables, motor.values)
        if self._scene.inputs:
            self._add_variable(
                Int64(
                    'rejected',
                    causality=Fmi3Causality.output,
                    variability=Fmi3Variability.discrete,
                    description='number of input samples that a drive has rejected',
                    getter=lambda: sum(self._scene.rejections.values()),
                )
            )

    def _declare_outputs(self, outputs: LinkageOutputs) -> None:
        for field, variables in outputs.variables.items():
            self._declare_numbers(variables, outputs.values[field])
        for field in outputs.variables:
            of_reading = field == 'position'
            self._add_variable(
                Boolean(
                    f'{outputs.prefix}valid' if of_reading else f'{outputs.prefix}{field}_valid',
                    causality=Fmi3Causality.output,
                    variability=Fmi3Variability.discrete,
                    description='whether the last tick published a reading'
                    if of_reading
                    else f'whether that reading has a {field}; without, the last one stays',
                    getter=partial(outputs.valid.__getitem__, field),
                )
            )
        self._add_variable(
            _Enumeration(
                f'{outputs.prefix}status',
                causality=Fmi3Causality.output,
                variability=Fmi3Variability.discrete,
                declared_type='Status',
                description='status of the linkage at the last tick',
                getter=lambda: outputs.status,
            )
        )
        self.type_definitions['Status'] = _status_type()

    def _declare_numbers(
        self,
        variables: Sequence[Variable],
        values: list[float],
        causality: Fmi3Causality = Fmi3Causality.output,
        variability: Fmi3Variability = Fmi3Variability.discrete,
    ) -> None:
        settable = causality is Fmi3Causality.input
        for index, (name, unit, text) in enumerate(variables):
            self._add_variable(
                Float64(
                    name,
                    causality=causality,
                    variability=variability,
                    unit=unit,
                    description=text,
                    getter=partial(values.__getitem__, index),
                    setter=partial(values.__setitem__, index) if settable else None,
                )
            )

    def _add_variable(self, variable: Any) -> None:
        # nested: a dot in a name would be taken for an attribute of an attribute.
        self.register_variable(variable, nested=False)
        if unit := getattr(variable, 'unit', None):
            self.register_units([Unit(unit, **_EXPONENTS[unit])])

    def to_xml(self, model_options: dict[str, str] | None = None) -> Element:
        """Return the model description; PythonFMU3 cannot write all parts."""
        root: Element = super().to_xml(model_options or {})
        # A joint is named as in ROS, which structured names would forbid.
        root.set('variableNamingConvention', 'flat')
        root.set('generationTool', f'linkage_ros {__version__}, {root.get("generationTool")}')
        # The same scene gives the same file.
        root.attrib.pop('generationDateAndTime')
        seed = root.find("ModelVariables/Int64[@name='seed']")
        if seed is not None:
            seed.attrib |= {'min': '0', 'max': str(LARGEST_SEED)}
        simulation = root.find('CoSimulation')
        if simulation is not None:
            simulation.set('fixedInternalStepSize', repr(self._scene.period))
            simulation.set('canHandleVariableCommunicationStepSize', 'true')
        return root

    @guard_call('fmi3EnterInitializationMode', (SlaveState.INSTANTIATED,), lambda: None)
    def enter_initialization_mode(self) -> None:
        """Await values for the first tick."""
        self.state = SlaveState.INITIALIZING

    @guard_call('fmi3ExitInitializationMode', (SlaveState.INITIALIZING,), lambda: None)
    def exit_initialization_mode(self) -> None:
        """Do the first tick, at the start time."""
        self._scene.start(self._seed, self._inputs)
        self.state = SlaveState.INITIALIZED
        self._log_rejections()

    @guard_call(
        'fmi3DoStep', (SlaveState.INITIALIZED,), lambda *_: Fmi3StepResult(Fmi3Status.error)
    )
    def do_step(self, current_time: float, step_size: float) -> Fmi3StepResult:
        """Do the ticks of a step; discard a step that is not a whole number of ticks."""
        # PythonFMU3 keeps the start time to itself: the first step begins there.
        begin = current_time if self._begin is None else self._begin
        try:
            ticks = self._scene.whole_ticks(current_time - begin, step_size)
        except LinkageError as error:
            self.log(str(error), Fmi3Status.discard)
            return Fmi3StepResult(Fmi3Status.discard)
        self._begin = begin
        self._scene.step(ticks, self._inputs)
        self.time = current_time + step_size
        self._log_rejections()
        return Fmi3StepResult(Fmi3Status.ok)

    def _log_rejections(self) -> None:
        """Log each reason for which samples are rejected, once."""
        # Not as the status of the step: of `warning` the wrapper makes that no time has passed.
        for rejection in self._scene.rejections:
            if rejection.name not in self._logged:
                self._logged.add(rejection.name)
                text = f'an input sample is rejected: {rejection.value}; further ones are counted'
                self.log(text, Fmi3Status.warning)


def _status_type() -> EnumerationType:
    made = EnumerationType('Status', [])
    made.add_value('no crank', NO_CRANK, 'no state of the crank is known')
    for status, number in STATUS_NUMBERS.items():
        made.add_value(status.value, number, _STATUS_TEXTS[status.value])
    return made
