"""The gyro compared with the orientations."""

from collections.abc import Sequence

from fedora_qa.checks.imu.agreement import ROTATION_TEXTS, agreement_observation
from fedora_qa.checks.protocol import Observation, WindowCheck
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.inertial_agreement import WindowMotion, motion_of


class ImuRotation(WindowCheck[WindowMotion]):
    """Does the integral of the gyro equal the rotation between poses?

    The rms of rotation residuals between neighbouring poses (mrad) and the worst residual; the bias (rad/s),
    misalignment (deg) and gain (percent) of the gyro; and the segment whose bias differs most. Each is stated with its
    error. Where the two streams follow different conventions: the size of the disagreement, and the convention under
    which they agree, for the whole sequence or a part.

    Why it matters
    --------------
    Gyro and poses measure the same motion. Integration of the gyro between poses accumulates every difference: a bias
    of 0.01 rad/s is 10 deg after 17 s.

    How
    ---
    The integral of a cubic spline through the gyro, plus the coning term of each substep, is compared with q_k^-1
    q_k+1; residuals are in the world's axes. Where the fit does not converge, other conventions are applied first:
    exchanged axes, degrees, other orders of the quaternion. Then weighted least squares is iterated over the whole
    sequence, with corrected timestamps. A group of parameters (bias, axes, gain, clocks) is fitted together with the
    others only where it explains the residuals far beyond chance; every other group is tested alone in addition.
    Outlying rows are left out of the fit, and stated.

    A bias is also fitted to each segment of 0.5 to 5 s, so that a bias that steps does not average out. If the streams
    differ in a way that no parameter describes, such as smoothed poses, nearly collinear parameters could have any
    value. Where the difference makes the detection limit of a parameter useless, the parameter is not a finding and is
    not fitted; the residuals state the difference. Bias and gain of a recorded IMU without declaration are properties:
    the record states them among the inferred facts, and they are not judged.

    Noise model
    -----------
    Declared pose noise, which neighbouring residuals share with opposite sign; white noise of the gyro; timestamps
    rounded to a microsecond (0.29 us times the rate); stored digits; a declared random walk of the bias, whose values
    at both ends of a segment are unknowns, and whose course between them is noise of the rows. Without declared noise,
    the values of ``pose.noise`` and ``imu.noise`` are used. Errors are formal ones, multiplied by a misfit above 1, and
    widened where the spread over segments exceeds them. The model error bound is the error of the integration,
    estimated from every second sample (Richardson: fourth order, a fifteenth of the difference).

    The noise of the gyro's own samples biases gain and timing. Its effect is measured from two halves of the samples,
    subtracted, and not counted as information: quiet flight increases the error and does not bias the result. Samples
    in steps that hardly change have a mean error of up to half a step. It is bounded by their motion in steps and by
    the declared noise (``fedora_qa/estimators/imu/samples.py``), and propagated to every parameter.

    Cannot detect
    -------------
    Errors that gyro and poses share. Misalignment about an axis about which the body never rotates. Lost samples whose
    timestamps were lost too (``clocks.gaps``).

    Sources
    -------
    J. Bortz, IEEE Trans. AES 7 (1971) 61; P. Savage, J. Guidance 21 (1998) 19; C. Forster et al., On-manifold
    preintegration, IEEE Trans. Robotics 33 (2017) 1; ``fedora_qa/estimators/imu/preintegration.py``,
    ``bias_walk.py``, ``grouped_fit.py``, ``sequence_fit.py``.
    """

    name = "imu.rotation"
    needs = ("imu", "pose")

    def measure(self, window: Window) -> WindowMotion | None:
        """Keep the window's own samples."""
        return motion_of(window)

    def conclude(self, state: Sequence[WindowMotion], facts: Facts) -> Observation:
        """Fit the whole sequence."""
        return agreement_observation(state, facts, "rotation", ROTATION_TEXTS, "mrad", 1e3)
