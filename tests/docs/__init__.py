"""Documentation: what it says can be done is done."""
