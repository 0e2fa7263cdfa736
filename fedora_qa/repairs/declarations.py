"""Write the declarations that a repair changes to the attributes from which they are read."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Final

import h5py
import numpy as np

from fedora_qa.errors import NotRepairableError
from fedora_qa.layout.canonical import ATTRIBUTES
from fedora_qa.layout.metadata import Supplied
from fedora_qa.layout.resolve import Layout
from fedora_qa.sequence.declared import Declared
from fedora_qa.sequence.read_declared import MalformedError, read_attribute

_NAMES: Final = {"position_sigma_m": "position_sigma", "rotation_sigma_rad": "rotation_sigma", "model": "camera_model"}
"""Attributes whose names differ from those of the fields; ``model`` only of cameras."""


@dataclass(frozen=True, slots=True)
class Declaration:
    """An attribute and its new value.

    Attributes
    ----------
    owner
        Path of the object that carries it, as in the layout.
    name
        Of the attribute.
    value
        In the type of its kind.
    """

    owner: str
    name: str
    value: Any


def changed_declarations(
    before: Declared, after: Declared, supplied: Mapping[str, Supplied]
) -> tuple[Declaration, ...]:
    """Return the declarations that differ, in the order of the layout.

    Parameters
    ----------
    before, after
        Without and with the repair.
    supplied
        What the dialect, or a file beside the sequence, declares, by canonical key.

    Raises
    ------
    NotRepairableError
        One differs that lies in no attribute of the layout, or that the file does not make itself.
    """
    old, new = _attributes(before), _attributes(after)
    changed = {place for place, value in new.items() if place not in old or not np.array_equal(old[place], value)}
    unknown = [f"{owner}.{name}" for owner, name in changed - ATTRIBUTES.keys()]
    if unknown or before.depth_range_m != after.depth_range_m:
        raise NotRepairableError(
            f"Expected declarations that are attributes, got {', '.join(unknown) or 'a range of depth'}"
        )
    # What is supplied takes precedence over what would be written into the file.
    for owner, name in ATTRIBUTES:
        if (owner, name) in changed and (made := supplied.get(f"{owner}/{name}".lstrip("/"))):
            raise NotRepairableError(
                f"Expected declarations that the file makes itself, got {owner or '/'}.{name} by {made.origin}; change "
                f"it to {np.asarray(new[owner, name]).tolist()} there, or leave the diagnosis out with --only"
            )
    return tuple(Declaration(owner, name, new[owner, name]) for owner, name in ATTRIBUTES if (owner, name) in changed)


def write_declaration(file: h5py.File, layout: Layout, declaration: Declaration) -> None:
    """Write one declaration, in the stored type where that is a floating-point number.

    Raises
    ------
    NotRepairableError
        The stored type cannot hold it, or the value is none that the layout allows.
    """
    owner, name, value = declaration.owner, declaration.name, declaration.value
    binding = layout.bindings.get(owner)
    path = (binding.path if binding else owner) or "/"
    holder = file[path] if path in file else file.create_group(path)
    attributes = holder.attrs
    # As an array, not as an open attribute: of one that is open HDF5 would keep the old value when it is replaced.
    old = np.asarray(attributes[name]) if name in attributes else None
    if old is not None and old.dtype.kind == "f" and old.size == np.size(value):
        attributes.modify(name, np.asarray(value, old.dtype).reshape(old.shape))
    else:
        attributes[name] = value
    try:
        read = read_attribute(holder, ATTRIBUTES[owner, name])
    except MalformedError as error:
        raise NotRepairableError(f"Expected {path} to hold {name} = {value}, got: {error}") from error
    is_number = isinstance(value, float | np.ndarray)
    # Six digits: what single precision holds.
    if not (np.allclose(read, value, rtol=1e-6, atol=0) if is_number else read == value):
        raise NotRepairableError(f"Expected {path} to hold {name} = {value}, got {read} in the stored type")


def _attributes(declared: Declared) -> dict[tuple[str, str], Any]:
    """Return every declaration by the object that carries it and its name."""
    models = {"metadata/events": declared.events, "metadata/imu": declared.imu, "metadata/pose": declared.pose}
    values = {
        (owner, _NAMES.get(each.name, each.name) if owner == "metadata/pose" else each.name): getattr(model, each.name)
        for owner, model in models.items()
        if model is not None
        for each in fields(model)
    }
    for camera_name, camera in declared.cameras.items():
        for each in fields(camera):
            name = _NAMES.get(each.name, each.name)
            values[f"metadata/cameras/{camera_name}", name] = getattr(camera, each.name)
    values["path/rgb", "transfer"] = declared.transfer
    values["metadata/flow", "model"] = declared.flow_model
    for name in ("profile", "sequence", "world", "illumination"):
        values["", name] = getattr(declared, name)
    return values
