"""What is shown of this ring's files."""
