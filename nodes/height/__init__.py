"""From slope to height in mm.

Integrators, the film at rest set to zero, and the height's stated error.
A new integrator goes here.
"""
