"""`hdassist report`: one file, true to the other commands, the same bytes every time, and no order without reason."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from importlib import resources
from pathlib import Path
from xml.dom.minidom import parseString

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.drive.preset.fields import origin_counts
from hdassist.features.preset_comparison import DriveSheet, sheet_of
from hdassist.features.report import Curve, Facts, Lines, Paragraph, ReportSection, Seat, Table, Tiles, four_digits
from hdassist.interface.pages.check import check_report
from hdassist.interface.pages.mount import instruction_of, mount_report
from hdassist.interface.pages.report import ENVELOPE_COLUMNS, drive_report, outline, report_html, report_markdown
from hdassist.interface.terminal.output import report_object
from hdassist.interface.terminal.streams import Style
from hdassist.interface.terminal.words import proof
from tests.helpers.process import SMALL, run

LIMIT = "acceptance.F_ior=40"
ASSUMED = "source.bearing.g_b={kind: assumed, range: [0, 3]}"
SETS = ["mounting.holes=4", ASSUMED, LIMIT]  # few holes: the less to compute
ASKED = [word for text in SETS for word in ("--set", text)]
UNICODE = Style(ascii=False, codes=False, width=80)
DRAWN = (Curve, Seat)
ALONE = {"meta", "path", "polyline", "polygon", "circle", "line"}  # elements without an end


class Page(HTMLParser):
    """Elements in their order, checked to close as they open, and all text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[str] = []
        self.links: list[str] = []
        self.text = ""
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag, attrs):
        self.seen.append(tag)
        self.links += [value for name, value in attrs if name in ("src", "href", "srcset", "action") and value]
        if tag not in ALONE:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.seen.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


def sections(report) -> list[ReportSection]:
    return [block for block in report.blocks if isinstance(block, ReportSection)]


