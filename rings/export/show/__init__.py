"""What `tactograph show` prints of stores."""
