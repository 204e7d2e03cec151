"""Relative motion that a filter may believe in: one model a file, and its process noise."""
