# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
An importer in a process of its own, which a crash would end: calls in, statuses and log lines out.

It reads a JSON list of calls a line, makes them on a new instance, and prints a list with the
status of each and the lines that it logged.
"""

import json
import sys

from fmpy import read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import FMU3Slave


def call_all(fmu: str, folder: str, calls: list[list]) -> list:
    """Make calls on a new instance; return a status and log lines for each."""
    description = read_model_description(fmu)
    logged = []
    instance = FMU3Slave(
        instanceName='called',
        guid=description.guid,
        unzipDirectory=folder,
        modelIdentifier=description.coSimulation.modelIdentifier,
    )
    instance.instantiate(
        logMessage=lambda _environment, status, _category, text: logged.append(
            (status, text.decode())
        )
    )
    answers = []
    for name, *arguments in calls:
        logged.clear()
        status = 0
        try:
            getattr(instance, name)(*arguments)
        except FMICallException as error:
            status = error.status
        answers.append((status, list(logged)))
    instance.freeInstance()
    return answers


if __name__ == '__main__':
    for line in sys.stdin:
        print(json.dumps(call_all(*sys.argv[1:], json.loads(line))), flush=True)
