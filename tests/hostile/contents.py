"""Attacks by types, shapes, values, attributes and names. Each edits an open copy of a small file."""

from collections.abc import Callable
from typing import Any, Final

import h5py
import numpy as np

from tests.hostile.storage import EVENTS, paths, replace

ESCAPES: Final = "\x1b]0;owned\x07\x1b[2J\x1b[31m\u202ecod.exe\u200b\r\n::error::owned\n<script>alert(1)</script>"
TIMESTAMPS: Final = ("path/rgb_ts", "path/depth_ts", "path/events/t", "path/imu/ts", "path/pose/ts")

Edit = Callable[[h5py.File], None]


def timestamps_as(dtype: str) -> Edit:
    """All stamps in another type."""

    def edit(file: h5py.File) -> None:
        for path in TIMESTAMPS:
            replace(file, path, data=file[path][:].astype(dtype))

    edit.__doc__ = f"Stamps as {dtype}."
    return edit


def everything_as(dtype: Any) -> Edit:
    """All streams in another type."""

    def edit(file: h5py.File) -> None:
        for path in paths(file):
            replace(file, path, data=file[path][:].astype(dtype))

    return edit


def filled(value: float, dtype: str | None = None) -> Edit:
    """All values of all streams are one value, as near as the type holds it."""

    def edit(file: h5py.File) -> None:
        for path in paths(file):
            was = file[path]
            kind = np.dtype(dtype) if dtype else was.dtype
            if kind.kind in "iu":
                limits = np.iinfo(kind)
                held = 0 if np.isnan(value) else int(min(max(value, limits.min), limits.max))
            else:
                held = value
            replace(file, path, data=np.full(was.shape, held, kind))

    return edit


def compound_events(file: h5py.File) -> None:
    """Events as one table."""
    rows = np.zeros(77, dtype=[("x", "u2"), ("y", "u2"), ("t", "i8"), ("p", "u1")])
    del file["path/events"]
    file["path/events"] = rows


def compound_timestamps(file: h5py.File) -> None:
    """Stamps as records, one of which holds text of any length."""
    replace(file, "path/imu/ts", shape=(101,), dtype=np.dtype([("s", "i8"), ("t", h5py.string_dtype())]))


def ragged(file: h5py.File) -> None:
    """Ragged arrays for stamps, and references for depth."""
    replace(file, "path/imu/ts", shape=(101,), dtype=h5py.vlen_dtype(np.int64))
    replace(file, "path/depth", shape=(6, 27, 36), dtype=h5py.ref_dtype)


def texts(file: h5py.File) -> None:
    """Text for stamps, of fixed length and of any."""
    replace(file, "path/imu/ts", data=np.array([b"12"] * 101))
    replace(file, "path/depth_ts", data=["12"] * 6, dtype=h5py.string_dtype())


def types_without_like(file: h5py.File) -> None:
    """Types that NumPy does not know: opaque, an array, a float of 3 bytes, an integer of 37 bits, time."""
    odd = h5py.h5t.IEEE_F32LE.copy()
    odd.set_fields(23, 17, 6, 0, 17)
    odd.set_size(3)
    short = h5py.h5t.NATIVE_INT64.copy()
    short.set_precision(37)
    kinds = {
        "path/imu/ts": h5py.h5t.UNIX_D64LE,
        "path/depth_ts": short,
        "path/depth": odd,
        "path/pose/ts": h5py.h5t.create(h5py.h5t.OPAQUE, 8),
        "path/rgb_ts": h5py.h5t.array_create(h5py.h5t.NATIVE_INT64, (3,)),
    }
    for path, kind in kinds.items():
        space = file[path].id.get_space()
        del file[path]
        h5py.h5d.create(file.id, path.encode(), kind, space)


def with_axes(rank: int) -> Edit:
    """All streams with another number of axes."""

    def edit(file: h5py.File) -> None:
        for path in paths(file):
            values = file[path][:]
            shape = (*values.shape, 1, 1, 1, 1, 1)[:rank] if rank else ()
            replace(file, path, data=np.resize(values, shape))

    return edit


def null_space(file: h5py.File) -> None:
    """All streams without any space."""
    for path in paths(file):
        replace(file, path, data=h5py.Empty(file[path].dtype))


def sensor_without_bounds(file: h5py.File) -> None:
    """The event camera is declared of four thousand million pixels, and events are at their edge."""
    file["metadata/cameras/events"].attrs.update({"width": 2**31, "height": 2**31})
    file["path/events/x"][:] = 65535
    file["path/events/y"][:] = 65535


def sensor_undeclared(file: h5py.File) -> None:
    """No camera is declared, and events are at columns and rows without bounds."""
    del file["metadata/cameras"]
    for name in "xy":
        replace(file, f"path/events/{name}", data=np.full(77, 2**40, np.int64))


def cameras_without_bounds(file: h5py.File) -> None:
    """All cameras are declared larger than any integer of C."""
    for name in ("rgb", "depth", "events"):
        file[f"metadata/cameras/{name}"].attrs.update({"width": np.uint64(2**63), "height": np.uint64(2**63)})


