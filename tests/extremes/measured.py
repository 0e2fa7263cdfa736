"""Errors of the arithmetic at its extremes, against 50 digits or a closed form: the table of docs/extremes.md.

    python -m tests.extremes.measured

Each case returns the largest error that it saw, in its unit, and states the bound that the tests hold it to.
"""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Final

import mpmath
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fedora_qa.estimators.clocks.regular_clock import fit_regular_clock
from fedora_qa.estimators.fitting.tails import log_chance_of_hits, normal_beyond
from fedora_qa.estimators.imu.preintegration import rotation_increments
from fedora_qa.geometry import so3
from fedora_qa.geometry.camera import RigidMotion
from fedora_qa.geometry.motion import interpolate_poses
from fedora_qa.geometry.rigid_flow import rigid_flow, rounding_px
from fedora_qa.layout.binding import FARTHEST_TIMESTAMP_NS, Binding, timestamps_ns
from fedora_qa.statistics.moments import ValueMoments
from fedora_qa.statistics.trajectory import translation

Float64 = NDArray[np.float64]

DIGITS: Final = 50
AXIS: Final = np.array([0.6, -0.48, 0.64])
WIDTH, HEIGHT = 1440, 1080


@dataclass(frozen=True, slots=True)
class Case:
    """What was tried, against what, and the largest error that it may have."""

    tried: str
    reference: str
    unit: str
    bound: float
    error: Callable[[], float]


def angles_there_and_back(angle_rad: float) -> float:
    """Exp of a rotation vector against mpmath, and its log against the vector; relative, absolute at 0."""
    vector = AXIS * angle_rad
    found = so3.exp_quaternion(vector)
    with mpmath.workdps(DIGITS):
        exact = [mpmath.mpf(float(v)) for v in vector]
        angle = mpmath.sqrt(sum(v * v for v in exact))
        sine = mpmath.sin(angle / 2) / angle if angle else mpmath.mpf(1) / 2
        off = [float(mpmath.mpf(float(q)) - v * sine) for q, v in zip(found[:3], exact, strict=True)]
        off.append(float(mpmath.mpf(float(found[3])) - mpmath.cos(angle / 2)))
    back = so3.log_quaternion(found) - vector
    return float(max(np.abs(off[:3]).max(), np.abs(back).max()) / (angle_rad or 1.0))


def steady_turn(rate_rad_s: float) -> float:
    """The gyro integrated over half a second, samples at 1 kHz, about one axis: rad against rate times time."""
    times_s = np.arange(501) / 1000
    rates = np.tile(AXIS * rate_rad_s, (501, 1))
    starts, stops = np.array([0.0]), np.array([0.5])
    found = rotation_increments(times_s, rates, starts, stops, substeps=500)
    exact = so3.exp_quaternion(AXIS[None] * rate_rad_s * 0.5)
    return float(np.linalg.norm(so3.log_quaternion(so3.compose(so3.inverse(exact), found))))


def coning(rate_rad_s: float, span_s: float) -> float:
    """The same for ``Rz(a t) Rx(b t)``, whose axis turns: body rates (b, a sin bt, a cos bt); rad."""
    a = b = rate_rad_s / np.sqrt(2)
    times_s = np.arange(501) / 1000
    rates = np.column_stack([np.full(501, b), a * np.sin(b * times_s), a * np.cos(b * times_s)])
    stops = np.array([span_s])
    found = rotation_increments(times_s, rates, np.zeros(1), stops, substeps=round(1000 * span_s))
    exact = Rotation.from_rotvec([0, 0, a * span_s]) * Rotation.from_rotvec([b * span_s, 0, 0])
    return float((exact.inv() * Rotation.from_quat(found[0])).magnitude())


def _view(degrees: float) -> Float64:
    focal = WIDTH / (2 * np.tan(np.radians(degrees) / 2))
    return np.array([[focal, 0.0, (WIDTH - 1) / 2], [0.0, focal, (HEIGHT - 1) / 2], [0.0, 0.0, 1.0]])


def _exact_flow(K: Float64, motion: RigidMotion, column: float, row: float, depth_m: float) -> list[mpmath.mpf]:
    exact = [[mpmath.mpf(float(v)) for v in line] for line in motion.R]
    fx, fy, cx, cy = (mpmath.mpf(float(v)) for v in (K[0, 0], K[1, 1], K[0, 2], K[1, 2]))
    ray = [(column - cx) / fx, (row - cy) / fy, mpmath.mpf(1)]
    moved = [
        sum(r * v for r, v in zip(line, ray, strict=True)) * mpmath.mpf(float(depth_m)) + mpmath.mpf(float(t))
        for line, t in zip(exact, motion.t_m, strict=True)
    ]
    return [fx * moved[0] / moved[2] + cx - column, fy * moved[1] / moved[2] + cy - row]


