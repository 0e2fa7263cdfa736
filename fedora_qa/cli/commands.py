"""Arguments and help of the commands whose work loads much; each imports its work when it runs.

The work of a command is in the file of its name; that of ``report`` in ``summary``, of ``verify`` in ``gate``.
"""

from typing import Any, Final

import click

from fedora_qa.cli.options import (
    PATH,
    BudgetParam,
    PlaceParam,
    ResolutionParam,
    allow_external_option,
    complete_dialect,
    config_option,
    detail_options,
    dialect_option,
    ignore_option,
    memory_option,
    metadata_option,
    output_options,
    record_options,
    select_option,
    table_options,
)
from fedora_qa.cli.startup import loading_modules

_EFFORTS: Final = click.Choice(["quick", "standard", "full", "exhaustive"])

_PROFILES: Final = click.Choice(["release", "training", "strict"])

_dask_option: Final = click.option(
    "--dask", metavar="ADDRESS", help="Do the work on a Dask cluster, such as tcp://host:8786."
)

_force_option: Final = click.option("--force", is_flag=True, help="Write over OUT where it exists.")

COMPARISON_FALSE_ALARM_RATE: Final = 0.01
"""Of a whole comparison: one in a hundred reports a difference where there is none."""

LONGEST_PIECE_S: Final = 20.0
"""Default length of the longest piece that ``extract`` tries, s: its file is still small enough to be sent."""


@click.command()
@click.argument("files", nargs=-1, required=True, type=PlaceParam())
@click.option("--effort", type=_EFFORTS, help="How much to look at; full unless configured otherwise.")
@click.option(
    "--budget",
    type=BudgetParam(),
    metavar="TIME",
    help="Look at as much as fits into a time such as 60s, 5m or 0.5h, in place of an effort.",
)
@select_option
@ignore_option
@config_option
@dialect_option
@metadata_option
@click.option(
    "--profile",
    type=_PROFILES,
    help="From which size a deviation matters: to publish the data (default), to train on them, or any size.",
)
@click.option("--fail-on", type=click.Choice(["failed", "warned"]), help="From which outcome on to exit with 1.")
@click.option(
    "--memory",
    metavar="AMOUNT",
    help="Memory to aim at, of all processes together; a peak may exceed it.  [default: 700MB a job, and 1GB at least]",
)
@click.option(
    "--jobs",
    type=click.IntRange(min=1),
    help="Files, and windows of a file, checked at once; they share the memory.  [default: as many as cores]",
)
@_dask_option
@click.option(
    "--resume",
    type=PATH,
    metavar="DIR",
    help="Keep the result of each file in DIR, and check only files without one. Made where it is missing.",
)
@click.option(
    "--canary",
    is_flag=True,
    default=None,
    help="Plant a fault for each check, in memory: a check that does not detect its own is reported as crashed.",
)
@allow_external_option
@detail_options
@record_options
def check(**arguments: Any) -> int:
    """Check FILES, or folders of them: recompute what must hold between their streams, and report what does not.

    Exit codes: 0 clean; 1 findings at or above --fail-on; 2 misuse; 3 incomplete. With several, 2 before 3 before 1.
    """
    with loading_modules():
        from fedora_qa.cli.check import run_check  # noqa: PLC0415 - loads what measures

    return run_check(**arguments)


