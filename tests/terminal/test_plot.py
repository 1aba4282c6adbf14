"""Plots, looks and quantities."""

import io
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hdassist.features.report import Curve, CurveMark, Hole, Quantity, Seat, SeatMark, Table, as_object, csv_table
from hdassist.interface.terminal.output import combine, csv_text, json_text
from hdassist.interface.terminal.plot import curve, dots_to_braille, least_and_greatest, seat_in_characters
from hdassist.interface.terminal.streams import Style

BRAILLE, ASCII = Style(ascii=False, codes=False, width=80), Style(ascii=True, codes=False, width=80)


def rows(page: str) -> list[str]:
    """The drawn rows of a plot, without its axes."""
    return [re.split(r"[│┤|+]", line, maxsplit=1)[1] for line in page.splitlines()[1:-3]]


def test_axes_are_numbered_and_carry_units():
    page = curve(BRAILLE, Curve(np.array([0.0, 360.0]), np.array([-7.0, 12.0]), "angle, deg", "error, arcsec"))
    lines = page.splitlines()
    assert lines[0] == "error, arcsec"
    assert lines[-1].strip() == "angle, deg"
    numbers = [float(n) for n in re.findall(r"^ *(-?[\d.]+) ┤", page, flags=re.MULTILINE)]
    assert numbers == sorted(numbers, reverse=True)
    assert -7 <= numbers[-1] < numbers[0] <= 12
    assert [float(n) for n in lines[-2].split()] == [0, 100, 200, 300]


@pytest.mark.parametrize("style", [BRAILLE, ASCII])
def test_a_rising_line_rises(style):
    drawn = rows(curve(style, Curve(np.linspace(0, 1, 200), np.linspace(0, 1, 200), "x", "y", rows=10)))
    first = [min((k for k, c in enumerate(row) if c.strip()), default=None) for row in drawn]
    seen = [k for k in first if k is not None]
    assert len(seen) == len(drawn)
    assert seen == sorted(seen, reverse=True)
    assert seen[-1] == 0
    assert seen[0] > 60


def test_a_legend_breaks_between_its_parts():
    x = np.linspace(0, 1, 50)
    drawn = Curve(x, x, "x", "error, least and greatest around", second=-x, names=("before", "after"))
    for width in range(40, 60):
        page = curve(Style(ascii=False, codes=False, width=width), drawn)
        assert "⠒⠒⠒ before" in page and "⠒⠒ ⠒⠒ after" in page