@pytest.fixture(scope="module")
def sheet() -> DriveSheet:
    return sheet_of(load_preset(SMALL, [*SETS, "operation.M_g=[4.0]"]))


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A folder with a report as the command writes it."""
    place = tmp_path_factory.mktemp("report")
    result = run("report", SMALL, *ASKED, "--torque", "4", "-o", "a.html", "--jobs", "2", cwd=place)
    assert (result.returncode, result.stdout) == (0, "")
    assert result.stderr.endswith("wrote a.html\n")
    return place


@pytest.mark.thorough
def test_the_same_input_is_the_same_bytes_whatever_the_jobs(sheet, folder):
    again = report_html(drive_report(sheet, draws=64, seed=0))
    assert (folder / "a.html").read_bytes() == again.encode("utf-8")


@pytest.mark.thorough
def test_a_quiet_report_is_the_same_file(folder):
    result = run("report", SMALL, *ASKED, "--torque", "4", "-o", "quiet.html", "--quiet", cwd=folder)
    assert (result.returncode, result.stdout) == (0, "")
    assert (folder / "quiet.html").read_bytes() == (folder / "a.html").read_bytes()


@pytest.mark.thorough
def test_it_is_one_file_that_asks_for_no_other(folder):
    page = Page((folder / "a.html").read_text(encoding="utf-8"))
    assert not page.links
    assert not {"script", "link", "img", "iframe"} & {*page.seen}
    assert not re.search(r"@import|url\(", page.text)
    assert "prefers-color-scheme: dark" in page.text
    assert "@page { size: A4" in page.text


@pytest.mark.thorough
def test_its_drawings_are_svg(sheet, folder):
    text = (folder / "a.html").read_text(encoding="utf-8")
    drawn = [parseString(svg).documentElement for svg in re.findall(r"<svg.*?</svg>", text, flags=re.DOTALL)]
    figures = [b for s in sections(drive_report(sheet, draws=64, seed=0)) for b in s.blocks if isinstance(b, DRAWN)]
    assert len(drawn) == len(figures) == 5  # what it would take: spread; error, seat, positions, stiffness
    assert all(svg.getElementsByTagName("title") for svg in drawn)
    labels = [figure.y_label for figure in figures if isinstance(figure, Curve)]
    assert sum("; median, 5 to 95 %" in label for label in labels) == 1
    charts = [svg for svg in drawn if svg.getAttribute("viewBox") == "0 16 480 248"]
    texts = [each.firstChild.data for svg in charts for each in svg.getElementsByTagName("text")]
    assert texts and max(map(len, texts)) <= 60  # 480 units of 12.5 px: longer ones would reach over the next drawing


def test_report_starts_with_the_verdict_and_repeats_check_and_mount(sheet, folder):
    text = re.sub(r"\s+", " ", Page((folder / "a.html").read_text(encoding="utf-8")).text.split("}", 1)[1])
    point = report_object(check_report(sheet.check, 0))["operating_points"][0]
    low = point["belief"]["p5_arcsec"]
    order = ["PASS: within its limits", f"{low:.1f} to", "Kinematic error", "Inputs and provenance"]
    assert [text.index(words) for words in order] == sorted(text.index(words) for words in order)
    assert instruction_of(sheet.advice).replace("->", "→") in text
    mount = report_object(mount_report(sheet.advice, 0))
    assert f"hole {mount['recommended']['hole']}" in text
    values = origin_counts(sheet.drive)
    assert f"{values['given']} given, {values['identified']} identified from measurements, " in text
    assert "radial clearance between outer ring and balls (bearing.g_b)" in text
    for words in (
        sheet.drive.origin.sha256,
        "; ".join(sheet.drive.origin.overrides),
        f"verified: {proof(sheet.certificate, sheet.cross_checks)}",
        "holes are numbered counter-clockwise",
    ):
        assert words in text


def test_input_angles_are_revolutions_and_numbers_have_no_exponent(sheet):
    report = report_object(check_report(sheet.check, 0))
    (section, *_) = sections(drive_report(sheet, draws=64, seed=0))
    rows = dict(row for block in section.blocks if isinstance(block, Table) for row in block.rows if len(row) == 2)
    degrees = report["operating_points"][0]["at_max"]["phi_h_deg"]
    assert rows["largest error at phi_h, rev"] == f"{degrees / 360:.2f}"
    assert (four_digits(39_690.0), four_digits(396.9), four_digits(1.2)) == ("39690", "396.9", "1.2")


def test_the_line_of_a_limit_has_its_number(sheet):
    report = drive_report(sheet, draws=64, seed=0)
    limits = [block.limit for section in sections(report) for block in section.blocks if isinstance(block, Curve)]
    numbers = re.findall(r'<text class="y held"[^>]*>([\d.]+)<', report_html(report))
    assert numbers == [f"{limit:.4g}" for limit in limits if limit is not None]
    assert numbers


def test_printed_report_has_one_font_size_besides_its_headings():
    css = resources.files("hdassist.interface.pages").joinpath("templates/report.css").read_text("utf-8")
    sized = re.findall(r"^\s*([^{}@/]*?) {[^{}]*font-size: ([^;]+);", css, flags=re.MULTILINE)
    assert {name for name, _ in sized if not name.endswith("svg")} <= {
        "h1", "h2", ".word", ".tiles b", "body", ".warnings h2", ".tiles span, .tiles small",
    }  # fmt: skip


def test_html_lines_break_neither_in_ranges_nor_before_units(sheet):
    page = report_html(drive_report(sheet, draws=64, seed=0))
    hyphen, blank = "\N{NON-BREAKING HYPHEN}", "\N{NO-BREAK SPACE}"
    assert re.search(rf"\([\d.]+{hyphen}[\d.]+\)</td>", page)
    assert re.search(rf"\([\d.]+{blank}to{blank}[\d.]+\)", page)
    assert f"4{blank}N·m" in page
    assert not re.search(r"\([\d.]+(-| to )[\d.]+\)</", page)


@pytest.mark.thorough
def test_equal_holes_are_never_called_best_or_worst():
    drive = load_preset(SMALL, ["phases.xi_b=unknown", "phases.xi_g=unknown", "operation.M_g=[4.0]"])
    sheet = sheet_of(drive, draws=8)
    (mounting,) = (each for each in sections(drive_report(sheet, draws=8, seed=0)) if each.title.startswith("Mounting"))
    assert sheet.advice.word == "ANY_HOLE"
    assert {row[0] for block in mounting.blocks if isinstance(block, Table) for row in block.rows} == {"", "now"}
    assert {each.kind for block in mounting.blocks if isinstance(block, Seat) for each in block.places} == {"now"}


def test_markdown_says_the_same(sheet):
    report = drive_report(sheet, draws=64, seed=0)
    text = report_markdown(report, UNICODE)
    plain = text.replace("\\", "")
    assert "**PASS: within its limits**" in text
    assert [f"\n## {section.title}\n" in plain for section in sections(report)] == [True] * 4
    for section in sections(report):
        for block in section.blocks:
            match block:
                case Paragraph():
                    words = [block.text]
                case Facts():
                    words = [f"{label}: {fact}" for label, fact in block.rows]
                case Table():
                    shown = [block.title, *block.notes, *(cell for row in block.rows for cell in row)]
                    words = shown * bool(block.rows)
                case Curve():
                    words = []  # its labels stand in the drawing
                case Seat():
                    words = [block.title, block.legend]
            assert all(each in plain for each in words)
    assert text.count("```text") == text.count("\n```\n") == 5


def test_in_seven_bits_nothing_becomes_a_sign_of_markdown(sheet):
    text = report_markdown(drive_report(sheet, draws=64, seed=0), Style(ascii=True, codes=False, width=80))
    assert text.isascii()
    prose = re.sub(r"```text\n.*?\n```\n", "", text, flags=re.DOTALL)
    assert "N\\*m" in prose
    assert not re.search(r"(?<!\\)\*", prose.replace("**", ""))


def test_report_states_any_hole_if_no_hole_is_better():
    drive = load_preset(SMALL, [*SETS[:-1], "operation.M_g=[4.0]", "phases.phi_hb=unknown"])
    report = drive_report(sheet_of(drive, draws=2), draws=2, seed=0)
    told = report_object(report)
    assert (told["mount"]["word"], told["mount"]["hole"]) == ("ANY_HOLE", None)
    assert any("no hole is expected to be better than another" in reason for reason in report.why)
    [tiles] = [block for block in report.blocks if isinstance(block, Tiles)]
    assert next(value for label, value, _ in tiles.rows if label == "position of the fixed wheel") == "any"
    ranges, *errors = [block for block in sections(report)[0].blocks if isinstance(block, Curve)]
    assert "by percentile of the drives" in ranges.y_label
    (shown,) = (f"{point['F_ior_shown_arcsec']:.1f}″" for point in told["check"]["operating_points"])
    assert [f"of a sampled drive with F'_ior {shown}" in error.y_label for error in errors] == [True]
    assert "phases.phi_hb" in report_markdown(report, UNICODE).replace("\\", "")


@pytest.mark.parametrize(
    ("args", "code", "words"),
    [
        (["-o", "report.pdf"], 2, "invalid report name: 'report.pdf'"),
        (["-o", "kept.html"], 2, "kept.html already exists"),
        (["-o", "none/report.html"], 4, "there is no directory"),
        (["--set", "gears.j_n=-1", "-o", "new.html"], 2, "must be from 0 to"),
    ],
)
def test_faults_end_before_anything_is_computed_or_written(tmp_path, args, code, words):
    (tmp_path / "kept.html").write_text("mine")
    result = run("report", SMALL, *args, cwd=tmp_path)
    assert (result.returncode, result.stdout) == (code, "")
    assert words in result.stderr
    assert [(file.name, file.read_text()) for file in tmp_path.iterdir()] == [("kept.html", "mine")]


def test_for_scripts_there_is_one_object_and_one_line(sheet):
    told = report_object(drive_report(sheet, draws=64, seed=0))
    assert (told["schema"], told["verdict"], told["exit_code"]) == ("hdassist.report/1", "PASS", 0)
    assert told["check"] == report_object(check_report(sheet.check, 0))
    json.dumps(told, allow_nan=False)


def test_chart_keeps_the_extremes_of_a_dense_curve():
    x = np.linspace(0, 100, 20_000)
    y = np.sin(x) * 0.1
    y[12_345], y[777] = 5.0, -3.0
    corners = outline(Curve(x, y, x_label="x", y_label="y"), y)
    assert (min(high for _, high in corners), max(high for _, high in corners)) == (-3.0, 5.0)
    assert len(corners) == 2 * ENVELOPE_COLUMNS


def test_no_block_is_dropped(sheet):
    x, report = np.arange(3.0), drive_report(sheet, draws=64, seed=0)
    figures = (Curve(x, x, "x of two", "y of two", second=-x, names=("now", "then")),)
    report = replace(report, blocks=(*report.blocks, ReportSection("more", (Lines("listed", ("a line",)), *figures))))
    for page in (report_html(report), report_markdown(report, UNICODE)):
        for words in ("listed", "a line", "x of two", "y of two", "now", "then"):
            assert words in page


def test_unreadable_preset_gives_an_error_in_json():
    result = run("report", "none.yaml", "--json")
    told = json.loads(result.stdout)
    assert (result.returncode, told["exit_code"], told["error"]["code"]) == (4, 4, "FILE_UNREADABLE")
    assert told["schema"] == "hdassist.report/1"
