"""Objects that fill the frame: no film is at rest, so a plane is level and a known step scales."""
