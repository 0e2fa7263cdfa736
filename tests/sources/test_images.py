"""Folders of images are rows in the order of their numbers."""

import struct
import time
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from fedora_qa.sources import images
from fedora_qa.sources.images import (
    ImageForm,
    image_form,
    images_of,
    in_order,
    left_out,
    number_in,
    numbers_of,
    read_image,
)
from fedora_qa.sources.source import SourceError
from tests.support.dsec_folder import write_png


def names_in(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir()]


def test_rows_follow_the_numbers(tmp_path: Path) -> None:
    """Image 10 comes after image 9, with and without leading zeros."""
    for number in (10, 9, 2):
        write_png(tmp_path / f"frame{number}.png", np.full((2, 3), number, np.uint8))
    images = images_of(tmp_path, names_in(tmp_path))
    assert images.shape == (3, 2, 3)
    assert images.rows(0, 3)[:, 0, 0].tolist() == [2, 9, 10]
    assert images.rows(1, 2)[:, 0, 0].tolist() == [9]


@given(st.lists(st.integers(0, 10**6), min_size=1, max_size=30, unique=True))
def test_order_is_that_of_the_numbers(numbers: list[int]) -> None:
    """Whatever the order of the listing."""
    names = [f"{number}.png" for number in numbers]
    read = numbers_of(Path(), names)
    assert read is not None
    assert read.rows(0, len(numbers)).tolist() == sorted(numbers)
    assert in_order(names) == [f"{number}.png" for number in sorted(numbers)]


def test_times_in_names(tmp_path: Path) -> None:
    """A name may state seconds with decimals; a name without a number states none."""
    assert float(number_in("1504645177.25.png") or 0) == 1504645177.25
    assert number_in("left.png") is None
    read = numbers_of(Path(), ["1.5.png", "1.25.png"])
    assert read is not None
    assert read.rows(0, 2).tolist() == [1.25, 1.5]
    assert numbers_of(Path(), ["a1.png", "b1.png"]) is None
    assert in_order(["b.png", "a.png"]) == ["a.png", "b.png"]


@pytest.mark.parametrize(
    ("numbers", "missing"),
    [([0, 1, 2], None), ([0, 2, 4], None), ([0, 1, 3, 4], 2), ([0, 2, 4, 8], 6), ([5], None), ([0.5, 1.0, 2.0], None)],
)
def test_gaps(numbers: list[float], missing: int | None) -> None:
    """Equal steps of any length leave out nothing; times may have any steps."""
    assert left_out(np.array(numbers)) == missing


def test_an_image_of_another_size_fails_alone(tmp_path: Path) -> None:
    """The rows before and after it are read."""
    for number, width in enumerate((3, 4, 3)):
        write_png(tmp_path / f"{number}.png", np.zeros((2, width), np.uint8))
    images = images_of(tmp_path, names_in(tmp_path))
    with pytest.raises(SourceError, match=r"1.png of 3 x 2 pixels"):
        images.rows(0, 3)
    assert images.rows(2, 3).shape == (1, 2, 3)


def test_opening_twenty_thousand_images_reads_one_header(tmp_path: Path) -> None:
    """Less than two seconds: names are listed, and nothing but the first header is read."""
    first = tmp_path / "000000.png"
    write_png(first, np.zeros((2, 3), np.uint8))
    for number in range(1, 20_000):
        (tmp_path / f"{number:06d}.png").touch()
    began = time.perf_counter()
    images = images_of(tmp_path, names_in(tmp_path))
    numbers = numbers_of(tmp_path, names_in(tmp_path))
    spent_s = time.perf_counter() - began
    assert images.shape == (20_000, 2, 3)
    assert numbers is not None
    assert spent_s < 2.0


SHAPES = st.sampled_from([(5, 7), (4, 3, 3), (1, 1), (6, 2, 4)])


