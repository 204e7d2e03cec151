"""What has been recorded in flight, or by a simulation, and files hold: readings, ephemerides."""
