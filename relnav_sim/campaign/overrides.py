"""Changes to a campaign from the command line (`--set PATH=VALUE`), and where in its sources a problem stands."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from relnav_sim.campaign.expand import Variable
from relnav_sim.campaign.loader import Document, load_document
from relnav_sim.campaign.paths import PathError, parse_path, replaced
from relnav_sim.campaign.problems import Path, Problem, dotted


class Source:
    """The file and the overrides of a campaign, to say where a value was written."""

    def __init__(self, name: str, document: Document) -> None:
        self.name = name
        self._document = document
        self._overridden: dict[Path, str] = {}

    def override(self, path: Path, text: str) -> None:
        """Note that the value at a path comes from an override."""
        self._overridden[path] = text

    def located(self, problem: Problem) -> tuple[tuple[int, int], str]:
        """Return a problem as ``file:line: path: sentence``, with a key to sort by."""
        path = f"{dotted(problem.path)}: " if problem.path else ""
        for order, (overridden, text) in enumerate(self._overridden.items()):
            if problem.path and problem.line is None and problem.path[: len(overridden)] == overridden:
                return (0, order), f"--set {text}: {path}{problem.sentence}"
        line = problem.line or self._document.line(problem.path)
        return (1, line), f"{self.name}:{line}: {path}{problem.sentence}"

    def swept_overrides(self, variables: tuple[Variable, ...]) -> list[Problem]:
        """Return a problem for each override of a value that the campaign varies anyway."""
        return [
            Problem(
                path,
                f"{variable.section} varies this value; set {variable.section}.{variable.text}=[VALUE] instead",
            )
            for path in self._overridden
            for variable in variables
            if path[: len(variable.path)] == variable.path[: len(path)]
        ]


def apply_overrides(data: Any, overrides: Sequence[str], source: Source) -> tuple[Any, list[Problem]]:
    """Return the data with the overrides in place.

    Args:
        data: The file's data.
        overrides: Each ``PATH=VALUE``, the value read as strictly as one in the file.
        source: Takes note of what was overridden.
    """
    problems: list[Problem] = []
    if not isinstance(data, dict):
        return data, problems
    for text in overrides:
        name, equals, value = text.partition("=")
        try:
            if not equals:
                raise PathError("write PATH=VALUE, for example runs=10")
            path = _override_path(name.strip(), data)
            source.override(path, text)
            document = load_document(value)
            problems += [Problem(path, problem.sentence) for problem in document.problems]
            if not document.problems:
                data = _changed(data, path, document.data)
        except PathError as error:
            source.override((text,), text)
            problems.append(Problem((text,), str(error)))
    return data, problems


def _changed(data: dict[str, Any], path: Path, value: Any) -> dict[str, Any]:
    """Return the data with a value in place; a filter without a value is taken out, as a sensor without one is none."""
    match path:
        case ("filters", name) if value is None and name in (data.get("filters") or {}):
            return {**data, "filters": {key: one for key, one in data["filters"].items() if key != name}}
    changed: dict[str, Any] = replaced(data, path, value)
    return changed


def _override_path(name: str, data: Any) -> Path:
    """Return the path of an override; below `grid`, `zip` and a stress's name the rest is one key."""
    section, _, rest = name.partition(".")
    if section in ("grid", "zip") and rest:
        return (section, rest)
    if section == "stress" and rest:
        known = [key for key in data.get("stress") or () if rest.startswith(f"{key}.")]
        stress = max(known, key=len, default=rest.partition(".")[0])
        below = rest.removeprefix(stress).removeprefix(".")
        return (section, stress, below) if below else (section, stress)
    return parse_path(name, data)
