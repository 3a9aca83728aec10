# Copyright 2026 The linkage_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

# Read first: load, Closure, Linkage, SpaceLinkage, Position, Status, load_scene, Scene, Pipeline,
# Tick, read_bag, Bag, svg, generate_function, Design, LinkageError.

# What `linkage_ros` exports, for type checkers: at run time a name is imported when it is used.

from linkage_ros.bag.reader import Bag as Bag, BagMessage as BagMessage, read_bag as read_bag
from linkage_ros.tools.models.array_functions import ArrayFunctions as ArrayFunctions
from linkage_ros.tools.drawing.drawn_linkage import svg as svg
from linkage_ros.errors import (
    BagError as BagError,
    DefinitionError as DefinitionError,
    FileError as FileError,
    LinkageError as LinkageError,
    SynthesisError as SynthesisError,
)
from linkage_ros.messages.joint_state import (
    JointStateReader as JointStateReader,
    Rejection as Rejection,
)
from linkage_ros.kinematics.batch import Batch as Batch
from linkage_ros.kinematics.closure import Closure as Closure
from linkage_ros.kinematics.plane.closure import PlanarClosure as PlanarClosure
from linkage_ros.kinematics.results import (
    Acceleration as Acceleration,
    Position as Position,
    Velocity as Velocity,
)
from linkage_ros.kinematics.plane.linkage import (
    Input as Input,
    Limits as Limits,
    Linkage as Linkage,
    Mass as Mass,
    Ratio as Ratio,
    RevoluteJoint as RevoluteJoint,
    SlideJoint as SlideJoint,
    Slider as Slider,
)
from linkage_ros.kinematics.space.closure import SpaceClosure as SpaceClosure
from linkage_ros.kinematics.space.linkage import (
    SpaceLinkage as SpaceLinkage,
    SpatialJoint as SpatialJoint,
)
from linkage_ros.kinematics.space.masses import SpatialMass as SpatialMass
from linkage_ros.kinematics.results import InputRange as InputRange
from linkage_ros.kinematics.status import Status as Status
from linkage_ros.tick.interpreted_tick import Tick as Tick
from linkage_ros.tick.pipeline import Pipeline as Pipeline
from linkage_ros.replay.replay import recorded_scene as recorded_scene
from linkage_ros.description.linkage_file import load as load
from linkage_ros.description.scene_file import load_scene as load_scene
from linkage_ros.description.scene import Scene as Scene
from linkage_ros.resources import linkage_names as linkage_names, scene_names as scene_names
from linkage_ros.tools.design.defects import assess as assess, Assessment as Assessment
from linkage_ros.tools.design.design import Design as Design
from linkage_ros.tools.design.function.task import generate_function as generate_function
from linkage_ros.tools.design.motion import (
    from_fixed_pivots as from_fixed_pivots,
    from_moving_pivots as from_moving_pivots,
    Pose as Pose,
)
from linkage_ros.tools.design.path.curves import PathTask as PathTask
from linkage_ros.tools.design.path.generate import generate_path as generate_path
from linkage_ros.tools.view.page import LinkagePage as LinkagePage

__version__: str
