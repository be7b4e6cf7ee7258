"""The camera's blur, and the size of its pixels on the film."""
