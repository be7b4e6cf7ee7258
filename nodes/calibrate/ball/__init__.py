"""Find the balls on the presses, and prepare light and shape of every press."""
