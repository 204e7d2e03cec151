"""Statistics of a campaign: per-run figures at full rate while a block runs, and what they say over runs."""
