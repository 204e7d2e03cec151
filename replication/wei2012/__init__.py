"""Wei, Song and Zhang (2012): the model-free unscented particle filter."""
