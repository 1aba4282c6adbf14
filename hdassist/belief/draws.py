"""Draws of a drive, which are solved fully if they agree with the reference data, and stored for later commands.

Stiffness takes only some ten states and is solved first. A draw that agrees badly with the reference data on stiffness
is solved for F'_ior only with a probability p. Its weight is divided by p, so that the expected sum of weights is
unchanged. For a draw with the density q relative to that of the prior, the likelihood L of all reference data, and the
likelihood L_K of those on stiffness,

(1)  weight = L / (q p),  p = min(1, L_K / (k q))

k is KEPT_LIKELIHOOD, or the largest likelihood among the first draws if that is smaller. With a larger k, nearly all
draws of a drive that agrees badly would be omitted, although they agree equally badly.

Stored draws are looked up by all their dependencies: values of the drive and ranges of its prior, torques, rotations,
reference data, seed, source code, and the instruction set of the processor, on which the last digits depend. If a file
has an invalid checksum or type, its draws are computed again.
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
    LEAST_DENSITY,
    PILOT_DRAWS,
    DeviationProposal,
    ProposedDeviations,
    open_deviations,
    proposed_draws,
    stiffness_log_likelihoods,
)
from hdassist.drive.error.cycle import WITHOUT_EFFECT
from hdassist.drive.error.error_map import Batch, ErrorMap, error_maps
from hdassist.drive.error.extremes import DRAWN_GRIDS, many_extremes
from hdassist.drive.error.readings import ranges_as_tested
from hdassist.drive.error.stiffness import NEAR_ZERO, Twist
from hdassist.drive.model.contacts import contact_system
from hdassist.drive.model.deviations import carried, no_hole_better
from hdassist.drive.model.geometry import Array, Geometry, flank_candidates
from hdassist.drive.model.rules import first_conflict
from hdassist.drive.preset.fields import Drive
from hdassist.drive.solve.answers import ARCSEC, EMPTY, Certificate
from hdassist.drive.solve.formulation import formulate
from hdassist.drive.solve.walk import digits_depend_on
from hdassist.run.errors import HdassistError
from hdassist.run.kept import ClosedRecord, KeptAnswer, Magnitude, Number
from hdassist.run.run import Run

_ShareOfOne = Annotated[float, Field(strict=True, ge=0, le=1)]
_MOST_WEIGHT = 1e100  # largest weight of a draw, so that squares of weights do not overflow


@dataclass(frozen=True)
class Draw(ClosedRecord):
    """One draw: its predictions and weight, or the reason why it has none.

    refused: reason why it is not a valid drive or has no trustworthy result; empty if there is none.
    figures: predicted values by name.
    F_ior_arcsec: F'_ior at each torque [arcsec]; None if the draw was not solved further.
    turned_arcsec: F'_ior at each torque and rotation of the fixed wheel [arcsec]; None as for F_ior_arcsec.
    weight: weight of the draw by equation (1).
    shares: quantile level of each field in its prior.
    proof: certificate of its states, except those with the wheel turned.
    follows: values of fields that depend on other fields, by path.
    turned_proof: certificate of the states with the wheel turned.
    sets_arcsec: F'_ior [arcsec] at each torque, for each further set of deviations on the same contact system.
    set_weights: weight of each further set.
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
        """Certificate of all states of the draw."""
        return self.proof + self.turned_proof

    @property
    def without_turns(self) -> Draw:
        """The same draw as if no rotations were requested."""
        no_turns = self.turned_arcsec and tuple(() for _ in self.turned_arcsec)
        return replace(self, turned_arcsec=no_turns, turned_proof=EMPTY)


_DRAWS = TypeAdapter(list[Draw])


# returns the figures of a drive by name, with their certificate
FiguresOf = Callable[[Drive], tuple[Mapping[str, float], Certificate]]
UnderWay = dict[int, Future[list[Draw]]]  # draws in progress, by number
# largest number of processes for which no draws are started in advance, because few processes wait only briefly at the
# end of a batch
_FEW_PROCESSES = 4
# likelihood, relative to perfect agreement, below which a draw is solved further with a probability proportional to it
KEPT_LIKELIHOOD = 0.2
# smallest value of k; draws that agree less than this are not drives with these reference data
_LEAST_KEPT_LIKELIHOOD = 0.01
_SHOWN_DIGITS = 6  # digits of an error in arcsec; further digits depend on the number of positions computed together


