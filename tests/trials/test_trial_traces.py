"""Trials with traces: a hidden cam offset found again from the error over the cam angle."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.design.trace_page import figures as trace_figures
from hdassist.error.trace import trace
from hdassist.errors import DataError, UntrustedError, UsageError
from hdassist.mounting.positions import rotated
from hdassist.preset.fields import Drive
from hdassist.terminal.answers import csv_text
from hdassist.trials.posterior import Posterior, posterior
from hdassist.trials.prior import SampleSizes, Tables, prior_of, tabulated
from hdassist.trials.trial import Rig, Trial, read_trial, trial_positions
from hdassist.trials.trial_traces import TrialTrace
from hdassist.trials.verification import verify
from tests.process import SMALL

M_G, HOLES = 4.0, 12
POSITIONS = trial_positions(HOLES, "all")
RIG = Rig(M_G, noise_arcsec=0.5)
FEW = SampleSizes(draws=8, traced_draws=8, particles=600, compared=8)
TOLD = load_preset(SMALL).model_copy(update={"uncertainty": {"tolerances.e_hh": 1.0, "phases.phi_hh": 2.0}})


@pytest.fixture(scope="module")
def tables() -> Tables:
    return tabulated(TOLD, (M_G,), traced=True, sizes=FEW)


@cache
def figures(size: float, direction: float, hole: int, start: float, fixed: str = "rigid") -> str:
    """What `hdassist trace -n 2 --csv` writes of the hidden drive in a hole."""
    drive = rotated(hidden(size, direction, fixed), 360 * hole / HOLES)
    return csv_text(*trace_figures(trace(drive, M_G, start_deg=start, revolutions=2, cross_check=None)))


def hidden(size: float, direction: float, fixed: str = "rigid") -> Drive:
    end = "b" if fixed == "rigid" else "g"
    drive = load_preset(SMALL, [f"mounting.fixed={fixed}", f"tolerances.e_h{'g' if end == 'b' else 'b'}=0"])
    return drive.with_values({f"tolerances.e_h{end}": size, f"phases.phi_h{end}": direction})


def read(path: Path, text: str, hole: int = 0, of: Drive = TOLD, *, reverse: bool = False) -> Trial:
    path.write_text(text, encoding="utf-8")
    return read_trial(f"h{hole}:{path}", HOLES, of, reverse=reverse)


def learnt(tables: Tables, *trials: Trial) -> Posterior:
    return posterior(prior_of(tables, trials=trials, rig=RIG), trials, RIG, POSITIONS)


def off(known: Posterior, direction: float) -> float:
    return abs((known.directions()[0].direction_deg - direction + 180) % 360 - 180)


@pytest.mark.parametrize("direction", [20.0, 340.0])
def test_a_trace_in_two_holes_tells_the_offset_and_its_mirror_image(
    tables: Tables, tmp_path: Path, direction: float
) -> None:
    """The direction counts as phi_hb does, whatever the wheel is turned by; its mirror image is told from it."""
    trials = [read(tmp_path / f"{hole}.csv", figures(50.0, direction, hole, 70.0 + hole), hole) for hole in (0, 4)]
    known = learnt(tables, *trials)
    one = known.directions()[0]
    assert one.share > 0.9
    assert off(known, direction) < max(3 * one.spread_deg, 5)
    assert abs(known.offset_um[0] - 50) < max(3 * known.offset_um[1], 4)


def test_with_the_flexspline_fixed_its_own_offset_is_told(tmp_path: Path) -> None:
    of = load_preset(SMALL, ["mounting.fixed=flexspline", "tolerances.e_hb=0", "tolerances.e_hg=30"])
    of = of.model_copy(update={"uncertainty": TOLD.uncertainty})
    trials = [
        read(tmp_path / f"{hole}.csv", figures(45.0, 130.0, hole, 200.0, "flexspline"), hole, of) for hole in (0, 4)
    ]
    known = learnt(tabulated(of, (M_G,), traced=True, sizes=FEW), *trials)
    assert off(known, 130) < max(3 * known.directions()[0].spread_deg, 5)


def test_the_other_sign_of_the_error_is_noticed_and_can_be_said(tables: Tables, tmp_path: Path) -> None:
    rows = [line.split(",") for line in figures(50.0, 20.0, 0, 100.0).splitlines()]
    name = rows[0].index("error_arcsec")
    other = "\n".join(
        [",".join(rows[0]), *(",".join([*r[:name], str(-float(r[name])), *r[name + 1 :]]) for r in rows[1:])]
    )
    good = read(tmp_path / "good.csv", figures(50.0, 20.0, 0, 100.0))
    turned = read(tmp_path / "other.csv", other, reverse=True)
    assert good.trace
    assert turned.trace
    assert turned.trace.error == pytest.approx(good.trace.error)
    both = [read(tmp_path / "0.csv", other), read(tmp_path / "1.csv", figures(50.0, 20.0, 4, 30.0), 4, reverse=True)]
    with pytest.raises(UntrustedError, match="far likelier with the other sign"):
        prior_of(tables, trials=both, rig=RIG)


@pytest.mark.parametrize("sense", [1, -1])
def test_two_encoders_make_the_same_trace(tmp_path: Path, sense: int) -> None:
    """Whichever way the output's encoder counts; the cam's counts counter-clockwise."""
    rows = [line.split(",") for line in figures(50.0, 20.0, 0, 100.0).splitlines()]
    cam, error = (np.array([float(r[rows[0].index(n)]) for r in rows[1:]]) for n in ("phi_h_deg", "error_arcsec"))
    output = sense * (cam / -30 - error / 3600)  # phi_g = phi_h/u - F_kpp, u = -30
    text = "cam_deg,output_deg\n" + "\n".join(
        f"{c!r},{o!r}" for c, o in zip(cam.tolist(), output.tolist(), strict=True)
    )
    one = read(tmp_path / "encoders.csv", text).trace
    other = read(tmp_path / "error.csv", figures(50.0, 20.0, 0, 100.0)).trace
    assert one
    assert other
    assert one.error == pytest.approx(other.error, abs=1e-6)


def test_traces_and_numbers_together(tables: Tables, tmp_path: Path) -> None:
    traced = read(tmp_path / "t.csv", figures(50.0, 20.0, 0, 100.0))
    number = Trial(120.0, 18.7)
    prior = prior_of(tables, trials=(traced,), rig=RIG)
    alone, together = (posterior(prior, some, RIG, POSITIONS) for some in ((traced,), (traced, number)))
    assert together.trials == (traced, number)
    assert together.expected_loss[together.best] <= alone.expected_loss[alone.best] + 0.01
    assert off(together, 20) < max(3 * together.directions()[0].spread_deg, 8)
    outcome = verify(together, Trial(120.0, 19.0))
    assert outcome.as_predicted
    with pytest.raises(UntrustedError, match="beside the traces"):
        posterior(together.prior, (traced, Trial(120.0, 400.0)), RIG, POSITIONS)
    with pytest.raises(UsageError, match="those of the prior"):
        posterior(together.prior, (number,), RIG, POSITIONS)


def rows(cam: np.ndarray, name: str = "cam_deg") -> str:
    error = 5 * np.sin(2 * np.radians(cam))
    return f"{name},error_arcsec\n" + "\n".join(f"{c:.4f},{e:.4f}" for c, e in zip(cam, error, strict=True))


def test_growing_angles_are_taken_where_there_are_both(tmp_path: Path) -> None:
    up, down = np.arange(0, 720, 3.0), np.arange(720, -3, -3.0)
    both = read(tmp_path / "both.csv", rows(np.append(up, down))).trace
    alone = read(tmp_path / "down.csv", rows(down)).trace
    assert both
    assert alone
    assert (both.growing, alone.growing) == (True, False)
    assert both.cam_turns == pytest.approx(2, abs=0.01)


def test_means_lie_at_the_cells_and_noise_is_that_of_the_readings(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    cam = np.arange(0, 720, 0.5) + 90.0
    text = rows(cam).splitlines()
    noisy = [text[0], *(f"{t.split(',')[0]},{float(t.split(',')[1]) + 0.5 * rng.standard_normal()}" for t in text[1:])]
    found = read(tmp_path / "n.csv", "\n".join(noisy), 1).trace
    assert found
    assert found.reading_noise_arcsec == pytest.approx(0.5, rel=0.1)
    expected = 5 * np.sin(2 * found.phi_h)
    assert found.error[0] == pytest.approx(expected - expected.mean(), abs=0.5)
    # 18 readings in a cell, where two turns are folded 36
    count = found.reading_noise_arcsec**2 / found.variance[0]
    assert np.all((np.abs(count - 18) < 4) | (np.abs(count - 36) < 4))
    matrices, target = found.whitened(1.0)
    slow = np.linalg.inv(matrices[0]) @ np.linalg.inv(matrices[0]).T
    assert np.sqrt(slow[0, 0] + slow[1, 1] - 2 * slow[0, 1]) < 1.5  # the level is open, neighbours err alike
    assert target[0] == pytest.approx(matrices[0] @ found.error[0])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (rows(np.arange(0, 300, 3.0)), "less than one cam turn"),
        (rows(np.arange(0, 1440, 30.0)), "too few for its curve"),
        (rows(np.arange(0, 30, 0.1), "output_deg"), "do not tell where the cam stands"),
        ("a,b,c\n" + "1,2,3\n4,5,7\n" * 20, "no column"),
    ],
)
def test_files_that_are_no_traces_of_a_trial(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(DataError, match=words):
        read(tmp_path / "bad.csv", text)


def test_a_file_is_named_and_a_number_is_a_number(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "17.3").write_text(rows(np.arange(0, 720, 3.0)))
    assert read_trial("h4:17.3", HOLES, TOLD) == Trial(120.0, 17.3)
    assert isinstance(read_trial("h4:./17.3", HOLES, TOLD).trace, TrialTrace)
    with pytest.raises(UsageError, match="neither a number nor a file"):
        read_trial("h4:none.csv", HOLES, TOLD)
    with pytest.raises(UsageError, match="is no number"):
        read_trial("h4:./17.3", HOLES)
