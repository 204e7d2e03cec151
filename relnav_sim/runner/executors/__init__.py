"""Who computes tasks: this process, worker processes, or a cluster, behind one protocol."""
