"""From images to light relative to the film at rest.

Division by the flat frame, drift, noise, coarser images, and light from film to film.  Another
correction of brightness goes here.
"""
