"""Orbits, frames, constants and gravity: neutral ground for the truth and for what filters believe."""
