"""Attacks by what leads where: links, cycles, depth, numbers of objects. Each edits an open copy of a small file."""

import h5py
import numpy as np

from tests.hostile.storage import replace


def external_storage(file: h5py.File) -> None:
    """Stamps of depth whose bytes are those of another file."""
    replace(file, "path/depth_ts", shape=(6,), dtype="i8", external=[("/etc/hostname", 0, 48)])


def virtual(file: h5py.File) -> None:
    """Stamps of depth that are those of another file."""
    layout = h5py.VirtualLayout(shape=(6,), dtype="i8")
    layout[:] = h5py.VirtualSource("/etc/other.h5", "secret", shape=(6,))
    del file["path/depth_ts"]
    file.create_virtual_dataset("path/depth_ts", layout)


def external_link(file: h5py.File) -> None:
    """The depth frames lie elsewhere."""
    del file["path/depth"]
    file["path/depth"] = h5py.ExternalLink("/etc/hostname", "/x")


def external_metadata(file: h5py.File) -> None:
    """What the cameras are is said elsewhere."""
    del file["metadata/cameras"]
    file["metadata/cameras"] = h5py.ExternalLink("/etc/hostname", "/x")


def soft_link_loops(file: h5py.File) -> None:
    """Links that lead to each other."""
    del file["path/depth"]
    file["path/depth"] = h5py.SoftLink("/path/other/depth")
    file["path/other"] = h5py.SoftLink("/path/another")
    file["path/another"] = h5py.SoftLink("/path/other")


def soft_links_without_end(file: h5py.File) -> None:
    """Each link leads through the next twice: forty of them, a million million ways."""
    for number in range(40):
        file[f"l{number}"] = h5py.SoftLink(f"/l{number + 1}/l{number + 1}")
    del file["path/depth"]
    file["path/depth"] = h5py.SoftLink("/l0/l0")


def soft_link_of_thousands_of_steps(file: h5py.File) -> None:
    """A link through one group, five thousand times."""
    top = file.create_group("top")
    top["self"] = top
    top["x"] = np.arange(3)
    del file["path/depth"]
    file["path/depth"] = h5py.SoftLink("/top/" + "self/" * 5000 + "x")


def hard_link_cycle(file: h5py.File) -> None:
    """A group within itself, and in a sister that holds it."""
    file["path/again"] = file["path"]
    file["path/events/up"] = file["/"]
    file["metadata/path"] = file["path"]


def deep_groups(file: h5py.File, levels: int = 10_000) -> None:
    """Groups within groups, ten thousand deep, and a dataset at the bottom."""
    here = file.id
    for _ in range(levels):
        here = h5py.h5g.create(here, b"g")
    h5py.Group(here)["deep"] = np.arange(3)


def many_datasets(file: h5py.File, count: int = 30_000) -> None:
    """Scalars without number."""
    group = file.create_group("many")
    space, kind = h5py.h5s.create(h5py.h5s.SCALAR), h5py.h5t.NATIVE_INT8
    for number in range(count):
        h5py.h5d.create(group.id, b"%d" % number, kind, space)


def named_type_for_a_stream(file: h5py.File) -> None:
    """A type lies where depth should."""
    del file["path/depth"]
    file["path/depth"] = np.dtype("f4")


def group_for_a_dataset(file: h5py.File) -> None:
    """Groups lie where stamps should."""
    del file["path/depth_ts"]
    file.create_group("path/depth_ts")


def dataset_for_a_group(file: h5py.File) -> None:
    """Numbers lie where groups should."""
    del file["metadata/cameras"], file["path/events"]
    file["metadata/cameras"] = np.arange(3)
    file["path/events"] = np.arange(3)
