"""Modes, arming, mission execution and fail-safes of the built-in autopilot: no bytes, no sockets."""
