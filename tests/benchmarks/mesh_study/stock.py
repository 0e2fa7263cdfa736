"""The depth of pyrender's own renderer, for comparison."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_generator.camera import Camera
from fedora_generator.mesh.context import open_context
from fedora_generator.mesh.model import MeshModel

Floats = NDArray[np.float64]

NEAR_M: Final = 0.05
FAR_M: Final = 1000.0

_OPTICAL_FROM_OPENGL: Final = np.diag([1.0, -1.0, -1.0, 1.0])


def stock_inverse_depth_per_m(model: MeshModel, camera: Camera, T_world_camera: Floats) -> Floats:
    """Inverse depth of 24 bits, at the first of four samples of each pixel.

    Parameters
    ----------
    model
        Triangles to draw.
    camera
        Camera matrix and size of the image.
    T_world_camera
        (4, 4) pose of the camera.

    Returns
    -------
    inverse_depth
        (height, width) 1 / z, 1/m; 0 for the sky.
    """
    context = open_context()  # before anything imports OpenGL
    import pyrender  # noqa: PLC0415
    from OpenGL import GL  # noqa: PLC0415

    from fedora_generator.mesh.opengl import use_depth_from_minus_one  # noqa: PLC0415

    K = camera.K
    lens = pyrender.IntrinsicsCamera(K[0, 0], K[1, 1], K[0, 2] + 0.5, K[1, 2] + 0.5, znear=NEAR_M, zfar=FAR_M)
    meshes = [
        pyrender.Primitive(positions=mesh.vertices_world_m, normals=mesh.normals_world, indices=mesh.triangles)
        for mesh in model.meshes
    ]
    scene = pyrender.Scene()
    scene.add(pyrender.Mesh(meshes))
    scene.add(lens, pose=T_world_camera @ _OPTICAL_FROM_OPENGL)
    use_depth_from_minus_one()
    GL.glClearDepth(1.0)
    GL.glFrontFace(GL.GL_CCW)
    context.viewport_width, context.viewport_height = camera.width, camera.height
    depth_m = context.render(scene, flags=pyrender.RenderFlags.DEPTH_ONLY | pyrender.RenderFlags.SKIP_CULL_FACES)
    with np.errstate(divide="ignore"):
        return np.where(depth_m > 0, 1.0 / depth_m.astype(np.float64), 0.0)
