"""The configuration of a command, what the machine adds to it, and the options of the engine that follow from it."""

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from fedora_qa.check_names import require_check_names, selected_explanations
from fedora_qa.cli.host import memory_mib, usable_cores
from fedora_qa.cli.startup import IN_PROCESS_VARIABLE
from fedora_qa.config import JOB_MEMORY_BYTES, LEAST_JOB_MEMORY_BYTES, CheckConfig, read_config
from fedora_qa.engine.options import CheckOptions
from fedora_qa.errors import MisuseError
from fedora_qa.storage.folder import local_version
from fedora_qa.storage.place import Place

if TYPE_CHECKING:  # the process that distributes the work loads no measuring code
    from fedora_qa.layout.dialect import DialectChoice

_JOB_FILE_BYTES: Final = 64_000_000
"""Bytes of files that occupy another job: each surveys a file and loads compiled loops for itself (docs/jobs.md)."""


def settings_from(config: Path | None, overrides: dict[str, Any]) -> CheckConfig:
    """Return the configuration with the options of the command line in its place."""
    settings = read_config(config) if config else CheckConfig()
    # An option that was not given must not override the file; click states that by None, or () if it may be repeated.
    return replace(settings, **{name: value for name, value in overrides.items() if value not in {None, ()}})


def with_jobs(settings: CheckConfig, files: Sequence[Place]) -> CheckConfig:
    """Return the configuration with a number of jobs: where none is stated, as many as the machine and files occupy.

    That is the number of usable cores, as far as the stated memory, or else half of the machine's, has room for each;
    and of local files one job a file, and one more for each 64 MB.
    """
    if settings.jobs is not None:
        return settings
    # One job can do all in the process of the command; several cannot.
    if os.environ.get(IN_PROCESS_VARIABLE):
        return replace(settings, jobs=1)
    jobs = usable_cores()
    machine_mib = memory_mib()
    if settings.memory is not None:
        jobs = min(jobs, settings.memory_bytes // LEAST_JOB_MEMORY_BYTES)
    elif machine_mib is not None:
        jobs = min(jobs, (machine_mib << 19) // JOB_MEMORY_BYTES)
    sizes = [local_version(file).size for file in files if isinstance(file, Path)]
    # A far server is read faster by several jobs, whatever the size: each waits for its own requests.
    if len(sizes) == len(files):
        jobs = min(jobs, len(sizes) + sum(sizes) // _JOB_FILE_BYTES)
    return replace(settings, jobs=max(1, jobs))


def check_options(settings: CheckConfig) -> CheckOptions:
    """Return the engine's options; raises ``MisuseError`` for a check, dialect or amount that does not exist."""
    # The same names as in `select` are legal in `required_coverage`; a misspelt one would otherwise require nothing.
    require_check_names([*settings.required_coverage, *settings.select, *settings.ignore])
    if not selected_explanations(settings.select, settings.ignore):
        raise MisuseError(
            "Expected at least one check to run, got a selection that leaves none; see `fedora-qa checks`"
        )
    return CheckOptions(
        effort=settings.effort,
        select=settings.select,
        ignore=settings.ignore,
        dialect=dialect_choice(settings.dialect, settings.metadata),
        memory_bytes=settings.memory_bytes,
        false_alarm_rate=settings.false_alarm_rate,
        profile=settings.profile,
        canary=settings.canary,
        allow_external=external_folders(settings.allow_external),
    )


def dialect_choice(dialect: str | None, metadata: str | None) -> "DialectChoice":
    """Return how sequences are read, by the names of a dialect and of a file of metadata; raises ``MisuseError``."""
    if not dialect and not metadata:
        return None
    from fedora_qa.layout.dialect import load_choice  # noqa: PLC0415 - loads HDF5

    return load_choice(dialect, metadata)


def external_folders(names: tuple[str, ...]) -> tuple[Path, ...]:
    """Return folders in which other files may be read; raises ``MisuseError`` where one does not exist."""
    # Absolute, because workers may have another working directory.
    folders = tuple(Path(name).absolute() for name in names)
    for folder in folders:
        if not folder.is_dir():
            raise MisuseError(f"Expected a folder in which other files may be read, got {folder}")
    return folders
