"""Pitch deviations from a gear checker: what a file means, and what is refused."""

from __future__ import annotations

import hashlib
import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from hdassist.readers.pitch import COLUMNS_HINT, PitchFile, read_pitch
from hdassist.readers.words import flank_in, form_in, length_in, micrometres, names_teeth
from hdassist.run.errors import Finding, PresetError, UsageError

FOUR = "1; 0\n2; 3\n3; -2\n4; 1\n"
BARE = np.array([0.0, 3.0, -2.0, 1.0])
ASSUMED = (
    "no unit is stated; the values are read as um",
    "no form is stated; the values are read as cumulative deviations",
    "no sense is stated; the teeth are read as numbered counter-clockwise, seen from the wave generator side",
    "no mark is stated; tooth 1 is taken as the marked tooth",
)


def read(data: str | bytes, teeth: int = 4, **asked: Any) -> PitchFile:
    """Read through standard input, which spares a file for each case."""
    with pytest.MonkeyPatch.context() as patch:
        stream = io.BytesIO(data.encode() if isinstance(data, str) else data)
        patch.setattr("sys.stdin", io.TextIOWrapper(stream))
        return read_pitch("-", teeth, **asked)


def findings(data: str | bytes, teeth: int = 4, **asked: Any) -> tuple[Finding, ...]:
    with pytest.raises(PresetError) as caught:
        read(data, teeth, **asked)
    assert caught.value.exit_code == 4
    assert all(finding.file == "<stdin>" for finding in caught.value.findings)
    return caught.value.findings


def faults(data: str | bytes, teeth: int = 4, **asked: Any) -> list[str]:
    return [str(finding).removeprefix("<stdin>:") for finding in findings(data, teeth, **asked)]


def free(values: Any) -> Any:
    return pytest.approx(np.asarray(values) - np.mean(values), abs=1e-12)


def test_a_plain_file(tmp_path: Path) -> None:
    file = tmp_path / "wheel.csv"
    file.write_text(FOUR)
    result = read_pitch(file, 4)
    assert result.deviation == free(BARE)
    assert result.deviation.shape == (4,)
    assert not result.deviation.flags.writeable
    assert (result.mark, result.flank, result.file) == (1, None, str(file))
    assert result.sha256 == hashlib.sha256(file.read_bytes()).hexdigest()
    assert result.notes == ASSUMED


@pytest.mark.parametrize(
    ("head", "asked", "expected"),
    [
        ("", {}, [0, 3, -2, 1]),
        ("# mark: 3\n", {}, [-2, 1, 0, 3]),
        ("# sense: cw\n", {}, [0, -1, 2, -3]),
        ("# sense: cw\n# mark: 2\n", {}, [-3, 0, -1, 2]),  # the example in the module
        ("# sense: cw\n# mark: 2\n# sign: ccw\n", {}, [3, 0, 1, -2]),
        ("# sense: clockwise\n# sign: cw\n", {}, [0, -1, 2, -3]),
        ("# sign: cw\n", {}, [0, -3, 2, -1]),
        ("# sense: cw\n", {"sense": "ccw"}, [0, 3, -2, 1]),
        ("# sign: ccw\n# mark: 4\n", {"sense": "cw"}, [1, -2, 3, 0]),
    ],
)
def test_result_counts_counter_clockwise_from_the_mark(head: str, asked: dict[str, Any], expected: list[float]) -> None:
    assert read(head + FOUR, **asked).deviation == free(expected)


def test_what_was_done_is_noted() -> None:
    head = "# sense: cw\n# sign: along\n# mark: 2\n# flank: right\ntooth; f_pt [mm]\n"
    result = read(head + "1; 0.003\n2; -0.004\n3; 0.002\n4; -0.0011\n")
    assert result.notes == (
        "converted from mm to um",
        "single pitch deviations summed up, closing error of -0.1 um distributed over all teeth",
        "numbers reversed",
        "signs reversed",
    )
    assert (result.mark, result.flank) == (2, "right")


def test_names_in_another_code_page_are_refused() -> None:
    text = "# Prüfer: Müller\n# форма: single\nЗуб;отклонение\n" + FOUR
    assert "single pitch deviations summed up" in " ".join(read(text.replace("-2", "-4")).notes)
    found = faults(text.replace("ü", "y").encode("cp1251"))
    assert [fault.split(" (")[0] for fault in found] == [
        "2:3: a name that is not UTF-8 text", "3:1: a name that is not UTF-8 text", "3:1: a name that is not UTF-8 text"
    ]  # fmt: skip
    assert all(fault.endswith("; save the file as UTF-8)") for fault in found)


