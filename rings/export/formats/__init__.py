"""Files of height maps of one format each."""
