"""Film that is no plane at rest: its shape by a drawing, or found from presses."""
