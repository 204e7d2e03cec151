"""How campaigns grow: CPU time, memory and bytes of every command against runs, cases, filters and epochs."""
