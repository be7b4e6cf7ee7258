"""Heights for other programs in further formats, and what is in a file."""
