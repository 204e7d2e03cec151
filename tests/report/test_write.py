"""The report on disk: complete, self-contained, escaped, small."""

import csv
import errno
import os
import re
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path

import pytest

from relnav_sim.plots.style import house_style, new_figure
from relnav_sim.report import write_report
from relnav_sim.report.drawing import Drawing, FigureFolder, Picture, draw
from relnav_sim.results import open_results
from relnav_sim.results.block import ResultsError
from relnav_sim.wording import shown_number

ResultMaker = Callable[..., Path]

NASTY = '<script>alert("1")</script> & "quotes" *md*'
VOID = {"meta", "link", "img", "br", "wbr", "hr", "input"}


class Page(HTMLParser):
    """What a browser would take from a page: addresses, ids, scripts, texts, and whether every tag is closed."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.addresses: list[str] = []
        self.ids: list[str] = []
        self.images: list[dict[str, str | None]] = []
        self.scripts: list[str | None] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text: list[str] = []
        self.open: list[str] = []
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = dict(attrs)
        self.tags.append((tag, found))
        self.addresses += [value or "" for name, value in attrs if name in ("src", "href", "srcset", "action", "data")]
        self.ids += [found["id"] or ""] if "id" in found else []
        self.scripts += [found.get("type")] if tag == "script" else []
        if tag == "img":
            self.images.append(found)
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text.append(data)


@pytest.fixture(scope="module")
def report(invent: ResultMaker, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report of two cases and three filters with awkward names, one failed run; its figures have no pixels."""
    folder = tmp_path_factory.mktemp("report")
    path = invent(
        folder,
        name=NASTY,
        labels=("sensors.radar.noise.kind=<b>", "a|b"),
        filters={"kf": 1.0, 'e"k<i>f': 0.6, "u$k$f": 0.601},
        failed={"kf": [3]},
        text="name: </pre><script>alert(2)</script>\n",
    )
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("relnav_sim.plots.style.png", lambda _: b"\x89PNG")
        return write_report(path, folder / "out")


@pytest.fixture(scope="module")
def page(report: Path) -> Page:
    return Page(report.read_text(encoding="utf-8"))


def test_the_page_is_well_formed(page: Page) -> None:
    assert page.open == []
    assert len(page.ids) == len(set(page.ids))


def test_nothing_is_asked_for_from_elsewhere(report: Path, page: Page) -> None:
    html = report.read_text(encoding="utf-8")
    assert not re.search(r"""(src|href|srcset|action)\s*=\s*["']?\s*(https?:)?//""", html, re.IGNORECASE)
    assert not re.search(r"url\((?!#)|@import|fetch\(|XMLHttpRequest", html)
    outside = [address for address in page.addresses if not address.startswith(("data:", "#", "figures/"))]
    assert outside == []
    linked = [address for address in page.addresses if address.startswith("figures/")]
    assert linked and all((report.parent / address).is_file() for address in linked)


def test_names_show_as_text(page: Page) -> None:
    assert page.scripts == ["application/json", None]
    text = "".join(page.text)
    assert text.count(NASTY) >= 2
    assert "</pre><script>alert(2)</script>" in text
    assert 'e"k<i>f' in text


def test_every_figure_is_inside_with_words_for_those_who_cannot_see_it(page: Page) -> None:
    assert len(page.images) == 2 + (7 + 3) + (
        4 + 3
    )  # of all cases and the scenario, of the first with a closer look, of the second
    for image in page.images:
        assert (image["src"] or "").startswith("data:image/png;base64,")
        assert len(image["alt"] or "") > 30


def test_a_failed_run_is_shown_with_its_reason(page: Page) -> None:
    text = " ".join(page.text)
    assert "1 of 12" in text
    assert "the covariance is not positive definite" in text
    assert "Failed runs, left out of every mean: kf 2 of 24." in text


def test_the_campaign_can_be_computed_again(page: Page) -> None:
    text = " ".join(page.text)
    assert "relnav run campaigns/invented.yaml" in text
    assert "0123456789abcdef" * 4 in text
    assert "numpy 2.4.6" in text
    assert "sensors.radar.range_sigma_m" in "".join(page.text)


