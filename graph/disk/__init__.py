"""Safe reading and writing of files: strict YAML, plain arrays, atomic files, a cache on disk."""
