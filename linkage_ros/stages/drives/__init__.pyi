# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

from linkage_ros.stages.drives.bag import BagParameters as BagParameters
from linkage_ros.stages.drives.chirp import Chirp as Chirp, ChirpParameters as ChirpParameters
from linkage_ros.stages.drives.clocked import LARGEST as LARGEST
from linkage_ros.stages.drives.compiled_drive import compile_drive as compile_drive
from linkage_ros.stages.drives.constant_rate import (
    ConstantRate as ConstantRate,
    ConstantRateParameters as ConstantRateParameters,
)
from linkage_ros.stages.drives.dependent_samples import (
    crank_of as crank_of,
    DependentSampleReader as DependentSampleReader,
    joint_of as joint_of,
    sampled_inverse as sampled_inverse,
)
from linkage_ros.stages.drives.drive import (
    Context as Context,
    CrankAtRest as CrankAtRest,
    CrankBehindPlay as CrankBehindPlay,
    CrankState as CrankState,
    describe_chatter as describe_chatter,
    Drive as Drive,
    DRIVES as DRIVES,
)
from linkage_ros.stages.drives.profile import (
    Profile as Profile,
    ProfileParameters as ProfileParameters,
    value_range as value_range,
)
from linkage_ros.stages.drives.sine import Sine as Sine, SineParameters as SineParameters
from linkage_ros.stages.drives.topic import (
    TopicDrive as TopicDrive,
    TopicParameters as TopicParameters,
)
from linkage_ros.stages.drives.torque import (
    MotorParameters as MotorParameters,
    PlayParameters as PlayParameters,
    reader as reader,
    TOPIC as TOPIC,
    TorqueParameters as TorqueParameters,
)
