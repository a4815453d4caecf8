"""Tables in a terminal, a file and a pipe."""

from lhpost6_pin.show.report.page import Table
from lhpost6_pin.show.terminal import print_blocks


def test_nothing_of_a_wide_table_is_cut_off_in_a_pipe(capsys):
    """Columns of text that begins with a number do not wrap; the last ones were cut off at 160 characters."""
    cells = [f"{k}.00 (strength of the reaction mass); {k}.37 (pull of H1 to H4)" for k in range(6)]
    print_blocks(Table("Limits", ("axis", *"abcdef"), [("x", *cells)]))
    lines = capsys.readouterr().out.splitlines()
    row = next(line for line in lines if "0.00" in line)
    assert all(cell in row for cell in cells) and row.endswith("│")
