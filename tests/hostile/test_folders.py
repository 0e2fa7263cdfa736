"""Whatever is in the files of a folder: a finding or one sentence, and no crash."""

import random
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from fedora_qa.errors import MisuseError
from tests.support.dsec_folder import write_dsec_folder
from tests.support.handmade import write_handmade

OPTIONS = CheckOptions(select=("integrity", "clocks", "metadata", "flow_geometry"), evidence=None)
TEXTS = (
    "nan\n" * 3,
    "1e400 5\n",
    "-1\n-2\n",
    "[]",
    "{}",
    "a: b\n",
    "1\n2 3\n",
    "9" * 30 + "\n",
    "\0",
    "inf\n",
    "1,,2\n",
)


def flip_bytes(path: Path, draw: random.Random) -> None:
    content = bytearray(path.read_bytes())
    for _ in range(draw.choice([1, 5])):
        content[draw.randrange(len(content))] ^= draw.randrange(1, 256)
    path.write_bytes(bytes(content))


def cut_off(path: Path, draw: random.Random) -> None:
    content = path.read_bytes()
    path.write_bytes(content[: draw.randrange(len(content))])


def empty(path: Path, _: random.Random) -> None:
    path.write_bytes(b"")


def remove(path: Path, _: random.Random) -> None:
    path.unlink()


def write_text(path: Path, draw: random.Random) -> None:
    path.write_text(draw.choice(TEXTS))


def make_folder(path: Path, _: random.Random) -> None:
    path.unlink()
    path.mkdir()


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("folders")
    return write_dsec_folder(write_handmade(root / "source.h5"), root / "clean")


@pytest.mark.parametrize(
    ("suffix", "attack"),
    [
        (suffix, attack)
        for suffix in (".png", ".txt", ".yaml", ".h5")
        for attack in (flip_bytes, cut_off, empty, remove, write_text, make_folder)
        if (suffix, attack) != (".h5", flip_bytes)
    ],
)
def test_no_file_of_a_folder_can_crash_a_check(
    suffix: str, attack: Callable[[Path, random.Random], None], clean: Path, tmp_path: Path
) -> None:
    """Bytes in HDF5 have their own tests; here it is cut off, emptied, removed or replaced."""
    for seed in range(3):
        draw = random.Random(seed)
        folder = Path(shutil.copytree(clean, tmp_path / str(seed)))
        victims = [path for path in sorted(folder.rglob(f"*{suffix}")) if path.name != "rectify_map.h5"]
        victim = draw.choice(victims)
        attack(victim, draw)
        try:
            record = check_file(folder, OPTIONS).record
        except MisuseError:
            assert suffix == ".h5"  # the role without which no folder fits
            continue
        assert [result.traceback for result in record.results if result.outcome == "crashed"] == []
        if attack in {cut_off, empty, make_folder} or (attack is flip_bytes and suffix == ".png"):
            assert record.verdict != "clean", victim
