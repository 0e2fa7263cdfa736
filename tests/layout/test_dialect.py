"""Dialects are data that is read strictly."""

from importlib import resources
from math import pi
from pathlib import Path

import pytest

from fedora_qa.errors import MisuseError
from fedora_qa.layout.canonical import DATASETS
from fedora_qa.layout.dialect import DIALECT_NAMES, DatasetPlace, load_dialect, scale_of

MINIMAL = 'name = "mine"\n[datasets]\n'


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "dialect.toml"
    path.write_text(text, "utf-8")
    return path


def test_every_file_of_the_folder_is_known_by_name() -> None:
    """The names have an order, which decides between equals, so they are written out."""
    folder = resources.files("fedora_qa.layout") / "dialects"
    assert sorted(entry.name for entry in folder.iterdir()) == sorted(f"{name}.toml" for name in DIALECT_NAMES)


@pytest.mark.parametrize("name", DIALECT_NAMES)
def test_what_is_shipped_is_valid(name: str, tmp_path: Path) -> None:
    """A dialect that is known by name is read without a validator, and gives what a validator makes of it."""
    text = (resources.files("fedora_qa.layout") / "dialects" / f"{name}.toml").read_text("utf-8")
    assert load_dialect(name) == load_dialect(written(tmp_path, text))


@pytest.mark.parametrize("name", DIALECT_NAMES)
def test_every_dialect_loads(name: str) -> None:
    """Each dialect that is known by name reads, carries its name, and says what it is."""
    dialect = load_dialect(name)
    assert dialect.name == name
    assert dialect.description


def test_canonical_dialect_places_everything_canonically() -> None:
    """The dialect ``fedora`` puts every dataset where the layout has it."""
    dialect = load_dialect("fedora")
    assert all(dialect.place_of(key) == DatasetPlace() and dialect.is_canonical(key) for key in DATASETS)


def test_other_dialects_have_no_place_for_what_they_do_not_name() -> None:
    """DSEC has no pose."""
    dialect = load_dialect("dsec")
    assert dialect.place_of("path/events/t") is not None
    assert dialect.place_of("path/pose/ts") is None


def test_the_example_of_the_docs_is_legal(tmp_path: Path) -> None:
    """What docs/dialects.md shows can be used."""
    page = (Path(__file__).parents[2] / "docs/dialects.md").read_text("utf-8")
    dialect = load_dialect(written(tmp_path, page.partition("```toml\n")[2].partition("```")[0]))
    assert set(dialect.files) == {"data", "pose", "images", "times", "calibration"}
    assert dialect.metadata["kind"] == "recorded"
    pose = DatasetPlace(file="pose", path="Cn_T_C0", convert="matrix4", invert=True)
    assert [dialect.datasets[f"path/pose/{name}"] for name in ("position", "orientation")] == [pose, pose]
    assert dialect.datasets["path/pose/ts"] == DatasetPlace(file="pose", path="ts", time_unit="us")


def test_own_dialect_can_build_on_the_canonical_one(tmp_path: Path) -> None:
    """A file that differs in one unit needs one line."""
    text = 'name = "metres"\ncanonical_elsewhere = true\n[datasets]\n"path/depth" = { value_unit = "m" }\n'
    dialect = load_dialect(written(tmp_path, text))
    depth = dialect.place_of("path/depth")
    assert depth is not None
    assert scale_of("path/depth", depth) == 1000.0
    assert not dialect.is_canonical("path/depth")
    assert dialect.is_canonical("path/rgb")


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ('name = "x"\nfoo = 1\n', "foo"),
        (MINIMAL + '"path/dept" = { path = "d" }\n', "path/dept"),
        (MINIMAL + '"path/depth" = { pth = "d" }\n', "pth"),
        (MINIMAL + '"path/depth" = { value_unit = "furlong" }\n', "furlong"),
        (MINIMAL + '"path/events/t" = { time_unit = "minutes" }\n', "time_unit"),
        (MINIMAL + '"path/events/p" = { polarity = "yes" }\n', "polarity"),
        (MINIMAL + '"path/events/x" = { columns = ["a"] }\n', "columns"),
        (MINIMAL + '"path/pose/position" = { convert = "turned" }\n', "path/pose/position.convert"),
        (
            MINIMAL + '"path/pose/position" = { convert = "position_quaternion", columns = [1, 2, 3] }\n',
            "path/pose/position.columns",
        ),
        (MINIMAL + '"path/pose/position" = { convert = "matrix4", columns = [0, 1, 2] }\n', "12 or 16 columns"),
        (MINIMAL + '"path/depth" = { columns = [0, 1, 2] }\n', "one column or channel, got 3"),
        (MINIMAL + '[metadata]\n"metadata/vertical" = "z"\n', "metadata.vertical"),
        ('description = "nameless"\n', "name"),
        ("name = \n", "TOML"),
    ],
    ids=["unknown key", "unknown dataset", "unknown field", "value unit", "time unit", "polarity", "columns",
         "turned", "columns of a pose", "columns of a matrix", "channels of depth", "vertical", "no name",
         "not TOML"],
)  # fmt: skip
def test_misuse_names_the_key(tmp_path: Path, text: str, named: str) -> None:
    """Whatever does not fit is refused, and the message names it."""
    with pytest.raises(MisuseError, match=named):
        load_dialect(written(tmp_path, text))


def test_unknown_dialect_lists_the_known() -> None:
    """A name that is neither a dialect nor a file is misuse."""
    with pytest.raises(MisuseError, match="purdue-lab"):
        load_dialect("klingon")


@pytest.mark.parametrize(
    ("key", "unit", "scale"),
    [("path/depth", "m", 1000.0), ("path/depth", "", 1.0), ("path/pose/position", "mm", 1e-3),
     ("path/imu/angular_velocity", "deg/s", pi / 180), ("path/imu/linear_acceleration", "g", 9.80665)],
)  # fmt: skip
def test_scales(key: str, unit: str, scale: float) -> None:
    """Canonical value = stored value times scale (g is standard gravity, by definition)."""
    assert scale_of(key, DatasetPlace(value_unit=unit)) == pytest.approx(scale, rel=1e-15)
