"""Augmented states: dynamics of [x; b], and the kinds of b that a campaign can name."""
