"""What the rover decides: observations in, waypoints and wheel speeds out."""
