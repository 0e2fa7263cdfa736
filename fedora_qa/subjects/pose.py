"""The checks of poses, with the proposals of causes and the canary of each."""

from typing import Final

from fedora_qa.checks.pose.continuity import PoseContinuity
from fedora_qa.checks.pose.noise import PoseNoise
from fedora_qa.checks.pose.orientation import PoseOrientation
from fedora_qa.diagnosis import pose
from fedora_qa.faults.canaries import declarations, motion
from fedora_qa.subjects.row import CatalogueRow

ROWS: Final = (
    CatalogueRow(PoseOrientation(), pose.propose_orientation, motion.long_quaternions),
    CatalogueRow(PoseContinuity(), pose.propose_continuity, motion.teleport),
    CatalogueRow(PoseNoise(), pose.propose_noise, declarations.other_pose_noise),
)
