"""Files read and written safely: strict YAML, plain arrays, whole files, a cache on disk."""