def _flows(degrees: float, depth_m: float) -> tuple[Float64, Float64, Float64]:
    """Return the flow of corners and middle in double precision, exactly, and what rounding may take; px."""
    K = _view(degrees)
    motion = RigidMotion(so3.exp(np.array([0.002, -0.003, 0.001])), np.array([0.004, -0.003, 0.002]))
    columns, rows = (v.ravel() for v in np.meshgrid([0.0, 720.0, WIDTH - 1.0], [0.0, 540.0, HEIGHT - 1.0]))
    depths = np.full(len(columns), depth_m)
    found = rigid_flow(K, motion, columns, rows, depths)
    with mpmath.workdps(DIGITS):
        exact = np.array(
            [[float(v) for v in _exact_flow(K, motion, c, r, depth_m)] for c, r in zip(columns, rows, strict=True)]
        )
    return found, exact, rounding_px(K, motion, columns, rows, depths, found)


def flow_error(degrees: float, depth_m: float) -> float:
    """Recomputed flow against mpmath, px."""
    found, exact, _ = _flows(degrees, depth_m)
    return float(np.abs(found - exact).max())


def single_precision_flow(degrees: float, depth_m: float) -> float:
    """Flow and depth rounded to float32, as a share of what the rounding bound allows: below 1 is honest."""
    stored_mm = np.float32(depth_m * 1000)
    found, _, bound = _flows(degrees, float(stored_mm) / 1000)
    _, exact, _ = _flows(degrees, depth_m)
    return float((np.abs(exact.astype(np.float32) - found) / bound).max())


def timestamps(kind: str, origin_us: int) -> float:
    """Stamps of a type in microseconds from an origin against fractions, ns; longdouble checks the whole numbers."""
    stored = np.array([origin_us, origin_us + 1, origin_us + 999_999]).astype(kind)
    binding = Binding("path/imu/ts", "ts", 3, (3,), stored.dtype, ns_per_unit=1000)
    origin_ns = origin_us * 1000
    found = timestamps_ns(stored, binding, origin_ns)
    exact = [Fraction(value.item()) * 1000 - origin_ns for value in stored]
    wide = (stored.astype(np.longdouble) - np.longdouble(origin_us)) * 1000
    assert np.finfo(np.longdouble).nmant < 63 or np.array_equal(wide.astype(np.int64), [round(v) for v in exact])
    return float(max(abs(int(a) - b) for a, b in zip(found, exact, strict=True)))


def saturated_timestamps() -> float:
    """Stamps of the ends of int64 and uint64 saturate at 73 years, so that differences fit; ns beyond that."""
    ends = [np.array([-(2**63), 2**63 - 1]), np.array([0, 2**64 - 1], np.uint64)]
    binding = Binding("path/imu/ts", "ts", 2, (2,), np.dtype("i8"), ns_per_unit=1000)
    found = np.concatenate([timestamps_ns(one, binding, 0) for one in ends])
    return float(max(0, np.abs(found.astype(object)).max() - FARTHEST_TIMESTAMP_NS))


def an_hour_of_clock(rate_hz: float) -> float:
    """The period of an hour of stamps, rounded to microseconds: relative, against the exact one."""
    numbers = np.arange(int(3600 * rate_hz), dtype=np.float64)
    fit = fit_regular_clock(np.rint(numbers * 1e6 / rate_hz).astype(np.int64) * 1000)
    assert fit is not None
    assert fit.missing == 0
    return abs(fit.period_ns * rate_hz / 1e9 - 1)


def interpolated_whirl(rate_rad_s: float) -> float:
    """Poses at 200 Hz between samples, turning about one axis: rad against the closed form."""
    times_ns = np.arange(41) * 5_000_000
    vectors = np.outer(times_ns / 1e9 * rate_rad_s, AXIS)
    at_ns = times_ns[10:30] + 2_500_000
    R, _ = interpolate_poses(times_ns, np.zeros((41, 3)), so3.exp_quaternion(vectors), at_ns=at_ns)
    exact = so3.exp(np.outer(at_ns / 1e9 * rate_rad_s, AXIS))
    return float(np.linalg.norm(so3.log(np.swapaxes(exact, 1, 2) @ R), axis=1).max())


def distance_flown(speed_m_s: float, radius_m: float, seconds: int) -> float:
    """The length of a circle's arc from poses at 200 Hz: relative, against speed times time."""
    times_s = np.arange(200 * seconds + 1) / 200
    angle = times_s * speed_m_s / radius_m
    positions = radius_m * np.column_stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)])
    motion = translation(times_s, positions)
    assert motion is not None
    return abs(motion.length.value / (speed_m_s * seconds) - 1)


def variance_of_a_constant(value: float) -> float:
    """Zero variance, of a million equal numbers: what is left, relative to the square of the number."""
    variance = ValueMoments.of(np.full(1_000_000, value)).variance
    assert variance is not None
    return variance / value**2


def tail_of_hits(hits: int, trials: int, share: float) -> float:
    """The logarithm of a binomial tail against the sum of its terms in mpmath: relative."""
    with mpmath.workdps(DIGITS):
        p = mpmath.mpf(share)
        terms = (mpmath.binomial(trials, k) * p**k * (1 - p) ** (trials - k) for k in range(hits, trials + 1))
        exact = float(mpmath.log(mpmath.fsum(terms)))
    return abs(float(log_chance_of_hits(hits, trials, share)) / exact - 1)


