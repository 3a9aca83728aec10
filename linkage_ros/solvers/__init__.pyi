# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

from linkage_ros.solvers.choose import (
    choose_solver as choose_solver,
    only_closed_form as only_closed_form,
)
from linkage_ros.solvers.loops import LoopFinder as LoopFinder
from linkage_ros.solvers.newton import NewtonClosure as NewtonClosure, NewtonDyad as NewtonDyad
from linkage_ros.solvers.registry import SOLVERS as SOLVERS
from linkage_ros.solvers.solver import Solver as Solver, SolverChoice as SolverChoice
from linkage_ros.solvers.table import TableClosure as TableClosure
from linkage_ros.solvers.validated_enclosure import (
    Cells as Cells,
    Disc as Disc,
    enclose_coordinates as enclose_coordinates,
    jet_product as jet_product,
    multiply_discs as multiply_discs,
    sum_discs as sum_discs,
    unit_vector as unit_vector,
)
