import csv
import io
import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from replication.inverse.__main__ import app
from replication.inverse.findings import FILE, read_findings
from replication.inverse.page import PAGE, page_of
from replication.inverse.page_evidence import searches_reached
from replication.inverse.page_files import files_of
from replication.papers import papers

ROOT = Path(__file__).parents[3]


FORMER_WORDS = 6546


def test_the_page_and_its_files_are_the_committed_ones() -> None:
    page = page_of(read_findings())
    for name, text in {PAGE: page, **files_of(read_findings())}.items():
        assert (ROOT / "docs" / name).read_text(encoding="utf-8") == text
    assert len(page.split()) <= min(3200, FORMER_WORDS / 2)


def test_the_page_begins_with_the_verdicts_of_all_claims() -> None:
    found = read_findings()["papers"]
    verdicts = page_of(read_findings()).partition("## Method")[0]
    claims = {name: claim for bank in found.values() for name, claim in bank["claims"].items()}
    assert set(claims) == {name for paper in papers().values() for name in paper.claims}
    for name, claim in claims.items():
        (line,) = [line for line in verdicts.splitlines() if line.startswith(f"- [{name}]")]
        heading = verdicts[: verdicts.index(line)].rpartition("### ")[2].partition("\n")[0]
        assert heading.startswith("Impossible") == (claim["probability"] == 0)
        assert heading.startswith("Possible only if") == bool(claim["choices"])


def test_synthetic_papers_that_were_searched_are_shown() -> None:
    bank = read_findings()["papers"]["alpha_kf"]
    tables = {
        "all tables": {"distance": 90.2, "honest": [50.0, 120.4]},
        "table_2": {"distance": 80.0, "honest": [40, 50]},
    }
    known = [{"near": True, "forged": "", "tables": tables}, {"near": True, "forged": "table_2 ekf", "tables": tables}]
    page = page_of({"papers": {"alpha_kf": bank | {"searched": known}}})
    assert "| near this paper's | reached: 90 (120) | **not reached**: 80 (50) |" in page
    assert (
        "| near this paper's; Table 2, EKF \N{MULTIPLICATION SIGN} 2 | reached: 90 (120) | **not reached**: 80 (50) |"
        in page
    )
    (told,) = [line for line in page.splitlines() if line.startswith("- No one setting was found for")]
    assert told.endswith("the same search reached 1 of 2 near this paper's settings.")
    without = {key: value for key, value in bank.items() if key != "searched"}
    assert "the same search reached" not in page_of({"papers": {"alpha_kf": without}})


def test_tables_that_a_search_reached_are_counted_near_and_elsewhere_without_changed_ones() -> None:
    within, beyond = ({"distance": distance, "honest": [40.0, 50.0]} for distance in (50.0, 50.1))
    tables = {"all tables": beyond, "table_2": within, "table_3": within}
    papers_ = [{"near": near, "forged": "", "tables": tables} for near in (True, True, False)]
    changed = {"near": True, "forged": "table_2 ekf", "tables": tables}
    assert searches_reached([*papers_, changed]) == "4 of 6 near this paper's settings and 2 of 3 elsewhere"
    assert searches_reached([changed]) == searches_reached([]) == ""


def test_verdicts_by_a_stand_in_say_so() -> None:
    page, judged = page_of(read_findings()), read_findings()["papers"]["mf_upf_learned"]["stand_in"]["same"]
    for claim in judged:
        (line,) = [line for line in page.splitlines() if line.startswith(f"- [{claim}]")]
        assert "a stand-in was flown" in line
    assert page.count("a stand-in was flown") == len(judged)


def test_the_files_hold_every_number_and_every_unknown() -> None:
    found = read_findings()["papers"]
    numbers, unknowns = (list(csv.DictReader(io.StringIO(text))) for text in files_of(read_findings()).values())
    printed = [
        value for table in found["alpha_kf"]["tables"].values() for row in table["rows"] for value in row["paper"]
    ]
    assert [float(row["paper"]) for row in numbers] == printed
    assert len(unknowns) == sum(len(bank["bank"]["unknowns"]) for bank in found.values())


def test_a_part_of_the_findings_may_be_missing() -> None:
    """Nothing else is lost: each part is left out of a bank in turn, and nested parts too."""
    for name, bank in read_findings()["papers"].items():
        for part in set(bank) - {"bank", "claims", "tables"}:
            rest = {key: value for key, value in bank.items() if key != part}
            assert page_of({"papers": {name: rest}}).startswith("# Which settings")
            assert files_of({"papers": {name: rest}})
        for check in bank["checks"]:
            checks = {key: value for key, value in bank["checks"].items() if key != check}
            assert page_of({"papers": {name: bank | {"checks": checks}}})


def test_findings_have_what_their_readers_take() -> None:
    for found in read_findings()["papers"].values():
        assert {"bank", "claims", "sentences", "tables", "together"} <= found.keys()
        assert "coverage" in found["checks"]
        for claim in found["claims"].values():
            low, high = claim["interval"]
            assert 0 <= low <= claim["probability"] <= high <= 1
            assert {"choices", "settings", "conflicts"} <= claim.keys()
        for table in found["tables"].values():
            for row in table["rows"]:
                assert len(row["paper"]) == len(row["alone"]) == len(row["joint_residual"])
    assert FILE.stat().st_size < 1_000_000


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["infer", "alpha_kf", "--out", "nowhere"], "nowhere/alpha_kf holds no bank"),
        (["infer", "alpha"], "there is no paper 'alpha'; give one of alpha_kf, mf_upf, mf_upf_learned, two_step_kf"),
        (["bank", "alpha_kf", "--size", "150"], "give a multiple of 100"),
        ([], "relnav: missing command; inverse --help lists the commands"),
        (["nosuch"], "relnav: no command is named 'nosuch'; inverse --help lists the commands"),
        (["chek"], "relnav: no command is named 'chek'; did you mean inverse check?"),
        (["infer"], "relnav: missing argument 'PAPER'; inverse infer --help lists its options"),
        (["page", "--nosuch"], "relnav: no such option: --nosuch; inverse page --help lists its options"),
    ],
)
def test_a_mistake_is_one_sentence(arguments: list[str], words: str) -> None:
    result = CliRunner().invoke(app, arguments, prog_name="inverse")
    assert result.exit_code == 2
    assert words in result.output
    assert "Traceback" not in result.output and "Usage" not in result.output


def test_the_page_is_written(tmp_path: Path) -> None:
    (tmp_path / "findings.json").write_text(json.dumps({"papers": {}}))
    result = CliRunner().invoke(app, ["page", "--docs", str(tmp_path), "--findings", str(tmp_path / "findings.json")])
    assert result.exit_code == 0
    assert (tmp_path / PAGE).read_text().startswith("# Which settings")
