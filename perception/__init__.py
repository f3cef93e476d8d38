"""What the rover sees: pictures in, rocks and terrain classes on the ground out."""
