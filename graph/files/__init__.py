"""Graph files: read strict YAML, apply variants, and write graphs and their schema."""
