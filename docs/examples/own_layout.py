"""Write a sequence in a layout that fedora-qa does not know: other names and units, and no declarations.

``python own_layout.py SEQUENCE OUT DELAY_US`` reads a file that ``fedora-generate`` wrote. The events of OUT are late
by DELAY_US.
"""

import sys

import h5py
import hdf5plugin  # noqa: F401 - the codec of SEQUENCE
import numpy as np

NS_PER_US = 1000
MM_PER_M = 1000

with h5py.File(sys.argv[1]) as sequence, h5py.File(sys.argv[2], "w") as out:
    path = sequence["path"]
    out["camera/frames"] = path["rgb"][:]
    out["camera/time"] = path["rgb_ts"][:] * NS_PER_US
    out["range/image"] = path["depth"][:] / MM_PER_M
    out["range/time"] = path["depth_ts"][:] * NS_PER_US
    out["dvs/x"] = path["events/x"][:]
    out["dvs/y"] = path["events/y"][:]
    out["dvs/time"] = (path["events/t"][:] + int(sys.argv[3])) * NS_PER_US
    out["dvs/polarity"] = np.where(path["events/p"][:] == 1, 1, -1).astype(np.int8)
    out["vehicle/position"] = path["pose/position"][:]
    out["vehicle/quaternion"] = path["pose/orientation"][:]
    out["vehicle/time"] = path["pose/ts"][:] * NS_PER_US
