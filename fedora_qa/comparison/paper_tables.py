"""The paper's tables with a row for each subject or file compared, and the published rows below them."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Final, Literal

from fedora_qa.comparison.types import ComparedFile, Comparison, Published, Subject
from fedora_qa.record.tables import ABSENT, SOURCE, TextTable, number_cell
from fedora_qa.record.types import Scalar
from fedora_qa.record.wording import number, with_error

Group = Mapping[str, Scalar]

_PUBLISHED_NOTE: Final = (
    "Rows with a source are published figures, as printed. MVSEC and DSEC are stereo; of their flow the text of the "
    "paper says 20 and 10 Hz."
)

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
"""Figures that others published, as they printed them, to be read beside our own."""


def paper_tables(comparison: Comparison) -> tuple[TextTable, ...]:
    """Return the tables of datasets, sequences, flow, and disparity."""
    subjects = comparison.subjects
    datasets = [_dataset(subject) for subject in subjects]
    for name, values, source in _published(comparison, "datasets"):
        cells = (_text(values, key) for key in ("rgb_mp", "rgb_hz", "events_mp", "depth", "flow"))
        datasets.append((name, *[ABSENT] * 4, *cells, source))

    sequences: list[tuple[str, ...]] = []
    for name, file in _distinct_names(subjects):
        sequence, motion = (file.statistics.get(group, {}) for group in ("sequence", "motion"))
        sequences.append(
            (
                name,
                number_cell(sequence.get("duration_s")),
                _with_error(motion, "distance", "m"),
                _with_error(motion, "speed_max", "m_s"),
                _with_error(motion, "angular_speed_max", "rad_s"),
                number_cell(sequence.get("event_rate_mean_per_s"), 1e-6),
                "",
            )
        )
    for name, values, source in _published(comparison, "sequences"):
        keys = ("duration_s", "distance_m", "speed_max_m_s", "angular_speed_max_rad_s")
        event_rate = number_cell(values.get("event_rate_mean_per_s"), 1e-6)
        sequences.append((name, *(_text(values, key) for key in keys), event_rate, source))

    flow: list[tuple[str, ...]] = []
    for subject in subjects:
        groups = (name for file in subject.files for name in file.statistics if name.startswith("flow/"))
        for group in dict.fromkeys(groups):
            mean, variance = _pooled([file.statistics[group] for file in subject.files if group in file.statistics])
            rate = f"{group.removeprefix('flow/').removesuffix('hz')} Hz"
            flow.append((subject.name, rate, number_cell(mean), number_cell(variance), ""))
    for name, values, source in _published(comparison, "flow"):
        flow.append((name, *(_text(values, key) for key in ("rate", "mean_px", "variance")), source))

    disparity: list[tuple[str, ...]] = []
    for name, file in _distinct_names(subjects):
        depth = file.statistics.get("depth")
        if depth:
            means = (number_cell(depth.get(key)) for key in ("disparity_mean_per_m", "mean_m"))
            disparity.append((name, *means, number_cell(depth.get("valid_share"), 100.0), ""))
    for name, values, source in _published(comparison, "disparity"):
        disparity.append((name, _text(values, "disparity_mean"), ABSENT, ABSENT, source))
    return (
        TextTable(
            "Datasets",
            ("dataset", "files", "T (s)", "D (m)", "million events", "colour (MP)", "(Hz)", "events (MP)", "depth",
             "flow", SOURCE),
            tuple(datasets),
            _PUBLISHED_NOTE,
            words=1,
        ),
        TextTable(
            "Sequences",
            ("sequence", "T (s)", "D (m)", "v max (m/s)", "ω max (rad/s)", "MER (million events/s)", SOURCE),
            tuple(sequences),
            "Length, distance flown, greatest speed and angular speed with standard errors, mean event rate.",
            words=1,
        ),
        TextTable(
            "Optical flow",
            ("sequences", "rate", "mean (px)", "variance (px²)", SOURCE),
            tuple(flow),
            "Length of flow over the interval of its rate, all files together. The paper prints its variance in pix/s.",
        ),
        TextTable(
            "Disparity and depth",
            ("sequence", "mean disparity (1/m)", "mean depth (m)", "valid (%)", SOURCE),
            tuple(disparity),
            "Disparity is the reciprocal of depth here and in FEDORA; DSEC's is of a stereo pair, in px.",
            words=1,
        ),
    )  # fmt: skip


def _distinct_names(subjects: Sequence[Subject]) -> Iterator[tuple[str, ComparedFile]]:
    """Yield each file with a name that distinguishes it from those of other subjects."""
    names = [file.name for subject in subjects for file in subject.files]
    for subject in subjects:
        for file in subject.files:
            yield (file.name if names.count(file.name) == 1 else f"{subject.name}: {file.name}"), file


def _dataset(subject: Subject) -> tuple[str, ...]:
    groups = [file.statistics for file in subject.files]
    first: Mapping[str, Group] = groups[0] if groups else {}
    cameras, rates = first.get("cameras", {}), first.get("rates", {})
    depth = f"{_megapixels(cameras, 'depth')} MP {_rounded(rates, 'depth_hz')} Hz" if "depth_hz" in rates else ABSENT
    flow = [name.removeprefix("flow/").removesuffix("hz") for name in first if name.startswith("flow/")]
    return (
        subject.name,
        str(len(subject.files)),
        _total(groups, "sequence", "duration_s"),
        _total(groups, "motion", "distance_m"),
        _total(groups, "events", "count", 1e-6),
        _megapixels(cameras, "rgb"),
        _rounded(rates, "rgb_hz"),
        _megapixels(cameras, "events"),
        depth,
        f"{', '.join(flow)} Hz" if flow else ABSENT,
        "",
    )


def _pooled(parts: Sequence[Group]) -> tuple[float | None, float | None]:
    """Return mean and variance of all pixels together, from those of each file."""
    pairs = [
        (float(pixels), float(mean), float(variance))
        for pixels, mean, variance in ((p.get("pixels"), p.get("mean_px"), p.get("variance_px2")) for p in parts)
        if isinstance(pixels, int | float) and isinstance(mean, int | float) and isinstance(variance, int | float)
    ]
    pixels = sum(part[0] for part in pairs)
    if not pixels:
        return None, None
    mean = sum(n * m for n, m, _ in pairs) / pixels
    # Law of total variance: the mean of the variances plus the variance of the means, both weighted by pixels.
    return mean, sum(n * (v + (m - mean) * (m - mean)) for n, m, v in pairs) / pixels


def _published(
    comparison: Comparison, table: Literal["datasets", "sequences", "flow", "disparity"]
) -> Iterator[tuple[str, Group, str]]:
    for row in comparison.published:
        if row.table == table:
            yield row.name, row.values, row.source


def _total(groups: Sequence[Mapping[str, Group]], group: str, key: str, scale: float = 1.0) -> str:
    """Return a sum over all files; absent where one of them lacks the value."""
    values = [statistics.get(group, {}).get(key) for statistics in groups]
    numbers = [float(value) for value in values if isinstance(value, int | float)]
    # A sum that lacks a file would look like a smaller dataset.
    return number(scale * sum(numbers)) if numbers and len(numbers) == len(values) else ABSENT


def _megapixels(cameras: Group, camera: str) -> str:
    width, height = cameras.get(f"{camera}_width_px"), cameras.get(f"{camera}_height_px")
    if not isinstance(width, int) or not isinstance(height, int):
        return ABSENT
    return f"{width * height / 1e6:.2g}"


def _rounded(rates: Group, key: str) -> str:
    value = rates.get(key)
    return f"{value:.3g}" if isinstance(value, int | float) else ABSENT


def _text(values: Group, key: str) -> str:
    """Return a printed figure with all its digits."""
    value = values.get(key)
    return ABSENT if value in {None, ""} else f"{value:.12g}" if isinstance(value, float) else str(value)


def _with_error(group: Group, name: str, unit: str) -> str:
    value, error = group.get(f"{name}_{unit}"), group.get(f"{name}_standard_error_{unit}")
    if not isinstance(value, int | float):
        return ABSENT
    return with_error(value, error if isinstance(error, int | float) else None, "")
