# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""An importer of FMUs: FMPy, whose code shares nothing with PythonFMU3 or with ours."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fmpy import extract, read_model_description
from fmpy.fmi3 import FMU3Slave

_KINDS = ('Float64', 'Int64', 'Boolean', 'Enumeration')


class Bench:
    """One instance of an FMU, extracted to a folder; ``logged`` takes status and text."""

    def __init__(self, fmu: Path, folder: Path, logged: list[tuple[int, str]]) -> None:
        description = read_model_description(fmu)
        self.variables = {variable.name: variable for variable in description.modelVariables}
        self.logged = logged
        self._instance = FMU3Slave(
            instanceName=str(folder),
            guid=description.guid,
            unzipDirectory=extract(fmu, folder),
            modelIdentifier=description.coSimulation.modelIdentifier,
        )
        self._instance.instantiate(logMessage=self._log)

    def _log(self, _environment: Any, status: int, _category: bytes, message: bytes) -> None:
        self.logged.append((status, message.decode()))

    def start(
        self, inputs: Mapping[str, float] | None = None, seed: int | None = None, at: float = 0.0
    ) -> dict[str, Any]:
        """Initialize the instance at a time, in [s]; return its outputs."""
        self._instance.enterInitializationMode(startTime=at)
        if seed is not None:
            self._instance.setInt64([self.variables['seed'].valueReference], [seed])
        self._set(inputs)
        self._instance.exitInitializationMode()
        return self.outputs()

    def step(
        self, time: float, seconds: float, inputs: Mapping[str, float] | None = None
    ) -> dict[str, Any]:
        """Step from a time on; return the outputs at its end."""
        self._set(inputs)
        *_, reached = self._instance.doStep(time, seconds)
        assert reached == time + seconds
        return self.outputs()

    def _set(self, inputs: Mapping[str, float] | None) -> None:
        for name, value in (inputs or {}).items():
            self._instance.setFloat64([self.variables[name].valueReference], [value])

    def outputs(self) -> dict[str, Any]:
        """Return all outputs, by name."""
        values = {}
        for kind in _KINDS:
            of = [v for v in self.variables.values() if v.type == kind and v.causality == 'output']
            read = getattr(self._instance, f'get{kind.replace("Enumeration", "Int64")}')
            numbers = read([v.valueReference for v in of]) if of else []
            values |= {v.name: number for v, number in zip(of, numbers, strict=True)}
        return values

    def reset(self) -> None:
        """Reset the instance."""
        self._instance.reset()

    def close(self) -> None:
        """End the simulation, and free the instance."""
        self._instance.terminate()
        self._instance.freeInstance()
