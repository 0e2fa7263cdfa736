"""Repair a file from Python."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fedora_qa.api.check import AnyPath
from fedora_qa.cli.check import check_options
from fedora_qa.cli.repair import require_writable
from fedora_qa.cli.sequences import require_hdf5
from fedora_qa.config import CheckConfig, read_config, with_options
from fedora_qa.engine.progress import quiet
from fedora_qa.errors import MisuseError
from fedora_qa.repairs.repair import repair as repair_file
from fedora_qa.repairs.result import Repair


def repair(
    path: AnyPath,
    out: AnyPath | None = None,
    *,
    only: Sequence[str] = (),
    dry_run: bool = False,
    force: bool = False,
    config: AnyPath | None = None,
    **options: Any,
) -> Repair:
    """Write a copy of a file in which confirmed, mechanical faults are undone, as ``fedora-qa repair`` does.

    Parameters
    ----------
    path
        An HDF5 file, which is only read.
    out
        The repaired file. It is written only if it is better than the file, and may be None in a dry run.
    only
        Identifiers of the diagnoses to repair, such as ``["D1"]``, which may be only supported; empty: all that are
        confirmed.
    dry_run
        Whether to return what would be done, and write nothing.
    force
        Whether ``out`` may exist.
    config
        A ``fedora-qa.toml`` whose options hold where none are given here.
    **options
        The keys of ``fedora-qa.toml``: ``effort="quick"``, ``select=["imu"]``.

    Returns
    -------
    Repair
        What was done; ``refusal`` states why nothing is written, and is empty where the file is.

    Raises
    ------
    MisuseError
        No such file, not HDF5 at all, an output that is the file itself or exists, an unknown diagnosis, or an option
        that does not exist or has an illegal value.
    """
    file, output = Path(path), None if out is None else Path(out)
    if output is None and not dry_run:
        raise MisuseError("Expected a file to write, or dry_run=True, got neither")
    require_writable(file, output, [Path(config)] if config else [], force=force)
    settings = with_options(read_config(Path(config)) if config else CheckConfig(), options)
    engine_options = check_options(settings)
    require_hdf5([file])
    return repair_file(file, None if dry_run else output, engine_options, quiet, only=tuple(only))
