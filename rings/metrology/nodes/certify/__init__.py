"""What a sensor measures and how surely, in the terms of ISO 25178-600 and -700 and of the GUM."""
