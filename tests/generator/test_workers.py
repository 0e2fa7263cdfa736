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

from fedora_generator.choices import SCENE_NAMES
from fedora_generator.cli import main
from fedora_generator.scene import load_scene
from fedora_generator.threads import thread_count
from tests.support.identical import identical

EXACT = [name for name in SCENE_NAMES if load_scene(name).renderer == "exact"]

PROGRAM = """
import sys
from fedora_generator.threads import thread_count
from tests.generator.test_workers import make

make(*sys.argv[1:])
print(thread_count())
"""


def make(folder: str) -> None:
    """Make every exact scene by the command."""
    for scene in EXACT:
        tiny = ["--size", "72x54", "--duration", "0.06", "--quality", "draft"]
        sys.argv = ["fedora-generate", "sequence", scene, "-o", f"{folder}/{scene}.h5", *tiny]
        main()


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Every exact scene, made by one worker in this process and by two in another."""
    one, two = (tmp_path_factory.mktemp(f"workers-{workers}") for workers in (1, 2))
    assert thread_count() == 1
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", [])
        make(str(one))
    environment = os.environ | {"NUMBA_NUM_THREADS": "2", "OMP_NUM_THREADS": "2"}
    command = [sys.executable, "-c", PROGRAM, str(two)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "2"
    return one, two


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