@given(st.data())
def test_what_is_written_is_read(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    """Values, size, depth and the order of channels survive, with 8 and 16 bits, grey, colour and transparency."""
    shape = data.draw(SHAPES)
    image = data.draw(arrays.arrays(data.draw(st.sampled_from([np.uint8, np.uint16])), shape))
    path = tmp_path_factory.mktemp("png") / "0.png"
    if len(shape) == 3 and shape[2] == 4:
        assert cv2.imwrite(str(path), image[..., [2, 1, 0, 3]])
    else:
        write_png(path, image)
    form = image_form(path)
    assert form == ImageForm(shape, str(image.dtype))
    np.testing.assert_array_equal(read_image(path, form), image)


def test_palette_and_single_bits(tmp_path: Path) -> None:
    """A palette is read as colours, and grey of one bit as 8 bits: as OpenCV decodes them."""

    def chunk(name: bytes, content: bytes) -> bytes:
        return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))

    def write(path: Path, bits: int, colour: int, rows: bytes, extra: bytes = b"") -> Path:
        header = chunk(b"IHDR", struct.pack(">IIBBBBB", 8, 1, bits, colour, 0, 0, 0))
        path.write_bytes(
            b"\x89PNG\r\n\x1a\n" + header + extra + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")
        )
        return path

    bits = write(tmp_path / "bits.png", 1, 0, b"\0\xf0")
    np.testing.assert_array_equal(read_image(bits, image_form(bits)), [[255] * 4 + [0] * 4])
    palette = write(tmp_path / "palette.png", 8, 3, b"\0" + bytes([1] * 8), chunk(b"PLTE", bytes([0, 0, 0, 9, 8, 7])))
    np.testing.assert_array_equal(read_image(palette, image_form(palette))[0, 0], [9, 8, 7])


@pytest.mark.parametrize("suffix", ["png", "jpg"])
def test_jpeg_and_png_state_their_size(suffix: str, tmp_path: Path) -> None:
    """The size that the header states is that of the decoded image."""
    path = tmp_path / f"0.{suffix}"
    for shape in ((11, 13, 3), (5, 6)):
        assert cv2.imwrite(str(path), np.full(shape, 90, np.uint8))
        form = image_form(path)
        assert form.shape == shape
        assert read_image(path, form).shape == shape


def test_channels_that_are_not_read(tmp_path: Path) -> None:
    """A JPEG of four components, as CMYK has, is refused for them, not for its size."""
    path = tmp_path / "0.jpg"
    assert cv2.imwrite(str(path), np.full((11, 13, 3), 90, np.uint8))
    content = bytearray(path.read_bytes())
    # The number of components follows marker, length, precision, height and width (ITU T.81, B.2.2).
    content[content.index(b"\xff\xc0") + 9] = 4
    path.write_bytes(bytes(content))
    with pytest.raises(SourceError, match="got channels that are not read; convert it to RGB"):
        image_form(path)


@pytest.fixture
def sound(tmp_path: Path) -> Path:
    path = tmp_path / "000000.png"
    write_png(path, np.random.default_rng(3).integers(0, 255, (40, 30, 3), np.uint8))
    return path


def test_any_flipped_byte_is_noticed(sound: Path) -> None:
    """A changed byte is refused wherever it lies, for a checksum covers every part."""
    content, form = sound.read_bytes(), image_form(sound)
    original = read_image(sound, form)
    for at in np.random.default_rng(1).integers(0, len(content), 150):
        damaged = bytearray(content)
        damaged[at] ^= 0x41
        sound.write_bytes(bytes(damaged))
        with pytest.raises(SourceError, match="Expected"):
            np.testing.assert_array_equal(read_image(sound, form), original)


@pytest.mark.parametrize("kept", [0, 4, 20, 33, 60, -1])
def test_cut_off(kept: int, sound: Path) -> None:
    """An image that ends early is refused."""
    form = image_form(sound)
    sound.write_bytes(sound.read_bytes()[:kept])
    with pytest.raises(SourceError, match=r"cut off|header|something else"):
        read_image(sound, form)


def test_cut_off_jpeg(tmp_path: Path) -> None:
    """OpenCV would fill the rest with grey."""
    path = tmp_path / "0.jpg"
    assert cv2.imwrite(str(path), np.random.default_rng(3).integers(0, 255, (40, 30, 3), np.uint8))
    form = image_form(path)
    path.write_bytes(path.read_bytes()[:-60])
    with pytest.raises(SourceError, match="cut off"):
        read_image(path, form)


def test_another_size_or_depth(sound: Path) -> None:
    """The sentence names both."""
    expected = image_form(sound)
    write_png(sound, np.zeros((40, 30), np.uint16))
    with pytest.raises(
        SourceError, match=r"000000.png of 30 x 40 pixels, 8-bit colour, got 30 x 40 pixels, 16-bit grey"
    ):
        read_image(sound, expected)


def test_a_stated_size_is_refused_before_memory_is_taken(sound: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A few bytes can state an image of gigabytes."""
    content = bytearray(sound.read_bytes())
    content[16:24] = (1 << 16).to_bytes(4, "big") * 2
    sound.write_bytes(bytes(content))
    with pytest.raises(SourceError, match="33554432 pixels at most, got 65536 x 65536"):
        image_form(sound)
    monkeypatch.setattr(images, "LARGEST_BYTES", 10)
    with pytest.raises(SourceError, match="in 10 bytes at most"):
        read_image(sound, ImageForm((1, 1), "uint8"))
