"""Surface metrology of a height map: level it, filter it, measure grooves and steps."""
