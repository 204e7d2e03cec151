"""LaTeX tables: every row fills its columns, every sign that LaTeX reads is escaped, braces balance."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from relnav_sim.report import write_report
from relnav_sim.report.latex import escaped, latex
from relnav_sim.report.tables import Column, Number, Row, Table, Words

ResultMaker = Callable[..., Path]


def widths(text: str) -> set[int]:
    """Return how many columns each line of the tabular spans, with that of its declaration."""
    declared = re.search(r"\{tabular\}\{@\{\}(.+)@\{\}\}", text).group(1)  # type: ignore[union-attr]  # it is there
    found = {len(re.sub(r"p\{[^}]*\}", "p", declared))}
    for line in text.splitlines():
        if line.endswith(r"\\"):
            cells = re.split(r"(?<!\\)&", line)
            spans = [re.match(r"\s*\\multicolumn\{(\d+)\}", cell) for cell in cells]
            found.add(sum(int(span.group(1)) if span else 1 for span in spans))
    return found


def test_by_hand() -> None:
    table = Table(
        "a_b", "Errors & more", "100 % of $x_1$.", "case",
        (Column("mean", "ekf"), Column("std", "ekf"), Column("said", numeric=False)),
        (
            Row("r = |position|", (Number(-1.5, -2, -1, 1), Number(0.25, decimals=2), Words("a<b")), "m"),
            Row("whole", (Words("best", span=2, mark="best"), Words("")), opens_block=True),
        ),
    )  # fmt: skip
    assert latex(table).splitlines() == [
        r"% needs \usepackage{booktabs,graphicx}",
        r"\begin{table}",
        r"  \centering\footnotesize",
        r"  \caption{Errors \& more. 100 \% of \$x\_1\$.}",
        r"  \label{tab:a-b}",
        r"  \sbox0{\begin{tabular}{@{}lrrl@{}}",
        r"    \toprule",
        r"     & \multicolumn{2}{c}{ekf} & \multicolumn{1}{c}{} \\",
        r"    \cmidrule(lr){2-3}",
        r"    case & \multicolumn{1}{c}{mean} & \multicolumn{1}{c}{std} & said \\",
        r"    \midrule",
        r"    r = $|$position$|$ / m & $-$1.5~{\scriptsize [$-$2.0, $-$1.0]} & 0.25 & a$<$b \\",
        r"    \midrule",
        r"    whole & \multicolumn{2}{c}{\textbf{best}} &  \\",
        r"    \bottomrule",
        r"  \end{tabular}}%",
        r"  \ifdim\wd0>\linewidth\resizebox{\linewidth}{!}{\usebox0}\else\usebox0\fi",
        r"\end{table}",
    ]


def test_long_words_are_set_in_lines() -> None:
    columns = (Column("settings", numeric=False), Column("n"))
    table = Table("t", "T", "C", "filter", columns, (Row("a", (Words("x " * 40), Number(1.0))),))
    assert r"{@{}lp{0.6\linewidth}r@{}}" in latex(table)


@pytest.mark.parametrize("text", ["\\input{x}", "$a_b^c$", "~#%&{}", 'say "x"'])
def test_nothing_is_left_for_latex_to_read(text: str) -> None:
    plain = re.sub(r"\\text\w+\{\}|\\[&%$#_{}]", "", escaped(text))
    assert not set(plain) & set('\\&%$#_{}~^"')


@pytest.mark.usefixtures("unrendered")
def test_every_table_of_a_report(make_result: ResultMaker, tmp_path: Path) -> None:
    path = make_result(
        labels=("a=1", "b_c=2"), filters={"ekf": 1.0, "u_kf%": 0.9}, runs=8, failed={"ekf": [1]},
        requirements={"wanted": {"kind": "nees"}},
    )  # fmt: skip
    folder = write_report(path, tmp_path / "out", formats=["latex"], most_figures=0)
    names = {file.stem for file in folder.glob("*.tex")}
    assert {"overview", "requirements", "filters", "case_000_settled", "case_001_comparison"} <= names
    for file in folder.glob("*.tex"):
        text = file.read_text(encoding="utf-8")
        assert len(widths(text)) == 1, file.name
        bare = re.sub(r"\\[{}]", "", text)
        assert bare.count("{") == bare.count("}")
