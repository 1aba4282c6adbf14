"""Test of the verdicts of check on drives that its samples cannot represent: `python -m benchmarks.honesty --n 40`.

Each hidden drive resembles the data-sheet preset. Its stiffnesses, wave, supports and clearances are sampled from other
distributions than those of the prior. Its rings, teeth, temperature and flanks (whole or coned) differ, although the
prior takes them as exact. Its teeth have harmonics of every order and noise, or with --teeth smooth only the orders 1
to 4. The teeth are shifted until the drive
has no backlash, as in a harmonic drive, and then closer by a preload from another distribution than that of the prior.
--stiff selects drives with small clearances and stiff supports. The known data of a hidden drive are K_1 to K_3, with
errors of 10 %, and an upper limit of its lost motion. With --coupling, a solid hub is known too if the drive has one,
as every designer knows it.

--own samples drives from the prior of one data sheet. The 90 % range of check must contain 90 % of these drives. It
cannot contain 90 % of the drives that --stiff selects from them, because the data do not show that they are stiff.
"""

from __future__ import annotations

import argparse
import os
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from itertools import repeat

import numpy as np

EXACT = ("flexspline.h_1", "flexspline.h_3", "flexspline.k_t", "bearing.ring_h", "material.E")  # exact in the prior
OFF = 0.08  # standard deviation of the logarithm of these fields in hidden drives
WARM = 6.0  # K, standard deviation of operation.dT
# highest order of the harmonics of the teeth, and standard deviation of single teeth [um]
TEETH = {"rough": (12, 1.0), "smooth": (4, 0.0)}
MISREAD = 0.10  # standard deviation of the logarithm of a catalogue stiffness
ROOM = 1.2  # limit of the lost motion in the catalogue over the lost motion of the drive
PRELOAD = 0.012  # scale of the Rayleigh distribution of the preload, a profile shift in modules
LEAST_PLAY = 1.0  # arcsec; backlash after the teeth are shifted
STIFF = {"bearing.g_b": (0.0, 0.3), "supports.C_1": (0.6, 1.0), "supports.C_2": (0.6, 1.0), "supports.C_3": (0.5, 1.0)}
OWN_DRAWS = 1024, 256  # numbers of samples of the prior of a data sheet, of all drives and within STIFF
LIMITS = 1.0  # standard deviation of the logarithm of a limit around the true F'_ior


@dataclass(frozen=True)
class Judged:
    """Verdict on a hidden drive.

    F_ior: true F'_ior [arcsec].
    limit: limit of F'_ior [arcsec].
    p5, p95: predicted 5th and 95th percentile of F'_ior [arcsec].
    verdict: verdict of check.
    effective: effective sample size.
    refused: reason why there is no verdict, empty if there is one.
    """

    F_ior: float = np.nan
    limit: float = np.nan
    p5: float = np.nan
    p95: float = np.nan
    verdict: str = ""
    effective: float = 0.0
    refused: str = ""


def judged(
    number: int,
    draws: int,
    most: int,
    seed: int,
    teeth: str = "rough",
    stiff: bool = False,
    coupling: bool = False,
) -> Judged:
    """Return the verdict by the rule of check on a hidden drive.

    number: number of the drive.
    draws: required effective sample size.
    most: factor by which it may be increased if the verdict is undecided.
    seed: seed of all drives.
    teeth: kind of teeth, a key of TEETH.
    stiff: whether the drive lies within STIFF.
    coupling: whether a solid hub is known.
    """
    from hdassist.belief.evidence import evidence_of
    from hdassist.belief.prior import prior_of
    from hdassist.belief.samples import FEWEST_SAMPLES, SamplingEffort, draw_samples, limits_settled
    from hdassist.run.errors import HdassistError
    from hdassist.run.run import Run

    rng = np.random.default_rng([seed, number])
    try:
        preset, M_g, F_ior = hidden(rng, teeth, stiff, coupling)
        limit = F_ior * np.exp(LIMITS * rng.standard_normal())
        samples = draw_samples(
            prior_of(preset), [M_g], evidence=evidence_of(preset), enough=partial(limits_settled, [limit]),
            effort=SamplingEffort(draws, most * draws, 32 * draws, least=FEWEST_SAMPLES), run=Run(seed=number),
        )  # fmt: skip
    except HdassistError as error:
        return Judged(refused=error.message)
    verdict = samples.probability_within(limit, 0).verdict().value
    p5, p95 = (samples.percentile(share, 0) for share in (0.05, 0.95))
    return Judged(F_ior, limit, p5, p95, verdict, samples.effective)


