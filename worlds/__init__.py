"""What the ground is: scenario files, terrain, rocks and soil. No simulation lives here."""
