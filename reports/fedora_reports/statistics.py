"""Statistics as tables: those of the paper (sequence, flow, depth) first, then all statistics by group."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from fedora_qa.record.types import FileRecord, Scalar
from fedora_qa.record.wording import number, with_error

Group = Mapping[str, Scalar]

_ABSENT: Final = "–"

_UNITS: Final = {
    "m_s": "m/s",
    "rad_s": "rad/s",
    "per_s": "1/s",
    "per_m": "1/m",
    "px2": "px²",
    "px": "px",
    "hz": "Hz",
    "dn": "DN",
    "rad": "rad",
    "us": "µs",
    "ms": "ms",
    "m": "m",
    "s": "s",
}
"""Units by the ending of a name, longer endings first."""

_ERROR: Final = "standard_error"


@dataclass(frozen=True, slots=True)
class Table:
    """A table of text; the first column heads its rows. ``numeric``: the others hold numbers, aligned to the right."""

    title: str
    note: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    numeric: bool = True


def paper_tables(files: Sequence[FileRecord], names: Sequence[str]) -> tuple[Table, ...]:
    """Return the paper's tables with a row for each file, by its name; those without any row are left out."""
    sequences, flows, depths = [], [], []
    for name, file in zip(names, files, strict=True):
        sequence, motion = (file.statistics.get(group, {}) for group in ("sequence", "motion"))
        if sequence or motion:
            distance, speed = _with_error(motion, "distance", "m"), _with_error(motion, "speed_max", "m_s")
            angular_speed = _with_error(motion, "angular_speed_max", "rad_s")
            duration, event_rate = _value(sequence, "duration_s"), _value(sequence, "event_rate_mean_per_s", 1e-6)
            sequences.append((name, duration, distance, speed, angular_speed, event_rate))
        for group, flow in file.statistics.items():
            if group.startswith("flow/"):
                rate = group.removeprefix("flow/")
                rate = f"{rate.removesuffix('hz')} Hz" if rate.endswith("hz") else rate
                lengths = (_value(flow, key) for key in ("mean_px", "variance_px2", "max_px"))
                flows.append((name, rate, *lengths, _value(flow, "valid_share", 100.0)))
        depth, rgb = file.statistics.get("depth", {}), file.statistics.get("rgb", {})
        if depth or rgb:
            span = f"{_value(depth, 'min_m')} to {_value(depth, 'max_m')}" if depth else _ABSENT
            cells = (_value(depth, "mean_m"), _value(depth, "disparity_mean_per_m"), _value(depth, "valid_share", 100))
            depths.append((name, span, *cells, _value(rgb, "brightness_mean_dn")))
    tables = (
        Table(
            "Sequence",
            "Length, distance flown, greatest speed and angular speed with standard errors, mean event rate.",
            ("sequence", "T (s)", "D (m)", "v max (m/s)", "ω max (rad/s)", "MER (million events/s)"),
            tuple(sequences),
        ),
        Table(
            "Optical flow",
            "Length of flow, in px over the interval of its rate.",
            ("sequence", "rate", "mean (px)", "variance (px²)", "max (px)", "valid (%)"),
            tuple(flows),
        ),
        Table(
            "Depth and light",
            "Disparity is the reciprocal of depth; brightness is the mean luma of the colour frames.",
            ("sequence", "depth (m)", "mean (m)", "mean disparity (1/m)", "valid (%)", "brightness (DN)"),
            tuple(depths),
        ),
    )
    return tuple(table for table in tables if table.rows)


def all_statistics(file: FileRecord) -> tuple[Table, ...]:
    """Return every statistic of a file, a table for each group."""
    tables = []
    for group_name, group in file.statistics.items():
        rows = []
        for key, value in group.items():
            # A standard error stands beside the value that it belongs to.
            if _ERROR in key:
                continue
            name, unit = split_unit(key)
            ending = next((ending for ending in _UNITS if key.endswith(f"_{ending}")), "")
            error_key = f"{key.removesuffix(ending)}{_ERROR}_{ending}" if ending else f"{key}_{_ERROR}"
            if value is None:
                text = _ABSENT
            elif isinstance(value, bool | str):
                text = str(value)
            else:
                error = group.get(error_key)
                text = with_error(value, error if isinstance(error, int | float) else None, unit)
            rows.append((name, text))
        if rows:
            tables.append(Table(group_name, "", ("quantity", "value"), tuple(rows)))
    return tuple(tables)


def split_unit(key: str) -> tuple[str, str]:
    """Return the name of a quantity in words and its unit: ``speed_max_m_s`` is ``speed max`` in ``m/s``."""
    for ending, unit in _UNITS.items():
        if key.endswith(f"_{ending}"):
            return key.removesuffix(f"_{ending}").replace("_", " "), unit
    return key.replace("_", " "), ""


def _value(group: Group, key: str, scale: float = 1.0) -> str:
    value = group.get(key)
    return number(scale * value) if isinstance(value, int | float) else _ABSENT


def _with_error(group: Group, name: str, unit: str) -> str:
    value, error = group.get(f"{name}_{unit}"), group.get(f"{name}_{_ERROR}_{unit}")
    if not isinstance(value, int | float):
        return _ABSENT
    return with_error(value, error if isinstance(error, int | float) else None, "")