def hidden(rng: np.random.Generator, teeth: str = "rough", stiff: bool = False, coupling: bool = False):
    """Return the preset with the known data of a hidden drive, a torque M_g [N*m] and the true F'_ior [arcsec]."""
    preset, there, deviations = hidden_drive(rng, teeth=teeth, stiff=stiff, coupling=coupling)
    M_g = preset.operation.M_g[0]
    return preset, M_g, true_F_ior(there, M_g, deviations)


def true_F_ior(drive, M_g: float, teeth) -> float:
    """Return F'_ior of a hidden drive at a torque M_g [N*m], in arcsec; teeth: deviations of its teeth."""
    from hdassist.drive.error.cycle import kinematic_error
    from hdassist.run.run import UNCHECKED

    found = kinematic_error(drive, M_g, teeth=teeth, run=UNCHECKED)
    return found.F_ior_arcsec


def hidden_drive(
    rng: np.random.Generator,
    ratios: tuple[float, ...] = (50, 80, 100, 120),
    teeth: str = "rough",
    stiff: bool = False,
    coupling: bool = False,
):
    """Return the preset with the known data of a hidden drive, the drive, and the deviations of its teeth.

    rng: random generator.
    ratios: possible ratios of the drive.
    teeth: kind of its teeth, a key of TEETH.
    stiff: whether the drive lies within STIFF.
    coupling: whether the preset states a solid hub if the wave generator of the drive sits on one.
    """
    from hdassist import load_preset
    from hdassist.belief.evidence import stiffness_figures
    from hdassist.belief.prior import prior_of
    from hdassist.drive.loading import load_text, similar_preset
    from hdassist.drive.model.rules import first_conflict
    from hdassist.drive.preset.knowledge import read_requirements

    like = load_preset("vzp160")
    ratio, diameter = float(rng.choice(ratios)), float(rng.choice([42, 63.5, 90, 160]))
    M_r = 67 * (diameter / 63.5) ** 3
    requirements = partial(read_requirements, like, ratio=ratio, pitch_diameter=f"{diameter} mm", torque=f"{M_r:.4g}")
    known = load_text(similar_preset("own", like, requirements()), "own.yaml")
    while True:
        there = known.with_values(drawn_values(prior_of(known), rng, STIFF if stiff else {}))
        there = there.with_values(
            {path: there.number(path) * np.exp(OFF * rng.standard_normal()) for path in EXACT} | {"operation.dT": 0.0}
        )
        there = _without_play(there, PRELOAD * rng.rayleigh())
        if there and first_conflict(there) is None:
            break
    there = there.with_values({"operation.dT": WARM * rng.standard_normal()})
    numerics = {"stations": int(rng.choice([1, 3, 5, 9])), "nominal_curve": str(rng.choice(["linear", "inextensible"]))}
    there = there.model_copy(update={"numerics": there.numerics.model_copy(update=numerics)})
    figures, _ = stiffness_figures(there)
    stiffness = [figures[name] * np.exp(MISREAD * rng.standard_normal()) for name in ("K_1", "K_2", "K_3")]
    solid = load_text(similar_preset("own", like, requirements(coupling="solid")), "own.yaml")
    bounds = solid.source["supports.C_3"].range
    hub = "solid" if coupling and bounds and bounds[0] <= there.supports.C_3 <= bounds[1] else None
    given = requirements(stiffness=",".join(f"{K:.5g}" for K in sorted(stiffness)), coupling=hub)
    text = similar_preset("own", like, given)
    preset = load_text(text, "own.yaml", [f"catalogue.lost_motion={ROOM * figures['lost_motion']:.4g}"])
    return preset, there, tooth_deviations(there, rng, *TEETH[teeth])


