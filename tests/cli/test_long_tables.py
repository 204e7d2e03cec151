"""Tables of very many rows have a line for each; shorter ones are broken to fit."""

from relnav_sim.cli import output

CELLS = ("a label of a case with many words, " * 3, "x", "a note of many words " * 3)


def printed(capsys, rows):
    output.print_table([(f"{i}", *CELLS) for i in range(rows)], ("case", "label", "figure", "note"))
    return capsys.readouterr().out.splitlines()


def test_a_row_of_a_long_table_is_a_line(capsys):
    lines = printed(capsys, output._MOST_WRAPPED + 1)
    assert len(lines) == output._MOST_WRAPPED + 2
    assert lines[0].split() == ["case", "label", "figure", "note"]
    for i, line in enumerate(lines[1:]):
        assert line.split("  ")[0].strip() == f"{i}" and all(cell.strip() in line for cell in CELLS)
    starts = {line.index("a note of") for line in lines[1:]}
    assert starts == {lines[0].index("note")}


def test_a_row_of_a_short_table_is_broken(capsys):
    lines = printed(capsys, 3)
    assert len(lines) > 4 and max(map(len, lines)) <= output._PIPED_WIDTH