@click.command()
@click.argument("corpora", nargs=-1, required=True, type=PATH, metavar="CORPUS...")
@click.option("--effort", type=_EFFORTS, help="How much to look at.")
@select_option
@ignore_option
@config_option
@click.option("--jobs", type=click.IntRange(min=1), help="Files checked at once.  [default: as many as cores]")
@click.option(
    "--state", type=PATH, metavar="DIR", help="Where to keep results of files.  [default: beside each CORPUS]"
)
@table_options("json", "html", "markdown")
@click.option("--svg", "svg_path", type=PATH, metavar="OUT", help="Draw the curves, for documents.")
@click.option("--publish", type=PATH, metavar="OUT", help="Write the detection power of each check, for the package.")
@click.option(
    "--publish-confidence", type=PATH, metavar="OUT", help="Write how often diagnoses are right, for the package."
)
def power(**arguments: Any) -> int:
    """Check every file of each CORPUS, whose manifest.json lists the planted faults, and tabulate what was found.

    Run again after an interrupt, it continues. Exit codes: 0 measured; 2 misuse; 3 a check crashed.
    """
    with loading_modules():
        from fedora_qa.cli.power import run_power  # noqa: PLC0415 - loads what measures

    return run_power(**arguments)


@click.command()
@click.argument("folder", metavar="DIR", type=PlaceParam())
@click.option("--policy", "policy_path", required=True, type=PATH, metavar="POLICY.toml", help="What must hold.")
@click.option(
    "--baseline", "baseline_path", type=PATH, metavar="RECORD", help="Accept the findings of an earlier gate's record."
)
@click.option(
    "--jobs",
    type=click.IntRange(min=1),
    help="Files, and windows of a file, checked at once.  [default: as many as cores]",
)
@_dask_option
@click.option("--certificate", type=PATH, metavar="OUT", help="Certify what was checked, where the release is clean.")
@allow_external_option
@detail_options
@record_options
def gate(**arguments: Any) -> int:
    """Check every sequence in DIR, and DIR as a whole, as a policy demands; DIR may be a prefix, s3://bucket/prefix/.

    The record holds the sequences and, last, the release itself. Exit codes: 0 clean; 1 findings; 2 misuse; 3
    incomplete.
    """
    with loading_modules():
        from fedora_qa.cli.gate import run_gate  # noqa: PLC0415 - loads what measures

    return run_gate(**arguments)


@click.command()
@click.argument("certificate_path", metavar="CERTIFICATE", type=PATH)
@click.argument("folder", metavar="DIR", type=PATH)
def verify(**arguments: Any) -> int:
    """Compare every byte of DIR with CERTIFICATE, which `gate --certificate` wrote.

    Exit codes: 0 the same; 1 something was changed, added or removed, or a waiver has expired; 2 misuse.
    """
    with loading_modules():
        from fedora_qa.cli.gate import run_verify  # noqa: PLC0415 - loads what measures

    return run_verify(**arguments)


@click.command()
@click.argument("files", nargs=-1, required=True, type=PATH)
@dialect_option
@metadata_option
@memory_option
@allow_external_option
@table_options("json", "markdown", "latex")
def stats(**arguments: Any) -> int:
    """Print statistics of FILES or folders: duration, distance, greatest speeds, event rate, flow, depth, light."""
    with loading_modules():
        from fedora_qa.cli.stats import run_stats  # noqa: PLC0415 - loads what measures

    return run_stats(**arguments)


@click.command()
@click.argument("paths", nargs=-1, required=True, type=PATH, metavar="A B...")
@click.option(
    "--as",
    "design",
    type=click.Choice(["versions", "sequences", "datasets"]),
    help="How to compare them; versions where files have the same names, else sequences or datasets.",
)
@click.option(
    "--false-alarm-rate",
    type=click.FloatRange(0, 1, min_open=True, max_open=True),
    default=COMPARISON_FALSE_ALARM_RATE,
    show_default=True,
    help="Probability that the comparison reports any difference where there is none.",
)
@dialect_option
@metadata_option
@memory_option
@allow_external_option
@table_options("json", "html", "markdown", "latex")
def compare(**arguments: Any) -> int:
    """Compare B and the others with A: sequences, folders of them, or records that `check --json` wrote.

    Files are measured; records are read, with the arrays beside them, and their findings compared. Exit codes: 0
    compared, whatever the result; 2 misuse.
    """
    with loading_modules():
        from fedora_qa.cli.compare import run_compare  # noqa: PLC0415 - loads what measures

    return run_compare(**arguments)


