"""Height maps in files of any format: read, and written for others."""
