"""Files of heights in the formats of surface metrology: a format, a file."""
