# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

from linkage_ros.tools.models.source_code.array_module import write_arrays as write_arrays
from linkage_ros.tools.models.source_code.c import C as C
from linkage_ros.tools.models.source_code.javascript import JavaScript as JavaScript
from linkage_ros.tools.models.source_code.languages import (
    C_NAME as C_NAME,
    c_name as c_name,
    LANGUAGES as LANGUAGES,
)
from linkage_ros.tools.models.source_code.python_module import PythonModule as PythonModule
from linkage_ros.tools.models.source_code.source import (
    FUNCTIONS as FUNCTIONS,
    STATUSES as STATUSES,
    Subject as Subject,
    write_source as write_source,
)
