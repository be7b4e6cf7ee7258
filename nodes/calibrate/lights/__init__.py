"""Find the LEDs' positions, and the presses and the ambient light that fit them."""
