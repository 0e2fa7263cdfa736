"""Events of the exact world: each pixel is rendered only where and when its light requires it.

``README.md`` describes the method. Read ``follower`` (one interval of the flight), then ``camera_path``,
``light_kernels`` and ``crossing_kernels`` in the order of its steps.
"""
