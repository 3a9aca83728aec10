# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

# Read first: motion_at, Tape, Operation, Tree, Path, Compiled, compile_program, Program.

from linkage_ros.kinematics.compiling.linkage import (
    Compiled as Compiled,
    CompiledAnswer as CompiledAnswer,
)
from linkage_ros.kinematics.compiling.numpy_blocks import (
    ArrayForm as ArrayForm,
    BlockFunction as BlockFunction,
)
from linkage_ros.kinematics.compiling.python import (
    compile_line as compile_line,
    python_body as python_body,
    python_source as python_source,
)
from linkage_ros.kinematics.compiling.real_program import (
    compile_program as compile_program,
    Program as Program,
)
from linkage_ros.kinematics.compiling.solve import BLOCK as BLOCK, SolverOutline as SolverOutline
from linkage_ros.kinematics.compiling.tape import (
    Kind as Kind,
    Operation as Operation,
    Tape as Tape,
)
from linkage_ros.kinematics.compiling.trace import (
    DecisionBranch as DecisionBranch,
    motion_at as motion_at,
    number_of as number_of,
    OutputSelection as OutputSelection,
    Path as Path,
    SolvedLeaf as SolvedLeaf,
    TracedMotion as TracedMotion,
    Tree as Tree,
)
from linkage_ros.kinematics.compiling.writer import (
    count_uses as count_uses,
    TextWriter as TextWriter,
    WrittenText as WrittenText,
)
