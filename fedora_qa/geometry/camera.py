"""The pinhole camera: integer pixel coordinates are pixel centres; optical Z forward, X right, Y down.

Source: R. Hartley, A. Zisserman, Multiple View Geometry, 2nd ed. (2004), eqs. 6.3 to 6.9.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fedora_qa.geometry import so3

Float64 = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class RigidMotion:
    """Motion of points in the frame of a camera: ``X1 = R @ X0 + t_m``.

    Attributes
    ----------
    R
        (3, 3) rotation from the first to the second camera frame (Z forward, X right, Y down).
    t_m
        (3,) position of the first camera in the second camera frame, m.

    Notes
    -----
    Both together are ``T_world_camera(t1)^-1 T_world_camera(t0)``.
    """

    R: Float64
    t_m: Float64

    def corrected(self, twist: Float64) -> "RigidMotion":
        """Return this motion followed by a small one.

        Parameters
        ----------
        twist
            (6,) of the small motion in the second camera frame: rotation vector, rad, then translation, m.

        Returns
        -------
        RigidMotion
            Of points, from the first camera frame to the corrected second one.
        """
        # X1' = dR (R X0 + t) + dt.
        dR = so3.exp(twist[:3])
        return RigidMotion(dR @ self.R, dR @ self.t_m + twist[3:])

    def twist_from(self, other: "RigidMotion") -> Float64:
        """Return the twist (6,), rad and m, with ``other.corrected(twist)`` equal to this motion."""
        # dR = R R_other^T, dt = t - dR t_other.
        dR = self.R @ other.R.T
        return np.concatenate((so3.log(dR), self.t_m - dR @ other.t_m))


def camera_motion(
    R_world_body0: Float64, position0_m: Float64, R_world_body1: Float64, position1_m: Float64, T_body_camera: Float64
) -> RigidMotion:
    """Return the motion of static points in the frame of a camera, between two poses of the body.

    Parameters
    ----------
    R_world_body0, position0_m, R_world_body1, position1_m
        (3, 3) rotation from body to world, and (3,) position in the world, m, of the first and the second pose.
    T_body_camera
        (4, 4) mounting of the camera, camera frame to body frame, m.

    Returns
    -------
    RigidMotion
        From the first to the second camera frame.
    """
    # X_camera = R_bc^T (R_wb^T (X_world - p) - l), written for both poses and X_world eliminated.
    R_body_camera, lever_m = T_body_camera[:3, :3], T_body_camera[:3, 3]
    R_body1_body0 = R_world_body1.T @ R_world_body0
    at_body1_m = R_world_body1.T @ (position0_m - position1_m) + R_body1_body0 @ lever_m - lever_m
    return RigidMotion(R_body_camera.T @ R_body1_body0 @ R_body_camera, R_body_camera.T @ at_body1_m)


def motion_derivatives(
    R_world_body0: Float64, position0_m: Float64, R_world_body1: Float64, position1_m: Float64, T_body_camera: Float64
) -> tuple[Float64, Float64, Float64]:
    """Return the derivatives of the twist of ``camera_motion`` by small changes of the poses.

    To first order a twist (omega, tau) moves the point X1 by ``omega x X1 + tau``. With the lever arm l, the origin o
    of the first body relative to the second, D = R_world_body1^T R_world_body0 and C = R_camera_body, a rotation d of
    one body about its own origin gives

        first body:   omega =  C D d,   tau =  C (D d x (l - o))
        second body:  omega = -C d,     tau = -C (d x l)

    Parameters
    ----------
    R_world_body0, position0_m, R_world_body1, position1_m, T_body_camera
        As of ``camera_motion``.

    Returns
    -------
    by_rotation0, by_rotation1
        (6, 3) by the rotation d of the first and of the second body, as in ``R_world_body Exp(d)``, about the axes of
        the body: rad and m a rad, rotation first, in the second camera frame.
    by_position0
        (6, 3) by the first position along the axes of the world; that by the second one has the opposite sign.
    """
    R_camera_body, lever_m = T_body_camera[:3, :3].T, T_body_camera[:3, 3]
    R_body1_body0 = R_world_body1.T @ R_world_body0
    origin0_m = R_world_body1.T @ (position0_m - position1_m)
    turn0 = R_camera_body @ R_body1_body0
    by_rotation0 = np.vstack((turn0, -R_camera_body @ so3.cross_matrices(lever_m - origin0_m) @ R_body1_body0))
    by_rotation1 = np.vstack((-R_camera_body, R_camera_body @ so3.cross_matrices(lever_m)))
    return by_rotation0, by_rotation1, np.vstack((np.zeros((3, 3)), R_camera_body @ R_world_body1.T))


def motion_covariance(
    R_world_body0: Float64,
    position0_m: Float64,
    R_world_body1: Float64,
    position1_m: Float64,
    T_body_camera: Float64,
    *,
    position_sigma_m: float,
    rotation_sigma_rad: float,
) -> Float64:
    """Return the covariance (6, 6) of the twist of ``camera_motion`` when both poses carry white noise.

    Position noise is given for each axis of the world. Rotation noise n, as in ``R_world_body Exp(n)``, is given for
    each axis of the body.

    Parameters
    ----------
    R_world_body0, position0_m, R_world_body1, position1_m, T_body_camera
        As of ``camera_motion``.
    position_sigma_m, rotation_sigma_rad
        Standard deviation of each axis of either pose, m and rad.

    Returns
    -------
    ndarray of float64
        (6, 6), rad^2, rad m and m^2: rotation first, then translation, in the second camera frame.
    """
    by_rotation0, by_rotation1, by_position = motion_derivatives(
        R_world_body0, position0_m, R_world_body1, position1_m, T_body_camera
    )
    rotation = by_rotation0 @ by_rotation0.T + by_rotation1 @ by_rotation1.T
    # Isotropic noise of sigma: J sigma^2 J^T. Both positions have the same Jacobian up to its sign, hence 2.
    covariance: Float64 = rotation_sigma_rad**2 * rotation + 2 * position_sigma_m**2 * by_position @ by_position.T
    return covariance
