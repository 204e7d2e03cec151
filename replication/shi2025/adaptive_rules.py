"""The rules of Shi et al. (2025) for their future work: an alpha found at each epoch."""

from __future__ import annotations

from dataclasses import replace

from replication.rules import Interpretation, Part, Rule
from replication.shi2025.interpretations import ALPHAS, BEST_ALPHAS, R_MEAN, V_MEAN, role_of
from replication.shi2025.rules import RULES


def _with_alpha(interpretation: Interpretation, name: str) -> Interpretation:
    return replace(interpretation, filters={**interpretation.filters, "alpha_kf": name})


_JUDGED = ("A1", "A2", "A3", "A4", "A5", "A6", "A7")
_FOUND_ALPHA = (
    Part(
        "alpha that the filter finds, mean over updates",
        "value",
        ("alpha_kf",),
        "diagnostic_alpha",
        "1",
        at_least=BEST_ALPHAS[0],
        at_most=BEST_ALPHAS[1],
    ),
    *(
        Part(
            f"how much lower its mean {what} error is than at the best fixed alpha",
            "margin",
            ("alpha_kf",),
            column,
            "%",
            tuple(map(role_of, ALPHAS)),
            at_least=0.0,
        )
        for what, column in (("position", R_MEAN), ("velocity", V_MEAN))
    ),
)


def future_rules() -> tuple[Rule, ...]:
    """Return the rules with the adaptive alpha filter in the alpha filter's place.

    The paper leaves an alpha found online to future work. For the mixture it is told the mixture (scheme
    responsibilities); for Gaussian noise it has nothing to find (scheme student_t). A6 asks which fixed alpha is best:
    here the alpha that the filter finds must lie in that range, and serve better than every fixed one. One process
    noise for all filters; the claims on printed numbers, outliers, wave and covariance are not repeated.
    """
    rules = []
    for rule in RULES:
        if rule.claim not in _JUDGED:
            continue
        main = tuple(_with_alpha(item, "adaptive_alpha") for item in rule.main if item.name == "common")
        if rule.claim == "A6":
            text = (
                "As A6: the alpha that the filter finds, mean over the updates of a run, lies in 0.05 to 0.1, and its "
                "mean position error and mean velocity error are lower than at every fixed alpha of Table 4, on the "
                "same runs, all with their whole 95 % intervals."
            )
            rule = replace(rule, text=text, parts=_FOUND_ALPHA)
        elif rule.claim == "A7":
            # Counted for each scheme; nothing is sampled.
            main = tuple(
                Interpretation(scheme, words, filters={"alpha_kf": f"adaptive_{scheme}"})
                for scheme, words in (
                    ("responsibilities", "told the mixture of two components"),
                    ("student_t", "with Student-t noise and three steps"),
                )
            )
        rules.append(replace(rule, main=main, others=()))
    return tuple(rules)
