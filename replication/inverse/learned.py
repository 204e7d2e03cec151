"""What a network learns from a bank: a function of printed numbers, with inputs and outputs brought to one scale."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np

from relnav_sim.arrays import Array

WIDTHS = (128, 64)
CLIP = 6.0
"""Scaled inputs beyond this count as this: a network says nothing sensible further out."""
NARROWEST = 0.02
"""Least width of a scale: numbers that hardly differ but by rounding are the same."""


@dataclass(frozen=True)
class Scale:
    """Median and half the width of the middle 68 % of each quantity, (q,)."""

    middle: Array
    width: Array

    @classmethod
    def of(cls, values: Array) -> Scale:
        """Return the scale of values (n, q)."""
        low, middle, high = np.quantile(values, (0.16, 0.5, 0.84), axis=0)
        return cls(middle, np.maximum((high - low) / 2, NARROWEST))

    def scaled(self, values: Array) -> Array:
        """Return values on this scale, clipped."""
        return np.clip((values - self.middle) / self.width, -CLIP, CLIP)


@dataclass(frozen=True)
class Learned:
    """A function (n, inputs) -> (n, outputs)."""

    inputs: Scale
    outputs: Scale
    network: Any

    @classmethod
    def from_examples(cls, inputs: Array, outputs: Array, seed: int, epochs: int = 60) -> Learned:
        """Return the function that examples teach, by least squares with early stopping; deterministic."""
        from sklearn.exceptions import ConvergenceWarning
        from sklearn.neural_network import MLPRegressor

        scales = Scale.of(inputs), Scale.of(outputs)
        network = MLPRegressor(
            hidden_layer_sizes=WIDTHS,
            early_stopping=True,
            n_iter_no_change=6,
            max_iter=epochs,
            batch_size=256,
            random_state=seed,
            alpha=1e-4,
        )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)  # a limit on its time, not an error
            network.fit(scales[0].scaled(inputs), scales[1].scaled(outputs).squeeze())
        return cls(*scales, network)

    def __call__(self, inputs: Array) -> Array:
        """Return the outputs (n, outputs) of inputs (n, inputs)."""
        found = np.asarray(self.network.predict(self.inputs.scaled(inputs))).reshape(len(inputs), -1)
        return found * self.outputs.width + self.outputs.middle
