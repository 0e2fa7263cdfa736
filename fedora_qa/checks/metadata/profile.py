"""The sizes, rates and thresholds of the paper, for files that declare its profile."""

from math import atan, degrees
from typing import Final

import numpy as np

from fedora_qa.checks.exact import count_of_faults
from fedora_qa.checks.protocol import FactsCheck, Observation, Statistic
from fedora_qa.conventions import HORIZONTAL_FIELD_OF_VIEW_DEG, NS_PER_S, NS_PER_US
from fedora_qa.layout.canonical import FLOW_STREAMS
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts

PAPER: Final = "fedora-paper"

# The paper's numbers: px (width, height), Hz, m, DN and us.
_SIZES: Final = {"rgb": (1440, 1080), "depth": (1440, 1080), "events": (640, 480)}
_RATES_HZ: Final = {"rgb": 50, "depth": 50, "imu": 1000, "pose": 200, "flow/10hz": 10, "flow/25hz": 25, "flow/50hz": 50}
_STREAMS: Final = ("rgb", "depth", "events", "imu", "pose", *FLOW_STREAMS, "rgb_to_event", "depth_to_event")
_DEPTH_RANGE_M: Final = (0.1, 30.0)
_THRESHOLD_DN: Final = 30.0
_LEAST_PACKET_US: Final = 200


class MetadataProfile(FactsCheck):
    """Does the file conform to the profile that it declares?

    The difference of each number of the file from the paper's, for files with ``profile="fedora-paper"`` only.

    Why it matters
    --------------
    Users who train on the published sequences and test on another file rely on the same sizes, rates and thresholds.

    How
    ---
    Every stream must exist. Colour and depth are 1440x1080 px and events 640x480 px, all with a horizontal field of
    view of 60 degrees. Frames have 50 Hz, IMU 1000 Hz, pose 200 Hz, and flow 10, 25 and 50 Hz. The range of depth is
    0.1 to 30 m. Events follow the linear model with a threshold of 30 DN, in packets at least 0.2 ms apart. A period is
    the median of the steps between timestamps.

    Noise model
    -----------
    No random error. Allowed are the rounding of timestamps to a microsecond, of the depth range to float32, and of a
    focal length to whole pixels. The last changes a field of view 2 atan(W / 2f) by W/2 / (f^2 + W^2/4) rad.

    Cannot detect
    -------------
    Properties that the paper does not state. Other checks test whether the declarations are true.

    Sources
    -------
    "FEDORA: A Flying Event Dataset fOr Reactive behAvior", as summarised in the canonical layout, version 1.0.
    """

    name = "metadata.profile"

    def not_applicable(self, facts: Facts) -> str:
        """Require the profile of the paper."""
        return "" if facts.declared.profile == PAPER else f"the file does not declare profile={PAPER!r}"

    def examine(self, facts: Facts) -> Observation:
        """Compare each number with the paper's."""
        statistics = [
            count_of_faults(
                f"{stream}.absent",
                int(stream not in facts.streams),
                "streams",
                statement=f"the profile requires {stream}: {facts.absent.get(stream, 'it is absent')}",
                code="metadata.profile.stream",
                where=Where(stream=stream),
            )
            for stream in _STREAMS
        ]
        # Sizes and fields of view of the cameras.
        for name, camera in facts.declared.cameras.items():
            width, height = _SIZES[name]
            statistics.append(_number(f"{name}.width", camera.width, "px", width))
            statistics.append(_number(f"{name}.height", camera.height, "px", height))
            focal_px = float(camera.K[0, 0])
            if focal_px > 0:
                # 2 atan(W / 2f); a focal length rounded to whole pixels moves it by W/2 / (f^2 + W^2/4) rad.
                field_deg = degrees(2 * atan(camera.width / (2 * focal_px)))
                rounding_deg = degrees(camera.width / 2 / (focal_px**2 + camera.width**2 / 4))
                statistics.append(
                    _number(f"{name}.field_of_view", field_deg, "deg", HORIZONTAL_FIELD_OF_VIEW_DEG, rounding_deg)
                )

        # Rates of the streams.
        for stream, rate_hz in _RATES_HZ.items():
            clock = facts.clocks.get(stream)
            if clock is None or np.count_nonzero(clock.advancing) < 2:
                continue
            # Missing samples do not move a median.
            period_us = float(np.median(np.diff(clock.times_ns[clock.advancing]))) / NS_PER_US
            expected_us = NS_PER_S / rate_hz / NS_PER_US
            # Both timestamps of a step are rounded to a microsecond: 1 us in the worst case.
            statistics.append(_number(f"{stream}.period", period_us, "us", expected_us, 1.0))

        # Range of depth.
        if facts.declared.depth_range_m is not None:
            for side, value, expected in zip(
                ("nearest", "farthest"), facts.declared.depth_range_m, _DEPTH_RANGE_M, strict=True
            ):
                # The declared range may have been float32: 6e-8 relative, with a margin.
                statistics.append(_number(f"depth.{side}", value, "m", expected, 1e-6 * expected))

        # Model, thresholds and packets of the event sensor.
        model = facts.declared.events
        if model is not None:
            # The paper states a least interval: longer packets keep it.
            short_us = max(0, _LEAST_PACKET_US - model.packet_interval_us)
            statistics += [
                count_of_faults(
                    "events.model",
                    int(model.model != "linear"),
                    "declarations",
                    statement=f"the events are declared of the {model.model} model; the profile requires the linear "
                    "model",
                    code="metadata.profile.model",
                    where=Where(stream="events"),
                ),
                _number("events.threshold_on", model.threshold_on, "DN", _THRESHOLD_DN),
                _number("events.threshold_off", model.threshold_off, "DN", _THRESHOLD_DN),
                _number("events.packet_too_short", short_us, "us", 0.0),
            ]
        return Observation(Coverage(len(statistics), len(statistics), "requirements"), tuple(statistics))


def _number(name: str, value: float, unit: str, expected: float, model_error_bound: float = 0.0) -> Statistic:
    stream, quantity = name.rsplit(".", 1)
    return Statistic(
        name=name,
        value=float(value),
        unit=unit,
        standard_error=0.0,
        statement=f"{quantity.replace('_', ' ')} of {stream} is {value:.6g} {unit}; "
        f"the profile requires {expected:.6g}",
        code=f"metadata.profile.{quantity}",
        where=Where(stream=stream),
        expected=expected,
        model_error_bound=model_error_bound,
    )
