"""Colours, arrows and pictures of a touch, as plain functions that nodes share."""
