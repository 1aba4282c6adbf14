from __future__ import annotations

import pytest

from hdassist.explorer.answers import Curve, Place, Sure, Turned, Value
from hdassist.explorer.canvas import Canvas
from hdassist.explorer.graphs import graph, zone_picture
from hdassist.explorer.known import Known, merged
from hdassist.explorer.pictures import Plotted, curve_picture, seat_picture, value_words
from hdassist.explorer.themes import inks

INKS = inks(True)


def curve(values: list[float], sure: Sure = Sure.REFINED, band: tuple[float, float] | None = None) -> Curve:
    step = 360 / len(values)
    places = tuple(Place(k * step, k, (Value(v, sure, band),)) for k, v in enumerate(values))
    return Curve((80.0,), places, len(values))


def test_dots_lie_where_they_are_set_and_texts_above_them() -> None:
    canvas = Canvas(3, 2)
    canvas.dot(0, 0, "red")
    canvas.dot(3, 7, "red")
    canvas.dot(99, -1, "red")  # outside
    canvas.text(2, 0, "xy", "")  # moved inside
    assert canvas.drawn().plain == "⠁xy\n ⢀ "


def test_a_curve_has_its_marks_at_their_values_and_numbers_that_enclose_them() -> None:
    rows = curve_picture(Plotted(curve([30, 20, 10, 20])), 60, 14, INKS).plain.split("\n")
    marks = [(r, row.index("○")) for r, row in enumerate(rows) if "○" in row]
    assert marks[0][1] == 5 and len(marks) == 3  # 30 at hole 0, 20 twice, 10
    at = {row.split("┤")[0].strip(): r for r, row in enumerate(rows) if "┤" in row}
    assert abs(at["30"] - marks[0][0]) <= 1 and abs(at["20"] - marks[1][0]) <= 1 and abs(at["10"] - marks[2][0]) <= 1
    assert all(len(row) == 60 for row in rows)


@pytest.mark.parametrize(
    ("sure", "mark"), [(Sure.COARSE, "·"), (Sure.REFINED, "○"), (Sure.PROVEN, "●"), (Sure.FITTED, "◌")]
)
def test_each_mark_says_how_sure_a_value_is(sure: Sure, mark: str) -> None:
    assert mark in curve_picture(Plotted(curve([30, 20, 10], sure)), 60, 14, INKS).plain


def test_trials_limits_and_bands_are_drawn() -> None:
    plot = Plotted(curve([30, 20, 10], band=(5, 35)), limits={80.0: 25.0}, trials=((120.0, 21.0),))
    drawn = curve_picture(plot, 60, 16, INKS)
    assert "◆" in drawn.plain and "limit 25 at 80 N·m" in drawn.plain
    assert any(INKS.band in str(span.style) for span in drawn.spans)


def test_without_a_curve_the_picture_says_why() -> None:
    assert "directions unknown" in curve_picture(Plotted(None, empty="directions unknown"), 40, 10, INKS).plain


def test_the_seat_counts_counter_clockwise_from_the_right() -> None:
    rows = seat_picture(Plotted(curve([30, 20, 10, 40])), 4, 0.0, [3], 31, 13, INKS).plain.split("\n")
    where = {label: (r, row.index(label)) for r, row in enumerate(rows) for label in "012xNBW" if label in row}
    assert where["0"][1] > where["1"][1] > where["2"][1] and where["1"][0] < where["0"][0] < where["x"][0]
    assert where["N"][0] == where["0"][0] and where["B"][0] == where["2"][0]  # best where the curve is least


def test_a_coarse_value_is_rounded_and_says_so() -> None:
    found = curve([26.28, 20], Sure.COARSE)
    assert value_words(found.places[0], None, (80.0,)) == ["80 N·m ~26″ COARSE"]
    [told] = value_words(curve([28, 14], Sure.PROVEN).places[1], curve([28, 14], Sure.PROVEN).places[0], (80.0,))
    assert told == "80 N·m 14.0″ -50% PROVEN"


def test_a_curve_never_becomes_less_sure() -> None:
    proven = curve([28, 14], Sure.PROVEN)
    assert merged(proven, curve([27, 13], Sure.COARSE)).places[0].values[0].F_ior_arcsec == 28
    known = Known()
    for answer in (curve([27, 13], Sure.COARSE), proven):
        known.take(answer)
    assert known.curve is not None and known.curve.sure is Sure.PROVEN


def test_only_usable_places_are_best_or_worst() -> None:
    places = tuple(Place(90.0 * k, k, (Value(v, Sure.PROVEN),), k != 2) for k, v in enumerate([30, 20, 10, 40]))
    found = Curve((80.0,), places, 4)
    assert (found.best.hole, found.worst.hole) == (1, 3)


def test_bars_of_a_zone_are_as_high_as_their_forces() -> None:
    turned = Turned(
        80.0, 0.0, (0.0,), (0.0,), 0.0, (), ((-10.0, 0.0, 10.0),) * 2, (((100.0, 50.0, -30.0), (0.0, 0.0, 0.0)),),
        ((1.0, 0.0),), "",
    )  # fmt: skip
    rows = zone_picture(turned, 0, 0, 30, 12, INKS).plain.split("\n")
    heights = [sum(row[column] in "█" for row in rows) for column in (2, 12)]
    assert heights == [9, 4] and rows[5][12] == "▄" and "▀" in rows[10][20:]
    assert "100 N at most" in rows[0]


def test_a_graph_has_its_curve_between_numbered_axes() -> None:
    x = [float(k) for k in range(101)]
    rows = graph(x, [([k / 10 for k in x], INKS.text)], 50, 13, INKS, words="deg").plain.split("\n")
    assert rows[-1].strip().endswith("deg") and "0 ┤" in "\n".join(rows) and "10 ┤" in "\n".join(rows)