def test_a_misspelled_key_is_noted() -> None:
    assert (
        'line 1: "sens" is ignored; the nearest name is sense' in read("# sens: cw\n# operator: Meier\n" + FOUR).notes
    )


def test_an_argument_wins_over_the_file_and_is_noted() -> None:
    result = read("# form: single\n# flank: left\n# sense: ??\n" + FOUR, form="cumulative", flank="left", sense="ccw")
    assert result.deviation == free(BARE)
    assert result.flank == "left"
    assert "form cumulative as requested; the file states single" in result.notes
    assert "sense ccw as requested; the file states ??" in result.notes
    assert not any("flank" in note for note in result.notes)


@pytest.mark.parametrize(
    "name", ["f_pt [um]", "fp/µm", "single pitch (um)", "Teilungs-Einzelabweichung fp, μm", "шаг, мкм"]
)
def test_single_pitch_deviations_are_summed_up(name: str) -> None:
    single = BARE - np.roll(BARE, 1)
    text = f"tooth;{name}\n" + "".join(f"{tooth};{value}\n" for tooth, value in enumerate(single))
    result = read(text)
    assert result.deviation == free(BARE)
    assert "single pitch deviations summed up" in result.notes
    assert read(text.replace(name, "value"), form="single").deviation == free(BARE)
    assert read("# form: single\n" + text.replace(name, "value")).deviation == free(BARE)


def test_a_closing_error_is_shared_out() -> None:
    single = BARE - np.roll(BARE, 1) + 0.2
    result = read("# form: single\n" + "".join(f"{k};{value:.3f}\n" for k, value in enumerate(single)))
    assert result.deviation == free(BARE)
    assert "single pitch deviations summed up, closing error of 0.8 um distributed over all teeth" in result.notes


def test_a_drift_of_cumulative_deviations_stays() -> None:
    assert read("".join(f"{k};{2 * k}\n" for k in range(10)), 10).deviation == free(2.0 * np.arange(10))


def test_a_wheel_without_deviations_is_one() -> None:
    for form in ("cumulative", "single"):
        assert not read("1;0\n2;0\n3;0\n4;0\n", form=form).deviation.any()


FLANKS = "tooth;left [um];right [um]\n1;0;5\n2;3;6\n3;-2;9\n4;1;7\n"


