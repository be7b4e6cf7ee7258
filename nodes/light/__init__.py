"""From images to light relative to the film at rest.

Divides by the flat frame, takes drift off, states the noise, coarsens; models near light.
Another correction of brightness goes here.
"""
