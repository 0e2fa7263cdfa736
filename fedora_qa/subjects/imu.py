"""The checks of the IMU, with the proposals of causes and the canary of each."""

from typing import Final

from fedora_qa.checks.imu.noise import ImuNoise
from fedora_qa.checks.imu.rotation import ImuRotation
from fedora_qa.checks.imu.timing import ImuTiming
from fedora_qa.checks.imu.translation import ImuTranslation
from fedora_qa.diagnosis import imu
from fedora_qa.faults.canaries import declarations, motion, timestamps
from fedora_qa.subjects.row import CatalogueRow

ROWS: Final = (
    CatalogueRow(ImuRotation(), imu.propose_rotation, motion.gyro_bias),
    CatalogueRow(ImuTranslation(), imu.propose_translation, motion.accel_bias),
    CatalogueRow(ImuTiming(), imu.propose_timing, timestamps.late_imu),
    CatalogueRow(ImuNoise(), imu.propose_noise, declarations.other_imu_noise),
)
