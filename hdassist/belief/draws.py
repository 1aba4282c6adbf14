"""Draws of a drive: each solved as far as it agrees with the evidence, and kept for the next command on the same drive.

Stiffness needs some ten states, so a draw that agrees badly with evidence of stiffness goes on to F'_ior by chance
only, with a probability p by which its weight is divided: the sum of weights stays right on average. Of a draw from a
density q over the prior's, with the likelihood L of all evidence and L_K of stiffness alone,

(1)  weight = L / (q p),  p = min(1, L_K / (k q))

k is KEPT_LIKELIHOOD; where no first draw agrees as well, the likelihood of that which agrees best: else nearly all
would be left out, alike bad as they are.

Kept draws are found by all that they depend on: values of the drive and ranges of its prior, torques, turns, evidence,
seed, the source of the code that computes them and the machine's instructions, on which the last digits depend. A file
whose checksum or types do not hold is drawn anew.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import astuple, dataclass, field, replace
from functools import cached_property
from typing import Annotated, Any

import numpy as np
from pydantic import Field, TypeAdapter
from scipy.special import softmax

from hdassist.belief.evidence import (
    ACCURACY,
    ACCURACY_LOAD,
    SMOOTH_NUMBERS,
    STIFFNESS_FIGURES,
    Evidence,
    error_kinds,
    errors_of_drive,
    kernel,
    log_likelihood,
    log_likelihoods,
    smooth_misfits,
    stiffness_figures,
    values_of_errors,
)
from hdassist.belief.prior import RIGID_SHIFT, DrivePrior
from hdassist.belief.proposals import (
    PILOT_DRAWS,
    DeviationProposal,
    open_deviations,
    proposed_draws,
    stiffness_log_likelihoods,
)
from hdassist.error.cycle import WITHOUT_EFFECT
from hdassist.error.error_map import Batch, ErrorMap, error_maps
from hdassist.error.extremes import DRAWN_GRIDS, many_extremes
from hdassist.error.stiffness import NEAR_ZERO, Twist
from hdassist.errors import HdassistError
from hdassist.model.contacts import contact_system
from hdassist.model.deviations import carried, no_hole_better
from hdassist.model.geometry import Array, Geometry, flank_candidates
from hdassist.model.rules import first_conflict
from hdassist.preset.fields import Drive
from hdassist.run.kept import ClosedRecord, KeptAnswer, Magnitude, Number
from hdassist.run.run import Run
from hdassist.solve.answers import ARCSEC, EMPTY, Certificate
from hdassist.solve.formulation import formulate
from hdassist.solve.walk import digits_depend_on

_ShareOfOne = Annotated[float, Field(strict=True, ge=0, le=1)]
_MOST_WEIGHT = 1e100  # of a draw that is believed: squares of weights are added


@dataclass(frozen=True)
class Draw(ClosedRecord):
    """One draw: why it is no drive, or its predictions, F'_ior [arcsec] (None where weeded), weight and proof.

    F_ior_arcsec, at each torque; turned_arcsec, at each torque with each turn; sets_arcsec, at each torque with each
    further set of deviations on the same contact system, and set_weights; shares: of each field's probability;
    proof of its states, and turned_proof, of those with the wheel turned; follows: values of fields that follow from
    others, by path.
    """

    refused: str = ""
    figures: Mapping[str, Number] = field(default_factory=dict)
    F_ior_arcsec: tuple[Magnitude, ...] | None = None
    turned_arcsec: tuple[tuple[Magnitude, ...], ...] | None = None
    weight: Annotated[Magnitude, Field(le=_MOST_WEIGHT)] = 0.0
    shares: tuple[_ShareOfOne, ...] = ()
    proof: Certificate = EMPTY
    follows: Mapping[str, Number] = field(default_factory=dict)
    turned_proof: Certificate = EMPTY
    sets_arcsec: tuple[tuple[Magnitude, ...], ...] = ()
    set_weights: tuple[Annotated[Magnitude, Field(le=_MOST_WEIGHT)], ...] = ()

    @property
    def certificate(self) -> Certificate:
        """Proof of the states behind it."""
        return self.proof + self.turned_proof

    @property
    def without_turns(self) -> Draw:
        """The same draw as it is where no turns are asked for."""
        no_turns = self.turned_arcsec and ((),) * len(self.turned_arcsec)
        return replace(self, turned_arcsec=no_turns, turned_proof=EMPTY)


_DRAWS = TypeAdapter(list[Draw])


FiguresOf = Callable[[Drive], tuple[Mapping[str, float], Certificate]]  # of a drive by name, with the proof of them
UnderWay = dict[int, Future[list[Draw]]]  # draws by their number
_FEW_PROCESSES = 4  # that wait so little at the end of a batch that no draw is begun which may not be needed
KEPT_LIKELIHOOD = 0.2  # of a perfect one: a draw below it goes on with a probability of its likelihood over this
_LEAST_KEPT_LIKELIHOOD = 0.01  # where no draw agrees better: one that agrees less is no drive of this evidence
_SHOWN_DIGITS = 6  # of an arcsec: the last ones hang on how many positions are computed at once


@dataclass(frozen=True)
class Sampling:
    """Draws of a drive that answer one question: all that they depend on.

    prior of the drive; torques [N*m]; rotations_deg, turns of the fixed wheel at which F'_ior is wanted too; evidence
    on the drive; further, figures that each draw has beside F'_ior, and further_name, all that they depend on beside
    the drive, in words, without which draws with them are not kept; seed of the draws; sets of deviations that a draw
    has F'_ior of, as mounted, where deviations are open and no F'_ior was measured.
    """

    prior: DrivePrior
    torques: tuple[float, ...]
    rotations_deg: tuple[float, ...] = ()
    evidence: tuple[Evidence, ...] = ()
    further: FiguresOf | None = None
    further_name: str = ""
    seed: int = 0
    sets: int = 1

    @cached_property
    def measured(self) -> tuple[Evidence, ...]:
        """F'_ior as measured on the drive."""
        return tuple(each for each in self.evidence if each.M_g)

    @cached_property
    def near(self) -> DeviationProposal | None:
        """Deviations near F'_ior as measured, several draws of which share all else; None where none are open."""
        is_open = self.measured and open_deviations(self.prior)
        return DeviationProposal(self.prior, self.measured, self.seed) if is_open else None

    @property
    def alike(self) -> int:
        """Number of draws that share all but the deviations."""
        return self.near.draws if self.near else 1

    # Draws that were kept

    def kept(self) -> list[Draw]:
        """The draws that are kept, from the first on; none where not all of them are draws."""
        return (self._is_answer and self.answer.found()) or []

    def keep(self, draws: Sequence[Draw]) -> None:
        """Keep draws, from the first on; those with turns also as draws without, where more are kept so."""
        if self._is_answer:
            self.answer.keep(list(draws))
        alone = replace(self, rotations_deg=())
        if self.rotations_deg and len(alone.kept()) < len(draws):
            alone.keep([each.without_turns for each in draws])

    @property
    def _is_answer(self) -> bool:
        """Whether all that draws depend on is told."""
        return bool(self.further_name or not self.further)

    @property
    def answer(self) -> KeptAnswer[list[Draw]]:
        """The draws as they are kept, by all that they depend on."""
        depends = {
            "drive": self.prior.drive.model_dump(mode="json", exclude=WITHOUT_EFFECT),
            "fields": [[each.path, each.distribution, each.low, each.high, each.draws] for each in self.prior.fields],
            "torques": self.torques,
            "rotations": self.rotations_deg,
            "evidence": [astuple(each) for each in self.evidence],
            "further": self.further_name,
            "seed": self.seed,
            "sets": self.sets,
            "program": digits_depend_on(),
        }
        return KeptAnswer("samples", depends, _DRAWS)

    # New draws

    def new(
        self, draws: Sequence[Draw], first: int, last: int, run: Run, ahead: UnderWay, most: int
    ) -> Iterator[list[Draw]]:
        """New draws, from the first to before the last, `alike` of them at a time.

        Arguments: draws so far, by the first of which the others are proposed; ahead, draws that are under way by their
        number: of a run of many processes as many follow, of most at most, so that none waits at the end of a batch.
        """
        pilot = [each.figures for each in draws[:: self.alike][:PILOT_DRAWS]]
        fresh = first // self.alike, -(-last // self.alike)
        best = stiffness_log_likelihoods(self.evidence, pilot if len(pilot) == PILOT_DRAWS else ())
        agreeing = float(np.exp(max(best.values(), default=0.0)))
        kept = min(max(agreeing, _LEAST_KEPT_LIKELIHOOD), KEPT_LIKELIHOOD)

        def tasks(begin: int, end: int) -> list[tuple[Any, ...]]:
            """Arguments of `solved` for draws by their number."""
            shares, density = proposed_draws(self.prior, self.evidence, pilot, begin, end, self.seed)
            rows = zip(range(begin, end), self.prior.values(shares), shares.tolist(), density.tolist(), strict=True)
            return [(*row, kept, self._unturned(row[0])) for row in rows]

        if run.executor and run.at_a_time > _FEW_PROCESSES and self.alike == 1:
            most = min(most, PILOT_DRAWS) if first < PILOT_DRAWS else most
            begin, end = max(ahead, default=first - 1) + 1, min(last + run.at_a_time, most)
            if begin < end:
                ahead |= {k: run.executor.submit(self.solved, k, *task) for k, *task in tasks(begin, end)}
            return (ahead.pop(k).result() for k in range(first, last))
        return run.map(self.solved, *zip(*tasks(*fresh), strict=True))

    def _unturned(self, number: int) -> Draw | None:
        """A draw as it is kept without turns, to which they are added; None of one that made no drive."""
        return next((each for each in self._kept_unturned[number : number + 1] if not each.refused), None)

    @cached_property
    def _kept_unturned(self) -> list[Draw]:
        """Draws as they are kept without turns; none where F'_ior as measured on the drive moves all of it at once."""
        return replace(self, rotations_deg=()).kept() if self.rotations_deg and not self.measured else []

    def solved(
        self,
        number: int,
        values: dict[str, float],
        shares: list[float],
        density: float,
        kept: float = KEPT_LIKELIHOOD,
        unturned: Draw | None = None,
    ) -> list[Draw]:
        """Draws solved that share all but the deviations: why they are no drive, else their predictions and weights.

        Arguments: number among all; values, by path, and their shares of probability, with the chance behind them by
        which a draw that agrees badly goes on; density that it was drawn with, over the prior's; kept, k of equation
        (1); unturned, the draw where only its turns are not known.
        """
        try:
            if unturned:
                return [self._turned(unturned, values)]
            return self._solved(number, values, shares, density, kept)
        except HdassistError as error:
            return [Draw(refused=str(error.fault))] * self.alike

    def with_turns(self, unturned: Draw, values: dict[str, float]) -> Draw:
        """Return a draw of values by path with the turns that it lacks; one without a trustworthy answer says so."""
        try:
            return self._turned(unturned, values)
        except HdassistError as error:
            return Draw(refused=str(error.fault))

    def _turned(self, unturned: Draw, values: dict[str, float]) -> Draw:
        """A draw of values by path with the turns that it lacks."""
        if unturned.F_ior_arcsec is None:
            return unturned
        drive = self.prior.drive.with_values(values).with_values(unturned.follows)
        maps = error_maps(drive, self._held(drive, 0)[1])
        turned, proof = errors_by_turn(maps, drive, self.torques, unturned.F_ior_arcsec, self.rotations_deg)
        return replace(unturned, turned_arcsec=tuple(map(tuple, turned.tolist())), turned_proof=proof)

    def _held(self, drive: Drive, number: int) -> tuple[dict[str, tuple[float, float]], tuple[float, ...]]:
        """Torque [N*m] and turn [deg] at which F'_ior is evidence on a drive, by figure; all torques that it needs.

        number: that of the draw, which decides the turn of the accuracy.
        """
        held = {each.figure: (each.M_g, each.rotation_deg) for each in self.measured}
        if self.torques and any(each.figure == ACCURACY for each in self.evidence):
            held[ACCURACY] = (ACCURACY_LOAD * drive.rated_torque, turn_of_test_deg(drive, [self.seed, number]))
        return held, tuple(dict.fromkeys((*self.torques, *(M_g for M_g, _ in held.values()))))

    def _solved(
        self, number: int, values: dict[str, float], shares: list[float], density: float, kept: float
    ) -> list[Draw]:
        """The same; raises HdassistError where an answer cannot be trusted."""
        *of_fields, chance = shares
        drive, proof, follows = self.prior.drive.with_values(values), EMPTY, dict[str, float]()
        if outside := next((path for path, value in values.items() if not drive.allows(path, value)), None):
            return [Draw(refused=f"{outside}: out of range")] * self.alike
        if self.prior.meshing:
            place, beyond = self.prior.meshing
            shift, proof = meshing_shift(drive)
            follows = {beyond.path: shift + float(beyond.value(np.array(shares[place])))}
            drive = drive.with_values(follows)
        if conflict := first_conflict(drive):
            return [Draw(refused=f"{conflict.path}: {conflict.message}")] * self.alike
        # stiffness takes some states: by its likelihood a draw goes on or not, and weighs the more
        figures: Mapping[str, float] = {}
        formulation = formulate(contact_system(drive))
        going_on = 1.0
        if any(each.figure in STIFFNESS_FIGURES for each in self.evidence):
            figures, of_stiffness = stiffness_figures(drive, formulation)
            proof += of_stiffness
            of_stiffness_alone = float(np.exp(log_likelihood(self.evidence, figures)))
            going_on = min(1.0, of_stiffness_alone / density / kept)  # equation (1)
        if chance >= going_on:
            return [Draw(figures=figures, proof=proof, follows=follows)] * self.alike
        held, torques = self._held(drive, number)
        maps = error_maps(drive, torques, formulation)
        nearer, of_tables = self.near.drawn(maps, number) if self.near else ([({}, 1.0)], EMPTY)
        proof += of_tables
        solved = list[Draw]()
        for deviations, their_density in nearer:
            own = [deviations.get(f.path, share) for f, share in zip(self.prior.fields, of_fields, strict=True)]
            moved = drive.with_values(self.prior.values(np.array([own]))[0])
            F_ior, there, of_errors = errors_now(maps, moved, self.torques, list(held.values()))
            turned, of_turned = errors_by_turn(maps, moved, self.torques, F_ior.tolist(), self.rotations_deg)
            more, of_further = self.further(moved) if self.further else ({}, EMPTY)
            now = {**figures, **more, **dict(zip(held, there.tolist(), strict=True))}
            weight = float(np.exp(log_likelihood(self.evidence, now))) / (density * their_density) / going_on
            if self.measured:
                seed = [self.seed, number * self.alike + len(solved)]
                F_ior, turned = self._shown(there[: len(self.measured)], F_ior, turned, seed)
            sets_arcsec, tested, of_sets = self._further_sets(maps, moved, number, own)
            figures_of_sets = [{**figures, **({} if test is None else {ACCURACY: test})} for test in tested]
            likelihoods = [np.exp(log_likelihood(self.evidence, of_set)) for of_set in figures_of_sets]
            solved.append(
                Draw(
                    figures=now,
                    F_ior_arcsec=tuple(F_ior.tolist()),
                    turned_arcsec=tuple(map(tuple, turned.tolist())),
                    weight=weight,
                    shares=tuple(own),
                    proof=proof + of_errors + of_further + of_sets,
                    follows=follows,
                    turned_proof=of_turned,
                    sets_arcsec=tuple(map(tuple, sets_arcsec.T.tolist())),
                    set_weights=tuple(float(likelihood) / density / going_on for likelihood in likelihoods),
                )
            )
            proof = EMPTY
        return solved

    @cached_property
    def _set_places(self) -> list[int]:
        """Places of the deviations that differ from set to set: those that are open, and not fitted with others."""
        if self.measured or self.sets < 2:
            return []
        fields = open_deviations(self.prior)
        return [
            place
            for place, field_prior in enumerate(self.prior.fields)
            if field_prior in fields and not field_prior.draws
        ]

    def _further_sets(
        self, maps: Sequence[ErrorMap], drive: Drive, number: int, shares: Sequence[float]
    ) -> tuple[Array, list[float | None], Certificate]:
        """Return F'_ior [arcsec] of further sets of deviations, shape (torques, sets), that as tested, and the proof.

        maps: of the error of the drive at all torques; number of the draw; shares of the fields of the draw.
        """
        if not self._set_places:
            return np.empty((len(self.torques), 0)), [], EMPTY
        columns = self._set_columns(number, shares)
        of_torque = {error_map.M_g: error_map for error_map in maps}
        as_mounted = [many_extremes(of_torque[M_g], Batch(drive, columns), DRAWN_GRIDS) for M_g in self.torques]
        F_ior = np.array([extremes.F_ior_arcsec for extremes in as_mounted])
        proof = sum((extremes.certificate for extremes in as_mounted), EMPTY)
        if not any(datum.figure == ACCURACY for datum in self.evidence):
            return F_ior, [None for _ in range(1, self.sets)], proof
        tested, of_test = self._tested_sets(of_torque[ACCURACY_LOAD * drive.rated_torque], drive, number, columns)
        return F_ior, tested, proof + of_test

    def _set_columns(self, number: int, shares: Sequence[float]) -> dict[str, Array]:
        """Return values of the deviations of further sets, by path, shape (sets,) each.

        number of the draw; shares of the fields of the draw, which all else keeps.
        """
        rng = np.random.default_rng([self.seed, number, _SETS])
        random = np.tile(shares, (self.sets - 1, 1))
        random[:, self._set_places] = rng.random((self.sets - 1, len(self._set_places)))
        values = self.prior.values(random)
        paths = [self.prior.fields[place].path for place in self._set_places]
        return {path: np.array([of_set[path] for of_set in values]) for path in paths}

    def _tested_sets(
        self, error_map: ErrorMap, drive: Drive, number: int, columns: Mapping[str, Array]
    ) -> tuple[list[float | None], Certificate]:
        """Return F'_ior [arcsec] of further sets of deviations as the manufacturer tests it, and the proof.

        error_map: at the load of the test; number of the draw; columns: values of the sets by path, shape (sets,) each.
        """
        turns_deg = [turn_of_test_deg(drive, [self.seed, number, place]) for place in range(1, self.sets)]
        turned = {path: columns.get(path, drive.number(path)) + np.array(turns_deg) for path in carried(drive)}
        extremes = many_extremes(error_map, Batch(drive, {**columns, **turned}), DRAWN_GRIDS)
        return extremes.F_ior_arcsec.tolist(), extremes.certificate

    def _shown(self, there: Array, F_ior: Array, turned: Array, seed: list[int]) -> tuple[Array, Array]:
        """F'_ior [arcsec] of the drive, where the model of a draw has F_ior and turned, by F'_ior as measured on it.

        A draw of its scale, misfit, noise and misread value (evidence.py, equation 1), the same whatever else is asked
        for. Arguments: there, F'_ior of the model as measured, shape (values,); the others as of errors_by_turn.
        """
        y, stated, correlation = values_of_errors(self.measured)
        f, rng, kinds = there[None], np.random.default_rng(seed), error_kinds(len(y), {1.0: 0.0})
        mean = f.mean(axis=1)
        kind = kinds[rng.choice(len(kinds), p=softmax(log_likelihoods(kinds, f, y, stated, correlation, mean)[:, 0]))]
        of_scale, noise = rng.standard_normal(1), rng.standard_normal((1, len(y)))
        points = [(M_g, turn) for M_g in self.torques for turn in (0.0, *self.rotations_deg)]
        loads, turns = np.array([*points, *((each.M_g, each.rotation_deg) for each in self.measured)]).T
        misfit = np.zeros((1, len(turns)))
        for M_g in np.unique(loads):
            numbers = np.random.default_rng([*seed, int(M_g.view(np.uint64))]).standard_normal((1, SMOOTH_NUMBERS))
            misfit[:, loads == M_g] = smooth_misfits(turns[loads == M_g], numbers)
        every = np.append(np.column_stack([F_ior, turned]), there)[None]
        spreads, alike = kind.spreads(stated, y)[None], kernel(turns, turns) * np.equal.outer(loads, loads)
        shown, _ = errors_of_drive(every, y, (kind.misfit * mean) ** 2, spreads, alike, (of_scale, misfit, noise))
        shown = np.round(shown, _SHOWN_DIGITS).reshape(len(self.torques), -1)
        return shown[:, 0], shown[:, 1:]


