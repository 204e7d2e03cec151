"""The page of speed figures has a place for everything that the benchmarks publish, and no other."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]


def test_page_and_scripts_name_the_same_sections():
    scripts = "".join(script.read_text() for script in (ROOT / "benchmarks").glob("*.py"))
    page = (ROOT / "docs" / "speed.md").read_text()
    published = sorted(re.findall(r'bench\.publish\(\s*"([^"]+)"', scripts))
    assert published == sorted(re.findall(r"<!-- (.+): measured -->", page))
    assert published == sorted(re.findall(r"<!-- (.+): end -->", page))


def test_make_bench_runs_every_script_that_publishes():
    run = re.search(r"^BENCHMARKS := (.*)$", (ROOT / "Makefile").read_text(), re.MULTILINE)[1].split()
    scripts = (ROOT / "benchmarks").glob("*.py")
    assert sorted(run) == sorted(script.stem for script in scripts if "bench.publish(" in script.read_text())
