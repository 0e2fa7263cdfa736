"""The gyro against the orientations."""

from collections.abc import Sequence

from fedora_qa.checks.imu.agreement import ROTATION_TEXTS, agreement_observation
from fedora_qa.checks.protocol import Observation, WindowCheck
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.inertial_agreement import WindowMotion, motion_of


class ImuRotation(WindowCheck[WindowMotion]):
    """Does the gyro, integrated, give the rotation between poses?

    The scatter of rotation residuals between neighbouring poses (mrad), the worst of them, and the gyro's bias (rad/s),
    misalignment (deg) and gain (percent), and the segment where the bias differs most, each with its error. Where the
    two streams disagree grossly: by how much, and which reading reconciles them, of the whole or of a part.

    Why it matters
    --------------
    Gyro and pose are one motion told twice. Whoever integrates the one between the other's samples inherits every
    difference: a bias of 0.01 rad/s is 10 deg after 17 s.

    How
    ---
    Increments from the integral of a cubic spline through the gyro plus the coning term of each substep, against
    q_k^-1 q_k+1; residuals in the world's axes. Gross readings first: exchanged axes, degrees, other orders of the
    quaternion are tried where the fit does not settle. Then weighted least squares over the whole sequence, iterated in
    the stamps; a group of parameters (bias, axes, gain, clocks) is freed only where it explains the residuals far
    beyond chance, and every other is tested alone beside those. Rows far out are left out of the fit, and stated. The
    sequence is cut into segments of 0.5 to 5 s, and each is asked for its own bias: one that steps does not average
    out. Where the streams differ in a way that no parameter describes, such as smoothed poses, nearly collinear
    parameters would take values of any size: a parameter whose detection limit the difference makes useless is not
    stated as a fault, is not freed, and leaves the difference to the residuals. Bias and gain of a recorded IMU that
    nobody declares are properties: they are stated among what was inferred, and not judged.

    Noise model
    -----------
    Pose noise as declared, which neighbours share with opposite sign, the gyro's white noise (of a stream of which
    nobody declares any, as pose.noise and imu.noise measure it within that stream), stamps rounded to a microsecond
    (0.29 us times the rate), stored digits; a declared walk of the bias as one unknown a segment. Errors are formal
    ones, scaled by a misfit above 1, widened where the spread over segments exceeds them. Allowed for is the
    integration's own error, from every second sample (Richardson: fourth order, a fifteenth of the difference). Gain
    and timing are told by the gyro's own samples: what their noise does to the fit is measured from two halves of them,
    taken off, and not counted as knowledge, so that quiet flight is uncertain rather than wrong. Samples in steps that
    hardly change err by a mean of up to half a step: it is bounded by how far they move in steps and by the declared
    noise (``fedora_qa/estimators/imu/rounding.py``), and is carried into every parameter.

    Cannot see
    ----------
    Faults that gyro and pose share; misalignment about an axis about which the body never turns; drops of samples whose
    stamps went with them (clocks.gaps).

    Sources
    -------
    J. Bortz, IEEE Trans. AES 7 (1971) 61; P. Savage, J. Guidance 21 (1998) 19; C. Forster et al., On-manifold
    preintegration, IEEE Trans. Robotics 33 (2017) 1; ``fedora_qa/estimators/imu/preintegration.py``,
    ``grouped_fit.py``, ``sequence_fit.py``.
    """

    name = "imu.rotation"
    needs = ("imu", "pose")

    def measure(self, window: Window) -> WindowMotion | None:
        """Keep the window's own samples."""
        return motion_of(window)

    def conclude(self, state: Sequence[WindowMotion], facts: Facts) -> Observation:
        """Fit the whole sequence."""
        return agreement_observation(state, facts, "rotation", ROTATION_TEXTS, "mrad", 1e3)
