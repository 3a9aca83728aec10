# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

# Read first: Drive, DRIVES, drive_class, CrankState, Crank, TopicDrive, TorqueDrive,
# ConstantRateDrive, ProfileDrive, BagDrive.

from linkage_ros.stages.drives.bag import BagDrive as BagDrive
from linkage_ros.stages.drives.chirp import Chirp as Chirp, ChirpDrive as ChirpDrive
from linkage_ros.stages.drives.compiled_drive import compile_drive as compile_drive
from linkage_ros.stages.drives.dependent_samples import (
    DependentSampleReader as DependentSampleReader,
    ExchangedInputs as ExchangedInputs,
    ExchangedMotion as ExchangedMotion,
)
from linkage_ros.stages.drives.drive import (
    Context as Context,
    Crank as Crank,
    CrankAtRest as CrankAtRest,
    CrankBehindPlay as CrankBehindPlay,
    CrankState as CrankState,
    describe_chatter as describe_chatter,
    Drive as Drive,
    drive_class as drive_class,
    DRIVES as DRIVES,
)
from linkage_ros.stages.drives.profile import Profile as Profile, ProfileDrive as ProfileDrive
from linkage_ros.stages.drives.steady_motion import (
    ConstantRate as ConstantRate,
    ConstantRateDrive as ConstantRateDrive,
    Sine as Sine,
    SineDrive as SineDrive,
)
from linkage_ros.stages.drives.topic import (
    sample_inputs as sample_inputs,
    SampledCrank as SampledCrank,
    SampledInputs as SampledInputs,
    TopicDrive as TopicDrive,
)
from linkage_ros.stages.drives.torque import (
    MotorParameters as MotorParameters,
    PlayParameters as PlayParameters,
    TorqueDrive as TorqueDrive,
)
from linkage_ros.stages.drives.torque_crank import TorqueCrank as TorqueCrank
