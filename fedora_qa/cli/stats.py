"""``fedora-qa stats``: the sequence and flow tables of the paper, and tables of images and rates.

``compare`` measures files in the same way.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Final

from fedora_qa import __version__
from fedora_qa.cli.console import print_table, text
from fedora_qa.cli.documents import write_document
from fedora_qa.cli.exit_codes import CLEAN, INCOMPLETE
from fedora_qa.cli.isolated import run_isolated
from fedora_qa.cli.outputs import Outputs
from fedora_qa.cli.progress import progress_bar
from fedora_qa.cli.sequences import sequences_of
from fedora_qa.cli.settings import external_folders
from fedora_qa.comparison.tables import tables_to_latex
from fedora_qa.config import parse_bytes
from fedora_qa.engine.executors.executor import Task, opening_test
from fedora_qa.engine.tasks import FileStatistics, collect_statistics
from fedora_qa.errors import UnrecognisedError
from fedora_qa.layout.dialect import DialectChoice, load_choice
from fedora_qa.record.markdown import escape, table_section
from fedora_qa.record.tables import ABSENT, TextTable, number_cell
from fedora_qa.record.types import Scalar
from fedora_qa.record.wording import with_error
from fedora_qa.statistics.collector import Statistics

NOTES: Final = (
    "T from the first to the last pose (or frame). D, v max and w max from least-squares quintic splines through the "
    "poses, their knots chosen by cross-validation; the excess that noise leaves is estimated by a parametric "
    "bootstrap and subtracted; the error includes it. Flow, depth and brightness from every fourth column and row of "
    "every frame. Flow is its magnitude in px over the interval of its rate."
)


def run_stats(
    files: tuple[Path, ...],
    dialect: str | None,
    metadata: str | None,
    memory: str,
    allow_external: tuple[str, ...],
    outputs: Outputs,
) -> int:
    """Run the command and return its exit code."""
    reading = reading_of(dialect, metadata, memory, allow_external)
    sequences = [place for place in sequences_of(files, reading.dialect) if isinstance(place, Path)]
    outputs.require_writable(sequences)
    by_file: dict[str, Statistics] = {}
    unrecognised: list[UnrecognisedError] = []
    for number, path in enumerate(sequences):
        try:
            by_file[str(path)] = measured_file(path, reading, place=(number, len(sequences))).statistics
        except UnrecognisedError as error:
            unrecognised.append(error)
    # Of several sequences the others are measured.
    if not by_file:
        raise unrecognised[0]
    tables = tables_of(by_file)
    if outputs.json:
        tool = {"name": "fedora-qa", "version": __version__}
        measured = [{"path": path, "statistics": statistics} for path, statistics in by_file.items()]
        # NaN is no JSON: an error here is better than a document that other parsers refuse.
        write_document(outputs.json, json.dumps({"tool": tool, "files": measured}, indent=1, allow_nan=False) + "\n")
    if outputs.markdown:
        write_document(outputs.markdown, f"{tables_to_markdown(tables)}\n\n{escape(NOTES)}\n")
    if outputs.latex:
        write_document(outputs.latex, tables_to_latex(tables))
    console = outputs.console()
    for source in tables:
        print_table(console, source)
    console.print(text(NOTES, "dim"))
    for each in unrecognised:
        console.print(text(str(each), "yellow"))
    return INCOMPLETE if unrecognised else CLEAN


@dataclass(frozen=True, slots=True)
class Reading:
    """How files are read.

    Attributes
    ----------
    dialect
        How they name and scale their data; None: as it is recognised.
    memory_bytes
        Memory to aim at.
    allow_external
        Folders with other files that a file may link to.
    in_process
        Whether they are opened in this process, which ends where HDF5 crashes on one.
    """

    dialect: DialectChoice
    memory_bytes: int
    allow_external: tuple[Path, ...]
    in_process: bool = False


def reading_of(
    dialect: str | None, metadata: str | None, memory: str, allow_external: Sequence[str], *, in_process: bool = False
) -> Reading:
    """Return how files are read, by the options of a command; raises ``MisuseError`` where one is illegal."""
    folders = external_folders(tuple(allow_external))
    return Reading(load_choice(dialect, metadata), parse_bytes(memory), folders, in_process)


def measured_file(
    path: Path, reading: Reading, *, with_distributions: bool = False, place: tuple[int, int] = (0, 1)
) -> FileStatistics:
    """Measure the statistics of a file and, if asked for, its distributions; raises as ``run_isolated``.

    Parameters
    ----------
    place
        How many files were measured before, and how many there are: the progress states both.
    """
    arguments = (path, reading.dialect, reading.memory_bytes, reading.allow_external, with_distributions)
    opening = opening_test(path, reading.dialect, reading.allow_external)
    done, count = place
    with progress_bar(path.name if count == 1 else f"{path.name}, file {done + 1} of {count}") as bar:
        measured: FileStatistics = run_isolated(
            Task(collect_statistics, arguments), path, opening, bar, in_process=reading.in_process
        )
    return measured


def tables_to_markdown(tables: Iterable[TextTable]) -> str:
    """Return tables as GitHub-flavoured markdown, each under its title."""
    return "\n\n".join(map(table_section, tables))


def tables_of(by_file: Mapping[str, Statistics]) -> tuple[TextTable, ...]:
    """Return the sequence table, the flow table, and tables of light, depth and rates, for files by path."""
    # A file's name suffices where it distinguishes the file from the others; else its path.
    names = [PurePath(path).name for path in by_file]
    by_name = {
        name if names.count(name) == 1 else path: statistics
        for (path, statistics), name in zip(by_file.items(), names, strict=True)
    }
    # The union over files, as one may lack a stream that another has.
    streams = list(dict.fromkeys(key for statistics in by_name.values() for key in statistics.get("rates", {})))
    sequence_rows, flow_rows, image_rows, rate_rows = [], [], [], []
    for name, statistics in by_name.items():
        sequence, motion, events = (statistics.get(group, {}) for group in ("sequence", "motion", "events"))
        sequence_rows.append(
            (
                name,
                number_cell(sequence.get("duration_s")),
                _with_error(motion, "distance", "m"),
                _with_error(motion, "speed_max", "m_s"),
                _with_error(motion, "angular_speed_max", "rad_s"),
                number_cell(events.get("count")),
                # MER, the mean event rate, in 1e6 events/s.
                number_cell(sequence.get("event_rate_mean_per_s"), 1e-6),
                number_cell(events.get("brighter_share"), 100.0),
            )
        )
        for group, flow in statistics.items():
            if group.startswith("flow/"):
                cells = (number_cell(flow.get(key)) for key in ("mean_px", "variance_px2", "max_px"))
                valid = number_cell(flow.get("valid_share"), 100.0)
                flow_rows.append((name, group.removeprefix("flow/"), *cells, valid))
        depth, rgb = statistics.get("depth", {}), statistics.get("rgb", {})
        if depth or rgb:
            spread = f"{number_cell(depth.get('min_m'))} to {number_cell(depth.get('max_m'))}" if depth else ABSENT
            cells = (number_cell(depth.get(key)) for key in ("mean_m", "disparity_mean_per_m"))
            valid = number_cell(depth.get("valid_share"), 100.0)
            image_rows.append((name, spread, *cells, valid, number_cell(rgb.get("brightness_mean_dn"))))
        if streams:
            rate_rows.append((name, *(number_cell(statistics.get("rates", {}).get(key)) for key in streams)))
    tables = (
        TextTable(
            "Sequences",
            ("sequence", "T [s]", "D [m]", "v max [m/s]", "w max [rad/s]", "events", "MER [M/s]", "brighter [%]"),
            tuple(sequence_rows),
            words=1,
        ),
        TextTable(
            "Flow",
            ("sequence", "rate", "mean [px]", "variance [px^2]", "max [px]", "valid [%]"),
            tuple(flow_rows),
            words=1,
        ),
        TextTable(
            "Depth and light",
            ("sequence", "depth [m]", "mean depth [m]", "mean disparity [1/m]", "valid [%]", "brightness [DN]"),
            tuple(image_rows),
            words=1,
        ),
        TextTable(
            "Rates",
            ("sequence", *(f"{stream.removesuffix('_hz')} [Hz]" for stream in streams)),
            tuple(rate_rows),
            words=1,
        ),
    )
    return tuple(source for source in tables if source.rows)


def _with_error(group: Mapping[str, Scalar], name: str, unit: str) -> str:
    value, error = group.get(f"{name}_{unit}"), group.get(f"{name}_standard_error_{unit}")
    # Noise of the poses adds to distances and maxima (NOTES); without the error of its removal a value is not shown.
    if not isinstance(value, int | float) or not isinstance(error, int | float):
        return ABSENT
    return with_error(value, error, "")
