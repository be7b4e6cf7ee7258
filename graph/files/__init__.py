"""Graph files: strict YAML read, variants patched, graphs written back as files and schema."""
