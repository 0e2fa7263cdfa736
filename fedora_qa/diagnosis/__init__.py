"""Infer causes from the features of failed measurements; runs only after an alarm.

In order of reading: ``hypothesis`` is what a module proposes for the alarms of a subject, with its support from
``support.toml``. Modules are named after subjects; ``clocks`` has those of index maps as well, with ``clock_units`` for
factors of whole streams, ``flow`` those of all flow but ``flow_geometry``, and ``event_conservation`` those of
``event_response.conservation``, with ``event_balance`` for what the number of the events states. ``joined_findings``
has those that two findings state together, ``filtered_noise`` what has taken noise. ``candidates`` gathers hypotheses
by cause, ``diagnose`` chooses the fewest causes, and ``vetoes`` (with ``clock_grids``) and ``direct`` state what
contradicts or measures a cause. ``declared_cameras`` states which declared numbers of cameras were chosen.
``proposed_faults`` makes faults of a ``fitted_cause``, those of clocks in ``proposed_clock_faults``, of cameras in
``proposed_camera_faults`` and of poses and the IMU in ``proposed_motion_faults``, with sizes from the hypotheses and
from ``measured_sizes``, and the part of the images or of the time that deviates from ``image_parts``; ``conclusion``
states how a cause is known after they were undone.
"""
