"""The paper's tables with a row for each thing compared, and the published rows below them."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Final, Literal

from fedora_qa.comparison.text_table import ABSENT, SOURCE, TextTable
from fedora_qa.comparison.types import ComparedFile, Comparison, Subject
from fedora_qa.record.types import Scalar
from fedora_qa.record.wording import number, with_error

Group = Mapping[str, Scalar]

_PUBLISHED_NOTE: Final = (
    "Rows with a source are published figures, as printed. MVSEC and DSEC are stereo; of their flow the text of the "
    "paper says 20 and 10 Hz."
)


def paper_tables(comparison: Comparison) -> tuple[TextTable, ...]:
    """Return the tables of datasets, sequences, flow, and disparity."""
    subjects = comparison.subjects
    return (
        TextTable(
            "Datasets",
            ("dataset", "files", "T (s)", "D (m)", "million events", "colour (MP)", "(Hz)", "events (MP)", "depth",
             "flow", SOURCE),
            (*(_dataset(subject) for subject in subjects), *_published_datasets(comparison)),
            _PUBLISHED_NOTE,
            words=1,
        ),
        TextTable(
            "Sequences",
            ("sequence", "T (s)", "D (m)", "v max (m/s)", "ω max (rad/s)", "MER (million events/s)", SOURCE),
            (*(_sequence(name, file) for name, file in _named(subjects)), *_published_sequences(comparison)),
            "Length, distance flown, greatest speed and angular speed with standard errors, mean event rate.",
            words=1,
        ),
        TextTable(
            "Optical flow",
            ("sequences", "rate", "mean (px)", "variance (px²)", SOURCE),
            (*(row for subject in subjects for row in _flow(subject)), *_published_flow(comparison)),
            "Length of flow over the interval of its rate, all files together. The paper prints its variance in pix/s.",
        ),
        TextTable(
            "Disparity and depth",
            ("sequence", "mean disparity (1/m)", "mean depth (m)", "valid (%)", SOURCE),
            (*(_depth(name, file) for name, file in _named(subjects) if file.statistics.get("depth")),
             *_published_disparity(comparison)),
            "Disparity is the reciprocal of depth here and in FEDORA; DSEC's is of a stereo pair, in px.",
            words=1,
        ),
    )  # fmt: skip


def _named(subjects: Sequence[Subject]) -> Iterator[tuple[str, ComparedFile]]:
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


def _sequence(name: str, file: ComparedFile) -> tuple[str, ...]:
    sequence, motion = (file.statistics.get(group, {}) for group in ("sequence", "motion"))
    return (
        name,
        _value(sequence, "duration_s"),
        _measured(motion, "distance", "m"),
        _measured(motion, "speed_max", "m_s"),
        _measured(motion, "angular_speed_max", "rad_s"),
        _value(sequence, "event_rate_mean_per_s", 1e-6),
        "",
    )


def _flow(subject: Subject) -> Iterator[tuple[str, ...]]:
    for group in dict.fromkeys(name for file in subject.files for name in file.statistics if name.startswith("flow/")):
        mean, variance = _pooled([file.statistics[group] for file in subject.files if group in file.statistics])
        rate = f"{group.removeprefix('flow/').removesuffix('hz')} Hz"
        yield subject.name, rate, _shown(mean), _shown(variance), ""


def _depth(name: str, file: ComparedFile) -> tuple[str, ...]:
    depth = file.statistics["depth"]
    cells = (_value(depth, key) for key in ("disparity_mean_per_m", "mean_m"))
    return name, *cells, _value(depth, "valid_share", 100.0), ""


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


def _published_datasets(comparison: Comparison) -> Iterator[tuple[str, ...]]:
    for name, values, source in _published(comparison, "datasets"):
        cells = (_text(values, key) for key in ("rgb_mp", "rgb_hz", "events_mp", "depth", "flow"))
        yield name, *[ABSENT] * 4, *cells, source


def _published_sequences(comparison: Comparison) -> Iterator[tuple[str, ...]]:
    keys = ("duration_s", "distance_m", "speed_max_m_s", "angular_speed_max_rad_s")
    for name, values, source in _published(comparison, "sequences"):
        yield name, *(_text(values, key) for key in keys), _value(values, "event_rate_mean_per_s", 1e-6), source


def _published_flow(comparison: Comparison) -> Iterator[tuple[str, ...]]:
    for name, values, source in _published(comparison, "flow"):
        yield name, *(_text(values, key) for key in ("rate", "mean_px", "variance")), source


def _published_disparity(comparison: Comparison) -> Iterator[tuple[str, ...]]:
    for name, values, source in _published(comparison, "disparity"):
        yield name, _text(values, "disparity_mean"), ABSENT, ABSENT, source


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


def _value(group: Group, key: str, scale: float = 1.0) -> str:
    value = group.get(key)
    return number(scale * value) if isinstance(value, int | float) else ABSENT


def _text(values: Group, key: str) -> str:
    """Return a printed figure with all its digits."""
    value = values.get(key)
    return ABSENT if value in {None, ""} else f"{value:.12g}" if isinstance(value, float) else str(value)


def _measured(group: Group, name: str, unit: str) -> str:
    value, error = group.get(f"{name}_{unit}"), group.get(f"{name}_standard_error_{unit}")
    if not isinstance(value, int | float):
        return ABSENT
    return with_error(value, error if isinstance(error, int | float) else None, "")


def _shown(value: float | None) -> str:
    return ABSENT if value is None else number(value)
