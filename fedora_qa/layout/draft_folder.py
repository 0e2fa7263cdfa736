"""Draft a dialect for a folder."""

from pathlib import Path


def draft_folder(folder: Path, name: str) -> str:
    """Return the text of a dialect for a folder."""
    raise NotImplementedError(folder, name)
