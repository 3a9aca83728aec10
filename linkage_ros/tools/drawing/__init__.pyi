# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

# Read first: svg, draw_linkage, paint_linkage, paint_picture, Camera, animate, links_dxf,
# plot_joints.

from linkage_ros.tools.drawing.animation import (
    animate as animate,
    AnimatedMotion as AnimatedMotion,
    ANIMATION_KINDS as ANIMATION_KINDS,
    check_kind as check_kind,
    range_motion as range_motion,
    RATE as RATE,
)
from linkage_ros.tools.drawing.draw_command import (
    add_camera as add_camera,
    camera_of as camera_of,
    reach_lines as reach_lines,
)
from linkage_ros.tools.drawing.drawing_data import (
    drawn_in_frames as drawn_in_frames,
    pose_in_frames as pose_in_frames,
)
from linkage_ros.tools.drawing.drawn_linkage import draw_linkage as draw_linkage, svg as svg
from linkage_ros.tools.drawing.dxf import links_dxf as links_dxf
from linkage_ros.tools.drawing.figure import (
    assemblies_picture as assemblies_picture,
    label_joints as label_joints,
    paint_linkage as paint_linkage,
    paint_picture as paint_picture,
    plot_joints as plot_joints,
    stacked_axes as stacked_axes,
)
from linkage_ros.tools.drawing.painting import (
    degree_step as degree_step,
    GHOST as GHOST,
    Label as Label,
    LAYERS as LAYERS,
    NameLabels as NameLabels,
    OTHER as OTHER,
    OTHER_TEXT as OTHER_TEXT,
    paint_shapes as paint_shapes,
    picture_settings as picture_settings,
    place_labels as place_labels,
    plot_places as plot_places,
    save_picture as save_picture,
    set_plane as set_plane,
    TRACE as TRACE,
    WANTED as WANTED,
)
from linkage_ros.tools.drawing.plot_command import (
    crank_curves as crank_curves,
    curves_over_time as curves_over_time,
    is_after_gap as is_after_gap,
    longest_step as longest_step,
)
from linkage_ros.tools.drawing.space_drawing import (
    Camera as Camera,
    choose_camera as choose_camera,
    space_page_data as space_page_data,
)
from linkage_ros.tools.drawing.spread import draw_spread as draw_spread, JointSpread as JointSpread