_SETS = 11  # of the seeds of a draw: that of its further sets of deviations
_TESTED_TURN = 7  # of the seeds of a draw: that of the turn in which its accuracy was tested


def turn_of_test_deg(drive: Drive, seed: Sequence[int]) -> float:
    """Return the turn of the fixed wheel [deg] in which the manufacturer tested the accuracy of a drive.

    The preset does not state it, so that each hole is equally likely: to compare the accuracy with the present hole
    would make this hole seem better than the others.

    drive: the drive; if no hole is better than another, the turn is 0.
    seed: seed and number of the draw.
    """
    if no_hole_better(drive):
        return 0.0
    share = float(np.random.default_rng([*seed, _TESTED_TURN]).random())
    holes = drive.mounting.holes
    return 360 * int(share * holes) / holes if holes else 360 * share


def errors_now(
    maps: Sequence[ErrorMap],
    drive: Drive,
    torques: Sequence[float],
    measured: Sequence[tuple[float, float]] = (),
) -> tuple[Array, Array, Certificate]:
    """F'_ior [arcsec] of a drive at torques [N*m], shape (torques,), and as measured, shape (measured,), and the proof.

    Arguments: maps of its error at all torques; measured, single torques [N*m] with a turn each [deg]. Raises
    UntrustedError where an answer cannot be trusted.
    """
    now, there, proof = dict[float, float](), dict[tuple[float, float], float](), EMPTY
    for error_map in maps:
        # by themselves, so that their digits are the same whatever else is searched
        alone = [at for at in measured if at[0] == error_map.M_g]
        first = np.nan
        if error_map.M_g in torques or any(turn % 360 == 0 for _, turn in alone):
            found = many_extremes(error_map, Batch.of(drive), DRAWN_GRIDS)
            first = now[error_map.M_g] = found.first
            proof += found.certificate
        F_ior, of_measured = _at_turns(error_map, drive, first, [turn for _, turn in alone])
        there |= zip(alone, F_ior.tolist(), strict=True)
        proof += of_measured
    return np.array([now[M_g] for M_g in torques]), np.array([there[at] for at in measured]), proof