def test_csv_markdown_and_html_show_the_same_figures(report: Path, page: Page) -> None:
    with open_results(report.parent.parent / "invented.h5") as results:
        expected = results.statistic(1, "u$k$f", "mean")[:, 1, 0].mean()
    with open(report.parent / "tables" / "case_001_settled.csv", encoding="utf-8") as file:
        row = next(row for row in csv.DictReader(file) if row["error"] == "x")
    assert float(row["u$k$f mean"]) == pytest.approx(expected, rel=1e-12)
    assert float(row["u$k$f mean low 95"]) < expected < float(row["u$k$f mean high 95"])
    shown = shown_number(expected, 3)
    assert shown in " ".join(page.text)
    assert shown in (report.parent / "report.md").read_text(encoding="utf-8")


def test_figures_are_written_as_png(report: Path) -> None:
    names = {path.name for path in (report.parent / "figures").iterdir()}
    expected = ("accuracy_by_case", "case_000_rms", "case_001_boxes", "case_000_errors_kf", "case_001_errors_u_k_f_2")
    assert {f"{name}.png" for name in expected} <= names
    assert not [name for name in names if not name.endswith(".png")]


def test_a_figure_is_a_pdf_too_where_that_is_wanted_and_the_page_links_what_is_there(tmp_path: Path) -> None:
    def drawn(vectors: bool) -> tuple[Picture, set[str]]:
        with house_style():
            drawing = Drawing(new_figure(1.0), "caption", "words")
        picture = draw(FigureFolder(tmp_path, vectors), "one", lambda: drawing)
        assert picture is not None
        return picture, {path.name for path in tmp_path.iterdir()}

    both, files = drawn(vectors=True)
    assert (both.forms, files) == (("png", "pdf"), {"one.png", "one.pdf"})
    assert (tmp_path / "one.pdf").read_bytes().startswith(b"%PDF")
    one, files = drawn(vectors=False)
    assert (one.forms, files) == (("png",), {"one.png"}), "the PDF is of an earlier report"


def test_a_full_disk_names_the_figure_and_leaves_the_earlier_one_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def half(self: Path, content: bytes) -> int:
        with open(self, "wb") as file:
            file.write(content[: len(content) // 2])
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))  # as a write tells it: without a name

    (tmp_path / "one.png").write_bytes(b"earlier")
    monkeypatch.setattr(Path, "write_bytes", half)
    with house_style():
        drawing = Drawing(new_figure(1.0), "caption", "words")
    with pytest.raises(OSError, match="No space left") as full:
        draw(FigureFolder(tmp_path, vectors=False), "one", lambda: drawing)
    assert full.value.filename == str(tmp_path / "one.png")
    assert [path.name for path in tmp_path.iterdir()] == ["one.png"]
    assert (tmp_path / "one.png").read_bytes() == b"earlier"


def test_the_page_links_every_file_of_a_figure(report: Path) -> None:
    linked = set(re.findall(r'href="(figures/[^"]+)"', report.read_text(encoding="utf-8")))
    assert linked == {f"figures/{path.name}" for path in (report.parent / "figures").iterdir()}


def test_the_markdown_is_safe_and_complete(report: Path) -> None:
    text = (report.parent / "report.md").read_text(encoding="utf-8")
    assert "<script>alert(1)" not in text.replace(NASTY, "")
    assert text.startswith("# &lt;script&gt;")
    images = re.findall(r"\]\((figures/[^)]+)\)", text)
    assert len(images) == 19
    assert all((report.parent / image).is_file() for image in images)


