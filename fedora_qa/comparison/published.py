"""Figures that others published, as they printed them, to be read beside our own."""

from typing import Final

from fedora_qa.comparison.types import Published

_FEDORA: Final = "FEDORA paper"
_BY_FEDORA: Final = "FEDORA paper, of others"

PUBLISHED: Final[tuple[Published, ...]] = (
    Published("datasets", "DDD-17", {"events_mp": 0.1, "depth": "none", "flow": "none"}, _BY_FEDORA),
    Published("datasets", "DDD-20", {"events_mp": 0.1, "depth": "none", "flow": "none"}, _BY_FEDORA),
    Published(
        "datasets",
        "MVSEC",
        {"rgb_mp": 0.4, "rgb_hz": 20, "events_mp": 0.1, "depth": "lidar", "flow": "10 Hz"},
        _BY_FEDORA,
    ),
    Published(
        "datasets",
        "DSEC",
        {"rgb_mp": 1.6, "rgb_hz": 20, "events_mp": 0.3, "depth": "lidar 10 Hz", "flow": "20 Hz"},
        _BY_FEDORA,
    ),
    Published(
        "datasets",
        "FEDORA",
        {"rgb_mp": 1.6, "rgb_hz": 50, "events_mp": 0.3, "depth": "1.6 MP 50 Hz", "flow": "10, 25, 50 Hz"},
        _FEDORA,
    ),
    *(
        Published(
            "sequences",
            name,
            {"duration_s": duration, "distance_m": distance, "speed_max_m_s": speed, "angular_speed_max_rad_s": turn,
             "event_rate_mean_per_s": rate},
            _FEDORA,
        )
        # T (s), D (m), v max (m/s), w max (rad/s), and mean event rate (events/s) of the paper's sequence table.
        for name, duration, distance, speed, turn, rate in (
            ("FEDORA Baylands Day1", 165, 594.87, 5.032, 1.233, 1.12e6),
            ("FEDORA Baylands Day2", 220, 386.31, 2.531, 2.845, 1.44e6),
            ("FEDORA Baylands Ngt1", 159, 268.47, 2.416, 10.718, 1.69e6),
            ("FEDORA Racetrack Day", 112, 188.86, 2.218, 2.374, 2.01e6),
            ("FEDORA Racetrack Ngt", 112, 188.36, 2.058, 2.098, 1.79e6),
        )
    ),
    *(
        # Mean in px over the interval of the rate; the paper prints the variance in pix/s.
        Published("flow", "FEDORA Baylands, three sequences", {"rate": rate, "mean_px": mean, "variance": variance},
                  _FEDORA)
        for rate, mean, variance in (("10 Hz", 18.841, 18.67), ("25 Hz", 10.392, 12.163), ("50 Hz", 6.15, 9.13))
    ),
    Published("flow", "DSEC, test set", {"rate": "", "mean_px": 7.751, "variance": 7.0},
              _BY_FEDORA),
    Published("disparity", "FEDORA, test set", {"disparity_mean": 0.2566},
              _FEDORA),
    # Px of a stereo pair; FEDORA's disparity is the reciprocal of depth, 1/m.
    Published("disparity", "DSEC, test set", {"disparity_mean": 20.21}, _BY_FEDORA),
)  # fmt: skip
