"""What a filter believes: relative dynamics, process noise and measurement functions."""
