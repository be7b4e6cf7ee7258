"""Mechanics of touch: contacts over time, pose, slip, stitching, markers, forces and shear."""
