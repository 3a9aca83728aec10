# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

# Read first: Closure, PlanarClosure, SpaceClosure, Linkage, SpaceLinkage, JointedLinkage,
# RevoluteJoint, SlideJoint, Slider, SpatialJoint, Status, Position, Velocity, Acceleration,
# InputRange, SingularityMargin, RRRDyad, Driven, Structure.

from linkage_ros.kinematics.analysis.carried_efforts import CarriedEfforts as CarriedEfforts
from linkage_ros.kinematics.analysis.crank_branches import (
    branches_over as branches_over,
    CrankBranch as CrankBranch,
)
from linkage_ros.kinematics.analysis.curves import (
    Curve as Curve,
    drawn_once as drawn_once,
    sweep_range as sweep_range,
    traced_carriers as traced_carriers,
    unwrap_angles as unwrap_angles,
)
from linkage_ros.kinematics.analysis.exchanged_inputs import turn_to_pose as turn_to_pose
from linkage_ros.kinematics.analysis.grashof import (
    CHANGE_POINTS as CHANGE_POINTS,
    four_bar_type as four_bar_type,
    four_bars as four_bars,
    FourBarType as FourBarType,
    GRASHOF as GRASHOF,
    TRIPLE_ROCKERS as TRIPLE_ROCKERS,
)
from linkage_ros.kinematics.analysis.pose_view import (
    all_places as all_places,
    LinkageView as LinkageView,
    pose_text as pose_text,
    prepare_view as prepare_view,
    SAME_ANGLE as SAME_ANGLE,
    symbol_size as symbol_size,
)
from linkage_ros.kinematics.analysis.ranges import (
    describe_ranges as describe_ranges,
    golden_section as golden_section,
    is_iterated as is_iterated,
    link_lengths as link_lengths,
    sample_inputs as sample_inputs,
)
from linkage_ros.kinematics.analysis.reached_values import (
    find_reached_values as find_reached_values,
    reach_boxes as reach_boxes,
    ReachBox as ReachBox,
)
from linkage_ros.kinematics.analysis.searched_inputs import search_inputs as search_inputs
from linkage_ros.kinematics.analysis.shapes import (
    bar_size as bar_size,
    bounding_corners as bounding_corners,
    carried_shapes as carried_shapes,
    Circle as Circle,
    COLOURS as COLOURS,
    convex_hull as convex_hull,
    draw_shapes as draw_shapes,
    draw_skeleton as draw_skeleton,
    driven_links as driven_links,
    FACES as FACES,
    frames_of_links as frames_of_links,
    INK as INK,
    LinkFrame as LinkFrame,
    Polygon as Polygon,
    round_corners as round_corners,
    Segment as Segment,
    Shape as Shape,
    shape_outline as shape_outline,
)
from linkage_ros.kinematics.analysis.space_shapes import (
    Part as Part,
    SpaceDrawing as SpaceDrawing,
)
from linkage_ros.kinematics.analysis.sweep_analysis import (
    check_closes as check_closes,
    check_limits as check_limits,
    check_turns as check_turns,
    conditioning_curves as conditioning_curves,
    find_extremes as find_extremes,
    follow_grid as follow_grid,
    grid_positions as grid_positions,
    InputSweep as InputSweep,
    pose_alone as pose_alone,
    starts_at_pose as starts_at_pose,
    SweptCurve as SweptCurve,
    transmission_angles as transmission_angles,
    usual_inputs as usual_inputs,
)
from linkage_ros.kinematics.analysis.worst_states import find_worst_states as find_worst_states
from linkage_ros.kinematics.arithmetic import (
    all_finite as all_finite,
    call as call,
    copysign as copysign,
    cross_product as cross_product,
    has_result as has_result,
    make_vector as make_vector,
    remainder as remainder,
    ROUNDING as ROUNDING,
    sin as sin,
    SMALLEST as SMALLEST,
    sqrt as sqrt,
    UNIT_ROUNDOFF as UNIT_ROUNDOFF,
    unit_vector as unit_vector,
    where as where,
    wrap_angle as wrap_angle,
)
from linkage_ros.kinematics.batch import (
    Array as Array,
    Batch as Batch,
    CODES as CODES,
    Complex as Complex,
    Mask as Mask,
)
from linkage_ros.kinematics.checks import check_weighed as check_weighed
from linkage_ros.kinematics.closure import Closure as Closure
from linkage_ros.kinematics.doubles import (
    SHRINK as SHRINK,
)
from linkage_ros.kinematics.iterated.elimination import Elimination as Elimination
from linkage_ros.kinematics.iterated.grid import Grid as Grid
from linkage_ros.kinematics.iterated.start_table import StartTable as StartTable
from linkage_ros.kinematics.limits import Bound as Bound
from linkage_ros.kinematics.plane.assembly_modes import (
    other_assemblies as other_assemblies,
    STARTS as STARTS,
)
from linkage_ros.kinematics.plane.closure import (
    PlanarClosure as PlanarClosure,
    separate_blocks as separate_blocks,
)
from linkage_ros.kinematics.plane.drawn_pose import read_drawn_pose as read_drawn_pose
from linkage_ros.kinematics.plane.dyads.rpr import (
    RPRDyad as RPRDyad,
    RPRPose as RPRPose,
    swivel_diagonal as swivel_diagonal,
)
from linkage_ros.kinematics.plane.dyads.rrr import (
    crank_diagonal as crank_diagonal,
    RRRDyad as RRRDyad,
    RRRPose as RRRPose,
)
from linkage_ros.kinematics.plane.linkage import (
    AssemblyPose as AssemblyPose,
    GROUND as GROUND,
    Input as Input,
    JointedLinkage as JointedLinkage,
    Limits as Limits,
    Linkage as Linkage,
    links_by_point as links_by_point,
    Mass as Mass,
    NO_LIMITS as NO_LIMITS,
    Point as Point,
    PoseCorrections as PoseCorrections,
    Ratio as Ratio,
    RevoluteJoint as RevoluteJoint,
    Side as Side,
    SlideJoint as SlideJoint,
    Slider as Slider,
    turn_ratios as turn_ratios,
)
from linkage_ros.kinematics.plane.sides import (
    assembly_sides as assembly_sides,
    closes_in_two_ways as closes_in_two_ways,
    closing_name as closing_name,
    sides_at as sides_at,
    without_drawn_pose as without_drawn_pose,
    written_sides as written_sides,
)
from linkage_ros.kinematics.plane.standing_joints import (
    find_standing_state as find_standing_state,
    turning_points as turning_points,
)
from linkage_ros.kinematics.plane.topology import (
    assur_groups as assur_groups,
    Driven as Driven,
    Dyad as Dyad,
    GearedLinks as GearedLinks,
    Group as Group,
    Iterated as Iterated,
    links_of as links_of,
    Structure as Structure,
)
from linkage_ros.kinematics.results import (
    Acceleration as Acceleration,
    InputRange as InputRange,
    Position as Position,
    SingularInput as SingularInput,
    SingularityMargin as SingularityMargin,
    Velocity as Velocity,
)
from linkage_ros.kinematics.space.carried_points import (
    CarriedPoints as CarriedPoints,
    unit_across as unit_across,
)
from linkage_ros.kinematics.space.closure import (
    SpaceClosure as SpaceClosure,
)
from linkage_ros.kinematics.space.deviating_parts import put_together as put_together
from linkage_ros.kinematics.space.freedom import (
    balls_of as balls_of,
    find_freedom as find_freedom,
    find_input_sets as find_input_sets,
    Freedom as Freedom,
)
from linkage_ros.kinematics.space.linkage import (
    extent_of as extent_of,
    ONE_PLACE as ONE_PLACE,
    SpaceLinkage as SpaceLinkage,
    SpatialJoint as SpatialJoint,
    unit_of as unit_of,
)
from linkage_ros.kinematics.space.masses import (
    check_inertia as check_inertia,
    combine_masses as combine_masses,
    SpatialMass as SpatialMass,
    tensor_rows as tensor_rows,
    thin_rod as thin_rod,
    turned_tensor as turned_tensor,
)
from linkage_ros.kinematics.space.one_plane import closure_as_drawn as closure_as_drawn
from linkage_ros.kinematics.space.planar_loops import PARALLEL as PARALLEL
from linkage_ros.kinematics.space.rod_joints import with_rod_joints as with_rod_joints
from linkage_ros.kinematics.space.vectors import (
    cross as cross,
    direction_of as direction_of,
    dot as dot,
    GROUND_FRAME as GROUND_FRAME,
    length as length,
    minus as minus,
    plus as plus,
    scale as scale,
    SpaceFrame as SpaceFrame,
    turn_about as turn_about,
    Vector as Vector,
    ZERO as ZERO,
)
from linkage_ros.kinematics.status import Status as Status
from linkage_ros.kinematics.step import (
    GroupDescription as GroupDescription,
    LinkState as LinkState,
)
