"""Keep results by key: in this process, and on disk from start to start."""
