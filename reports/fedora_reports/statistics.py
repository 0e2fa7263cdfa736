"""Statistics as tables: the paper's sequence and flow tables first, then everything that was counted."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePath
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
    """A table of text; the first column heads its rows. ``numeric``: the others hold numbers, set to the right."""

    title: str
    note: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    numeric: bool = True


def paper_tables(files: Sequence[FileRecord]) -> tuple[Table, ...]:
    """Return the paper's tables with a row for each file; those without any row are left out."""
    tables = (_sequences(files), _flow(files), _depth(files))
    return tuple(table for table in tables if table.rows)


def all_statistics(file: FileRecord) -> tuple[Table, ...]:
    """Return everything that was counted, a table for each group."""
    groups = ((name, _quantities(group)) for name, group in file.statistics.items())
    return tuple(Table(name, "", ("quantity", "value"), rows) for name, rows in groups if rows)


def _sequences(files: Sequence[FileRecord]) -> Table:
    head = ("sequence", "T (s)", "D (m)", "v max (m/s)", "ω max (rad/s)", "MER (million events/s)")
    rows = []
    for file in files:
        sequence, motion = (file.statistics.get(group, {}) for group in ("sequence", "motion"))
        if sequence or motion:
            rows.append(
                (
                    short_name(file, files),
                    _value(sequence, "duration_s"),
                    _measured(motion, "distance", "m"),
                    _measured(motion, "speed_max", "m_s"),
                    _measured(motion, "angular_speed_max", "rad_s"),
                    _value(sequence, "event_rate_mean_per_s", 1e-6),
                )
            )
    note = "Length, distance flown, greatest speed and angular speed with standard errors, mean event rate."
    return Table("Sequence", note, head, tuple(rows))


def _flow(files: Sequence[FileRecord]) -> Table:
    head = ("sequence", "rate", "mean (px)", "variance (px²)", "max (px)", "valid (%)")
    rows = [
        (
            short_name(file, files),
            _rate(group),
            *(_value(flow, key) for key in ("mean_px", "variance_px2", "max_px")),
            _value(flow, "valid_share", 100.0),
        )
        for file in files
        for group, flow in file.statistics.items()
        if group.startswith("flow/")
    ]
    return Table("Optical flow", "Length of flow, in px over the interval of its rate.", head, tuple(rows))


def _depth(files: Sequence[FileRecord]) -> Table:
    head = ("sequence", "depth (m)", "mean (m)", "mean disparity (1/m)", "valid (%)", "brightness (DN)")
    rows = []
    for file in files:
        depth, rgb = file.statistics.get("depth", {}), file.statistics.get("rgb", {})
        if depth or rgb:
            span = f"{_value(depth, 'min_m')} to {_value(depth, 'max_m')}" if depth else _ABSENT
            cells = (_value(depth, "mean_m"), _value(depth, "disparity_mean_per_m"), _value(depth, "valid_share", 100))
            rows.append((short_name(file, files), span, *cells, _value(rgb, "brightness_mean_dn")))
    note = "Disparity is the reciprocal of depth; brightness is the mean luma of the colour frames."
    return Table("Depth and light", note, head, tuple(rows))


def short_name(file: FileRecord, files: Sequence[FileRecord]) -> str:
    """Return the file's name where that is enough to tell it from the others, else its path."""
    name = PurePath(file.path).name or file.path
    return name if sum(PurePath(other.path).name == name for other in files) == 1 else file.path


def _rate(group: str) -> str:
    """Return ``10 Hz`` for ``flow/10hz``, and any other name as it is."""
    rate = group.removeprefix("flow/")
    return f"{rate.removesuffix('hz')} Hz" if rate.endswith("hz") else rate


def _quantities(group: Group) -> tuple[tuple[str, str], ...]:
    """Return names and values; a standard error stands beside the value that it belongs to."""
    rows = []
    for key, value in group.items():
        if _ERROR in key:
            continue
        name, unit = split_unit(key)
        rows.append((name, _shown(value, group.get(_error_key(key)), unit)))
    return tuple(rows)


def split_unit(key: str) -> tuple[str, str]:
    """Return a quantity's name in words and its unit: ``speed_max_m_s`` is ``speed max`` in ``m/s``."""
    for ending, unit in _UNITS.items():
        if key.endswith(f"_{ending}"):
            return key.removesuffix(f"_{ending}").replace("_", " "), unit
    return key.replace("_", " "), ""


def _error_key(key: str) -> str:
    ending = next((ending for ending in _UNITS if key.endswith(f"_{ending}")), "")
    return f"{key.removesuffix(ending)}{_ERROR}_{ending}" if ending else f"{key}_{_ERROR}"


def _shown(value: Scalar, error: Scalar, unit: str) -> str:
    if value is None:
        return _ABSENT
    if isinstance(value, bool | str):
        return str(value)
    return with_error(value, error if isinstance(error, int | float) else None, unit)


def _value(group: Group, key: str, scale: float = 1.0) -> str:
    value = group.get(key)
    return number(scale * value) if isinstance(value, int | float) else _ABSENT


def _measured(group: Group, name: str, unit: str) -> str:
    value, error = group.get(f"{name}_{unit}"), group.get(f"{name}_{_ERROR}_{unit}")
    if not isinstance(value, int | float):
        return _ABSENT
    return with_error(value, error if isinstance(error, int | float) else None, "")
