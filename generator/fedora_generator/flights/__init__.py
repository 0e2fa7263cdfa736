"""Flights of a quadrotor: a route in position and yaw, and the attitude that follows from flying it.

Read in this order:

* ``kinds``: the options of each kind of flight; each builds a route.
* ``route``: waypoints become corners in time, and these a path with derivatives in closed form.
* ``gusts``: the wind, and how far it pushes the quadrotor off its path.
* ``quadrotor``: the attitude that follows from the path, and the state at each instant.
* ``choice``: which kind a scene's table describes. It first resolves missions of QGroundControl (``plan``) and the
  flights of the package (``presets``).
"""
