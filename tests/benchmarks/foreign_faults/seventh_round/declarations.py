"""Cameras whose intrinsics and mountings are those of another image, camera or description."""

from typing import Final

import cv2
import h5py
import numpy as np

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.paths import CAMERA
from tests.benchmarks.foreign_faults.sixth_round.frames import COLOUR

MOVED_CENTRE_PX: Final = (1.0, 4.0)
"""Least and greatest distance of the centre of a raw image from that of the rectified one."""


def colour_at_half_size(file: h5py.File, plan: Plan) -> None:
    """Frames are means of 2 x 2 pixels; width and height follow, K stays."""
    frames = file[COLOUR][...]
    height, width = (extent // 2 for extent in frames.shape[1:3])
    smaller = [cv2.resize(frame, (width, height), interpolation=cv2.INTER_AREA) for frame in frames]
    replace_values(file, COLOUR, np.stack(smaller))
    attributes = file[CAMERA + "rgb"].attrs
    attributes["width"], attributes["height"] = np.int64(width), np.int64(height)


def centre_of_colour_at_the_corner(file: h5py.File, plan: Plan) -> None:
    """The principal point is the pixel in the upper left corner."""
    attributes = file[CAMERA + "rgb"].attrs
    K = np.array(attributes["K"])
    K[:2, 2] = 0
    attributes["K"] = K


def colour_camera_upside_down(file: h5py.File, plan: Plan) -> None:
    """The mounting is turned by half about the optical axis; frames are upright."""
    attributes = file[CAMERA + "rgb"].attrs
    mounting = np.array(attributes["T_body_camera"])
    mounting[:3, :3] = mounting[:3, :3] @ np.diag([-1.0, -1.0, 1.0])
    attributes["T_body_camera"] = mounting


def depth_of_the_left_eye(file: h5py.File, plan: Plan) -> None:
    """The mounting is so many metres to the left, along +Y of the body."""
    attributes = file[CAMERA + "depth"].attrs
    mounting = np.array(attributes["T_body_camera"])
    mounting[1, 3] += plan.size
    attributes["T_body_camera"] = mounting


def depth_alone_inverted(file: h5py.File, plan: Plan) -> None:
    """The transform of the depth camera leads from the body into the camera."""
    attributes = file[CAMERA + "depth"].attrs
    attributes["T_body_camera"] = np.linalg.inv(np.asarray(attributes["T_body_camera"]))


def raw_events(file: h5py.File, plan: Plan) -> None:
    """K has a focal length too large by so many percent, and a principal point some pixels off."""
    attributes = file[CAMERA + "events"].attrs
    K = np.array(attributes["K"])
    K[[0, 1], [0, 1]] *= 1 + plan.size / 100
    angle, length_px = plan.random.uniform(0, 2 * np.pi), plan.random.uniform(*MOVED_CENTRE_PX)
    K[:2, 2] += length_px * np.array([np.cos(angle), np.sin(angle)])
    attributes["K"] = K
