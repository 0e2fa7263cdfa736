"""Facts of the machine: for the record's run, and for ``doctor``."""

import os
import platform
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from typing import Final

from fedora_qa.record.types import Scalar

PACKAGES: Final = (
    "numpy",
    "scipy",
    "h5py",
    "hdf5plugin",
    "numcodecs",
    "opencv-contrib-python-headless",
    "numba",
    "pydantic",
    "click",
    "rich",
)
"""Distributions that results may depend on."""


def host_facts() -> Mapping[str, Scalar]:
    """Return facts of the machine that may explain why two runs differ."""
    return {
        "system": platform.system(),
        "machine": platform.machine(),
        "python": platform.python_version(),
        "cores": usable_cores(),
        "memory_mib": memory_mib(),
        **{name: package_version(name) for name in PACKAGES},
    }


def package_version(name: str) -> str | None:
    """Return the version of an installed distribution; None where it is not installed."""
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def usable_cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        # A container or batch system may grant fewer cores than the machine has; `cpu_count` counts all of them.
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def memory_mib() -> int | None:
    """Return the machine's memory, MiB; None where the system does not state it."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") >> 20
    except (ValueError, OSError):
        return None
