"""Live sensors: cameras, LED controller and firmware, previews, guides, simulated sensors."""