def errors_by_turn(
    maps: Sequence[ErrorMap],
    drive: Drive,
    torques: Sequence[float],
    now: Sequence[float],
    rotations_deg: Sequence[float],
) -> tuple[Array, Certificate]:
    """F'_ior [arcsec] of a drive with its fixed wheel turned [deg], shape (torques, rotations), and the proof.

    Arguments: maps of its error at torques [N*m] and others; now, F'_ior where the wheel stands, at each torque. Raises
    UntrustedError where an answer cannot be trusted.
    """
    of_torque = {each.M_g: each for each in maps}
    found = [_at_turns(of_torque[M_g], drive, F_ior, rotations_deg) for M_g, F_ior in zip(torques, now, strict=True)]
    turned = np.array([F_ior for F_ior, _ in found]).reshape(len(torques), len(rotations_deg))
    return turned, sum((proof for _, proof in found), EMPTY)


def _at_turns(error_map: ErrorMap, drive: Drive, now: float, turns: Sequence[float]) -> tuple[Array, Certificate]:
    """F'_ior [arcsec] of a drive with its fixed wheel turned [deg], shape (turns,), and the proof of it.

    Argument: now, F'_ior as it stands.
    """
    F_ior, away = np.full(len(turns), now), np.flatnonzero(np.array(turns) % 360)
    if not len(away):
        return F_ior, EMPTY
    there = many_extremes(error_map, Batch.turned(drive, np.array(turns)[away]), DRAWN_GRIDS)
    F_ior[away] = there.F_ior_arcsec
    return F_ior, there.certificate