@click.command()
@click.argument("predictions", type=PATH)
@click.argument("sequence", type=PATH)
@click.option(
    "--format",
    "form",
    type=click.Choice(["canonical", "dsec"]),
    help="canonical: an HDF5 file; dsec: a folder of PNG images of flow. By what lies there where absent.",
)
@dialect_option
@metadata_option
@allow_external_option
@table_options("json", "html", "markdown", has_format=False)
def score(**arguments: Any) -> int:
    """Score PREDICTIONS of flow, depth and pose against the truth of SEQUENCE, a file or folder.

    PREDICTIONS lie in an HDF5 file at the keys of the format, with timestamps of the sequence: path/flow/10hz in px,
    path/depth in mm, path/pose. NaN is a missing prediction. Flow may be a folder of PNG images, as DSEC has it.
    --dialect and --metadata are of SEQUENCE. Exit codes: 0 scored, whatever the result; 2 misuse, also predictions that
    do not fit the sequence; 1 and 3 as of check, where SEQUENCE cannot be read.
    """
    with loading_modules():
        from fedora_qa.cli.score import run_score  # noqa: PLC0415 - loads what measures

    return run_score(**arguments)


@click.command()
@click.argument("file", type=PATH)
@click.argument("finding")
@click.option("-o", "--output", required=True, type=PATH, metavar="OUT", help="The small file.")
@click.option(
    "--record", "record_path", type=PATH, metavar="RECORD", help="Where FINDING stands; else FILE is checked."
)
@click.option(
    "--longest",
    "longest_s",
    type=click.FloatRange(min=0, min_open=True),
    default=LONGEST_PIECE_S,
    show_default=True,
    metavar="SECONDS",
    help="The longest piece to try.",
)
@click.option("--effort", type=_EFFORTS, help="As `check` had it.")
@click.option("--config", type=PATH, help="As `check` had it.")
@click.option("--dialect", metavar="NAME|FILE.toml", shell_complete=complete_dialect, help="As `check` had it.")
@click.option("--metadata", metavar="FILE.toml", help="As `check` had it.")
@allow_external_option
@_force_option
def extract(**arguments: Any) -> int:
    """Write the part of FILE around the place of FINDING, such as F1, and check that it still shows the finding.

    FILE may be a folder that is a sequence. Pieces are tried from short to long. Exit codes: 0 written, and the finding
    is in it; 2 misuse; 3 written, and the finding is not in it.
    """
    with loading_modules():
        from fedora_qa.cli.extract import run_extract  # noqa: PLC0415 - loads what measures

    return run_extract(**arguments)


@click.command()
@click.argument("file", type=PlaceParam())
@click.option("-o", "--output", type=PATH, metavar="OUT", help="The repaired file.")
@click.option("--dry-run", is_flag=True, help="Print what would be done, and write nothing.")
@click.option(
    "--only",
    multiple=True,
    metavar="D1,D2",
    help="Repair these diagnoses, which may be only supported. May be repeated.",
)
@click.option("--effort", type=_EFFORTS, help="As `check` has it.")
@select_option
@ignore_option
@config_option
@dialect_option
@metadata_option
@click.option("--profile", type=_PROFILES, help="As `check` has it.")
@click.option("--memory", metavar="AMOUNT", help="Memory to aim at, such as 1GB.")
@_force_option
def repair(**arguments: Any) -> int:
    """Check FILE, undo what is confirmed and mechanical in a copy, check the copy, and keep it if it is better.

    Of a folder that is a sequence, the copy is one canonical file.

    Exit codes: 0 written, or with --dry-run there is something to repair; 1 nothing is confirmed, or the copy is not
    better, and nothing is left behind; 2 misuse.
    """
    with loading_modules():
        from fedora_qa.cli.repair import run_repair  # noqa: PLC0415 - loads what measures

    return run_repair(**arguments)


