"""The claims and sentences of Shi et al. (2025) as conditions on printed numbers.

As everywhere, a published reduction counts as reproduced when at least half of it is there, and a size within a factor
of two.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from relnav_sim.arrays import Array, Mask
from replication.inverse.alpha_kf_flight import ALPHAS, process_noise
from replication.inverse.alpha_kf_more_claims import absolute, holds_besides
from replication.inverse.alpha_kf_numbers import NUMBERS
from replication.inverse.alpha_kf_unknowns import COLUMNS, LABELS, SHARING, UNKNOWNS
from replication.inverse.bank import Bank
from replication.inverse.claims import Quantity, judged, roughly_met, wilson
from replication.inverse.pairs import claims_together
from replication.inverse.prior import values
from replication.inverse.sentences import Sentence, tested
from replication.inverse.table import rounded

_PLACE = {number.name: place for place, number in enumerate(NUMBERS)}
BEST_ALPHAS = (0.05, 0.1)


def _number(found: Array, name: str) -> Array:
    column: Array = found[:, _PLACE[name]]
    return column


def _below(found: Array, table: int, quantity: str, other: str) -> Array:
    """Return by how much the alpha filter's mean error is below another filter's, as a share."""
    alpha = _number(found, f"table_{table} alpha_kf {quantity} mean")
    return 1 - alpha / np.maximum(_number(found, f"table_{table} {other} {quantity} mean"), 5e-4)


def _reductions(found: Array, table: int, quantity: str, ekf: float, ukf: float) -> Mask:
    below_ekf, below_ukf = _below(found, table, quantity, "ekf"), _below(found, table, quantity, "ukf")
    return (below_ekf >= ekf / 2) & (below_ukf >= ukf / 2)


def _converge(found: Array) -> Mask:
    ekf, ukf, alpha = (
        np.maximum(_number(found, f"table_2 {name} convergence"), 0.2) for name in ("ekf", "ukf", "alpha_kf")
    )
    same = (alpha / ekf >= 21 / 18 / 2) & (alpha / ekf <= 21 / 18 * 2)
    return (ekf >= 9) & (ekf <= 36) & (ukf / alpha >= math.sqrt(240 / 21)) & same


def _least(found: Array, quantity: str) -> Mask:
    """Return whether a mean error is least at one of `BEST_ALPHAS`."""
    means = np.stack([_number(found, f"table_4 alpha={alpha:g} {quantity} mean") for alpha in ALPHAS], axis=1)
    return np.isin(np.argmin(means, axis=1), [ALPHAS.index(alpha) for alpha in BEST_ALPHAS])


def holds(found: Array) -> dict[str, Mask]:
    """Return in which papers (n, numbers) each claim holds by the numbers of their one run."""
    above_ukf = _number(found, "table_3 alpha_kf v mean") - _number(found, "table_3 ukf v mean")
    each = {
        "A1": _reductions(found, 2, "r", 0.746, 0.567),
        "A2": _reductions(found, 2, "v", 0.478, 0.400),
        "A3": _converge(found),
        "A4": _reductions(found, 3, "r", 0.345, 0.360),
        "A5": (_below(found, 3, "v", "ekf") >= 0.043 / 2) & (above_ukf >= 0.007 / 2),
        "A6": _least(found, "r"),
        "A7": np.zeros(len(found), dtype=bool),
    }
    return each


A7_SENTENCE = (  # counted, not flown
    "impossible: the paper states 10000 samples, and more than 13 cost more than a UKF, whatever it leaves open"
)


def quantities(u: Array) -> list[Quantity]:
    """Return what conditions are told of, from the bank's uniform numbers (n, unknowns)."""
    setting = values(UNKNOWNS, u)
    rows = [{name: float(value[row]) for name, value in setting.items()} for row in range(len(u))]
    noise = {column: np.array([process_noise(row, column)[0] for row in rows]) for column in COLUMNS}
    told = [
        Quantity(unknown.words, unknown.unit, setting[unknown.name], unknown.choices)
        for unknown in UNKNOWNS
        if "_psd_" not in unknown.name
    ]
    for table in (2, 3):
        own = noise[f"alpha_kf_{table}"]
        for other in ("ekf", "ukf"):
            ratio = noise[f"{other}_{table}"] / own
            told.append(
                Quantity(
                    f"the process noise of the {LABELS[other]} over the alpha filter's in Table {table}", "", ratio
                )
            )
    told += [Quantity(f"the process noise of the {words}", "m^2/s^3", noise[c]) for c, words in COLUMNS.items()]
    return told


def _common(setting: Mapping[str, Array]) -> Mask:
    return np.asarray(setting["sharing"] == SHARING.index("one for all"))


SENTENCES: tuple[Sentence, ...] = (
    Sentence(
        "The alpha filter and the UKF used the same R and Q: position errors 0.667 and 1.541 m.",
        _common,
        lambda found: np.log(_number(found, "table_2 ukf r mean") / _number(found, "table_2 alpha_kf r mean")),
        math.log(1.541 / 0.667),
    ),
    Sentence(
        "The alpha filter and the UKF used the same R and Q: convergence in 21 and 240 s.",
        _common,
        lambda found: np.log(
            np.maximum(_number(found, "table_2 ukf convergence"), 0.2)
            / np.maximum(_number(found, "table_2 alpha_kf convergence"), 0.2)
        ),
        math.log(240 / 21),
    ),
    Sentence(
        "EKF and UKF had the same R and Q too: position errors 2.623 and 1.541 m.",
        _common,
        lambda found: np.abs(np.log(_number(found, "table_2 ekf r mean") / _number(found, "table_2 ukf r mean"))),
        math.log(2.623 / 1.541),
    ),
    Sentence(
        "The relative velocity error is least between alpha = 0.05 and 0.1; Table 4 itself has it least at 0.999.",
        lambda setting: np.ones(len(setting["sharing"]), dtype=bool),
        None,
        0.0,
    ),
)


def findings(bank: Bank, printed: Array) -> dict[str, Any]:
    """Return what the bank says of each claim and sentence."""
    told, met = quantities(bank.u), roughly_met(bank.numbers, printed, NUMBERS)
    by_claim = holds(rounded(bank.numbers, NUMBERS)) | absolute(bank, printed)
    by_claim |= holds_besides(bank.outcomes, BEST_ALPHAS)
    claims = {name: judged(mask, told, NUMBERS, met) for name, mask in by_claim.items()}
    claims["A7"].update(probability=0.0, interval=[0.0, 0.0], sentence=A7_SENTENCE)
    together = np.all([mask for name, mask in by_claim.items() if name != "A7"], axis=0)
    setting = values(UNKNOWNS, bank.u)
    shared = {name: float(mask[_common(setting)].mean()) for name, mask in by_claim.items()}
    for name, share in shared.items():
        claims[name]["probability_with_one_process_noise"] = share
    return {
        "claims": claims,
        "all_claims": {
            "words": "All claims but the one on cost",
            "probability": float(together.mean()),
            "interval": list(wilson(int(together.sum()), len(together))),
        },
        "together": claims_together(by_claim),
        "sentences": [tested(sentence, setting, bank.numbers) for sentence in SENTENCES],
    }
