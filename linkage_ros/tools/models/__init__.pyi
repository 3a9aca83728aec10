# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

from linkage_ros.tools.models.array_functions import make_array_functions as make_array_functions
from linkage_ros.tools.models.mjcf import mujoco_model as mujoco_model
from linkage_ros.tools.models.part import (
    make_scene_model as make_scene_model,
    ModelPart as ModelPart,
    PartError as PartError,
    prefix_names as prefix_names,
)
from linkage_ros.tools.models.robot_model_command import model_of as model_of
from linkage_ros.tools.models.tree import grow_tree as grow_tree, Tree as Tree
from linkage_ros.tools.models.urdf import add_frames as add_frames, urdf_model as urdf_model
