# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

# Read first: Mechanics, AppliedForces, AppliedLoads, Loads, Friction, Motor, Motion, METHODS,
# Reactions, JointReaction, TwoMasses, Winding.

from linkage_ros.dynamics.applied import AppliedForces as AppliedForces
from linkage_ros.dynamics.dry_friction import settle_forces as settle_forces
from linkage_ros.dynamics.equation import (
    Mechanics as Mechanics,
    Terms as Terms,
)
from linkage_ros.dynamics.integrators import (
    EXACT as EXACT,
    gauss_legendre as gauss_legendre,
    GAUSS_MATRIX as GAUSS_MATRIX,
    GAUSS_NODES as GAUSS_NODES,
    GAUSS_WEIGHTS as GAUSS_WEIGHTS,
    METHODS as METHODS,
    rk4 as rk4,
)
from linkage_ros.dynamics.laws import (
    Contact as Contact,
    LawTerm as LawTerm,
    TorqueTable as TorqueTable,
)
from linkage_ros.dynamics.loads import (
    AppliedLoads as AppliedLoads,
    check_loads as check_loads,
    Friction as Friction,
    GREATEST_LOAD as GREATEST_LOAD,
    JointFriction as JointFriction,
    JointLoad as JointLoad,
    JointSpring as JointSpring,
    Loads as Loads,
    PointLoad as PointLoad,
    SoftStop as SoftStop,
    Spring as Spring,
    STIFFEST as STIFFEST,
    WrenchLoad as WrenchLoad,
)
from linkage_ros.dynamics.motion import (
    LARGEST as LARGEST,
    last_before as last_before,
    Motion as Motion,
    SingleDofMechanism as SingleDofMechanism,
)
from linkage_ros.dynamics.motor import Motor as Motor
from linkage_ros.dynamics.reactions import (
    JointReaction as JointReaction,
    Reactions as Reactions,
)
from linkage_ros.dynamics.several_freedoms import (
    InputVector as InputVector,
    SeveralDofMechanism as SeveralDofMechanism,
    SeveralMotion as SeveralMotion,
)
from linkage_ros.dynamics.several_motors import (
    behind_play as behind_play,
    InputMotors as InputMotors,
    InputWindings as InputWindings,
    MotorPlay as MotorPlay,
    motors_of as motors_of,
)
from linkage_ros.dynamics.two_masses import TwoMasses as TwoMasses
from linkage_ros.dynamics.winding import Winding as Winding
from linkage_ros.dynamics.wrenches import HeldWrench as HeldWrench
