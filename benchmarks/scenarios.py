"""Fly the library of campaigns and write docs/scenarios.md: what each asks, why, and the decision of its report.

    python benchmarks/scenarios.py                every scenario; three minutes of processor time
    python benchmarks/scenarios.py geo demo       these, and any that the page lacks

Questions and reasons come from the campaigns, decisions from `relnav report`.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
import textwrap
from pathlib import Path

from relnav_sim.cli.library import first_words, library_names, library_text

PAGE = Path(__file__).parents[1] / "docs" / "scenarios.md"

_HEAD = """# Scenarios

Campaigns that come with relnav, each small enough to run in seconds and each with a question whose answer is not plain
beforehand. `relnav list campaigns` lists them from any folder. To have one, change it and run it:

<!-- run by: tests/cli/test_new.py -->
```sh
relnav new my.yaml --from vbar-hold
relnav run my.yaml
relnav report
```

Below each question stands why it is asked and the first sentence of the decision in its report, for the numbers of the
file as it comes. It is an answer to that file, not a rule: other sensors, orbits or process noise may turn it, which
is what the file is there to be changed for. "No filter can be recommended" is an answer too: each of those compared
diverges, misses a requirement, or is overconfident.

`make scenarios` flies all of them and writes this page anew.
"""


def why(text: str) -> str:
    """Return the paragraph below the question of a campaign, which ends at an empty comment line."""
    paragraphs = re.split(r"^#\s*$", text.split("\n\n", 1)[0], flags=re.MULTILINE)
    return " ".join(line.removeprefix("#").strip() for line in paragraphs[1].strip().splitlines())


def decision_of(name: str, folder: Path) -> str:
    """Fly a campaign of the library in a folder and return the first sentence of its decision."""

    def relnav(*words: str) -> str:
        command = [sys.executable, "-m", "relnav_sim", *words]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(f"{' '.join(words)}: {done.stderr}")
        return done.stdout

    relnav("new", f"{name}.yaml", "--from", name)
    relnav("run", f"{name}.yaml", "--workers", "1")
    _page, *decision = relnav("report", f"results/{name}.h5", "--format", "md").splitlines()
    if not decision:
        raise RuntimeError(f"{name}: its report decides nothing")
    return decision[0]


def choice_of(decision: str) -> str:
    """Return the choice that a decision's sentence begins with: "Fly ekf", without the numbers after it."""
    return re.split(r" \(|: ", decision, maxsplit=1)[0]


def page_of(decisions: dict[str, str]) -> str:
    """Return the page, with a section for each campaign of the library."""
    sections = [_HEAD]
    for name in library_names():
        text = library_text(name)
        reason = textwrap.fill(why(text), 120, break_on_hyphens=False)
        sections.append(f"## {name}\n\n**{first_words(text)}**\n\n{reason}\n\n> {decisions[name]}\n")
    return "\n".join(sections)


def decisions_on(page: str) -> dict[str, str]:
    """Return the decisions of a page, by the names of their campaigns, as they stand there."""
    return dict(re.findall(r"^## (\S+)\n(?:(?!## |> ).*\n)*> (.+)$", page, flags=re.MULTILINE))


def main(names: list[str]) -> None:
    """Fly the campaigns named, or all, and write the page."""
    decisions = decisions_on(PAGE.read_text(encoding="utf-8")) if PAGE.exists() else {}
    missing = [name for name in library_names() if name not in decisions]
    for name in dict.fromkeys([*(names or library_names()), *missing]):
        with tempfile.TemporaryDirectory() as folder:
            decisions[name] = decision_of(name, Path(folder))
        print(f"{name}: {decisions[name]}", flush=True)
    PAGE.write_text(page_of(decisions), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