def _without_play(drive, preload: float):
    """Return the drive with the profile shift of its circular spline adjusted to a backlash of LEAST_PLAY, and preload.

    preload: further profile shift that closes the teeth [modules].
    Returns None if no shift gives this backlash.
    """
    from scipy.optimize import brentq

    from hdassist.drive.error.stiffness import stiffness
    from hdassist.run.errors import HdassistError
    from hdassist.run.run import UNCHECKED

    def shifted(by: float):
        return drive.with_values({"gears.x_b": drive.gears.x_b + by})

    def excess(by: float) -> float:
        return stiffness(shifted(by), points=1, run=UNCHECKED).play_arcsec - LEAST_PLAY

    try:
        return shifted(brentq(excess, -0.3, 0.3, xtol=1e-4) - preload)
    except (HdassistError, ValueError):  # the teeth jam or have backlash at both ends of the range
        return None


def drawn_values(prior, rng: np.random.Generator, within: dict[str, tuple[float, float]]) -> dict[str, float]:
    """Return values of a hidden drive for the uncertain fields of the prior, by path.

    Sizes follow Rayleigh distributions; other values are more frequent near the ends of their ranges than in the prior.

    prior: prior of the preset.
    rng: random generator.
    within: range of the cumulative probability for fields that are restricted, by path.
    """
    found = {}
    for each in prior.fields:
        if each.distribution == "meshing" or each.group.startswith("tolerances.f_p"):  # set elsewhere
            continue
        low, high = within.get(each.path, (0.0, 1.0))
        share = low + (high - low) * rng.beta(0.8, 0.8)
        if each.path.startswith(("tolerances.", "harmonics.a_")):
            share = min(0.35 * rng.rayleigh(), 1.0)
        found[each.path] = float(each.value(np.array([share]))[0])
    return found


def tooth_deviations(drive, rng: np.random.Generator, highest: int, noise_um: float):
    """Return the deviations of the teeth of both wheels [um]: harmonics that decrease with their order, and noise.

    rng: random generator.
    highest: highest order of the harmonics.
    noise_um: standard deviation of single teeth [um].
    """
    from hdassist.drive.model.deviations import ToothDeviations

    def wheel(z: int, peak_to_peak: float):
        angle, found = 2 * np.pi * np.arange(z) / z, noise_um * rng.standard_normal(z)
        for order in range(1, highest + 1):
            size = peak_to_peak / 2 * (1.0 if order == 1 else 0.1 * rng.rayleigh() / order)
            found += size * np.cos(order * angle - 2 * np.pi * rng.random())
        return found

    gears = drive.gears
    return ToothDeviations(
        wheel(gears.z_g, drive.number("tolerances.F_i1")), wheel(gears.z_b, drive.number("tolerances.F_i2"))
    )


