"""Flights of a quadrotor: a route in position and yaw, and the attitude that follows from flying it.

What a scene says (``kinds``, ``burst``) becomes corners in time (``route``), those a path in closed form
(``smoothed_line``), and the path an attitude (``flatness``).
"""
