"""F'_ior over all that is not known exactly, as the explorer has it: the numbers and the verdict of check."""

from __future__ import annotations

import json
from collections.abc import Mapping
from io import StringIO
from types import MappingProxyType

import pytest

from hdassist.drive.loading import load_preset
from hdassist.features.design import DesignCheck, check
from hdassist.features.report import Report
from hdassist.interface.explorer.asking import Known
from hdassist.interface.explorer.compute import (
    FirstErrors,
    LeverEffects,
    drive_answers,
    lever_effects,
    typical_of,
)
from hdassist.interface.explorer.panes import headline
from hdassist.interface.terminal.output import json_text, report_object
from hdassist.interface.terminal.streams import Style, console
from hdassist.run.errors import HdassistError, Verdict
from tests.explorer.rig import QUICK, tiny
from tests.helpers.process import TINY, no_processes, run

OPEN = ("phases.phi_hb=unknown", "source.gears.j_n={kind: assumed, range: [12, 18], ref: judged}")


def believed(*overrides: str, typical: Mapping[str, float] = MappingProxyType({})) -> list[object]:
    """Answers about the tiny drive, the page of its check last."""
    told: list[object] = []
    with no_processes():
        tell = lambda name, answer: told.append(answer) if name != "done" else None  # noqa: E731
        drive_answers(load_preset(TINY, overrides), typical, QUICK, tell)
    pages = [isinstance(each, Report) and each.command == "check" for each in told]
    return told[: pages.index(True) + 1]


@pytest.mark.thorough
def test_it_grows_to_the_answer_of_check() -> None:
    open_ = [*OPEN, "acceptance.F_ior={1: 3000, 4: 2050}"]
    told = believed(*open_)
    grown, page = [each for each in told if isinstance(each, DesignCheck)], told[-1]
    sizes = [each.samples.effective for each in grown if each.samples]
    assert sizes == sorted(sizes) and sizes[0] < 9 and len(sizes) == len(grown) > 1
    command = json.loads(
        run(
            "check", TINY, *(word for text in open_ for word in ("--set", text)), "--draws", f"{QUICK.draws}", "--json"
        ).stdout
    )
    assert isinstance(page, Report)
    assert json.loads(json_text(report_object(page)))["operating_points"] == command["operating_points"]
    assert json.loads(json_text(report_object(page)))["steps"] == command["steps"]


def test_known_drive_is_solved_in_every_state_before_check() -> None:
    limits = "acceptance.F_ior={1: 3000, 4: 20}"
    told = believed(limits)
    points = check(load_preset(TINY, [limits])).points
    searched, proven = (each.F_ior_arcsec for each in told if isinstance(each, FirstErrors))
    assert proven == [point.error.F_ior_arcsec for point in points] and searched == pytest.approx(proven, abs=0.01)
    (found,) = (each for each in told if isinstance(each, DesignCheck))
    assert [point.verdict for point in found.points] == [Verdict.PASS, Verdict.FAIL]
    assert typical_of(found) == ({}, proven)


@pytest.mark.thorough
def test_first_number_after_a_change_is_of_the_typical_drive() -> None:
    *_, found, _ = believed("operation.M_g=[4.0]", *OPEN)
    assert isinstance(found, DesignCheck)
    typical, (before,) = typical_of(found)
    first, *_ = believed("operation.M_g=[4.0]", *OPEN, typical=typical)
    assert isinstance(first, FirstErrors) and first.F_ior_arcsec == pytest.approx([before], abs=0.01)
    first, *_ = believed("operation.M_g=[4.0]", *OPEN, "tolerances.e_hb=1", typical=typical)
    assert isinstance(first, FirstErrors) and abs(first.F_ior_arcsec[0] - before) > 1


@pytest.mark.thorough
def test_a_contradiction_and_rolling_balls_are_said() -> None:
    with pytest.raises(HdassistError, match="contradicts the other reference data"):
        believed(*OPEN, "catalogue.K_1=1e9", "catalogue.K_2=1", "catalogue.K_3=1")
    *_, page = believed(*OPEN, "bearing.ball_motion=rolling", "bearing.d_ball=5")
    assert isinstance(page, Report) and any("have no range" in note for note in page.warnings)


def text_of_headline(known: Known) -> str:
    """The headline as a person reads it."""
    style = Style(ascii=False, codes=False, width=120)
    stream = StringIO()
    console(stream, style).print(headline(tiny(), known, None, 0, 118))
    return stream.getvalue()


def test_outdated_and_incomplete_results_are_marked_as_such() -> None:
    *_, some, found, page = believed("operation.M_g=[4.0]", *OPEN, "acceptance.F_ior=2050")
    assert isinstance(found, DesignCheck) and isinstance(some, DesignCheck) and isinstance(page, Report)
    verdict = found.verdict
    part, whole = text_of_headline(Known(check=some)), text_of_headline(Known(check=found, page=page))
    assert "samples …" in part and not any(word in part for word in Verdict)  # a few samples decide nothing
    assert "samples  F'_ior" in whole and verdict in whole
    changed = text_of_headline(Known(old=found, first=FirstErrors([12.5])))
    assert "old …" in changed and verdict in changed and f"{typical_of(found)[1][0]:.2f} → 12.50" in changed


@pytest.mark.thorough
def test_inputs_change_a_typical_drive_that_includes_its_unknowns() -> None:
    open_ = ("operation.M_g=[4.0]", "tolerances.e_hb=unknown")
    *_, found, _ = believed(*open_)
    drive, told = load_preset(TINY, open_), list[object]()
    assert isinstance(found, DesignCheck)
    typical, _ = typical_of(found)
    with no_processes():
        lever_effects(
            drive, load_preset(TINY, [*open_, "gears.j_n=8"]), typical, QUICK, lambda _, answer: told.append(answer)
        )
    effects = told[-1]
    assert isinstance(effects, LeverEffects) and typical["tolerances.e_hb"] > 0
    by, (change,) = effects.steps["tolerances.e_hb"]
    assert by > 1 and abs(change) > 0.1
    assert effects.differing == ("gears.j_n",) and effects.steps["gears.j_n"][0] == 8 - 18  # to the pinned value
    assert effects.steps["gears.z_g"][0] == 2  # with z_b
