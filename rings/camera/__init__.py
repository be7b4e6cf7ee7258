"""The lens and the tilt of a camera, from an image of a grid on the film."""
