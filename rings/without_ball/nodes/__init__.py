"""LEDs and film of a sensor into which no ball was pressed."""
