"""The accelerometer against the positions."""

from collections.abc import Sequence

from fedora_qa.checks.imu.agreement import TRANSLATION_TEXTS, agreement_observation
from fedora_qa.checks.protocol import Observation, WindowCheck
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.inertial_agreement import WindowMotion, motion_of


class ImuTranslation(WindowCheck[WindowMotion]):
    """Does the specific force, integrated twice with gravity, give the path of the poses?

    The scatter of the residuals of neighbouring second differences (m/s), the worst of them, and the accelerometer's
    bias (m/s^2), the size and slope of gravity (m/s^2), the lever arm between IMU and poses (m), and the segment where
    the bias differs most, each with its error. Where the two streams disagree grossly: by how much, and which reading
    reconciles them, of the whole or of a part.

    Why it matters
    --------------
    Specific force with gravity of another size, or none, or of another sign, passes every test of the stream alone and
    ruins every filter. Lever arms of centimetres are forgotten easily, and look like timing in turns.

    How
    ---
    Second differences of consecutive positions against the double integral of ``R f + g``, R interpolated between the
    poses: no velocity is needed, and the gyro has no part in it. Gross readings and fit as in imu.rotation. In level
    flight gravity and bias along Z are one and the same to these streams: both are then named. Whether the sensor's
    gravity or the declared one is odd is told by which of the two is a number in use (9.8, 9.80665, 9.81 ...). A world
    whose vertical is declared unknown is turned until gravity, the median second difference of positions less that of
    ``R f``, points down; its slope is then not judged. Bias and excess of gravity of a recorded IMU that nobody
    declares are stated among what was inferred.

    Noise model
    -----------
    Position noise as declared, or measured where it is not (imu.rotation), which three neighbours share (1, -2, 1);
    white noise of the accelerometer; noisy orientations, which turn the force and so disturb across it only; rounded
    stamps (0.29 us times the speed), stored digits; a declared walk of the bias as one unknown a segment. Errors and
    the integration's allowance as in imu.rotation, and so is the mean error of samples in steps.

    Cannot see
    ----------
    What stays below position noise over the time that it takes to average it; a lever arm where the body does not turn;
    whether IMU or poses are off the body's origin.

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
