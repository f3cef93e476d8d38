"""Hands on a keyboard or a gamepad, as deflections of sticks: no frames, no sockets."""
