"""Rows of numbers in text: every dialect, missing samples, and fields that are no numbers."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lhpost6_pin.core.errors import RecordError
from lhpost6_pin.core.number_table import HOLES, Dialect, read_rows

DIALECTS = [Dialect(","), Dialect(";"), Dialect(";", ","), Dialect("\t"), Dialect("|"), Dialect(" "), Dialect(" ", ",")]
NUMBERS = st.floats(allow_nan=False, allow_infinity=False)


def read(lines, columns, dialect, holes=True):
    names, numbered = [f"c{i}" for i in range(columns)], list(enumerate(lines, 1))
    return read_rows(
        numbered, names, dialect, "t.csv", error=RecordError, commas="write points", correct="correct it", holes=holes
    )


@given(
    dialect=st.sampled_from(DIALECTS),
    rows=st.lists(st.lists(st.none() | NUMBERS, min_size=2, max_size=2), min_size=1, max_size=5),
    data=st.data(),
)
def test_numbers_and_missing_samples_are_read_as_they_were_written(dialect, rows, data):
    """To the last bit: `repr` is the shortest text that is read back as the same number."""
    holes = sorted(HOLES - {""} if dialect.separator == " " else HOLES)

    def field(value):
        if value is None:
            hole = data.draw(st.sampled_from(holes))
            return data.draw(st.sampled_from([hole, hole.upper(), f'"{hole}"'] if dialect.separator != " " else [hole]))
        return repr(value).replace(".", dialect.decimal)

    lines = [dialect.separator.join(map(field, row)) for row in rows]
    found = read(lines, 2, dialect)
    assert np.array_equal(found, [[math.nan if x is None else x for x in row] for row in rows], equal_nan=True)


def test_a_column_of_its_own_may_be_empty_in_some_rows():
    assert np.array_equal(read(["", "1", ""], 1, Dialect(",")), [[math.nan], [1.0], [math.nan]], equal_nan=True)


def test_without_rows_there_are_no_numbers():
    assert read([], 3, Dialect(",")).size == 0


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (["1,2", "x,3"], "line 2, column 'c0': 'x' is not a number; correct it"),
        (["1,2", ",3"], "line 2, column 'c0': '' is not a number; correct it"),
        (["1,2", "1e999,3"], "line 2, column 'c0': value is inf; correct it"),
        (["1,2", "1,2,3"], "line 2: 3 fields, the header has 2; correct it"),
        (["1,2", "1,5,2,5"], "line 2: 4 fields, the header has 2; write points"),
    ],
)
def test_what_is_no_number_is_named_with_its_place(lines, said):
    with pytest.raises(RecordError, match=said):
        read(lines, 2, Dialect(","), holes=False)