@dataclass(frozen=True)
class Sampling:
    """Everything on which the draws of a drive depend, and the methods that draw and store them.

    prior: prior of the drive.
    torques: torques at which F'_ior is computed [N*m].
    rotations_deg: rotations of the fixed wheel at which F'_ior is also computed [deg].
    evidence: reference data on the drive.
    figures_of: function that returns further predicted values of a draw; None if no further values are needed.
    figures_name: description of all inputs of figures_of except the drive; if it is empty, draws with further values
        are not stored.
    seed: seed of the draws.
    sets: number of sets of deviations for which F'_ior of a draw is computed; it applies only if deviations are
        uncertain and no F'_ior was measured.
    """

    prior: DrivePrior
    torques: tuple[float, ...]
    rotations_deg: tuple[float, ...] = ()
    evidence: tuple[Evidence, ...] = ()
    figures_of: FiguresOf | None = None
    figures_name: str = ""
    seed: int = 0
    sets: int = 1

    @cached_property
    def measured(self) -> tuple[Evidence, ...]:
        """Measured values of F'_ior of the drive."""
        return tuple(datum for datum in self.evidence if datum.M_g)

    @cached_property
    def accuracy(self) -> Evidence | None:
        """The catalogue accuracy; None if it is not stated."""
        return next((datum for datum in self.evidence if datum.figure == ACCURACY), None)

    @cached_property
    def near(self) -> DeviationProposal | None:
        """Proposal that draws several sets of deviations per system near the measured F'_ior.

        It is None if no F'_ior was measured or no deviation is uncertain.
        """
        is_open = self.measured and open_deviations(self.prior)
        return DeviationProposal(self.prior, self.measured, self.seed) if is_open else None

    @property
    def alike(self) -> int:
        """Number of draws that share all fields except the deviations."""
        return self.near.draws if self.near else 1

    # Stored draws

    def kept(self) -> list[Draw]:
        """Return the stored draws in order, starting with the first; an empty list if their file is invalid."""
        return (self._is_answer and self.answer.found()) or []

    def keep(self, draws: Sequence[Draw]) -> None:
        """Store draws in order, starting with the first.

        Draws with rotations are also stored without them, if fewer draws without rotations are stored so far.
        """
        if self._is_answer:
            self.answer.keep(list(draws))
        alone = replace(self, rotations_deg=())
        if self.rotations_deg and len(alone.kept()) < len(draws):
            alone.keep([draw.without_turns for draw in draws])

    @property
    def _is_answer(self) -> bool:
        """Whether the draws can be stored, because all their dependencies are known."""
        return bool(self.figures_name or not self.figures_of)

    @property
    def answer(self) -> KeptAnswer[list[Draw]]:
        """The cache entry of the draws, whose key contains all their dependencies."""
        depends = {
            "drive": self.prior.drive.model_dump(mode="json", exclude=WITHOUT_EFFECT),
            "fields": [
                [field_prior.path, field_prior.distribution, field_prior.low, field_prior.high, field_prior.draws]
                for field_prior in self.prior.fields
            ],
            "torques": self.torques,
            "rotations": self.rotations_deg,
            "evidence": [astuple(datum) for datum in self.evidence],
            "further": self.figures_name,
            "seed": self.seed,
            "sets": self.sets,
            "program": digits_depend_on(),
        }
        return KeptAnswer("samples", depends, _DRAWS)

    # New draws

    def new(
        self,
        draws: Sequence[Draw],
        first: int,
        last: int,
        run: Run,
        ahead: UnderWay,
        most: int,
    ) -> Iterator[list[Draw]]:
        """Return an iterator over new draws in groups of `alike`.

        draws: draws so far; the first ones determine the proposal of the new draws.
        first, last: number of the first new draw, and number after the last new draw.
        run: processes; if there are many, later draws are started in advance to keep all of them busy.
        ahead: draws in progress, by number; draws started in advance are added to it.
        most: largest number of draws.
        """
        pilot = [draw.figures for draw in draws[:: self.alike][:PILOT_DRAWS]]
        kept_likelihood = self._kept_likelihood(pilot)
        if run.executor and run.at_a_time > _FEW_PROCESSES and self.alike == 1:
            begin = max(ahead, default=first - 1) + 1
            end = min(last + run.at_a_time, most)
            if first < PILOT_DRAWS:  # the proposal of later draws needs all pilot draws
                end = min(end, PILOT_DRAWS)
            if begin < end:
                for number, *task in self._tasks(begin, end, pilot, kept_likelihood):
                    ahead[number] = run.executor.submit(self.solved, number, *task)
            return (ahead.pop(number).result() for number in range(first, last))
        begin = first // self.alike
        end = -(-last // self.alike)
        tasks = self._tasks(begin, end, pilot, kept_likelihood)
        return run.map(self.solved, *zip(*tasks, strict=True))

    def _kept_likelihood(self, pilot: Sequence[Mapping[str, float]]) -> float:
        """Return k of equation (1) from the predicted values of pilot draws; KEPT_LIKELIHOOD if these are too few."""
        if len(pilot) < PILOT_DRAWS:
            pilot = ()
        log_likelihood_of = stiffness_log_likelihoods(self.evidence, pilot)
        best = float(np.exp(max(log_likelihood_of.values(), default=0.0)))
        return min(max(best, _LEAST_KEPT_LIKELIHOOD), KEPT_LIKELIHOOD)

    def _tasks(
        self,
        begin: int,
        end: int,
        pilot: Sequence[Mapping[str, float]],
        kept_likelihood: float,
    ) -> list[tuple[Any, ...]]:
        """Return the arguments of `solved` for each of several draws.

        begin, end: number of the first draw, and number after the last draw.
        pilot: predicted values of the pilot draws.
        kept_likelihood: k of equation (1).
        """
        shares, density = proposed_draws(self.prior, self.evidence, pilot, begin, end, self.seed)
        numbers = range(begin, end)
        rows = zip(
            numbers,
            self.prior.values(shares),
            shares.tolist(),
            density.tolist(),
            strict=True,
        )
        return [(*row, kept_likelihood, self._unturned(number)) for number, row in zip(numbers, rows, strict=True)]

    def _unturned(self, number: int) -> Draw | None:
        """Return the draw with this number that is stored without rotations; None if there is no valid one."""
        candidates = self._kept_unturned[number : number + 1]
        return next((draw for draw in candidates if not draw.refused), None)

    @cached_property
    def _kept_unturned(self) -> list[Draw]:
        """Draws that are stored without rotations, to which rotations can be added.

        There are none if F'_ior was measured, because all values of F'_ior are then drawn together.
        """
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
        """Return draws that share all fields except the deviations, with their predictions and weights.

        A draw without a trustworthy result contains only the reason.

        number: number of this group of draws.
        values: values of the fields, by path.
        shares: quantile levels of the fields, followed by the random number that decides whether a badly agreeing draw
            is solved further.
        density: density of the draw relative to that of the prior.
        kept: k of equation (1).
        unturned: the same draw without rotations, if it is stored; None otherwise.
        """
        try:
            if unturned:
                return [self._turned(unturned, values)]
            return self._solved(number, values, shares, density, kept)
        except HdassistError as error:
            return self._refused(str(error.fault))

    def _refused(self, reason: str) -> list[Draw]:
        """Return a group of refused draws with the reason."""
        return [Draw(refused=reason) for _ in range(self.alike)]

    def with_turns(self, unturned: Draw, values: dict[str, float]) -> Draw:
        """Return a draw with its missing rotations, or with only the reason if a result cannot be trusted.

        values: values of the fields, by path.
        """
        try:
            return self._turned(unturned, values)
        except HdassistError as error:
            return Draw(refused=str(error.fault))

    def _turned(self, unturned: Draw, values: dict[str, float]) -> Draw:
        """Return a draw with its missing rotations.

        values: values of the fields, by path.
        """
        if unturned.F_ior_arcsec is None:
            return unturned
        drive = self.prior.drive.with_values(values).with_values(unturned.follows)
        torques = self._torques_with(self._tests_of(drive, 0))
        maps = error_maps(drive, torques)
        turned, proof = errors_by_turn(maps, drive, self.torques, unturned.F_ior_arcsec, self.rotations_deg)
        return replace(unturned, turned_arcsec=_as_rows(turned), turned_proof=proof)

    def _tests_of(self, drive: Drive, number: int) -> dict[str, tuple[float, float]]:
        """Return the torque [N*m] and rotation [deg] at which reference data on F'_ior apply to a drive, by figure.

        An accuracy that the manufacturer reads at a few positions is not included, because `_tested` predicts it.

        number: number of the draw, on which the random rotation in the accuracy test depends.
        """
        tests = {datum.figure: (datum.M_g, datum.rotation_deg) for datum in self.measured}
        if self.torques and self.accuracy and not self.accuracy.positions:
            tests[ACCURACY] = (ACCURACY_LOAD * drive.rated_torque, turn_of_test_deg(drive, [self.seed, number]))
        return tests

    def _torques_with(self, tests: Mapping[str, tuple[float, float]]) -> tuple[float, ...]:
        """Return the requested torques and then the torques of tests [N*m], without repetition."""
        loads = [M_g for M_g, _ in tests.values()]
        if self.torques and self.accuracy:
            loads.append(ACCURACY_LOAD * self.prior.drive.rated_torque)
        return tuple(dict.fromkeys((*self.torques, *loads)))

    def _solved(
        self,
        number: int,
        values: dict[str, float],
        shares: list[float],
        density: float,
        kept: float,
    ) -> list[Draw]:
        """Return the draws as `solved` does.

        Raises HdassistError if a result cannot be trusted.
        """
        *field_shares, chance = shares
        drive = self.prior.drive.with_values(values)
        for path, value in values.items():
            if not drive.allows(path, value):
                return self._refused(f"{path} is out of range")
        drive, follows, proof = self._meshed(drive, field_shares)
        if conflict := first_conflict(drive):
            return self._refused(f"{conflict.path}: {conflict.message}")

        formulation = formulate(contact_system(drive))
        figures: Mapping[str, float] = {}
        if any(datum.figure in STIFFNESS_FIGURES for datum in self.evidence):
            figures, proof_of_figures = stiffness_figures(drive, formulation)
            proof += proof_of_figures
        going_on = self._chance_of_going_on(figures, density, kept)
        if chance >= going_on:
            return [Draw(figures=figures, proof=proof, follows=follows) for _ in range(self.alike)]

        tests = self._tests_of(drive, number)
        system = _System(
            number=number,
            drive=drive,
            maps=error_maps(drive, self._torques_with(tests), formulation),
            shares=field_shares,
            follows=follows,
            figures=figures,
            tests=tests,
            density=density,
            going_on=going_on,
        )
        return self._draws_of(system, proof)

    def _chance_of_going_on(
        self,
        figures: Mapping[str, float],
        density: float,
        kept: float,
    ) -> float:
        """Return p of equation (1) from the stiffness values of a draw; 1 without reference data on stiffness."""
        if not figures:
            return 1.0
        likelihood = float(np.exp(log_likelihood(self.evidence, figures)))
        return min(1.0, likelihood / density / kept)

    def _meshed(self, drive: Drive, shares: Sequence[float]) -> tuple[Drive, dict[str, float], Certificate]:
        """Return a drive with the drawn profile shift of its circular spline, this shift by path, and the certificate.

        The drive is unchanged, without a shift by path, if the prior does not make the shift depend on other fields.

        shares: quantile levels of all fields.
        """
        # the profile shift does not depend on other fields
        if not self.prior.meshing:
            return drive, {}, EMPTY
        place, beyond = self.prior.meshing
        # the drawn quantile level gives the shift beyond the one at which the teeth of a drive at rest just mesh
        shift, proof = meshing_shift(drive)
        follows = {beyond.path: shift + float(beyond.value(np.array(shares[place])))}
        return drive.with_values(follows), follows, proof

    def _draws_of(self, system: _System, proof: Certificate) -> list[Draw]:
        """Return the draws of one contact system, each with its own deviations.

        proof: certificate of the states of the system so far, which is added to the first draw.
        """
        # without a measured F'_ior, the deviations are those drawn from the prior
        proposals = [ProposedDeviations(shares={}, density=1.0)]
        chosen: _ChosenSets | None = None
        if self.near:
            proposals, proof_of_tables = self.near.drawn(system.maps, system.number)
            proof += proof_of_tables
        elif self._is_selected:
            chosen = self._chosen_sets(system)
            proposals = [self._proposed(chosen)]
            proof += chosen.proof
        draws = []
        for place, deviations in enumerate(proposals):
            draw = self._draw_of(system, deviations, place, chosen)
            # the states of the system are counted only with the first draw
            draws.append(replace(draw, proof=proof + draw.proof))
            proof = EMPTY
        return draws

    def _draw_of(self, system: _System, deviations: ProposedDeviations, place: int, chosen: _ChosenSets | None) -> Draw:
        """Return the draw of a contact system with given deviations.

        deviations: proposed deviations of the draw.
        place: index of the draw among those of the system.
        chosen: sets of deviations chosen by the manufacturer's test; None if no sets were chosen.
        """
        # draws share the contact system, but each has its own deviations
        shares = self._shares_with(deviations, system.shares)
        drive = system.drive.with_values(self.prior.values(np.array([shares]))[0])
        errors = self._errors_of(system, drive, place)
        further_figures, proof_of_figures = self.figures_of(drive) if self.figures_of else ({}, EMPTY)
        figures = {**system.figures, **further_figures, **errors.by_figure}
        likelihood = float(np.exp(log_likelihood(self.evidence, figures)))
        # further sets of deviations reuse the factorised contact system
        sets = self._further_sets(system, drive, shares, chosen)
        return Draw(
            figures=figures,
            F_ior_arcsec=tuple(errors.F_ior_arcsec.tolist()),
            turned_arcsec=_as_rows(errors.turned_arcsec),
            weight=likelihood / (system.density * deviations.density) / system.going_on,  # equation (1)
            shares=tuple(shares),
            proof=errors.proof + proof_of_figures + sets.proof,
            follows=system.follows,
            turned_proof=errors.turned_proof,
            sets_arcsec=_as_rows(sets.F_ior_arcsec.T),
            set_weights=tuple(
                self._set_weight(system, tested_arcsec) / density
                for tested_arcsec, density in zip(sets.tested_arcsec, sets.densities, strict=True)
            ),
        )

    def _errors_of(
        self,
        system: _System,
        drive: Drive,
        place: int,
    ) -> _Errors:
        """Return F'_ior of a drive with the deviations of a draw on a contact system.

        place: index of the draw among those of the system.
        """
        F_ior, tested, proof = errors_now(system.maps, drive, self.torques, list(system.tests.values()))
        turned, turned_proof = errors_by_turn(system.maps, drive, self.torques, F_ior.tolist(), self.rotations_deg)
        # the drive differs from the model, and its measured values also determine this difference at other points
        if self.measured:
            seed = [self.seed, system.number * self.alike + place]
            F_ior, turned = self._shown(tested[: len(self.measured)], F_ior, turned, seed)
        by_figure = dict(zip(system.tests, tested.tolist(), strict=True))
        if self.torques and self.accuracy and self.accuracy.positions:
            batch = Batch.of(drive)
            reading, proof_of_reading = self._tested(system, drive, batch.columns, [[self.seed, system.number]])
            by_figure[ACCURACY] = float(reading[0])
            proof += proof_of_reading
        return _Errors(
            F_ior_arcsec=F_ior,
            turned_arcsec=turned,
            by_figure=by_figure,
            proof=proof,
            turned_proof=turned_proof,
        )

    def _shares_with(self, deviations: ProposedDeviations, shares: Sequence[float]) -> list[float]:
        """Return the quantile levels of all fields, with those of proposed deviations replaced."""
        paths = [field_prior.path for field_prior in self.prior.fields]
        return [deviations.shares.get(path, share) for path, share in zip(paths, shares, strict=True)]

    def _set_weight(self, system: _System, tested_arcsec: float | None) -> float:
        """Return the weight of a set of deviations by equation (1), before it is divided by the set's own density.

        tested_arcsec: reading of the set in the manufacturer's test [arcsec]; None without an accuracy.
        """
        figures = dict(system.figures)
        if tested_arcsec is not None:
            figures[ACCURACY] = tested_arcsec
        likelihood = float(np.exp(log_likelihood(self.evidence, figures)))
        return likelihood / system.density / system.going_on

    # Sets of deviations

    @cached_property
    def _set_places(self) -> list[int]:
        """Indices of the fields that differ between sets; none if each draw has only one set."""
        # measured values of the drive determine its deviations, so further sets are not drawn
        return [] if self.measured or self.sets < 2 else self._drawn_places

    @cached_property
    def _drawn_places(self) -> list[int]:
        """Indices of the uncertain deviations that are drawn independently, and not from joint draws of a fit."""
        fields = open_deviations(self.prior)
        return [
            place
            for place, field_prior in enumerate(self.prior.fields)
            if field_prior in fields and not field_prior.draws
        ]

    @property
    def _is_selected(self) -> bool:
        """Whether the manufacturer sells only drives that pass a test whose result depends on deviations."""
        return bool(self.torques and self.accuracy and self.accuracy.is_tight and self._drawn_places)

    def _chosen_sets(self, system: _System) -> _ChosenSets:
        """Return sets of deviations chosen among candidates by the manufacturer's test, the set of the draw first.

        This is importance sampling, because few drives of a system pass a tight test. The density with which a
        candidate is chosen, relative to that of the prior, increases with its likelihood. It is nowhere below
        LEAST_DENSITY, because an option may make a failing drive pass. The weight of a chosen set is divided by this
        density.
        """
        assert self.accuracy
        count = _READ_CANDIDATES if self.accuracy.positions else _SOLVED_CANDIDATES
        rng = np.random.default_rng([self.seed, system.number, _CHOSEN])
        candidates = np.tile(system.shares, (count, 1))
        candidates[1:, self._drawn_places] = rng.random((count - 1, len(self._drawn_places)))
        # all candidates are tested with the rotation and first position of the draw
        seeds = [[self.seed, system.number] for _ in range(count)]
        tested, proof = self._tested(system, system.drive, self._columns_of(candidates), seeds)
        likelihood = np.exp(self.accuracy.log_likelihood(tested))
        # equation (9d) of docs/theory.md
        density = LEAST_DENSITY + (1 - LEAST_DENSITY) * likelihood / likelihood.mean()
        # systematic sampling: equal steps of the cumulative density from a random start
        steps = (rng.random() + np.arange(self.sets) / self.sets) % 1
        chosen = np.minimum(np.searchsorted(np.cumsum(density) / count, steps), count - 1)
        return _ChosenSets(
            shares=candidates[chosen],
            tested_arcsec=tested[chosen],
            densities=density[chosen],
            proof=proof,
        )

    def _proposed(self, chosen: _ChosenSets) -> ProposedDeviations:
        """Return the first of the chosen sets as the deviations of the draw."""
        first_shares = chosen.shares[0].tolist()
        shares = {self.prior.fields[place].path: first_shares[place] for place in self._drawn_places}
        return ProposedDeviations(shares=shares, density=float(chosen.densities[0]))

    def _further_sets(
        self, system: _System, drive: Drive, shares: Sequence[float], chosen: _ChosenSets | None
    ) -> _FurtherSets:
        """Return F'_ior of further sets of deviations on the contact system of a draw.

        drive: drive with the deviations of the draw.
        shares: quantile levels of the fields of the draw.
        chosen: sets chosen by the manufacturer's test; None to draw the sets from the prior.
        """
        if not self._set_places:
            no_F_ior = np.empty((len(self.torques), 0))
            return _FurtherSets(F_ior_arcsec=no_F_ior, tested_arcsec=(), densities=(), proof=EMPTY)
        columns = self._columns_of(chosen.shares[1:] if chosen else self._set_shares(system.number, shares))
        map_of_torque = {error_map.M_g: error_map for error_map in system.maps}
        as_mounted = [many_extremes(map_of_torque[M_g], Batch(drive, columns), DRAWN_GRIDS) for M_g in self.torques]
        sets = _FurtherSets(
            F_ior_arcsec=np.array([extremes.F_ior_arcsec for extremes in as_mounted]),
            tested_arcsec=[None for _ in range(1, self.sets)],
            densities=[1.0 for _ in range(1, self.sets)],
            proof=sum((extremes.certificate for extremes in as_mounted), EMPTY),
        )
        if chosen:
            return chosen.further(sets)
        # without an accuracy, no reference data depend on the deviations of a set
        if not self.accuracy:
            return sets
        # each set is tested with its own rotation and first position
        seeds = [[self.seed, system.number, place] for place in range(1, self.sets)]
        tested, proof = self._tested(system, drive, columns, seeds)
        return replace(sets, tested_arcsec=tuple(tested.tolist()), proof=sets.proof + proof)

    def _set_shares(self, number: int, shares: Sequence[float]) -> Array:
        """Return the quantile levels of all fields for further random sets of deviations, shape (sets, fields).

        number: number of the draw.
        shares: quantile levels of the draw; fields other than the deviations keep them.
        """
        # the sets have a separate random stream, so the number of sets does not change other random numbers
        rng = np.random.default_rng([self.seed, number, _SETS])
        random = np.tile(shares, (self.sets - 1, 1))
        random[:, self._set_places] = rng.random((self.sets - 1, len(self._set_places)))
        return np.asarray(random)

    def _columns_of(self, shares: Array) -> dict[str, Array]:
        """Return the values of the deviations in several sets, by path, shape (sets,) each.

        shares: quantile levels of the fields, shape (sets, fields).
        """
        values = self.prior.values(shares)
        paths = [self.prior.fields[place].path for place in self._drawn_places]
        return {path: np.array([of_set[path] for of_set in values]) for path in paths}

    def _tested(
        self, system: _System, drive: Drive, columns: Mapping[str, Array], seeds: Sequence[Sequence[int]]
    ) -> tuple[Array, Certificate]:
        """Return readings of sets of deviations in the manufacturer's test [arcsec], shape (sets,), with a certificate.

        system: contact system of the sets.
        drive: drive with the properties that all sets share.
        columns: values of the sets by path, shape (sets,) each.
        seeds: seeds of the rotation and of the first position of each test.
        """
        assert self.accuracy
        load = ACCURACY_LOAD * drive.rated_torque
        map_of_test = next(error_map for error_map in system.maps if error_map.M_g == load)
        turns_deg = np.array([turn_of_test_deg(drive, seed) for seed in seeds])
        turned = {path: columns.get(path, drive.number(path)) + turns_deg for path in carried(drive)}
        starts = np.array([start_of_test(seed) for seed in seeds])
        batch = Batch(drive, {**columns, **turned})
        return ranges_as_tested(map_of_test, batch, self.accuracy.positions, starts, DRAWN_GRIDS)

    def _shown(self, tested: Array, F_ior: Array, turned: Array, seed: list[int]) -> tuple[Array, Array]:
        """Return F'_ior of the real drive [arcsec], drawn given the model and the measured values.

        The draw has its own scale, misfit, noise and misread value (evidence.py, equation 1). They do not depend on the
        other requested results. The results have the shapes of F_ior and turned.

        tested: F'_ior of the model under the conditions of the measured values [arcsec], shape (values,).
        F_ior: F'_ior of the model in the present position [arcsec], shape (torques,).
        turned: F'_ior of the model with the wheel turned [arcsec], shape (torques, rotations).
        seed: seed of the draw.
        """
        y, stated, correlation = values_of_errors(self.measured)
        predicted = tested[None]  # one draw, shape (1, values)
        mean = predicted.mean(axis=1)
        rng = np.random.default_rng(seed)
        kinds = error_kinds(len(y), {1.0: 0.0})
        log_likelihood_of_kinds = log_likelihoods(kinds, predicted, y, stated, correlation, mean)[:, 0]
        # draw one kind of error by its posterior probability
        kind = kinds[rng.choice(len(kinds), p=softmax(log_likelihood_of_kinds))]
        scale_normals = rng.standard_normal(1)
        noise_normals = rng.standard_normal((1, len(y)))

        loads, turns = self._points_shown()
        model = np.append(np.column_stack([F_ior, turned]), tested)[None]  # shape (1, points)
        spreads = kind.spreads(stated, y)[None]
        is_same_torque = np.equal.outer(loads, loads)
        shown, _ = errors_of_drive(
            model,
            y,
            (kind.misfit * mean) ** 2,
            spreads,
            kernel(turns.tolist(), turns.tolist()) * is_same_torque,
            (scale_normals, _misfit_normals(loads, turns, seed), noise_normals),
        )
        # rounding makes stored and newly computed draws agree
        shown = np.round(shown, _SHOWN_DIGITS).reshape(len(self.torques), -1)
        return shown[:, 0], shown[:, 1:]

    def _points_shown(self) -> tuple[Array, Array]:
        """Return the torque [N*m] and rotation [deg] of each requested F'_ior, and then of each measured one."""
        points = [(M_g, turn) for M_g in self.torques for turn in (0.0, *self.rotations_deg)]
        # the measured points, at which the errors are known, come last
        points += [(datum.M_g, datum.rotation_deg) for datum in self.measured]
        loads, turns = np.array(points).T
        return loads, turns


@dataclass(frozen=True, eq=False)
class _System:
    """A contact system, which draws that differ only in their deviations share.

    number: number of the group of draws.
    drive: drive with the drawn values of all fields.
    maps: error maps at all torques that a draw needs.
    shares: quantile level of each field, including the deviations.
    follows: values of fields that depend on other fields, by path.
    figures: predicted stiffness values by name; empty without reference data on stiffness.
    tests: torque [N*m] and rotation [deg] at which reference data on F'_ior apply, by name of the datum.
    density: density of the system relative to that of the prior, q of equation (1).
    going_on: probability with which the system was solved further, p of equation (1).
    """

    number: int
    drive: Drive
    maps: Sequence[ErrorMap]
    shares: Sequence[float]
    follows: dict[str, float]
    figures: Mapping[str, float]
    tests: Mapping[str, tuple[float, float]]
    density: float
    going_on: float


@dataclass(frozen=True, eq=False)
class _Errors:
    """F'_ior of a draw, with the certificates of its states.

    F_ior_arcsec: F'_ior in the present position [arcsec], shape (torques,).
    turned_arcsec: F'_ior with the wheel turned [arcsec], shape (torques, rotations).
    by_figure: F'_ior of the model to compare with reference data [arcsec], by name of the datum.
    proof: certificate of the states, except those with the wheel turned.
    turned_proof: certificate of the states with the wheel turned.
    """

    F_ior_arcsec: Array
    turned_arcsec: Array
    by_figure: Mapping[str, float]
    proof: Certificate
    turned_proof: Certificate


@dataclass(frozen=True, eq=False)
class _FurtherSets:
    """F'_ior of further sets of deviations on a contact system, with the certificate of its states.

    F_ior_arcsec: F'_ior in the present position [arcsec], shape (torques, sets).
    tested_arcsec: reading of each set in the manufacturer's test [arcsec]; None without an accuracy.
    densities: density with which each set was drawn, relative to that of the prior.
    """

    F_ior_arcsec: Array
    tested_arcsec: Sequence[float | None]
    densities: Sequence[float]
    proof: Certificate


@dataclass(frozen=True, eq=False)
class _ChosenSets:
    """Sets of deviations on a contact system chosen by the manufacturer's test, with the certificate of the tests.

    shares: quantile levels of all fields, shape (sets, fields).
    tested_arcsec: readings in the manufacturer's test [arcsec], shape (sets,).
    densities: density with which each set was chosen, relative to that of the prior, shape (sets,).
    """

    shares: Array
    tested_arcsec: Array
    densities: Array
    proof: Certificate

    def further(self, sets: _FurtherSets) -> _FurtherSets:
        """Return further sets with the readings and densities of the chosen sets after the first.

        sets: F'_ior of the chosen sets after the first.
        """
        tested_arcsec = tuple(self.tested_arcsec[1:].tolist())
        return replace(sets, tested_arcsec=tested_arcsec, densities=tuple(self.densities[1:].tolist()))


def _misfit_normals(loads: Array, turns_deg: Array, seed: Sequence[int]) -> Array:
    """Return random misfits of variance 1 at several points, independent between torques, shape (1, points).

    loads, turns_deg: torque [N*m] and rotation [deg] of each point, shape (points,).
    seed: seed of the draw.
    """
    misfits = np.zeros((1, len(turns_deg)))
    for M_g in np.unique(loads):
        # the bits of the torque are the seed, so other torques do not change its random numbers
        rng = np.random.default_rng([*seed, int(M_g.view(np.uint64))])
        normals = rng.standard_normal((1, SMOOTH_NUMBERS))
        misfits[:, loads == M_g] = smooth_misfits(turns_deg[loads == M_g], normals)
    return misfits


def _as_rows(values: Array) -> tuple[tuple[float, ...], ...]:
    """Return the rows of a two-dimensional array as tuples."""
    return tuple(map(tuple, values.tolist()))


_CHOSEN = 17  # number in the seed for sets of deviations chosen by a test
_SOLVED_CANDIDATES = 8  # number of candidate sets if they are chosen by F'_ior, which takes some 70 states each
_READ_CANDIDATES = 32  # number of candidate sets if they are chosen by readings at a few positions
_SETS = 11  # number in the seed for further sets of deviations
_TESTED_TURN = 7  # number in the seed for the rotation in the accuracy test
_TESTED_START = 13  # number in the seed for the first position of the accuracy test


def turn_of_test_deg(drive: Drive, seed: Sequence[int]) -> float:
    """Return the rotation of the fixed wheel at which the manufacturer tested the accuracy of a drive [deg].

    The preset does not state this hole, so all holes are equally probable. If the accuracy were applied to the present
    hole, this hole would seem better than the others. The rotation is 0 if no hole is better than another.

    seed: seed and number of the draw.
    """
    # all rotations give the same F'_ior
    if no_hole_better(drive):
        return 0.0
    # the manufacturer may have tested the drive in any hole
    share = float(np.random.default_rng([*seed, _TESTED_TURN]).random())
    holes = drive.mounting.holes
    return 360 * int(share * holes) / holes if holes else 360 * share


def start_of_test(seed: Sequence[int]) -> float:
    """Return the random first position of the manufacturer's test, as a share of the full mesh cycle.

    seed: seed and number of the draw.
    """
    return float(np.random.default_rng([*seed, _TESTED_START]).random())


def errors_now(
    maps: Sequence[ErrorMap],
    drive: Drive,
    torques: Sequence[float],
    measured: Sequence[tuple[float, float]] = (),
) -> tuple[Array, Array, Certificate]:
    """Return F'_ior of a drive in its present position and at measured points [arcsec], with the certificate.

    The shapes of the two arrays are (torques,) and (measured,).

    maps: error maps at all torques, including those of the measured points.
    drive: the drive.
    torques: torques in the present position [N*m].
    measured: torque [N*m] and rotation [deg] of each measured value.

    Raises UntrustedError if a state cannot be trusted.
    """
    F_ior_of_torque: dict[float, float] = {}
    F_ior_of_test: dict[tuple[float, float], float] = {}
    proof = EMPTY
    for error_map in maps:
        # the present position is searched separately, so its last digits do not depend on the other positions
        tests = [test for test in measured if test[0] == error_map.M_g]
        F_ior = np.nan
        if error_map.M_g in torques or any(turn % 360 == 0 for _, turn in tests):
            extremes = many_extremes(error_map, Batch.of(drive), DRAWN_GRIDS)
            F_ior = extremes.first
            F_ior_of_torque[error_map.M_g] = F_ior
            proof += extremes.certificate
        turned, proof_of_turns = _at_turns(error_map, drive, F_ior, [turn for _, turn in tests])
        F_ior_of_test |= zip(tests, turned.tolist(), strict=True)
        proof += proof_of_turns
    as_it_stands = np.array([F_ior_of_torque[M_g] for M_g in torques])
    as_measured = np.array([F_ior_of_test[test] for test in measured])
    return as_it_stands, as_measured, proof


def errors_by_turn(
    maps: Sequence[ErrorMap],
    drive: Drive,
    torques: Sequence[float],
    now: Sequence[float],
    rotations_deg: Sequence[float],
) -> tuple[Array, Certificate]:
    """Return F'_ior of a drive with its fixed wheel turned [arcsec], shape (torques, rotations), and the certificate.

    maps: error maps at all torques; maps at other torques are ignored.
    drive: the drive.
    torques: torques [N*m].
    now: F'_ior in the present position at each torque [arcsec].
    rotations_deg: rotations of the fixed wheel [deg].

    Raises UntrustedError if a state cannot be trusted.
    """
    map_of_torque = {error_map.M_g: error_map for error_map in maps}
    turned = np.empty((len(torques), len(rotations_deg)))
    proof = EMPTY
    for k, (M_g, F_ior) in enumerate(
        zip(
            torques,
            now,
            strict=True,
        )
    ):
        turned[k], proof_of_turns = _at_turns(map_of_torque[M_g], drive, F_ior, rotations_deg)
        proof += proof_of_turns
    return turned, proof


def _at_turns(
    error_map: ErrorMap,
    drive: Drive,
    now: float,
    turns_deg: Sequence[float],
) -> tuple[Array, Certificate]:
    """Return F'_ior of a drive with its fixed wheel turned [arcsec], shape (turns,), and the certificate.

    now: F'_ior in the present position [arcsec], which also applies after whole revolutions.
    turns_deg: rotations of the fixed wheel [deg].
    """
    F_ior = np.full(len(turns_deg), now)
    turned_places = np.flatnonzero(np.array(turns_deg) % 360)
    # the present position is already solved
    if not len(turned_places):
        return F_ior, EMPTY
    batch = Batch.turned(drive, np.array(turns_deg)[turned_places])
    extremes = many_extremes(error_map, batch, DRAWN_GRIDS)
    F_ior[turned_places] = extremes.F_ior_arcsec
    return F_ior, extremes.certificate


_OPENED = 0.1  # modules of clearance at each flank, with which any drive has backlash


def meshing_shift(drive: Drive) -> tuple[float, Certificate]:
    """Return the profile shift of the circular spline at which the teeth of a drive at rest just mesh [modules].

    A harmonic drive is made so that its teeth just fill their spaces: radial deflection, clearances and the profile
    shifts of both wheels are matched to each other. Backlash without load is proportional to the clearance beyond this
    point. One solution with a large clearance therefore gives the shift at which backlash begins.

    The second result is the certificate. Raises UntrustedError if the drive has no trustworthy solution with backlash.
    """
    gears = drive.gears
    alpha = np.radians(gears.alpha)
    mm_per_shift = gears.m * np.sin(alpha)  # displacement of a flank along its normal per unit of profile shift
    opened_mm = _OPENED * gears.m
    at_rest = drive.with_values({"operation.dT": 0.0})
    # at this shift, the flanks touch on the nominal shape of the rim; the elastic drive meshes at a similar shift
    least_gap_mm = float(flank_candidates(Geometry.of(at_rest)).gap.min()) + 1e-3 * gears.j_n
    first_shift = drive.number(RIGID_SHIFT) - least_gap_mm / mm_per_shift
    opened_drive = at_rest.with_values({RIGID_SHIFT: first_shift, "gears.j_n": gears.j_n + 1e3 * opened_mm})
    # a small torque in each direction brings the flanks of one side into contact
    least_torque = NEAR_ZERO * drive.rated_torque
    contact, tube, proof = Twist(opened_drive).at(np.array([-least_torque, least_torque]))
    backlash_rad = float(np.diff(contact + tube)[0]) / ARCSEC
    # the force of a flank acts at the base circle, so half of the backlash is the clearance over its radius
    clearance_mm = backlash_rad / 2 * gears.m * gears.z_g / 2 * np.cos(alpha)
    return first_shift - float((clearance_mm - opened_mm) / mm_per_shift), proof
