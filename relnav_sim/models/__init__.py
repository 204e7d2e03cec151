"""The former home of dynamics and measurements, kept for packages written for relnav 0.1; it goes with 0.3."""
