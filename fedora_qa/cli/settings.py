"""The configuration of a command, and the options of the engine that follow from it."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fedora_qa.config import CheckConfig, read_config
from fedora_qa.engine.options import CheckOptions
from fedora_qa.errors import MisuseError

if TYPE_CHECKING:  # the process that distributes the work loads no measuring code
    from fedora_qa.layout.dialect import DialectChoice


def settings_from(config: Path | None, overrides: dict[str, Any]) -> CheckConfig:
    """Return the configuration with the options of the command line in its place."""
    settings = read_config(config) if config else CheckConfig()
    # An option that was not given must not override the file; click states that by None, or () if it may be repeated.
    return replace(settings, **{name: value for name, value in overrides.items() if value not in {None, ()}})


def check_options(settings: CheckConfig) -> CheckOptions:
    """Return the engine's options; raises ``MisuseError`` for a check, dialect or amount that does not exist."""
    if settings.required_coverage or settings.select or settings.ignore:
        # Raises ``MisuseError`` where a name matches no check, or no check is left to run.
        from fedora_qa.engine.run import select_checks  # noqa: PLC0415 - loads every check

        # The same names as in `select` are legal here; one that is misspelt would otherwise require nothing.
        select_checks(tuple(settings.required_coverage), ())
        if not select_checks(settings.select, settings.ignore):
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
