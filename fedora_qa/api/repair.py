"""Repair a file from Python."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fedora_qa.api.options import AnyPath, copied_as, folder_texts, path_text, settings_of
from fedora_qa.cli.repair import repair_lines, require_writable
from fedora_qa.cli.sequences import require_one_sequence
from fedora_qa.cli.settings import check_options
from fedora_qa.engine.options import Effort
from fedora_qa.engine.progress import quiet
from fedora_qa.errors import MisuseError
from fedora_qa.judgement.materiality import Profile
from fedora_qa.record.notebook import html_lines
from fedora_qa.repairs.repair import repair as repair_file
from fedora_qa.repairs.result import Repair


@dataclass(frozen=True, slots=True, repr=False)
class RepairedFile(Repair):
    """What a repair did, or why it did nothing.

    Attributes
    ----------
    output
        The repaired file; None in a dry run. It is written where ``refusal`` is empty.
    """

    output: Path | None = None

    def __repr__(self) -> str:
        return "\n".join(repair_lines(self, self.output))

    def _repr_html_(self) -> str:
        """Return what was done as HTML for a notebook, in the sentences of the command."""
        return html_lines(repair_lines(self, self.output))


def repair(
    path: AnyPath,
    out: AnyPath | None = None,
    *,
    only: Sequence[str] = (),
    dry_run: bool = False,
    force: bool = False,
    effort: Effort | None = None,
    select: Sequence[str] | None = None,
    ignore: Sequence[str] | None = None,
    dialect: AnyPath | None = None,
    metadata: AnyPath | None = None,
    profile: Profile | None = None,
    memory: str | None = None,
    false_alarm_rate: float | None = None,
    allow_external: Sequence[AnyPath] | None = None,
    config: AnyPath | None = None,
) -> RepairedFile:
    """Write a copy of a file in which confirmed, mechanical faults are undone, as ``fedora-qa repair`` does.

    An option that is None holds as ``config`` states it, and without one as its default.

    Parameters
    ----------
    path
        An HDF5 file, or a folder that is one sequence; it is only read.
    out
        The repaired file. It is written only if it is better than the file, and may be None in a dry run.
    only
        Identifiers of the diagnoses to repair, such as ``["D1"]``, which may be only supported; empty: all that are
        confirmed.
    dry_run
        Whether to return what would be done, and write nothing.
    force
        Whether ``out`` may exist.
    effort, select, ignore, dialect, metadata, profile, memory, false_alarm_rate, allow_external, config
        How the file is checked before and after, as for ``check``.

    Returns
    -------
    RepairedFile
        What was done; ``refusal`` states why nothing is written, and is empty where the file is.

    Raises
    ------
    MisuseError
        No such file, not HDF5 at all, an output that is the file itself or exists, an unknown diagnosis, or an option
        that has an illegal value.
    """
    file, output = Path(path), None if out is None else Path(out)
    if output is None and not dry_run:
        raise MisuseError("Expected a file to write, or dry_run=True, got neither")
    if isinstance(only, str):
        raise MisuseError(f"Expected diagnoses in a list, got {only!r}; pass only=[{only!r}]")
    options = {
        "effort": effort,
        "select": select,
        "ignore": ignore,
        "dialect": path_text(dialect),
        "metadata": path_text(metadata),
        "profile": profile,
        "memory": memory,
        "false_alarm_rate": false_alarm_rate,
        "allow_external": folder_texts(allow_external),
    }
    settings = settings_of(config, options)
    require_writable(file, output, Path(config) if config else None, settings.metadata, force=force)
    engine_options = check_options(settings)
    require_one_sequence(file, engine_options.dialect)
    target = None if dry_run else output
    result = repair_file(file, target, engine_options, quiet, only=tuple(only))
    return copied_as(RepairedFile, result, output=target)
