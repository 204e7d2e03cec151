"""Which unreported settings of three papers give their printed numbers, or that none do."""
