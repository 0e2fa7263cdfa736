"""The same seed gives the same file with one worker and with two."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import h5py
import hdf5plugin  # noqa: F401  registers the codec
import numpy as np
import pytest

from fedora_generator.scene import list_scenes
from tests.support.identical import identical

EXACT = [scene.name for scene in list_scenes() if scene.renderer == "exact"]

PROGRAM = """
import sys
import numba
from fedora_generator.cli import main

folder, *scenes = sys.argv[1:]
for scene in scenes:
    tiny = ["--size", "72x54", "--duration", "0.06", "--quality", "draft"]
    sys.argv = ["fedora-generate", "sequence", scene, "-o", f"{folder}/{scene}.h5", *tiny]
    main()
print(numba.get_num_threads())
"""


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Every exact scene, made by one worker and by two."""
    made = []
    for workers in (1, 2):
        folder = tmp_path_factory.mktemp(f"workers-{workers}")
        environment = os.environ | {"NUMBA_NUM_THREADS": str(workers), "OMP_NUM_THREADS": str(workers)}
        command = [sys.executable, "-c", PROGRAM, str(folder), *EXACT]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        assert done.stdout.strip() == str(workers)
        made.append(folder)
    return made[0], made[1]


def content(path: Path) -> dict[str, Any]:
    """Every dataset and every attribute of a file, by name."""
    found: dict[str, Any] = {}

    def visit(name: str, node: h5py.HLObject) -> None:
        found.update({f"{name}@{key}": np.asarray(value) for key, value in node.attrs.items()})
        if isinstance(node, h5py.Dataset):
            found[name] = node[...]

    with h5py.File(path) as file:
        visit("", file)
        file.visititems(visit)
    return found


@pytest.mark.parametrize("name", EXACT)
def test_two_workers_make_what_one_makes(folders: tuple[Path, Path], name: str) -> None:
    """Every dataset and attribute, bit for bit; the bytes of the file too."""
    one, two = (folder / f"{name}.h5" for folder in folders)
    of_one, of_two = content(one), content(two)
    assert {"path/rgb", "path/events/t", "metadata/imu@gravity", "@seed"} <= of_one.keys()
    assert identical(of_one, of_two), [key for key in of_one if not identical(of_one[key], of_two.get(key))]
    assert one.read_bytes() == two.read_bytes()
