"""Find LEDs and film from presses of objects whose shapes nobody knows."""