@pytest.mark.slow
def test_many_cases_stay_small(make_result: ResultMaker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("relnav_sim.plots.style.pdf", lambda _: b"%PDF")  # which no page holds
    path = make_result(labels=[f"sensors.radar.range_sigma_m={n}" for n in range(25)], filters={"ekf": 1.0}, runs=3)
    index = write_report(path, tmp_path / "out", most_figures=4, workers=1)
    assert index.stat().st_size < 5_000_000
    page = Page(index.read_text(encoding="utf-8"))
    assert len(page.images) == 1 + 2 + 6 + 1  # the scenario, over all cases, and the first case
    assert {f"case-{n}" for n in range(25)} <= set(page.ids)
    assert " ".join(page.text).count("figures of this case are omitted") == 24
    assert "relnav figure invented.h5 errors --case case0024" in " ".join(page.text)
    assert (tmp_path / "out" / "tables" / "case_024_whole.csv").is_file()


@pytest.mark.slow
def test_pictures_that_do_not_fit_are_linked(make_result: ResultMaker, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr("relnav_sim.report.compose._LARGEST_HTML", 190_000)
    index = write_report(make_result(runs=3), tmp_path / "out")
    assert index.stat().st_size < 190_000
    page = Page(index.read_text(encoding="utf-8"))
    assert 0 < len(page.images) < 10
    assert sum(address.endswith(".png") for address in page.addresses) == 11


def test_workers_change_nothing(make_result: ResultMaker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("relnav_sim.report.compose._WORTH_A_PROCESS", 2)
    path = make_result(labels=["a=0", "a=1"], filters={"ekf": 1.0}, runs=3, times=11)
    pages = [write_report(path, tmp_path / str(n), most_figures=4, workers=n).read_bytes() for n in (1, 2)]
    assert pages[0] == pages[1]


@pytest.mark.usefixtures("undrawn", "unrendered")
def test_an_unfinished_campaign_is_reported(make_result: ResultMaker, tmp_path: Path) -> None:
    index = write_report(make_result(filters={"ekf": 1.0}, runs=4, planned=9), tmp_path / "out", formats=("html",))
    assert "The campaign is not finished: 5 runs" in index.read_text(encoding="utf-8")


@pytest.mark.usefixtures("undrawn", "unrendered")
def test_filters_and_cases_without_runs_are_named(make_result: ResultMaker, tmp_path: Path) -> None:
    path = make_result(labels=("a=1", "a=2"), filters={"ekf": 1.0}, runs=3, waiting=["ukf"], computed_cases=1)
    index = write_report(path, tmp_path / "out")
    text = " ".join(Page(index.read_text(encoding="utf-8")).text)
    assert "The campaign is not finished: 9 runs" in text
    assert "No run yet of ukf." in text
    assert "No run yet of ekf, ukf." in text
    with open(tmp_path / "out" / "tables" / "overview.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["filter"] for row in rows] == ["ekf", "ukf", "ekf", "ukf"]
    assert [row["position RMS [m]"] for row in rows[1:]] == ["no run yet"] * 3


@pytest.mark.usefixtures("undrawn", "unrendered")
def test_the_folder_lies_beside_the_result_and_formats_choose(make_result: ResultMaker) -> None:
    path = make_result(filters={"ekf": 1.0}, runs=1)
    assert write_report(path, formats=("csv", "md")) == path.with_suffix("") / "report.md"
    assert not (path.with_suffix("") / "index.html").exists()
    assert write_report(path, formats=["csv"]) == path.with_suffix("") / "tables"


@pytest.mark.usefixtures("unrendered")
def test_a_report_can_be_written_twice(make_result: ResultMaker) -> None:
    path = make_result(filters={"ekf": 1.0}, runs=2)
    first = write_report(path).read_bytes()
    assert write_report(path).read_bytes() == first


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"formats": ("pdf",)}, "html, md, csv, latex, not 'pdf'"),
        ({"formats": ()}, "at least one"),
        ({"axes": "lvlh"}, "rtn, shi2025, not 'lvlh'"),
    ],
)
def test_wrong_choices_are_refused_before_anything_is_written(
    make_result: ResultMaker, options: dict[str, object], words: str
) -> None:
    path = make_result(filters={"ekf": 1.0}, runs=1)
    with pytest.raises(ValueError, match=words):
        write_report(path, **options)  # type: ignore[arg-type]  # wrong on purpose
    assert not path.with_suffix("").exists()


def test_what_is_no_result_is_refused(tmp_path: Path) -> None:
    (tmp_path / "bad.h5").write_text("no HDF5")
    with pytest.raises(ResultsError, match=r"bad\.h5"):
        write_report(tmp_path / "bad.h5")
    assert not (tmp_path / "bad").exists()
