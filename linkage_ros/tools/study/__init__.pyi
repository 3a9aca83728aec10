# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

# Read first: measure_budget, Budget, Price, Knob, NeedAnswer, Setting, measure_age_in_use,
# measure_drive_step, measure_deliberate, measure_solving, price_scenes, motions_of, budget_table.

from linkage_ros.tools.study.accuracy_command import budget_html as budget_html
from linkage_ros.tools.study.age import (
    CARRY as CARRY,
    errors_in_use as errors_in_use,
    IN_USE as IN_USE,
    measure_age_in_use as measure_age_in_use,
    measure_age_of_command as measure_age_of_command,
    OF_COMMAND as OF_COMMAND,
)
from linkage_ros.tools.study.budget import (
    Budget as Budget,
    JointError as JointError,
    Knob as Knob,
    NeedAnswer as NeedAnswer,
    Price as Price,
    RecordingLoss as RecordingLoss,
    Setting as Setting,
)
from linkage_ros.tools.study.budget_text import (
    ALL_TOGETHER as ALL_TOGETHER,
    budget_json as budget_json,
    budget_table as budget_table,
    change_text as change_text,
    closing_lines as closing_lines,
    error_knobs as error_knobs,
    error_text as error_text,
    lead_lines as lead_lines,
    neighbours_of as neighbours_of,
    NOISE as NOISE,
    price_text as price_text,
    rows_of as rows_of,
    share_text as share_text,
    time_text as time_text,
    total_error as total_error,
)
from linkage_ros.tools.study.deliberate import (
    compare_runs as compare_runs,
    leave_out as leave_out,
    measure_deliberate as measure_deliberate,
    published_states as published_states,
)
from linkage_ros.tools.study.drive_step import (
    measure_drive_step as measure_drive_step,
    NAME as NAME,
)
from linkage_ros.tools.study.enclosure import prove as prove, solve as solve
from linkage_ros.tools.study.exact_constraints import SingularError as SingularError
from linkage_ros.tools.study.measure import (
    ERRORS as ERRORS,
    measure_budget as measure_budget,
    PARTS as PARTS,
)
from linkage_ros.tools.study.measuring import (
    alternate_order as alternate_order,
    describe_machine as describe_machine,
    percentile as percentile,
    Progress as Progress,
    Spread as Spread,
    spread_of as spread_of,
)
from linkage_ros.tools.study.member_motion import (
    draw_ticks as draw_ticks,
    draw_times as draw_times,
)
from linkage_ros.tools.study.need import (
    answer_need as answer_need,
    answers_of as answers_of,
    tune_scene as tune_scene,
)
from linkage_ros.tools.study.picture import budget_svg as budget_svg
from linkage_ros.tools.study.prices import (
    add_prices as add_prices,
    change_scene as change_scene,
    price_scenes as price_scenes,
    tick_price as tick_price,
    time_ticks as time_ticks,
    TimedScene as TimedScene,
    turn_crank as turn_crank,
)
from linkage_ros.tools.study.recording import measure_recording as measure_recording
from linkage_ros.tools.study.scene_motion import motions_of as motions_of
from linkage_ros.tools.study.solving import (
    compare_solver as compare_solver,
    comparison_solvers as comparison_solvers,
    exact_joints as exact_joints,
    measure_solving as measure_solving,
    scene_solver as scene_solver,
)
