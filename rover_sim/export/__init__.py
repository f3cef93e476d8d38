"""Worlds as files that other programs open: SDF, URDF, glTF and height maps."""