def test_a_flank_is_chosen_among_columns() -> None:
    assert read(FLANKS, flank="left").deviation == free(BARE)
    assert read(FLANKS, flank="right").deviation == free([5, 6, 9, 7])
    assert read("# flank: right\n" + FLANKS).flank == "right"
    assert read("Abweichung [um];Zahn\n0;1\n3;2\n-2;3\n1;4\n").deviation == free(BARE)
    both = "No;fp L;Fp L;fp R;Fp R\n" + "".join(f"{k};{s};{c};9;9\n" for k, s, c in [(1, -1, 0), (2, 1, 1), (3, 0, 1)])
    assert read(both, 3, flank="left", form="cumulative").deviation == free([0, 1, 1])
    assert read(both, 3, flank="left", form="single").deviation == free([0, 1, 1])


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        # what the table refuses stands in test_table; here that it arrives
        ("", "1:1: the file is empty (check that the measurement was saved)"),
        ("1\n2\n", "1:1: the rows have 1 column, but 2 are needed: tooth number, deviation "
         "(got 1; separate the columns by ; or , or tabs or blanks)"),
        (FOUR.replace("-2", "nan"), "3:4: column 2: must be a finite number "
         "(got nan; fill in the number, or leave out the row)"),
        # tooth numbers
        (FOUR.replace("3; -2\n", ""), "1:1: column 1: the wheel has 4 teeth, the file has 3 "
         "(got no row for tooth 3; 4 rows are needed)"),
        (FOUR.replace("4; 1\n", ""), "1:1: column 1: the wheel has 4 teeth, the file has 3 "
         "(got no row for tooth 4; 4 rows are needed)"),
        (FOUR + "5; 0\n", "5:1: column 1: the wheel has 4 teeth, the file has 5 "
         "(got a row for tooth 5; number the teeth from 0 or 1, each tooth once)"),
        (FOUR + "5; 0\n6; 1\n", "5:1: column 1: the wheel has 4 teeth, the file has 6 "
         "(got a row for tooth 5, 6; number the teeth from 0 or 1, each tooth once)"),
        (FOUR + "1; 0\n", "5:1: column 1: the tooth is given twice (got 1; first in line 1; keep one row)"),
        ("tooth;um\n" + FOUR.replace("3;", "3.5;") + "3; 1\n", "4:1: tooth: must be a tooth number (a whole number) "
         "(got 3.5; put tooth numbers in the first column, or name the columns)"),
        ("0.1;1\n0.2;2\n0.1;3\n0.4;4\n", "1:1: column 1: must be a tooth number (a whole number) "
         "(got 0.1; put tooth numbers in the first column, or name the columns)"),
        # keys
        ("# sense: up\n" + FOUR, "1:10: sense: must be ccw or cw, seen from the wave generator side (got up)"),
        ("# sign: minus\n" + FOUR, "1:9: sign: must be along (the numbering), ccw or cw (got minus)"),
        ("# form: odd\n" + FOUR, "1:9: form: must be cumulative or single (got odd)"),
        ("# flank: both\n" + FOUR, "1:10: flank: must be left or right (got both)"),
        ("# mark: top\n" + FOUR, "1:9: mark: must be the number of a tooth (got top)"),
        ("# mark:\n" + FOUR, "1:8: mark: must be the number of a tooth (got nothing)"),
        ("# mark: 5\n" + FOUR, "1:9: mark: the mark must be one of the wheel's teeth, 1 to 4 "
         "(got 5; state the number of the marked tooth)"),
        ("# mark: 2\n# mark: 3\n" + FOUR, "2:9: mark: two different values are stated "
         "(got 3; line 1 states 2; keep one of the two)"),
        ("# form: single\ntooth;Fp\n" + FOUR, "2:1: form: two different values are stated "
         "(got Fp; line 1 states single; keep one of the two)"),
        ("tooth;index deviation\n" + FOUR, "1:1: form: state whether they are single or cumulative pitch deviations "
         '(got index deviation; write a comment line above the rows, like "# form: cumulative" or "# form: single")'),
        # units
        ("# unit: in\n" + FOUR, "1:9: unit: the unit is not metric (got in; convert to um or mm; 1 µin is 0.0254 um)"),
        ("tooth;dev (µin)\n" + FOUR, "1:1: unit: the unit is not metric "
         "(got dev (µin); convert to um or mm; 1 µin is 0.0254 um)"),
        ("tooth;dev [arcsec]\n" + FOUR, "1:1: unit: the unit is a unit of angle, not of length "
         "(got dev [arcsec]; multiply by the pitch radius: 1 arcsec at 100 mm is 0.485 um)"),
        ("# unit: furlong\n" + FOUR, "1:9: unit: unknown unit furlong "
         "(got furlong; use one of mm, um, nm, cm, inch, in; a number without a unit is in um)"),
        ("# unit: mm\ntooth;dev [um]\n" + FOUR, "2:1: unit: two different values are stated "
         "(got dev [um]; line 1 states mm; keep one of the two)"),
        ("1;0\n2;0.03\n3;0.075\n4;0\n", "1:1: column 2: 0.075 um over the whole wheel "
         "(got unit um; check whether the unit is mm)"),
        ("# unit: mm\n1;0\n2;0.0001\n3;0\n4;0\n", "2:1: column 2: 0.1 um over the whole wheel "
         "(got unit mm; check whether the unit is um; no wheel is so accurate)"),
        ("# unit: mm\n" + FOUR, "2:1: column 2: 5000 um over the whole wheel "
         "(got unit mm; check the unit, and that the values are deviations, not positions)"),
        # forms and flanks
        ("# form: single\n1;0\n2;5\n3;4\n4;3\n",
         "2:1: column 2: single pitch deviations do not close: their sum is 12 um, "
         "their curve spans 3 um "
         "(check whether they are cumulative deviations, rounded too coarsely, or measured in several passes)"),
        (FLANKS, '1:1: 2 columns of deviations (got "left [um]" and "right [um]"; '
         f"{COLUMNS_HINT})"),
        ("tooth;fp;Fp\n1;2;3\n2;4;5\n3;1;1\n4;0;0\n", '1:1: 2 columns of deviations (got "fp" and "Fp"; '
         f"{COLUMNS_HINT})"),
        ("1;2.0;3\n2;4;5\n3;1;1\n4;0;0\n", '1:1: 2 columns of deviations (got "column 2" and "column 3"; '
         f"{COLUMNS_HINT})"),
    ],
)  # fmt: skip
def test_each_fault_is_said_with_its_place(text: str, expected: str) -> None:
    assert faults(text) == [expected]


