"""The commands of the program, one module each; heavy imports wait until a command runs."""