def numbers_without_bounds(file: h5py.File) -> None:
    """Every declared number is as large as its type holds."""
    for name in ("events", "imu", "pose"):
        attrs = file[f"metadata/{name}"].attrs
        for key in list(attrs):
            if isinstance(attrs[key], float | np.floating):
                attrs[key] = 1e308
            elif isinstance(attrs[key], int | np.integer):
                attrs[key] = np.int64(2**63 - 1)
    for name in ("rgb", "depth", "events"):
        attrs = file[f"metadata/cameras/{name}"].attrs
        attrs["K"] = np.full((3, 3), 1e308)
        attrs["T_body_camera"] = np.full((4, 4), 1e308)
        attrs["exposure_us"] = 1e308
    file["metadata/depth_range"][:] = [1e-308, 1e308]


def numbers_of_nothing(file: h5py.File) -> None:
    """Every declared number is the least above zero."""
    for name in ("events", "imu", "pose"):
        attrs = file[f"metadata/{name}"].attrs
        for key in list(attrs):
            if isinstance(attrs[key], float | np.floating):
                attrs[key] = 5e-324
    for name in ("rgb", "depth", "events"):
        file[f"metadata/cameras/{name}"].attrs["K"] = np.zeros((3, 3))


def timestamps_apart(file: h5py.File) -> None:
    """A hundred thousand events, a second apart each."""
    count = 100_000
    for path in EVENTS:
        data = np.arange(count) * 10**6 if path.endswith("t") else np.zeros(count)
        replace(file, path, data=data.astype(file[path].dtype), chunks=(count,), compression="gzip")
    for name in ("rgb", "depth"):
        file[f"metadata/{name}_to_event"][:] = 1


def timestamps_at_the_ends(file: h5py.File) -> None:
    """Stamps from the least to the greatest that there is."""
    for path in TIMESTAMPS:
        limits = np.iinfo(np.int64)
        count = len(file[path])
        file[path][:] = np.linspace(float(limits.min), float(limits.max - 1024), count).astype(np.int64)


def index_maps_out_of_bounds(file: h5py.File) -> None:
    """Frames point at events that cannot be."""
    file["metadata/rgb_to_event"][:] = [-(2**63), -1, 2**62, 2**63 - 1, 0, 77]
    file["metadata/depth_to_event"][:] = 2**63 - 1


def one_text_many_times(file: h5py.File) -> None:
    """A text a million times, every one of which is the same 64 KiB."""
    text = "x" * 60_000
    file.attrs.create("sequence", np.array([text] * 400, dtype=object), dtype=h5py.string_dtype())
    file["metadata/events"].attrs.create("model", np.array([text] * 400, dtype=object), dtype=h5py.string_dtype())


def long_texts(file: h5py.File) -> None:
    """Texts of a megabyte where words are expected."""
    text = "x" * 1_000_000
    for owner, name in (("metadata/events", "model"), ("metadata/events", "polarity"), ("metadata/flow", "model"),
                        ("path/rgb", "transfer"), ("path/rgb", "units"), ("metadata/cameras/rgb", "camera_model"),
                        ("/", "sequence")):  # fmt: skip
        if name in file[owner].attrs:
            del file[owner].attrs[name]
        file[owner].attrs[name] = text


def wrong_attributes(file: h5py.File) -> None:
    """Attributes of types that are not the layout's."""
    file["metadata/events"].attrs["threshold_on"] = np.zeros(3, dtype=[("a", "f8"), ("b", "i4")])
    file["metadata/events"].attrs["threshold_off"] = 1 + 2j
    file["metadata/events"].attrs["hot_pixels"] = np.full((10, 2), 2**63, np.uint64)
    file["metadata/imu"].attrs["gravity"] = h5py.Empty("f8")
    file["metadata/imu"].attrs["gyro_noise_density"] = file["path"].ref
    file["metadata/cameras/rgb"].attrs["K"] = np.zeros((3, 3), complex)
    file["metadata/cameras/depth"].attrs["K"] = b"\xff\xfe"
    file["metadata/cameras/events"].attrs["width"] = np.array([[[16]]], "f2")
    file.attrs["seed"] = np.float64("nan")
    file.attrs["profile"] = ESCAPES


def hostile_names(file: h5py.File) -> None:
    """Names and texts that would command a terminal, a browser or a build."""
    file[ESCAPES.replace("/", "|")] = 1
    file["path"].create_group("=cmd()|\x1b[31m")["x"] = 1
    file.attrs["sequence"] = ESCAPES
    file.attrs["format_version"] = ESCAPES
    file["metadata/events"].attrs["model"] = ESCAPES
    file["path/depth"].attrs["units"] = ESCAPES
    file["path/rgb"].attrs["transfer"] = ESCAPES
    file["metadata/flow"].attrs["unit"] = ESCAPES
    del file["path/rgb_ts"]
    file["path/rgb_ts"] = h5py.SoftLink("/" + ESCAPES)


def names_that_are_not_text(file: h5py.File) -> None:
    """Names that are not UTF-8."""
    h5py.h5g.create(file.id, b"\xff\xfe")
    h5py.h5d.create(file.id, b"\xc3\x28", h5py.h5t.NATIVE_INT8, h5py.h5s.create(h5py.h5s.SCALAR))
    group = file["path"].id
    group.links.create_soft(b"\xf0\x28", b"\xc3\x28")