def normal_tail(chance: float) -> float:
    """The deviate of a chance against mpmath's error function: relative error of the chance that it stands for."""
    with mpmath.workdps(DIGITS):
        back = mpmath.erfc(mpmath.mpf(normal_beyond(chance)) / mpmath.sqrt(2)) / 2
        return float(abs(back / mpmath.mpf(chance) - 1))


def _depths() -> dict[str, float]:
    near, far = 0.1, 30.0
    return {
        "0.1 m": near,
        "0.1 m less an ulp of float32": float(np.nextafter(np.float32(near), np.float32(0))),
        "30 m": far,
        "30 m and an ulp of float32": float(np.nextafter(np.float32(far), np.float32(99))),
    }


_MPMATH = "mpmath, 50 digits"
CASES: Final = (
    *(Case(f"rotation by {name}, exp and log", _MPMATH, "of the angle", 3e-16, lambda a=angle: angles_there_and_back(a))
      for name, angle in {"0": 0.0, "1e-300 rad": 1e-300, "1e-12 rad": 1e-12, "1e-3 rad": 1e-3, "1 rad": 1.0,
                          "pi - 1e-12": np.pi - 1e-12, "pi": float(np.pi)}.items()),
    *(Case(f"gyro over 0.5 s at {rate:g} rad/s about one axis, 1 kHz", "closed form", "rad", 1e-13,
           lambda r=rate: steady_turn(r)) for rate in (1e-12, 1.0, 100.0)),
    Case("gyro over 5 ms at 100 rad/s, the axis turning", "closed form", "rad", 2e-7, lambda: coning(100.0, 0.005)),
    Case("gyro over 0.5 s at 100 rad/s, the axis turning", "closed form", "rad", 2e-5, lambda: coning(100.0, 0.5)),
    Case("gyro over 0.5 s at 10 rad/s, the axis turning", "closed form", "rad", 1e-9, lambda: coning(10.0, 0.5)),
    Case("pose between samples at 100 rad/s about one axis, 200 Hz", "closed form", "rad", 1e-13,
         lambda: interpolated_whirl(100.0)),
    *(Case(f"flow, {degrees} degrees of view, depth {name}", _MPMATH, "px", 2e-10,
           lambda d=degrees, m=depth: flow_error(d, m))
      for degrees in (5, 60, 170) for name, depth in _depths().items()),
    *(Case(f"flow stored in float32, {degrees} degrees, depth {depth:g} m", "its rounding bound", "of the bound", 1.0,
           lambda d=degrees, m=depth: single_precision_flow(d, m))
      for degrees in (5, 60, 170) for depth in (0.1, 30.0)),
    *(Case(f"int64 timestamps from {name}", "fractions, longdouble", "ns", 0.0, lambda o=origin: timestamps("i8", o))
      for name, origin in {"-1e15 us": -(10**15), "0": 0, "2^53 us": 2**53, "2^62 us": 2**62}.items()),
    Case("uint64 timestamps from 2^63 us on", "the rule: 73 years, then no farther", "ns beyond", 1000.0,
         saturated_timestamps),
    Case("float64 timestamps from 2^53 us", "fractions of what is stored", "ns", 0.0, lambda: timestamps("f8", 2**53)),
    Case("float32 timestamps from 2^24 us", "fractions of what is stored", "ns", 0.0, lambda: timestamps("f4", 2**24)),
    *(Case(f"an hour of a clock of {rate:g} Hz, rounded to 1 us", "closed form", "of the period", 1e-12,
           lambda r=rate: an_hour_of_clock(r)) for rate in (30.0, 200.0, 1000.0)),
    Case("distance on a circle of 10 m at 20 m/s, 60 s", "closed form", "of the distance", 1e-6,
         lambda: distance_flown(20.0, 10.0, 60)),
    *(Case(f"variance of a million times {value:g}", "0", "of its square", 1e-13,
           lambda v=value: variance_of_a_constant(v)) for value in (1e-150, 0.1, 30.0, 65535.0, 1e150)),
    *(Case(f"{hits} of {trials} hits at a chance of {share:g}", _MPMATH, "of its logarithm", 1e-12,
           lambda h=hits, t=trials, s=share: tail_of_hits(h, t, s))
      for hits, trials, share in ((1, 1, 1e-300), (50, 100, 1e-6), (999, 1000, 0.5), (3, 2000, 1e-9))),
    *(Case(f"normal deviate of a chance of {chance:g}", _MPMATH, "of the chance", 1e-12,
           lambda c=chance: normal_tail(c)) for chance in (0.5, 1e-4, 1e-16, 1e-300)),
)  # fmt: skip


def main() -> int:
    """Print the table."""
    print("| tried | against | error | unit |\n| --- | --- | --- | --- |")
    for case in CASES:
        print(f"| {case.tried} | {case.reference} | {case.error():.1e} | {case.unit} |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
