"""The page in a real browser: nothing complains, nothing is asked for, nothing is wider than a telephone."""

import csv
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from browser import CHROMIUM, Tab, tab

from relnav_sim.report import write_report

ResultMaker = Callable[..., Path]
pytestmark = [pytest.mark.slow, pytest.mark.skipif(not CHROMIUM, reason="no Chromium is installed")]

ROWS = "[...document.querySelectorAll('#overview tbody tr')]"
LABEL = "document.getElementById('chart').getAttribute('aria-label')"
PICK = """
globalThis.pick = (id, value) => {
  const choice = document.getElementById(id);
  choice.value = value;
  choice.dispatchEvent(new Event("change"));
};
0"""


@pytest.fixture(scope="module")
def pages(invent: ResultMaker, tmp_path_factory: pytest.TempPathFactory) -> dict[int, Path]:
    """Reports of 1, 8 and 60 cases, with awkward names, failed runs and a filter that has no run yet."""
    found = {}
    for cases in (1, 8, 60):
        folder = tmp_path_factory.mktemp(f"cases{cases}")
        path = invent(
            folder,
            name="<script>alert(1)</script>",
            labels=[f"sensors.radar.range_sigma_m={n}&<b>" for n in range(cases)],
            runs=1 if cases == 1 else 4,
            failed={} if cases == 1 else {"ekf": [1]},
            waiting=["ukf2"],
        )
        found[cases] = write_report(path, folder / "out", most_figures=20)
    return found


@pytest.fixture(scope="module")
def browser() -> Iterator[Tab]:
    with tab() as opened:
        yield opened


@pytest.mark.parametrize("cases", [1, 8, 60])
@pytest.mark.parametrize(("width", "scheme"), [(1280, "light"), (400, "dark")])
def test_nothing_complains_and_it_fits(
    browser: Tab, pages: dict[int, Path], cases: int, width: int, scheme: str
) -> None:
    browser.complaints.clear()
    browser.asked.clear()
    browser.open(pages[cases], width, scheme=scheme)
    assert browser.run("document.documentElement.scrollWidth") <= width
    for table in ("decision", "overview"):  # their rows are stacked where they are wider than the screen
        scroll = f"document.querySelector('#{table} .scroll')"
        assert browser.run(f"{scroll}.scrollWidth <= {scroll}.clientWidth")
    assert browser.run("document.querySelector('h1').textContent") == "<script>alert(1)</script>"
    assert browser.run("document.querySelectorAll('#chart path').length") > 2
    assert browser.complaints == []
    assert [address for address in browser.asked if not address.startswith("data:")] == [pages[cases].as_uri()]
    assert pages[cases].stat().st_size < 5_000_000


def test_switches_sorting_zoom_and_theme(browser: Tab, pages: dict[int, Path]) -> None:
    browser.open(pages[8], 1280)
    browser.run(PICK)
    visible = f"{ROWS}.filter((row) => !row.hidden).length"
    assert browser.run(visible) == 8 * 4
    browser.run("pick('filter-switch', 'ekf')")
    assert browser.run(visible) == 8
    browser.run("pick('case-switch', '3')")
    assert browser.run(visible) == 1
    assert browser.run("document.getElementById('chart-case').selectedOptions[0].textContent").startswith("3:")
    assert browser.run("document.querySelectorAll('#chart-legend [aria-pressed=true]').length") == 1
    browser.run("pick('case-switch', ''); pick('filter-switch', '')")

    browser.run("document.querySelectorAll('#overview th button')[2].click()")
    order = browser.run(f"{ROWS}.map((row) => Number(row.cells[2]?.dataset.order ?? Infinity)).filter(Number.isFinite)")
    assert order == sorted(order)

    span = f"{LABEL}.match(/from (\\S+) to (\\S+) s/).slice(1).map(Number)"
    assert browser.run(span) == [0, 6000]
    browser.run("document.getElementById('chart').focus()")
    for key in ("+", "+"):
        browser.press(key)
    low, high = browser.run(span)
    assert high - low == pytest.approx(1500, abs=10)
    browser.press("ArrowRight")
    assert browser.run("document.getElementById('chart-reading').textContent").startswith("t = ")
    browser.press("0")
    assert browser.run(span) == [0, 6000]

    colour = "getComputedStyle(document.body).backgroundColor"
    before = browser.run(colour)
    browser.run("document.getElementById('theme-switch').click()")
    assert browser.run(colour) != before
    browser.run("document.getElementById('theme-switch').click()")
    assert browser.complaints == []


def test_it_reads_without_scripts_and_prints(browser: Tab, pages: dict[int, Path], tmp_path: Path) -> None:
    browser.open(pages[8], 1280, scripts=False)
    browser.printed(tmp_path / "page.pdf")
    assert (tmp_path / "page.pdf").stat().st_size > 20_000
    html = pages[8].read_text(encoding="utf-8")
    assert '<section id="series" hidden>' in html and html.count("<img ") > 5


def test_a_table_is_downloaded_as_it_stands(browser: Tab, pages: dict[int, Path]) -> None:
    browser.open(pages[8], 1280)
    browser.run("""
globalThis.kept = [];
URL.createObjectURL = (blob) => { kept.push(blob); return "#"; };
HTMLAnchorElement.prototype.click = function () { kept.push(this.download); };
document.querySelector("#overview button.csv").click();
0""")
    assert browser.run("kept[1]") == "overview.csv"
    rows = list(csv.reader(browser.run("kept[0].text()").splitlines()))
    with open(pages[8].parent / "tables" / "overview.csv", encoding="utf-8") as file:
        written = list(csv.DictReader(file))
    assert len({len(row) for row in rows}) == 1
    shown = [dict(zip(rows[0], row, strict=True)) for row in rows[1:]]
    assert [row["filter"] for row in shown] == [row["filter"] for row in written]
    numbers = [
        [float(row["position RMS [m]"]) for row in table if row["position RMS [m]"] != "no run yet"]
        for table in (shown, written)
    ]
    assert numbers[0] == numbers[1]


def test_a_table_that_goes_on_has_a_shadow_and_no_broken_word(browser: Tab, pages: dict[int, Path]) -> None:
    browser.open(pages[8], 400)
    cut = "[...document.querySelectorAll('.scroll')].filter((part) => part.scrollWidth > part.clientWidth)"
    assert browser.run(f"{cut}.length") > 3
    assert browser.run(f"{cut}.every((part) => getComputedStyle(part).backgroundAttachment.includes('local'))")
    wide = (
        "[...document.querySelectorAll('thead th,tbody th')].filter((cell) => cell.scrollWidth > cell.clientWidth + 1)"
    )
    assert browser.run(f"{wide}.map((cell) => cell.textContent)") == []
    assert browser.run("getComputedStyle(document.querySelector('.sortable tbody th')).overflowWrap") != "anywhere"
