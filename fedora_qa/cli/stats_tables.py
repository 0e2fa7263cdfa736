"""Statistics as tables of text, for the terminal and for markdown."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import PurePath
from typing import Final

from fedora_qa.record.types import Scalar
from fedora_qa.record.wording import number, with_error

Group = Mapping[str, Scalar]
Statistics = Mapping[str, Group]

_ABSENT: Final = "-"

NOTES: Final = (
    "T from the first to the last pose (or frame). D, v max and w max from least-squares quintic splines through the "
    "poses, their knots chosen by cross-validation; the excess that noise leaves is told by a parametric bootstrap and "
    "subtracted, and the error holds it. Flow, depth and brightness from every fourth column and row of every frame. "
    "Flow is its magnitude in px over the interval of its rate."
)


@dataclass(frozen=True, slots=True)
class StatsTable:
    """A table of text; the first column names the file."""

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def tables_of(by_file: Mapping[str, Statistics]) -> tuple[StatsTable, ...]:
    """Return the sequence table, the flow table, and tables of light, depth and rates, for files by path."""
    named = {_short(path, by_file): statistics for path, statistics in by_file.items()}
    tables = (_sequences(named), _flow(named), _images(named), _rates(named))
    return tuple(table for table in tables if table.rows)


def _short(path: str, by_file: Mapping[str, Statistics]) -> str:
    """Return the file's name if that distinguishes it from the others, else its path."""
    names = [PurePath(other).name for other in by_file]
    name = PurePath(path).name
    return name if names.count(name) == 1 else path


def _sequences(by_file: Mapping[str, Statistics]) -> StatsTable:
    head = ("sequence", "T [s]", "D [m]", "v max [m/s]", "w max [rad/s]", "events", "MER [M/s]", "brighter [%]")
    rows = []
    for name, statistics in by_file.items():
        sequence, motion, events = (statistics.get(group, {}) for group in ("sequence", "motion", "events"))
        rows.append(
            (
                name,
                _value(sequence, "duration_s"),
                _measured(motion, "distance", "m"),
                _measured(motion, "speed_max", "m_s"),
                _measured(motion, "angular_speed_max", "rad_s"),
                _value(events, "count"),
                # MER, the mean event rate, in 1e6 events/s.
                _value(sequence, "event_rate_mean_per_s", scale=1e-6),
                _value(events, "brighter_share", scale=100.0),
            )
        )
    return StatsTable("Sequences", head, tuple(rows))


def _flow(by_file: Mapping[str, Statistics]) -> StatsTable:
    rows = []
    for name, statistics in by_file.items():
        for group, flow in statistics.items():
            if group.startswith("flow/"):
                cells = (_value(flow, key) for key in ("mean_px", "variance_px2", "max_px"))
                rows.append((name, group.removeprefix("flow/"), *cells, _value(flow, "valid_share", scale=100.0)))
    return StatsTable(
        "Flow", ("sequence", "rate", "mean [px]", "variance [px^2]", "max [px]", "valid [%]"), tuple(rows)
    )


def _images(by_file: Mapping[str, Statistics]) -> StatsTable:
    head = ("sequence", "depth [m]", "mean depth [m]", "mean disparity [1/m]", "valid [%]", "brightness [DN]")
    rows = []
    for name, statistics in by_file.items():
        depth, rgb = statistics.get("depth", {}), statistics.get("rgb", {})
        if depth or rgb:
            spread = f"{_value(depth, 'min_m')} to {_value(depth, 'max_m')}" if depth else _ABSENT
            cells = (_value(depth, "mean_m"), _value(depth, "disparity_mean_per_m"))
            valid = _value(depth, "valid_share", scale=100.0)
            rows.append((name, spread, *cells, valid, _value(rgb, "brightness_mean_dn")))
    return StatsTable("Depth and light", head, tuple(rows))


def _rates(by_file: Mapping[str, Statistics]) -> StatsTable:
    # The union over files, as one may lack a stream that another has.
    streams = list(dict.fromkeys(key for statistics in by_file.values() for key in statistics.get("rates", {})))
    head = ("sequence", *(f"{stream.removesuffix('_hz')} [Hz]" for stream in streams))
    rows = [(name, *(_value(stats.get("rates", {}), key) for key in streams)) for name, stats in by_file.items()]
    return StatsTable("Rates", head, tuple(rows) if streams else ())


def _value(group: Group, key: str, scale: float = 1.0) -> str:
    value = group.get(key)
    return number(scale * value) if isinstance(value, int | float) else _ABSENT


def _measured(group: Group, name: str, unit: str) -> str:
    value, error = group.get(f"{name}_{unit}"), group.get(f"{name}_standard_error_{unit}")
    # Noise of the poses adds to distances and maxima (NOTES); without the error of its removal a value is not shown.
    if not isinstance(value, int | float) or not isinstance(error, int | float):
        return _ABSENT
    return with_error(value, error, "")
