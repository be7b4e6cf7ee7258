"""The passes that turn a graph into the steps of a run, one file each."""
