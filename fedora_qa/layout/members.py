"""Members of compound types: some members of each row, read and written as an array of numbers.

Many layouts store a table of events or samples as one dataset of a compound type (x, y, t, p). A dialect names the
members, as it numbers the columns of an array.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_qa.errors import did_you_mean
from fedora_qa.layout.hdf5_objects import RefusedError

_MEMBERS_NAMED: Final = 8
"""Members that a message names."""


@dataclass(frozen=True, slots=True)
class MembersForm:
    """Shape and type of the array that some members of a dataset make."""

    shape: tuple[int, ...]
    dtype: np.dtype[Any]


def form_of_members(dataset: h5py.Dataset, members: Sequence[str], path: str) -> MembersForm:
    """Return shape and type of some members of a dataset.

    Parameters
    ----------
    dataset
        Of a compound type.
    members
        Names of members. Several are the entries of one further axis, in this order.
    path
        Of the dataset, for messages.

    Raises
    ------
    RefusedError
        The type is not compound, lacks a member, or has members that are no numbers; or several are named that are not
        single numbers of one kind.
    """
    names = dataset.dtype.names
    if names is None:
        message = (
            f"Expected {path} of a compound type with {listed(members)}, got {dataset.dtype}; leave members out of the "
            "dialect"
        )
        raise RefusedError("wrong_dtype", "wrong_dtype", message)
    for member in members:
        if member not in names:
            hint = did_you_mean(member, names)
            message = f"Expected a member {member} of {path}, got {listed(names)}{hint}; correct members in the dialect"
            raise RefusedError("missing_stream", "missing_stream", message)
    if dataset.dtype.hasobject:
        # HDF5 follows the addresses of ragged members out of the process's memory where damage has altered them.
        message = (
            f"Expected numbers and texts of fixed length in the compound type of {path}, got ragged arrays, texts of "
            "any length or references; store the numbers in a dataset of their own"
        )
        raise RefusedError("wrong_dtype", "wrong_dtype", message)
    types = [dataset.dtype[member] for member in members]
    if len(types) == 1 and types[0].base.names:
        message = (
            f"Expected member {members[0]} of {path} as numbers, got a compound type, whose members are not read; "
            "store them in datasets of their own"
        )
        raise RefusedError("wrong_dtype", "wrong_dtype", message)
    if len(types) == 1:
        # A member may be an array by itself, such as the three axes of a gyroscope.
        return MembersForm((*dataset.shape, *types[0].shape), types[0].base)
    # Of whole and floating-point numbers together, or of int64 and uint64, no type holds both without loss.
    numbers = all(each.kind in "iuf" for each in types)
    together = np.result_type(*types) if numbers else np.dtype(np.void)
    if not numbers or {each.kind == "f" for each in types} != {together.kind == "f"}:
        got = ", ".join(f"{member} as {each}" for member, each in zip(members, types, strict=True))
        message = f"Expected members of {path} that are single numbers of one kind, got {got}"
        raise RefusedError("wrong_dtype", "wrong_dtype", message)
    return MembersForm((*dataset.shape, len(members)), together)


def require_not_compound(dtype: np.dtype[Any], path: str, expected: str) -> None:
    """Raise ``RefusedError`` where the dialect names no member of a compound type."""
    if dtype.names:
        message = (
            f"Expected {path} as {expected}, got a compound type with {listed(dtype.names)}; name the member that is "
            f'meant in a dialect, such as members = ["{dtype.names[0]}"]'
        )
        raise RefusedError("wrong_dtype", "wrong_dtype", message)


def listed(members: Sequence[str]) -> str:
    """Return the first names of members, for messages."""
    more = f" and {len(members) - _MEMBERS_NAMED} more" if len(members) > _MEMBERS_NAMED else ""
    return f"the member{'s' * (len(members) > 1)} {', '.join(members[:_MEMBERS_NAMED])}{more}"


def array_of_members(rows: NDArray[Any], members: Sequence[str]) -> NDArray[Any]:
    """Return members of rows as one array; a single member is a view of the rows."""
    if len(members) == 1:
        return rows[members[0]]
    return np.stack([rows[member] for member in members], axis=-1)


def put_members(rows: NDArray[Any], members: Sequence[str], values: NDArray[Any]) -> None:
    """Write an array, as ``array_of_members`` returns it, into the members of rows."""
    if len(members) == 1:
        rows[members[0]] = values
        return
    for entry, member in enumerate(members):
        rows[member] = values[..., entry]
