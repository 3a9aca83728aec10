# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

# Read first: Design, DesignRequest, FourBar, FunctionTask, PathTask, Pose, three_pairs,
# fixed_pivots, generate_path, Assessment, assess, prove, draw_design.

from linkage_ros.tools.design.dead_centres import (
    crank_rockers as crank_rockers,
    DeadCentreTask as DeadCentreTask,
)
from linkage_ros.tools.design.defects import (
    assess as assess,
    Assessment as Assessment,
    Needs as Needs,
    needs_penalties as needs_penalties,
    needs_penalty as needs_penalty,
    unmet_needs as unmet_needs,
)
from linkage_ros.tools.design.design import (
    Assembly as Assembly,
    Design as Design,
    DesignRequest as DesignRequest,
    FourBar as FourBar,
)
from linkage_ros.tools.design.double_double import sine_cosine as sine_cosine
from linkage_ros.tools.design.function.expression import (
    Expression as Expression,
    FUNCTIONS as FUNCTIONS,
)
from linkage_ros.tools.design.function.task import (
    angle_pairs as angle_pairs,
    chebyshev_points as chebyshev_points,
    check_defined as check_defined,
    FunctionTask as FunctionTask,
    on_scale as on_scale,
    structural_error as structural_error,
    wanted_rocker as wanted_rocker,
)
from linkage_ros.tools.design.motion import (
    fixed_pivots as fixed_pivots,
    from_fixed_pivots as from_fixed_pivots,
    from_moving_pivots as from_moving_pivots,
    moving_pivots as moving_pivots,
    Pose as Pose,
)
from linkage_ros.tools.design.pairs.angle_fit import (
    fit_angles as fit_angles,
    nearest_four_bar as nearest_four_bar,
    rocker_errors as rocker_errors,
    root_mean_square as root_mean_square,
)
from linkage_ros.tools.design.pairs.free_zeros import (
    five_pairs as five_pairs,
    four_pairs as four_pairs,
    FreeZeros as FreeZeros,
)
from linkage_ros.tools.design.pairs.freudenstein import (
    exact_four_bar as exact_four_bar,
    fit_equation as fit_equation,
    solve_links as solve_links,
    three_pairs as three_pairs,
)
from linkage_ros.tools.design.pairs.zero_search import (
    search_zeros as search_zeros,
    ZeroProblem as ZeroProblem,
)
from linkage_ros.tools.design.path.curves import (
    Aim as Aim,
    COLUMNS as COLUMNS,
    curve_distances as curve_distances,
    PathTask as PathTask,
    point_slopes as point_slopes,
    resample as resample,
    stay_closed as stay_closed,
    theta_at as theta_at,
    transmission_cotangents as transmission_cotangents,
)
from linkage_ros.tools.design.path.generate import (
    are_allowed as are_allowed,
    generate_path as generate_path,
    improve as improve,
    PathResult as PathResult,
)
from linkage_ros.tools.design.path.search import problem_of as problem_of
from linkage_ros.tools.design.picture import draw_design as draw_design
from linkage_ros.tools.design.proof import (
    assemble as assemble,
    closure_of as closure_of,
    prove as prove,
    prove_both_sides as prove_both_sides,
)
from linkage_ros.tools.design.study import (
    CHUNK as CHUNK,
    DesignFound as DesignFound,
    scipy_optimize as scipy_optimize,
    search as search,
)
