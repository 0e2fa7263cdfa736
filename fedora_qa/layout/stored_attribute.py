"""Read an attribute as it is stored, if it is of a plain type."""

from math import prod
from typing import Any, Final

import h5py
import numpy as np

from fedora_qa.layout.links import READ_ERRORS

LARGEST_BYTES: Final = 16 << 20
"""Largest attribute: a list of a million hot pixels. A damaged or hostile header can state any size."""

LONGEST_TEXT: Final = 4096
"""Largest number of characters: a text of the layout is a word or a line."""


def stored_attribute(holder: h5py.Group | h5py.Dataset, name: str) -> Any:
    """Return the value of an attribute, numbers or text, or None where there is none.

    Ragged arrays, references and compounds are never read. No attribute of the layout has such a type; where damage
    turns text into such a type, HDF5 follows its addresses out of the process's memory. A list of texts is never read
    either: it can refer to the same megabyte a million times.

    Raises
    ------
    ValueError
        The attribute is of such a type, or damaged.
    """
    try:
        attributes = holder.attrs
        if name not in attributes:
            return None
        attribute = attributes.get_id(name)
        dtype, shape = attribute.dtype, attribute.shape
        values = prod(shape or ())
        is_text = h5py.check_string_dtype(dtype) is not None
        # Kinds O and V of NumPy: ragged arrays, references and compounds.
        if dtype.kind in "OV" and not is_text:
            raise ValueError(f"a type that is neither numbers nor text ({dtype})")
        if is_text and values > 1:
            raise ValueError(f"{values} texts where one is expected")
        if values * dtype.itemsize > LARGEST_BYTES:
            raise ValueError(f"{values * dtype.itemsize} bytes, more than the {LARGEST_BYTES} that are read")
        if dtype.kind in "iuf" and shape is not None:
            numbers = np.empty(shape, dtype)
            attribute.read(numbers)
            return numbers[()]
        value = attributes[name]
        # The item size of text of variable length is that of a pointer, so that the bound on bytes does not apply.
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
