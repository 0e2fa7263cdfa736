"""The accelerometer compared with the positions."""

from collections.abc import Sequence

from fedora_qa.checks.imu.agreement import TRANSLATION_TEXTS, agreement_observation
from fedora_qa.checks.protocol import Observation, WindowCheck
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.inertial_agreement import WindowMotion, motion_of


class ImuTranslation(WindowCheck[WindowMotion]):
    """Does the specific force, integrated twice with gravity, give the path of the poses?

    The rms of the residuals of neighbouring second differences (m/s) and the worst residual; the accelerometer's bias
    (m/s^2), the size and slope of gravity (m/s^2), the lever arm between IMU and poses (m); and the segment whose bias
    differs most. Each is stated with its error. Where the two streams follow different conventions: the size of the
    disagreement, and the convention under which they agree, for the whole sequence or a part.

    Why it matters
    --------------
    Specific force with gravity of another size, of the other sign, or without gravity passes every test of the stream
    alone and makes every filter fail. Lever arms of centimetres are easily forgotten, and have the effect of a time
    offset in turns.

    How
    ---
    Second differences of consecutive positions are compared with the double integral of ``R f + g``, with R
    interpolated between the poses: neither a velocity nor the gyro is used. Conventions and fit are as in
    ``imu.rotation``. In level flight, gravity and bias along Z cannot be separated by these streams: both are then
    named. Of the sensor's and the declared gravity, the one that is no common constant (9.8, 9.80665, 9.81 ...) is
    suspected. A world whose vertical is declared unknown is rotated until gravity, the median second difference of
    positions minus that of ``R f``, points down; its slope is then not judged. Bias and excess of gravity of a recorded
    IMU without declaration are stated among the inferred facts.

    Noise model
    -----------
    Position noise as declared, or measured without a declaration (``imu.rotation``), which three neighbours share (1,
    -2, 1); white noise of the accelerometer; noise of orientations, which rotates the force and has an effect only
    across it; rounded timestamps (0.29 us times the speed); stored digits; a declared random walk of the bias, the
    errors, the bound of the integration, and the mean error of samples in steps as in ``imu.rotation``.

    Cannot detect
    -------------
    Errors below the position noise over the time that is needed to average it. A lever arm where the body does not
    rotate. Whether IMU or poses are displaced from the body's origin.

    Sources
    -------
    First principles: ``fedora_qa/estimators/imu/specific_force.py``; C. Forster et al., IEEE Trans. Robotics 33 (2017)
    1, section VI, for the integrals of which these are differences.
    """

    name = "imu.translation"
    needs = ("imu", "pose")

    def measure(self, window: Window) -> WindowMotion | None:
        """Keep the window's own samples."""
        return motion_of(window)

    def conclude(self, state: Sequence[WindowMotion], facts: Facts) -> Observation:
        """Fit the whole sequence."""
        return agreement_observation(state, facts, "translation", TRANSLATION_TEXTS, "m/s", 1.0)
