"""Batches: every capture once, whatever dies."""
