"""Execution only: from a campaign to a results file by plan, tasks, workers and shards."""
