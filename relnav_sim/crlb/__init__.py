"""The posterior Cramér-Rao bound: recursion, Fisher information, and the models it is computed for."""
