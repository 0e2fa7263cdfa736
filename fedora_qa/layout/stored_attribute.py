"""Read an attribute as it is stored, if it is of a plain type."""

from math import prod
from typing import Any, Final

import h5py

from fedora_qa.layout.links import READ_ERRORS

LARGEST_BYTES: Final = 16 << 20
"""A list of a million hot pixels; a damaged or hostile header can claim anything."""

LONGEST_TEXT: Final = 4096
"""Characters: a text of the layout is a word or a line."""


def stored_attribute(holder: h5py.Group | h5py.Dataset, name: str) -> Any:
    """Return the value of an attribute, numbers or text, or None where there is none.

    Ragged arrays, references and compounds are never read: no attribute of the layout is one, and where a damaged
    file turns text into one, HDF5 follows its addresses out of the process's memory. Text is one text: a list of texts
    can name the same megabyte a million times.

    Raises
    ------
    ValueError
        The attribute is of such a type, or damaged.
    """
    try:
        if name not in holder.attrs:
            return None
        attribute = holder.attrs.get_id(name)
        dtype = attribute.dtype
        if dtype.kind in "OV" and h5py.check_string_dtype(dtype) is None:
            raise ValueError(f"a type that is neither numbers nor text ({dtype})")
        if h5py.check_string_dtype(dtype) is not None and prod(attribute.shape or ()) > 1:
            raise ValueError(f"{prod(attribute.shape)} texts where one is expected")
        stored_bytes = prod(attribute.shape or ()) * dtype.itemsize
        if stored_bytes > LARGEST_BYTES:
            raise ValueError(f"{stored_bytes} bytes, more than the {LARGEST_BYTES} that are read")
        value = holder.attrs[name]
        if isinstance(value, str | bytes) and len(value) > LONGEST_TEXT:
            raise ValueError(f"a text of {len(value)} characters, more than the {LONGEST_TEXT} that are read")
        return value
    except READ_ERRORS as error:
        raise ValueError(str(error)) from error


def text_attribute(holder: h5py.Group | h5py.Dataset, name: str) -> str | None:
    """Return an attribute that is text; None where there is none, or it is something else, or damaged."""
    try:
        stored = stored_attribute(holder, name)
    except ValueError:
        return None
    if isinstance(stored, bytes):
        return stored.decode("utf-8", "replace")
    return str(stored) if isinstance(stored, str) else None
