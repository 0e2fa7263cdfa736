"""OpenEXR images that the package of that name writes are read, and damaged ones are refused in one sentence."""

import sys
import tempfile
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from fedora_qa.errors import MisuseError
from fedora_qa.sources.exr import exr_header
from fedora_qa.sources.images import ImageForm, image_form, images_of, read_image
from fedora_qa.sources.source import SourceError

COMPRESSIONS = (
    OpenEXR.NO_COMPRESSION,
    OpenEXR.RLE_COMPRESSION,
    OpenEXR.ZIPS_COMPRESSION,
    OpenEXR.ZIP_COMPRESSION,
    OpenEXR.PIZ_COMPRESSION,
)
"""Those that lose nothing."""


def write_exr(path: Path, channels: dict[str, np.ndarray], **header: object) -> Path:
    """Write a copy: the package replaces the values of the dictionary."""
    stated = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **header}
    with OpenEXR.File(stated, dict(channels)) as file:
        file.write(str(path))
    return path


def noise(height: int, width: int, dtype: type = np.float32, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(10, 3, (height, width)).astype(dtype)


@given(
    height=st.integers(1, 70),
    width=st.integers(1, 9),
    names=st.sampled_from([("Z",), ("R", "G", "B"), ("A", "B", "G", "R"), ("Depth.Z", "Vector.X", "Vector.Y")]),
    dtype=st.sampled_from([np.float16, np.float32, np.uint32]),
    compression=st.sampled_from(COMPRESSIONS),
)
def test_pixels_return(height: int, width: int, names: tuple[str, ...], dtype: type, compression: object) -> None:
    """Of any size, type and compression: R, G, B in this order without transparency, other channels by name."""
    channels = {name: noise(height, width, dtype, seed) for seed, name in enumerate(names)}
    read = ("R", "G", "B") if "R" in names else tuple(sorted(names))
    with tempfile.TemporaryDirectory() as folder:
        path = write_exr(Path(folder) / "0.exr", channels, compression=compression)
        form = image_form(path)
        pixels = read_image(path, form)
        assert exr_header(path).channels == read
    assert form == ImageForm((height, width) if len(read) == 1 else (height, width, len(read)), np.dtype(dtype).name)
    expected = np.stack([channels[name] for name in read], axis=-1)
    np.testing.assert_array_equal(pixels, expected[..., 0] if len(read) == 1 else expected)
    assert pixels.dtype == dtype


def test_a_folder_is_rows(tmp_path: Path) -> None:
    """In the order of their numbers; only the header of the first is read to list them."""
    for number in (10, 9):
        write_exr(tmp_path / f"depth{number}.exr", {"Z": np.full((2, 3), number, np.float32)})
    rows = images_of(tmp_path, [path.name for path in tmp_path.iterdir()])
    assert (rows.shape, rows.dtype) == ((2, 2, 3), np.float32)
    assert rows.rows(0, 2)[:, 0, 0].tolist() == [9, 10]


def test_every_cut_is_refused(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Wherever a file is cut off; and the package, which prints, does not get to see it."""
    content = write_exr(tmp_path / "whole.exr", {"Z": noise(40, 7)}).read_bytes()
    form, path = image_form(tmp_path / "whole.exr"), tmp_path / "cut.exr"
    for length in range(4, len(content)):
        path.write_bytes(content[:length])
        with pytest.raises(SourceError, match=r"^Expected .*cut\.exr.*, got .*cut off$"):
            read_image(path, form)
    assert "".join(capfd.readouterr()) == ""


@given(place=st.integers(4, 10**6), value=st.integers(0, 255))
@example(place=1667, value=117)  # the highest byte of the offset of a block
def test_changed_bytes_give_pixels_or_one_sentence(place: int, value: int) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = write_exr(Path(folder) / "0.exr", {"Z": noise(40, 7)})
        form, content = image_form(path), bytearray(path.read_bytes())
        content[place % (len(content) - 4) + 4] = value
        path.write_bytes(content)
        refusal = ""
        try:
            pixels = read_image(path, form)
        except SourceError as error:
            refusal = str(error)
        assert refusal.startswith("Expected ") or pixels.shape == form.shape


def test_forms_that_are_not_read(tmp_path: Path) -> None:
    """Tiles, a region of the image, and channels of several types."""
    tiles = OpenEXR.TileDescription()
    tiled = {"type": OpenEXR.tiledimage, "tiles": tiles}
    region = {"displayWindow": ((0, 0), (19, 9))}
    for header, channels, part in (
        (tiled, {"Z": noise(4, 5)}, "got tiles; convert it"),
        (region, {"Z": noise(4, 5)}, "got those of a part; render it without a region"),
        ({}, {"Z": noise(4, 5), "id": np.ones((4, 5), np.uint32)}, "got float32, uint32"),
    ):
        with pytest.raises(SourceError, match=part):
            image_form(write_exr(tmp_path / "0.exr", channels, **header))


def test_other_sizes_are_refused(tmp_path: Path) -> None:
    path = write_exr(tmp_path / "0.exr", {"Z": noise(4, 5)})
    with pytest.raises(SourceError, match=r"Expected 0\.exr of 5 x 5 pixels, 32-bit grey, got 5 x 4 pixels"):
        read_image(path, ImageForm((5, 5), "float32"))


def test_without_the_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The sentence names the extra."""
    path = write_exr(tmp_path / "0.exr", {"Z": noise(4, 5)})
    monkeypatch.setattr(sys, "path", [])
    monkeypatch.delitem(sys.modules, "OpenEXR")
    with pytest.raises(MisuseError, match=r"pip install 'fedora-qa\[exr\]'"):
        image_form(path)
