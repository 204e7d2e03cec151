"""What a reader can copy from the documents works: Python runs, campaigns are valid, commands are relnav's.

Commands, and Python that computes or reads results, run in `make check-slow`, on the shipped campaigns with four runs
a case.
"""

import ast
import contextlib
import io
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
import typer
import yaml
from site_pages import PAGES, ROOT, SNIPPETS, blocks, snippets

from relnav_sim import load_campaign, run_campaign
from relnav_sim.cli.app import app

COMMANDS = re.compile(r"(?:\$ )?(?:relnav|make|pip|python|dask|sbatch|cp|jq|pytest) ")
RESULT = re.compile(r"results/(\w+)\.h5")


def ids(block):
    return block.name


def words(line):
    """The words of a command, its comment left out."""
    return shlex.split(line, comments=True)


def commands(block):
    """The command lines of a shell snippet, or after the prompts of a console's."""
    text = block.text.replace("\\\n", " ")
    if block.language == "console":
        text = "\n".join(line[2:] for line in text.split("\n") if line.startswith("$ "))
    return [line for line in text.split("\n") if words(line)]


def parsed(line):
    """Fail where a command is none, or has options that do not exist."""
    name, *rest = words(line)
    if name == "relnav":
        if rest == ["--version"]:
            return
        group = typer.main.get_command(app)
        with group.make_context("relnav", rest[:1], resilient_parsing=True) as context:
            command = group.get_command(context, rest[0])
            assert command is not None, f"relnav has no command {rest[0]}"
            command.make_context(rest[0], rest[1:], parent=context)
    elif name == "make":
        targets = re.findall(r"^([a-z-]+):.*##", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
        assert rest[0] in targets
    elif name == "python":
        path = rest[1].replace(".", "/") if rest[0] == "-m" else rest[0]
        assert any((ROOT / p).exists() for p in (path, f"{path}.py", f"{path}/__main__.py"))
    elif name in ("cp", "pytest"):
        path = next(word for word in rest if not word.startswith("-"))
        assert (ROOT / path).exists()
    else:
        assert name in ("source", "pip", "git", "dask", "sbatch", "jq", "head", "tail"), f"what is {name}?"


@pytest.mark.parametrize("block", snippets("sh", "console"), ids=ids)
def test_commands_exist_with_their_options(block):
    assert commands(block)
    for line in commands(block):
        parsed(line)


def test_a_wrong_option_would_be_found(capsys):
    with pytest.raises(typer.Exit):
        parsed("relnav run my.yaml --rums 5")
    assert "no option is named --rums" in capsys.readouterr().err
    with pytest.raises(AssertionError, match="no command"):
        parsed("relnav rum my.yaml")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_nothing_that_can_be_run_goes_without_a_language(page):
    for block in blocks(page):
        if block.language == "":
            first = block.text.lstrip().split("\n")[0]
            assert not COMMANDS.match(first) or re.search(r"warning|:$", first), f"{block.name}: {first}"
            assert not first.startswith(("import ", "from ", "with ", ">>> ")), block.name


def test_every_mark_has_its_reason_or_its_test():
    for block in snippets(*SNIPPETS, "console"):
        for kind, text in block.marks.items():
            assert len(text) > 5, block.name
            if kind == "run by":
                test = (ROOT / text).read_text(encoding="utf-8")
                assert block.page.stem in test or block.page.stem in Path(text).stem, f"{block.name}: {text}"


def waits(block):
    """Whether a snippet computes or reads a result."""
    return bool(re.search(r"results/|run_campaign|load_campaign", block.text))


def here(*languages, slow):
    mine = [b for b in snippets(*languages) if not {"run by", "not run"} & set(b.marks)]
    return [b for b in mine if waits(b) == slow]


def executed(block, space):
    """Run Python of a page, after what it takes as given; a last expression may stand for what a reader looks at."""
    exec(block.marks.get("given", ""), space)
    with contextlib.redirect_stdout(io.StringIO()) as said:
        exec(compile(ast.parse(block.text), block.name, "exec"), space)
    stated = re.findall(r"print\(.*\)\s+# (.+)$", block.text, re.MULTILINE | re.DOTALL)
    if stated:
        assert said.getvalue().strip() == stated[-1].strip()


@pytest.mark.parametrize("block", here("python", slow=False), ids=ids)
def test_python_runs(block, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    executed(block, {})


def deep(base, path, value):
    """A campaign's content with the keys of `value` at `path`; at the top, sections take them in beside their own."""
    here = base
    for key in path:
        here = here.setdefault(key, {})
    for key, given in value.items():
        old = here.get(key)
        both = isinstance(old, dict) and isinstance(given, dict)
        here[key] = old | given if both and not path else given
    return base


@pytest.mark.parametrize("block", [b for b in snippets("yaml") if not {"run by", "not run"} & set(b.marks)], ids=ids)
def test_yaml_is_valid(block, tmp_path):
    content = yaml.safe_load(block.text)
    whole = "name" in content and "truth" in content
    file, *path = block.marks.get("in", "campaigns/demo.yaml").split(" ")
    if whole:
        text = block.text
    else:
        base = yaml.safe_load((ROOT / file).read_text(encoding="utf-8"))
        text = yaml.safe_dump(deep(base, path[0].split(".") if path else [], content))
    (tmp_path / "c.yaml").write_text(text, encoding="utf-8")
    load_campaign(tmp_path / "c.yaml")


@pytest.fixture
def world(tmp_path, monkeypatch):
    """A folder with the shipped campaigns at four runs a case, and `my.yaml` and `campaign.yaml` to go by."""
    (tmp_path / "campaigns").mkdir()
    for path in sorted((ROOT / "campaigns").glob("*.yaml")):
        text = re.sub(r"^runs: \d+", "runs: 4", path.read_text(encoding="utf-8"), flags=re.MULTILINE)
        (tmp_path / "campaigns" / path.name).write_text(text, encoding="utf-8")
    mine = yaml.safe_load((tmp_path / "campaigns" / "demo.yaml").read_text(encoding="utf-8"))
    mine["filters"] = {"ekf": {"kind": "ekf"}, "huber": {"kind": "huber"}}
    del mine["grid"]
    mine["truth"]["epoch"] = "2026-03-20T00:00:00 UTC"
    for name in ("my", "campaign"):
        (tmp_path / f"{name}.yaml").write_text(yaml.safe_dump(mine | {"name": name, "runs": 20}), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def results_of(text):
    """Compute the results that a text reads, of shipped campaigns and of `my.yaml`."""
    for name in sorted(set(RESULT.findall(text))):
        file = next((path for path in (Path(f"campaigns/{name}.yaml"), Path(f"{name}.yaml")) if path.exists()), None)
        if file and not Path(f"results/{name}.h5").exists():
            campaign = load_campaign(file)
            run_campaign(campaign.with_stress() if campaign.stressed else campaign, backend="sequential")


@pytest.mark.slow
@pytest.mark.parametrize("block", here("sh", "console", slow=True) + here("sh", "console", slow=False), ids=ids)
def test_commands_run(block, world):
    if "relnav new my.yaml" in block.text:
        (world / "my.yaml").unlink()
    for line in commands(block):
        if words(line)[1] not in ("run", "merge"):
            results_of(line)
        done = subprocess.run(
            ["bash", "-c", line],
            cwd=world, capture_output=True, text=True,
            env=os.environ | {"PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}", "COLUMNS": "120"},
        )  # fmt: skip
        # 1: some runs failed, as the campaign may mean them to.
        assert done.returncode in (0, 1), f"{line}\n{done.stdout}{done.stderr}"
        assert "Traceback" not in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("block", here("python", slow=True), ids=ids)
def test_python_on_results_runs(block, world):
    results_of(block.text)
    executed(block, {})
