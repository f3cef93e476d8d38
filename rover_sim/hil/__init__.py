"""Hardware and software in the loop: our world as the physics of a real autopilot."""