_OPENED = 0.1  # modules of clearance at each flank, with which any drive has play


def meshing_shift(drive: Drive) -> tuple[float, Certificate]:
    """Profile shift of the rigid wheel [modules] at which the teeth of a drive at rest just mesh, with the proof.

    A harmonic drive is made so that its teeth just fill their spaces: wave, clearances and the shifts of both wheels
    are chosen for each other, whatever they are. Without load the flanks are free of each other up to there, so the
    play grows by the same angle with each micrometre of clearance, and one answer with much clearance shows where it
    begins. Raises UntrustedError where the drive has no answer with play.
    """
    gears, alpha, opened = drive.gears, np.radians(drive.gears.alpha), _OPENED * drive.gears.m
    at_rest = drive.with_values({"operation.dT": 0.0})
    nearest = float(flank_candidates(Geometry.of(at_rest)).gap.min()) + 1e-3 * gears.j_n  # on the cam's own shape
    near = drive.number(RIGID_SHIFT) - nearest / (gears.m * np.sin(alpha))
    there = at_rest.with_values({RIGID_SHIFT: near, "gears.j_n": gears.j_n + 1e3 * opened})
    least = NEAR_ZERO * drive.rated_torque
    contact, tube, proof = Twist(there).at(np.array([-least, least]))
    play = float(np.diff(contact + tube)[0]) / ARCSEC  # rad
    # a flank's force acts at the base circle: half of the play is the clearance over its radius
    left = play / 2 * gears.m * gears.z_g / 2 * np.cos(alpha) - opened
    return near - float(left / (gears.m * np.sin(alpha))), proof