@click.command("import")
@click.argument("source", type=PATH)
@click.option("-o", "--output", type=PATH, required=True, metavar="OUT.h5", help="The canonical file.")
@click.option(
    "--resolution", type=ResolutionParam(), metavar="WxH", help="Size of the event camera, where SOURCE lacks it."
)
@click.option(
    "--topics", type=PATH, metavar="FILE.toml", help="Which topic of a bag holds which stream, in a table [topics]."
)
@click.option("--kind", type=click.Choice(["recorded", "synthetic"]), help="Whether sensors made SOURCE.")
@click.option("--allow-backwards", is_flag=True, help="Write timestamps that decrease as they are.")
@click.option(
    "--compression",
    type=click.IntRange(1, 9),
    default=2,
    show_default=True,
    metavar="LEVEL",
    help="Of Zstandard: 1 is the fastest, 9 makes the smallest file.",
)
@click.option("--force", is_flag=True, help="Write over OUT.h5 where it exists.")
def import_(**arguments: Any) -> int:
    """Write a canonical file from SOURCE, a recording in a format of event cameras.

    SOURCE is a Prophesee recording (EVT2, EVT3 or DAT), AEDAT 4.0, or a bag of ROS 1 or ROS 2. It is only read, in
    blocks. OUT.h5 gets its name when it is complete.

    Exit codes: 0 written; 2 SOURCE cannot be read, or OUT.h5 not be written, and nothing is left behind.
    """
    with loading_modules():
        from fedora_qa.cli.import_ import run_import  # noqa: PLC0415 - loads what measures

    return run_import(**arguments)


@click.command("export")
@click.argument("source", type=PATH)
@click.argument("output", type=PATH)
@click.option(
    "--to",
    "form",
    type=click.Choice(["fedora", "tum", "dsec", "rerun"]),
    required=True,
    help="fedora: one canonical file; tum: a text of poses; dsec: a folder; rerun: a recording for that viewer.",
)
@click.option("--record", "record_path", type=PATH, help="rerun: the record of a check, whose findings are shown too.")
@dialect_option
@metadata_option
def export(**arguments: Any) -> int:
    """Write SOURCE, a file or folder, in another layout to OUTPUT.

    fedora writes all of it as one HDF5 file, which is read without a dialect. tum writes the poses of the body in the
    world. dsec writes events, images, flow of 10 Hz, and the calibration of pinhole cameras; depth, IMU, poses and
    other flow have no place there. rerun writes all streams and the findings of --record on one timeline, for looking
    at them (pip install 'fedora-qa[rerun]'). OUTPUT gets its name when it is complete.

    Exit codes: 0 written; 2 SOURCE cannot be read, or OUTPUT not be written, and nothing is left behind.
    """
    with loading_modules():
        from fedora_qa.cli.export import run_export  # noqa: PLC0415 - loads what measures

    return run_export(**arguments)


@click.command()
@click.argument("record_path", metavar="RECORD", type=PATH)
@detail_options
@output_options
def report(**arguments: Any) -> int:
    """Show RECORD, which `check --json` wrote, as check showed it. The exit code is 0, whatever the verdict.

    Pictures come from RECORD.arrays.npz beside it; without that file the report is drawn without pictures.
    """
    with loading_modules():
        from fedora_qa.cli.summary import run_report  # noqa: PLC0415 - loads what measures

    return run_report(**arguments)


@click.command()
@click.argument("file", type=PATH)
@dialect_option
@metadata_option
@click.option("--draft-dialect", "draft_path", type=PATH, metavar="OUT", help="Write a first dialect for the file.")
@allow_external_option
def layout(**arguments: Any) -> int:
    """Describe where FILE, or a folder, keeps each stream, what is absent and why, and what was inferred."""
    with loading_modules():
        from fedora_qa.cli.layout import run_layout  # noqa: PLC0415 - loads what measures

    return run_layout(**arguments)
