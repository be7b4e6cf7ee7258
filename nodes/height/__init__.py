"""From slope to height in mm.

Integrators, and nodes that set the film at rest to zero.
A new integrator goes here.
"""
