"""Trial suites: many traverses over a grid of conditions, their table and their report."""
