"""The light of a film by a reflectance map, and the slope from it."""
