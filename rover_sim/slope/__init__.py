"""Slope and traction stress test: rigs that drive the simulated rover as a test bench would."""
