"""Scans of GelSight's sensors that flash their LEDs, by the light model that comes with them."""
