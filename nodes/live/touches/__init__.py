"""From a camera's frames to touches: match frames to LEDs, count faults."""
