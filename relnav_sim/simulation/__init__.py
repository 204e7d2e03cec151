"""One block of runs as a pure function: truth, sensors, filters, statistics per run."""
