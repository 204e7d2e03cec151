"""Liu et al. (2011): the improved two-step Kalman filter."""