@pytest.mark.parametrize("size", range(3, 13))
def test_axis_number_is_in_the_row_of_its_value(size):
    for level in (20, 40, 60, 80):
        page = curve(BRAILLE, Curve(np.array([0.0, 1.0, 2.0]), np.array([7.0, level, 93.0]), "x", "y", rows=size))
        found = re.search(rf"^ *{level} ┤(.*)$", page, flags=re.MULTILINE)
        columns = len(rows(page)[0])
        if found:
            assert found[1].ljust(columns)[columns // 2 - 1 : columns // 2 + 1].strip(), (level, page)


@given(st.integers(2, 14), st.floats(-1e4, 1e4), st.floats(1e-3, 1e5))
def test_axis_numbers_are_exact_in_the_middle_of_rows(size, low, span):
    page = curve(ASCII, Curve(np.array([0.0, 1.0]), np.array([low, low + span]), "x", "y", rows=size))
    drawn = page.splitlines()[1:-3]
    assert 2 <= len(drawn) <= size + 1
    numbers = {k: float(row.split()[0]) for k, row in enumerate(drawn) if re.match(r" *-?[\d.e+-]+ \+", row)}
    (first, upper), *between, (last, lower) = numbers.items()
    height = (upper - lower) / (last - first)
    for row, number in between:
        assert number == pytest.approx(upper - (row - first) * height, abs=1e-4 * span)
    assert abs(upper + first * height - (low + span)) <= 0.51 * height + 1e-5 * abs(
        low
    )  # the greatest value in the first row
    assert abs(lower - (len(drawn) - 1 - last) * height - low) <= 0.51 * height + 1e-9 * abs(low)


def test_crowded_points_show_their_range():
    x = np.linspace(0, 1, 20000)
    drawn = rows(curve(ASCII, Curve(x, np.where(np.arange(20000) % 2, 1.0, -1.0), "x", "y")))
    assert all(set(row) == {"*"} and len(row) >= 70 for row in drawn)


def test_an_envelope_has_two_lines_and_nothing_between():
    x = np.linspace(0, 100, 20000)
    drawn = rows(curve(ASCII, Curve(x, 10 * np.sin(2 * np.pi * x), "x", "y", over=1.0)))
    marked = [row for row in drawn if row.strip()]
    assert len(marked) == 2
    assert all(set(row) == {"*"} and len(row) >= 70 for row in marked)
    assert drawn[0] == marked[0]
    assert drawn[-1] == marked[-1]


def test_an_envelope_has_a_whole_stretch_at_its_edges_too():
    x = np.linspace(0, 20, 4000)
    y = np.sin(2 * np.pi * x) + np.where(x % 1 > 0.6, 3.0, 0.0)  # greatest late in each stretch
    least, greatest = least_and_greatest(x, y, 140, 1.0)
    for _, values in (least, greatest):
        assert np.ptp(values) < 0.05
    assert least_and_greatest(x[:100], y[:100], 140, 1.0)[1][1][0] == y[:100].max()  # a stretch longer than the curve


def test_a_gap_is_drawn_as_one():
    x = np.linspace(0, 100, 20000)
    x = x[(x < 30) | (x > 60)]
    drawn = rows(curve(ASCII, Curve(x, 10 * np.sin(2 * np.pi * x), "x", "y", over=1.0)))
    marked = [row for row in drawn if row.strip()]
    assert len(marked) == 2
    assert all(row[:20] == "*" * 20 and not row[23:40].strip() and row[45:65] == "*" * 20 for row in marked)


@pytest.mark.parametrize("more", [{}, {"second": np.linspace(0, 0.5, 50), "names": ("a", "b"), "rows": 20}])
def test_nearby_limit_is_a_horizontal_line_with_its_number(more):
    x = np.linspace(0, 1, 50)
    page = curve(ASCII, Curve(x, x, "x", "y", limit=1.25, **more))
    first, *others = rows(page)
    assert set(first) == {*"- 1.25"} and first.endswith("- 1.25")
    assert not any("1.25" in row for row in others)
    assert any("*" in row for row in others[: len(others) // 3])  # no empty half


def test_a_limit_that_is_far_takes_no_room():
    x = np.linspace(0, 1, 50)
    page = curve(ASCII, Curve(x, x, "x", "y", limit=3.0))
    assert "limit 3 lies above" in page.splitlines()[0]
    assert "*" in rows(page)[0] and "*" in rows(page)[-1]


def test_values_far_from_0_leave_no_half_empty():
    x = np.linspace(0, 1, 50)
    assert "*" in rows(curve(ASCII, Curve(x, 20 + 4 * x, "x", "y", from_zero=True)))[-1]
    near = curve(ASCII, Curve(x, 3 + 9 * x, "x", "y", from_zero=True))
    assert " 0 +" in near


def test_marks_have_one_sign_on_every_page_with_a_legend():
    x = np.linspace(0, 11, 12)
    marks = [CurveMark(k, float(k), words, "now") for k, words in enumerate(("now", "best", "measured", "next"))]
    page = curve(BRAILLE, Curve(x, x, "holes", "y", marks=tuple(marks)))
    assert page.splitlines()[-1].strip() == "holes (N: now, B: best, ◆: measured, ?: next)"
    assert "".join(rows(page)).count("◆") == 1
    assert "o: measured" in curve(ASCII, Curve(x, x, "holes", "y", marks=tuple(marks)))


def test_a_mark_before_the_curve_stands_at_its_begin():
    marks = (CurveMark(0.0, 0.5, "enough", "target"),)
    drawn = rows(curve(ASCII, Curve(np.linspace(1, 10, 20), np.linspace(0, 1, 20), "x", "y", marks=marks)))
    assert [row[0] for row in drawn].count("E") == 1


def test_letters_at_one_position_of_the_seat_are_adjacent():
    places = tuple(SeatMark("", angle, letter, "") for angle, letter in ((0.0, "W"), (0.0, "N"), (90.0, "B")))
    drawn = seat_in_characters(Seat("", (Hole(0, 0.0, True),), 0.0, 0.0, places, (), "x", ""))
    assert "WN" in drawn
    assert "B" in drawn


def test_plot_has_terminal_width_and_about_twelve_rows_if_tall():
    x = np.linspace(0, 1, 50)
    wide = curve(Style(ascii=False, codes=False, width=140, height=45), Curve(x, x, "x", "y", rows=2))
    assert max(map(len, wide.splitlines())) == 140
    assert 10 <= len(rows(wide)) <= 12


def test_braille_dots_are_where_unicode_has_them():
    dots = np.zeros((4, 2), dtype=bool)
    dots[0, 0] = dots[3, 1] = True
    assert dots_to_braille(dots) == [["⢁"]]
    assert dots_to_braille(np.ones((4, 2), dtype=bool)) == [["⣿"]]


@given(
    st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=50),
    st.integers(40, 200),
    st.booleans(),
    st.sampled_from([0.0, 1e-9, 3.0]),
)
def test_any_curve_can_be_drawn(values, width, plain, scale):
    style = Style(ascii=plain, codes=False, width=width)
    page = curve(style, Curve(np.arange(len(values), dtype=float), np.array(values) * scale, "x", "y"))
    assert max(map(len, page.splitlines())) <= width
    assert not plain or page.isascii()


class Terminal(io.StringIO):
    encoding = "utf-8"

    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(
    ("env", "forced", "ascii", "codes"),
    [
        ({}, {}, False, True),
        ({"NO_COLOR": "1"}, {}, False, False),
        ({"TERM": "dumb"}, {}, False, False),
        ({"LC_ALL": "C"}, {}, True, True),
        ({}, {"ascii": True}, True, True),
        ({}, {"no_color": True}, False, False),
    ],
)
def test_look_of_a_terminal(monkeypatch, env, forced, ascii, codes):
    for name in ("NO_COLOR", "TERM", "LC_ALL"):
        monkeypatch.delenv(name, raising=False)
    for name, value in env.items():
        monkeypatch.setenv(name, value)
    style = Style.of(Terminal(), **forced)
    assert (style.ascii, style.codes) == (ascii, codes)


def test_look_of_a_pipe():
    assert not Style.of(io.StringIO()).codes
    assert Style.of(io.StringIO()).width == 80


def test_seven_bit_text():
    assert ASCII.text("80 N·m ± 5 µm ≤ 3°") == "80 N*m +- 5 um <= 3 deg"
    assert ASCII.text("привод") == "??????"
    assert BRAILLE.text("80 N·m") == "80 N·m"


def test_quantities_nest_and_keep_full_precision():
    quantities = (
        Quantity("a.b_mm", "b", "mm", ".1f", lambda x: x),
        Quantity("a.c_mm", "c", "mm", ".1f", lambda x: None),
    )
    assert as_object(quantities, 1 / 3) == {"a": {"b_mm": 1 / 3, "c_mm": None}}
    assert [q.text(1 / 3) for q in quantities] == ["0.3", "-"]
    assert quantities[0].words == "b, mm"
    assert Table.by_row("t", (quantities[1], quantities[0]), (1 / 3, 1)) == Table(
        "t", ("b, mm",), (("0.3",), ("1.0",))
    )  # without the quantity that none has
    assert csv_table("small", quantities, (1, 2)) == (
        ["preset", "a.b_mm", "a.c_mm"],
        [["small", 1, None], ["small", 2, None]],
    )


def test_json_has_no_nan():
    with pytest.raises(ValueError, match="not JSON compliant"):
        json_text({"a": float("nan")})


def test_several_answers_take_the_worst_exit_code():
    assert combine("check", [{"exit_code": 3}]) == {"exit_code": 3}
    codes = [0, 6, 3, 4, 5]
    for k in range(2, 6):
        assert combine("check", [{"exit_code": c} for c in codes[:k]])["exit_code"] == codes[k - 1]


def test_csv_is_plain():
    assert csv_text(["a", "b"], [[1 / 3, None], ["x,y", 2]]) == f'a,b\n{1 / 3!r},\n"x,y",2\n'


def test_two_curves_can_be_told_apart_without_colour():
    x = np.linspace(0, 1, 200)
    waves = Curve(x, np.sin(6 * x), "x", "y", second=np.sin(6 * x + 0.5), names=("one", "two"), rows=20)
    plain = curve(ASCII, waves)
    assert plain.splitlines()[0] == "y: * one, o two"
    assert all(sign in "".join(rows(plain)) for sign in "*o")
    assert curve(BRAILLE, waves).splitlines()[0] == "y: ⠒⠒⠒ one, ⠒⠒ ⠒⠒ two"
    apart = Curve(x, 0 * x + 1, "x", "y", second=0 * x, names=("one", "two"))
    solid, dashed = (row for row in rows(curve(BRAILLE, apart)) if row.strip())
    assert " " not in solid.strip() and dashed.count(" ") > len(dashed) / 3
    same = rows(curve(ASCII, Curve(x, x, "x", "y", second=x, names=("one", "two"), rows=20)))
    assert "o" not in "".join(same)


def test_columns_of_numbers_are_told_from_words_by_their_cells():
    rows = (("K1", "-1.50", "≤ 30", "8.9 (5-10)", "-", "1e-08", "5th"), ("5", "2", "≥ 4", "7 %", "3", "-", "6th"))
    table = Table("", ("",) * 7, rows)
    assert table.words == [0, 6]
    assert Table("", (), ()).words == []
