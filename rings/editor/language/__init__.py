"""What the server knows of a graph file: one question of an editor, one module."""
