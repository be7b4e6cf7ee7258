"""What `tactograph show` prints of this ring's files."""
