"""One-shot sensors: three coloured lights at once, a map of the light instead of LED places."""