def test_all_faults_are_found_at_once() -> None:
    found = findings("# sense: up\n# mark: 9\n# unit: ft\n" + FOUR + "2; 1\n")
    assert [(one.line, one.path) for one in found] == [(1, "sense"), (2, "mark"), (3, "unit"), (8, "column 1")]
    found = findings("# sense: up\ntooth;um\n1;x\n2;1;1\n3;5\n")
    assert [(one.line, one.path) for one in found] == [(1, "sense"), (3, "um"), (4, "")]


def test_long_lists_of_teeth_are_shortened() -> None:
    (fault,) = faults("1;2\n202;3\n", 202)
    assert fault == (
        "1:1: column 1: the wheel has 202 teeth, the file has 2 "
        "(got no row for tooth 2, 3, 4, 5, 6 ... (200 in all); 202 rows are needed)"
    )


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"sense": "up"}, "invalid sense up: expected one of ccw, cw"),
        ({"form": "odd"}, "invalid form odd: expected one of cumulative, single"),
        ({"flank": "top"}, "invalid flank top: expected one of left, right"),
        ({"teeth": 1}, "invalid number of teeth 1: expected two or more"),
    ],
)
def test_wrong_arguments(asked: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        read(FOUR, **{"teeth": 4, **asked})


@pytest.mark.parametrize(
    ("name", "form"),
    [
        ("f_pt", "single"), ("fp [µm]", "single"), ("fp_left", "single"), ("Single pitch", "single"), ("fpi", "single"),
        ("Teilungs-Einzelabweichung fp", "single"), ("отклонение шага", "single"), ("tooth to tooth", "single"),
        ("F_p", "cumulative"), ("Fp [µm]", "cumulative"), ("Fp_links", "cumulative"), ("F_pi", "cumulative"),
        ("Teilungs-Summenabweichung", "cumulative"), ("Teilungsgesamtabweichung", "cumulative"),
        ("накопленная погрешность шага", "cumulative"), ("individual cumulative pitch deviation", "cumulative"),
        ("FP", "ambiguous"), ("Fpt", "ambiguous"), ("Index", "ambiguous"), ("index error", "ambiguous"),
        ("deviation", ""), ("Abweichung [um]", ""), ("pitch", ""), ("left", ""), ("fps", ""),
    ],
)  # fmt: skip
def test_words_for_the_form(name: str, form: str) -> None:
    assert form_in(name) == form


@pytest.mark.parametrize(
    ("name", "unit", "size"),
    [
        ("dev [µm]", "um", 1), ("dev [μm]", "um", 1), ("Abweichung/µm", "um", 1), ("dev (mm)", "mm", 1e3),
        ("dev_um", "um", 1), ("um", "um", 1), ("dev microns", "um", 1),
        ("DEV [MM]", "mm", 1e3), ("left (mm) Fp", "mm", 1e3), ("отклонение, мкм", "um", 1),
        ("Abweichung in µm", "um", 1), ("Fp [F_p] (um)", "um", 1), ("dev [nm]", "nm", 1e-3),
    ],
)  # fmt: skip
def test_units_in_names(name: str, unit: str, size: float) -> None:
    assert length_in(name) == unit
    assert micrometres(unit) == size


def test_names_without_a_unit() -> None:
    for name in ("deviation", "Fp", "Fp (left)", "[left]", "Abweichung in Zahnrichtung", "a/b"):
        assert length_in(name) == ""


def test_words_for_flanks_and_teeth() -> None:
    assert [flank_in(name) for name in ("Left flank", "linke Flanke", "LF", "fp_L", "левый")] == ["left"] * 5
    assert [flank_in(name) for name in ("right [um]", "rechts", "RF", "R", "правый")] == ["right"] * 5
    assert [flank_in(name) for name in ("flank", "left and right", "Fp", "relative")] == [""] * 4
    assert all(map(names_teeth, ("Tooth", "Zahn Nr.", "No.", "зуб", "#", "n", "Lücke")))
    assert not any(map(names_teeth, ("Fp", "normal", "left", "deviation of tooth", "")))


@dataclass(frozen=True)
class Dialect:
    """How a file is written: its text format, and which of the ways to say the same it uses."""

    separator: str
    decimal: str
    encoding: str
    newline: str
    quoted: bool
    trailing: bool
    form: str
    unit: str
    sense: str
    sign: str
    start: int
    mark: int
    in_names: bool

    def write(self, deviation: NDArray[np.float64], order: list[int]) -> bytes:
        """A file that says these deviations, which count counter-clockwise from the mark."""
        teeth = len(deviation)
        step = 1 if self.sense == "ccw" else -1
        place = [(step * (tooth - self.mark)) % teeth for tooth in range(teeth)]  # from the mark, counter-clockwise
        points_to = self.sense if self.sign == "along" else self.sign
        values = deviation[place] * (1 if points_to == "ccw" else -1) * (1e-3 if self.unit == "mm" else 1.0)
        if self.form == "single":
            values = values - np.roll(values, 1)
        lines = [f"# sense: {self.sense}", f"// sign = {self.sign}", f"% mark: {self.start + self.mark}"]
        if self.in_names:
            name = f"{'f_pt' if self.form == 'single' else 'F_p'} [{self.unit}]"
            lines.append(self.row("tooth", f'"{name}"'))
        else:
            lines += [f"# form: {self.form}", f"# unit: {self.unit}"]
        lines += [self.row(str(self.start + tooth), self.number(values[tooth])) for tooth in order]
        return (self.newline.join(lines) + self.newline).encode(self.encoding)

    def row(self, *cells: str) -> str:
        return self.separator.join(cells) + (self.separator if self.trailing else "")

    def number(self, value: float) -> str:
        text = f"{value:.9f}".replace(".", self.decimal)
        return f'"{text}"' if self.quoted else text


@pytest.mark.parametrize("form", ["cumulative", "single"])
@pytest.mark.parametrize("sense", ["ccw", "cw"])
@pytest.mark.parametrize("sign", ["along", "ccw", "cw"])
def test_files_of_one_wheel_agree(form: str, sense: str, sign: str) -> None:
    deviation = np.array([4.0, -3.0, 7.5, 1.0, -2.25])  # neither symmetric nor antisymmetric
    dialect = Dialect(";", ",", "utf-8", "\n", False, False, form, "um", sense, sign, 1, 2, False)
    assert read(dialect.write(deviation, [0, 1, 2, 3, 4]), 5).deviation == free(deviation)


@st.composite
def written(draw: st.DrawFn) -> tuple[NDArray[np.float64], Dialect, list[int]]:
    teeth = draw(st.integers(4, 30))
    drawn = draw(st.lists(st.floats(-200, 200), min_size=teeth, max_size=teeth))
    deviation = np.round(np.array(drawn), 6)
    deviation[0] = deviation.min() - 1  # no wheel is as good as all that

    def pick(*options: Any) -> Any:
        return draw(st.sampled_from(options))

    separator = pick(";", "\t", ", ", ",", " ", "   ")
    dialect = Dialect(
        separator,
        "." if "," in separator else pick(".", ","),
        pick("utf-8", "utf-8-sig", "utf-16", "latin-1"),
        pick("\n", "\r\n", "\r"),
        draw(st.booleans()),
        draw(st.booleans()),
        pick("cumulative", "single"),
        pick("um", "mm"),
        pick("ccw", "cw"),
        pick("along", "ccw", "cw"),
        pick(0, 1),
        draw(st.integers(0, teeth - 1)),
        draw(st.booleans()),
    )
    return deviation, dialect, draw(st.permutations(range(teeth)))


@given(written())
def test_every_way_to_write_a_wheel_reads_the_same(case: tuple[NDArray[np.float64], Dialect, list[int]]) -> None:
    deviation, dialect, order = case
    result = read(dialect.write(deviation, order), len(deviation))
    assert result.deviation == pytest.approx(deviation - deviation.mean(), abs=1e-4)
    assert result.mark == dialect.start + dialect.mark
