"""The host's side of the LED controller, and its protocol."""
