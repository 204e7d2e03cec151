"""The tables of docs/choose-a-filter.md, from the results of three campaigns.

python tests/docs/choice_tables.py FOLDER     writes them, from FOLDER/choose_filter.h5 and the two others
"""

import re
import sys
from pathlib import Path

import numpy as np

from relnav_sim import open_results
from relnav_sim.statistics.intervals import mean_interval

PAGE = Path(__file__).parents[2] / "docs" / "choose-a-filter.md"
CONSISTENT = 1.25
NAMES = {
    "cw": "`cw`", "cw_2nd": "`cw_second_order`", "ya": "`yamanaka_ankersen`", "two_body": "`nonlinear`",
    "j2": "`nonlinear_j2`", "field": "`nonlinear_field`, degree 20",
    "gnss": "relative GNSS", "camera_crosslink": "camera and crosslink", "camera_radar": "camera and radar",
    "gnss_radar": "relative GNSS and radar",
}  # fmt: skip
LEVELS = ("1e-14", "1e-12", "1e-10", "1e-8", "1e-6", "1e-4")


def tables(folder):
    """Return the tables by name, each a list of lines."""
    return {"filters": _filters(folder), "dynamics": _dynamics(folder), "sensors": _sensors(folder)}


def _runs(path):
    """By case and filter: RMS and ANEES of each run; infinite where it failed."""
    with open_results(path) as results:
        s = results.summary()
        cells = {}
        for case in range(len(results.cases)):
            for name in results.filters:
                rows = (s["case"] == case) & (s["filter"] == name)
                rms = np.where(s["failed"][rows], np.inf, s["settled_r_rms_m"][rows])
                cells[case, name] = rms, s["settled_anees"][rows]
        return results.filters, cells


def _interval(rms):
    found = mean_interval(rms)
    digits = 2 if found.estimate < 10 else 0
    return f"{found.estimate:.{digits}f} [{found.low:.{digits}f}, {found.high:.{digits}f}]"


def _filters(folder):
    filters, cells = _runs(folder / "choose_filter.h5")
    head = ["| filter | good start | poor start | glint, good start | glint, poor start |", "|---|---|---|---|---|"]
    rows = []
    for name in filters:
        texts = []
        for case in range(4):
            rms = cells[case, name][0]
            lost = int((rms > 20).sum())
            texts.append(f"{lost} of {len(rms)} runs above 20 m" if lost >= len(rms) / 20 else _interval(rms))
        rows.append(f"| `{name}` | {' | '.join(texts)} |")
    return head + rows


def _dynamics(folder):
    filters, cells = _runs(folder / "choose_dynamics.h5")
    head = [
        "| dynamics | circle, 10 km | circle, 500 m | ellipse e = 0.1, 10 km | ellipse e = 0.1, 500 m |",
        "|---|---|---|---|---|",
    ]
    rows = []
    for name in filters:
        texts = []
        for scene in range(4):
            levels = [cells[scene * len(LEVELS) + k, name] for k in range(len(LEVELS))]
            consistent = [k for k, (_, anees) in enumerate(levels) if np.mean(anees) <= CONSISTENT]
            best = min(consistent, key=lambda k: np.mean(levels[k][0]))
            texts.append(f"{_interval(levels[best][0])} ({LEVELS[best]})")
        rows.append(f"| {NAMES[name]} | {' | '.join(texts)} |")
    return head + rows


def _sensors(folder):
    filters, cells = _runs(folder / "choose_sensors.h5")
    rows = [f"| {NAMES.get(n, n)} | {_interval(cells[0, n][0])} | {_interval(cells[1, n][0])} |" for n in filters]
    return ["| sensors | 10 km | 1 km |", "|---|---|---|", *rows]


def of_page(text):
    """Return the tables that a page holds, by name."""
    found = re.findall(r"<!-- measured: (\w+) -->\n(.*?)<!-- end -->", text, re.DOTALL)
    return {name: table.strip().split("\n") for name, table in found}


if __name__ == "__main__":
    page = PAGE.read_text(encoding="utf-8")
    for name, table in tables(Path(sys.argv[1])).items():
        block = f"<!-- measured: {name} -->\n" + "\n".join(table) + "\n<!-- end -->"
        page = re.sub(
            rf"<!-- measured: {name} -->\n.*?<!-- end -->", lambda _, block=block: block, page, flags=re.DOTALL
        )
    PAGE.write_text(page, encoding="utf-8")
