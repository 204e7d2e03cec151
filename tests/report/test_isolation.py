"""Figures look the same whatever the user's Matplotlib settings say, and those stay as they are."""

import io
import logging
import os
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pytest
from PIL import Image

from relnav_sim.plots.style import house_style, new_figure, png, svg, write_figure
from relnav_sim.report import figure
from relnav_sim.results import open_results
from relnav_sim.results.read import Results

ResultMaker = Callable[..., Path]
ODD: dict[str, Any] = {
    "text.usetex": True,  # where LaTeX is missing, every text fails
    "font.family": ["no such font"],
    "font.size": 40.0,
    "axes.facecolor": "black",
    "axes.unicode_minus": False,
    "savefig.bbox": "tight",
    "savefig.transparent": True,
    "figure.dpi": 17.0,
    "xtick.labelsize": 31.0,
    "path.sketch": (5.0, 100.0, 2.0),
    "svg.fonttype": "path",
    "interactive": True,
}
BROKEN = b"font.size: \xff\xfe\nlines.linewidth: banana\n"


@pytest.fixture(scope="module")
def results(invent: ResultMaker, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Results]:
    with open_results(invent(tmp_path_factory.mktemp("isolation"), runs=4)) as opened:
        yield opened


@pytest.mark.parametrize("kind", ["rms", pytest.param("trajectory", marks=pytest.mark.slow)])
def test_settings_of_the_user_change_no_pixel_and_are_kept(results: Results, kind: str) -> None:
    plain = png(figure(results, kind))
    with matplotlib.rc_context(ODD):
        before = dict(matplotlib.rcParams)
        assert png(figure(results, kind)) == plain
        assert dict(matplotlib.rcParams) == before


def test_a_figure_keeps_its_style_when_the_user_saves_it(results: Results) -> None:
    """Ticks are made while drawing, so that the settings of that moment would count."""

    def pixels() -> np.ndarray:
        file = io.BytesIO()
        figure(results, "rms").savefig(file, dpi=100)
        return np.asarray(Image.open(file))

    plain = pixels()
    with matplotlib.rc_context(ODD):
        np.testing.assert_array_equal(pixels(), plain)


def test_styles_within_each_other_end_with_the_users_own() -> None:
    size = matplotlib.rcParams["font.size"]
    with house_style({"pdf.fonttype": 42}):
        with house_style():
            assert matplotlib.rcParams["pdf.fonttype"] == 42
        assert matplotlib.rcParams["font.size"] == 7.5
    assert matplotlib.rcParams["font.size"] == size


def test_a_figure_for_a_paper_has_truetype_letters(results: Results, tmp_path: Path) -> None:
    write_figure(figure(results, "rms"), tmp_path / "rms.pdf")
    assert (
        b"/FontType 42" in (tmp_path / "rms.pdf").read_bytes()
        or b"/CIDFontType2" in (tmp_path / "rms.pdf").read_bytes()
    )


def test_signs_that_no_font_has_are_no_warning(capfd: pytest.CaptureFixture[str]) -> None:
    with house_style():
        drawn = new_figure(1.0)
        drawn.text(0.1, 0.5, "\N{CJK UNIFIED IDEOGRAPH-8F68}\N{GOTHIC LETTER AHSA}")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        png(drawn)
        svg(drawn)
    assert caught == []
    assert capfd.readouterr().err == ""
    assert logging.getLogger("matplotlib").level == logging.NOTSET


ODD_STARTS = {
    "a backend that is missing": {"MPLBACKEND": "module://no_such_notebook.backend"},
    "a backend that is none": {"MPLBACKEND": "nonsense"},
    "settings that are broken": {"MATPLOTLIBRC": "broken.rc"},
    "no folder for settings": {"MPLCONFIGDIR": "/dev/null/nowhere"},
}
TOGETHER = {name: value for environment in ODD_STARTS.values() for name, value in environment.items()}


@pytest.mark.parametrize(
    "environment",
    [
        pytest.param(TOGETHER, id="all together"),
        *(pytest.param(environment, id=name, marks=pytest.mark.slow) for name, environment in ODD_STARTS.items()),
    ],
)
def test_matplotlib_starts_whatever_its_settings_are(environment: dict[str, str], tmp_path: Path) -> None:
    (tmp_path / "broken.rc").write_bytes(BROKEN)
    program = (
        "import os, sys; before = [os.environ.get('MPLBACKEND'), os.environ.get('MATPLOTLIBRC')]\n"
        "from relnav_sim.plots.style import house_style, new_figure, png\n"
        "with house_style():\n    drawn = new_figure(1.0); drawn.subplots().plot([1, 2])\n"
        "assert len(png(drawn)) > 1000 and 'matplotlib.pyplot' not in sys.modules\n"
        "assert [os.environ.get('MPLBACKEND'), os.environ.get('MATPLOTLIBRC')] == before\n"
        "import matplotlib; print(matplotlib.rcParams['font.size'])"
    )
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", program],
        cwd=tmp_path, env={**os.environ, **environment}, capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr) == (0, "10.0\n", "")