def own_drives(jobs: int, seed: int) -> list[list[bool]]:
    """Return for each drive whether its 90 % range contains F'_ior, for drives of the prior and for those within STIFF.

    The figures of a drive are known as for hidden drives, and all other samples are weighted by these figures.
    """
    from hdassist import load_preset
    from hdassist.belief.draws import Sampling
    from hdassist.belief.evidence import evidence_of, stiffness_figures
    from hdassist.belief.prior import prior_of
    from hdassist.belief.samples import EFFECTIVE_SAMPLES
    from hdassist.belief.statistics import effective_number, weighted_quantile
    from hdassist.drive.loading import load_text, similar_preset
    from hdassist.drive.preset.knowledge import read_requirements

    like = load_preset("vzp160")
    stiffness = "3.1e4,5.0e4,5.7e4"  # stiffness of the catalogue, replaced by the figures of each drive
    asked = read_requirements(like, ratio=100, pitch_diameter="63.5 mm", torque="67", stiffness=stiffness)
    preset = load_text(similar_preset("own", like, asked), "own.yaml")
    prior, evidence, rng = prior_of(preset), evidence_of(preset), np.random.default_rng(seed)
    sampling = Sampling(prior, preset.operation.M_g[:1], figures_of=stiffness_figures)
    drawn = []
    with ProcessPoolExecutor(jobs) as pool:
        for k, (count, within) in enumerate(zip(OWN_DRAWS, ({}, STIFF), strict=True)):
            low, high = np.array([(*within.get(each.path, (0.0, 1.0)),) for each in prior.fields] + [(0, 1)]).T
            shares = low + (high - low) * prior.shares(count, 2 * seed + k)
            rows = range(count), prior.values(shares), shares.tolist(), repeat(1.0)
            found = [one for (one,) in pool.map(sampling.solved, *rows, chunksize=16)]
            drawn.append([each for each in found if each.F_ior_arcsec])
    F_ior = np.array([each.F_ior_arcsec for each in drawn[0]])[:, 0]
    figures = {each.figure: np.array([draw.figures[each.figure] for draw in drawn[0]]) for each in evidence}

    def holds(one) -> bool | None:
        weights = np.array([each is not one for each in drawn[0]], dtype=float)
        for each in evidence:
            told = replace(each, value=one.figures[each.figure] * np.exp(MISREAD * rng.standard_normal()))
            if each.kind == "limit":
                told = each if each.figure == "play" else replace(each, value=ROOM * one.figures[each.figure])
            weights *= np.exp(told.log_likelihood(figures[each.figure]))
        if effective_number(weights) < EFFECTIVE_SAMPLES:
            return None
        p5, p95 = (weighted_quantile(F_ior, weights, share) for share in (0.05, 0.95))
        return bool(p5 <= one.F_ior_arcsec[0] <= p95)

    return [[held for held in map(holds, some) if held is not None] for some in drawn]


def main() -> None:
    """Judge drives, and print how often each verdict was wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--n", type=int, default=40, help="hidden drives")
    parser.add_argument("--draws", type=int, default=64, help="effective samples at least")
    parser.add_argument("--most", type=int, default=8, help="times as many, where the verdict is open")
    parser.add_argument("--teeth", choices=list(TEETH), default="rough", help="teeth of the hidden drives")
    parser.add_argument("--stiff", action="store_true", help="small clearances, stiff supports")
    parser.add_argument("--coupling", action="store_true", help="a solid hub is known where it is one")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--own", action="store_true", help="drives of the belief itself")
    args = parser.parse_args()
    if args.own:
        for of, held in zip(("of the belief", "of these, stiff ones"), own_drives(args.jobs, args.seed), strict=True):
            print(f"90 % ranges that hold drives {of}: {sum(held)} of {len(held)}, {np.mean(held):.0%}")
        return
    one = partial(
        judged,
        draws=args.draws,
        most=args.most,
        seed=args.seed,
        teeth=args.teeth,
        stiff=args.stiff,
        coupling=args.coupling,
    )
    found = []
    with ProcessPoolExecutor(args.jobs) as pool:
        for k, each in enumerate(pool.map(one, range(args.n))):
            found.append(each)
            print(k, each.refused or f"{each.verdict}: {each.F_ior:.1f} of {each.limit:.1f}, believed {each.p5:.1f} to "
                  f"{each.p95:.1f}, {each.effective:.0f} effective", flush=True)  # fmt: skip
    answers = [each for each in found if not each.refused]
    for verdict, is_wrong in (("PASS", lambda a: a.F_ior > a.limit), ("FAIL", lambda a: a.F_ior <= a.limit)):
        given = [each for each in answers if each.verdict == verdict]
        print(f"{verdict}: {len(given)} given, {sum(map(is_wrong, given))} wrong")
    print(f"INCONCLUSIVE: {sum(each.verdict == 'INCONCLUSIVE' for each in answers)} of {len(answers)}")
    inside = sum(each.p5 <= each.F_ior <= each.p95 for each in answers)
    print(f"90 % ranges that hold: {inside} of {len(answers)}; no answer: {len(found) - len(answers)}")


if __name__ == "__main__":
    main()
