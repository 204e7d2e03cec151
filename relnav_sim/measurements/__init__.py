"""What a filter believes a sensor reads: the interface, linear and user-given measurements, the built-in sensors."""
