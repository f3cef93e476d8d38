"""The machine around the planner: physics, camera, autopilot, MAVLink, reports and the command line."""

__version__ = "0.1.0"
