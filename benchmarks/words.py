"""What docs/performance.md says beside its numbers: reasons, ideas and choices, written by hand."""

HEAD = """\
# Speed and memory

Made by `python -m benchmarks --write`, which measures everything below in one run and takes some eight minutes. Ratios
count; absolute times belong to the machine named here and to what else it had to do.

Seconds of whole processes are seconds on the clock (median), with all that a user waits for: the interpreter, imports,
worker processes. All else is processor time of one thread. Memory is that of a command and its workers together, pages
that they share counted once (PSS, looked at every 0.2 s; at least the kernel's peak of the largest of them).
"""

# Why a target is missed, and what to try next; a row that is met says nothing.
REASONS = {
    "state": "pivots, certificate and the sums that keep what is reported each take about a third, all of them in "
    "numpy and BLAS already. Next: a compiled loop over the pivots; or bounds that prove of most candidates that "
    "they never touch, so that their gaps need not be looked at in every state.",
    "cvxpy": "the fastest solver through cvxpy takes about 6 ms a state, the programme compiled once and only its "
    "parameters changed. A thousandth of that is 6 µs, and the certificate alone takes 4. Against the solver of the "
    "cross-check (Clarabel) the factor is above 1000. Next: nothing, as long as every state keeps its certificate.",
    "daqp": "a profile of the engine at 80 and 800 N·m: pivots 24 and 11 %, values of all candidates that follow "
    "from those in the tableau 28 and 28 %, keeping books of the walk from state to state 25 and 28 %, the "
    "certificate 15 and 21 %, sums that are reported 8 and 12 %. The products of matrices in all of these take 4.2 "
    "and 3.2 µs a state: the floor; the rest are passes of numpy over some 60 000 numbers each. Next: a compiled "
    "walk, which would be the package's first compiled part.",
    "random drives": "some thousand states a drive, most of them for light errors whose hills are all alike. Next: "
    "look at fewer hills where the error is below an arc second.",
    "two processes": "the machine had other work to do. Next: measure on a quiet one.",
    "cycle": "20 200 states of what one state costs, and 0.04 s of set-up. Next: as for one state.",
    "search time": "the processor is another than that of which the target was made, where the search before this "
    "one, less exact, took 0.084 s; 0.03 s are set-up: the contact system, cvxpy's compilation of it and the first "
    "reference, which a command that searches at several positions pays once; half of the rest are the first cells, "
    "whose states lie far apart. Next: start from the compiled programme of a neighbour.",
    "search difference": "an island of the error, a few pitches where one zone alone holds the torque, that lies "
    "between the points of the first cells. Next: cells by the share that each zone takes, not by the error alone.",
    "check": "seconds of processor time, over two processes but for the import: cvxpy 0.75, every state of both "
    "torques 2.0, of which the cross-check by an interior-point method is 0.5, the self error (400 contact systems) "
    "1.1, what a micrometre does 0.6; what it rested on (nine assumptions, both ends, both torques) was 2.0, in place "
    "of which 64 samples of all that is not known now take some 5. Every state alone is more than the target leaves. "
    "Next: samples kept for the next command.",
    "mount": "besides 24 searches it solves every state where the wheel stands and where it should, searches under "
    "the preset's alternatives, and looks at 13 positions for both ends of each of nine assumptions, which is nearly "
    "half. Next: look there at the positions alone that are near the best.",
    "fig. 3": "besides 144 searches it solves every state where the wheel stands and where it should, searches under "
    "the preset's alternatives, and looks at 73 positions for both ends of each assumption. The processor is another "
    "than that of which the target was made (6.6 s there). Next: look at the holes alone.",
    "self-error": "400 pairs of phases, each with contacts, rings and a programme of its own: 1.1 s of processor "
    "time in one process; the import is the rest. Next: over two processes, which take 0.2 s to begin.",
    "stiffness": "the import, 0.3 s of other imports, and eight states again by an interior-point method, 0.4 s. "
    "Next: fewer of these.",
    "first line": "the import of cvxpy comes first, and 0.3 s of all else. Next: show the bar before the import.",
    "every state": "every position states and compiles its programme anew and proves its own extremes by another "
    "solver. Next: one programme for all positions of a torque.",
    "--help": "typer is most of it, and the interpreter.",
    "--version": "typer is most of it, and the interpreter.",
    "memory": "each worker holds its own share of numpy, scipy and cvxpy. Next: compile before the workers start.",
    "coned": "five times the flanks are candidates, and most of what a state costs goes with all of them. Next: "
    "leave out stations that bounds prove never to touch.",
    "growth": "a pivot costs the square of the candidates that change sides anywhere. Next: pivot on those near alone.",
}

CHOSEN = """\
## What was chosen, on which comparison

- **Principal pivots that neighbouring states share**, not one active-set solve after another (DAQP, warm): the table
  of solvers above. Both run the matrices that cvxpy compiled; states that pivots give up go to DAQP.
- **A search on the torus of tooth positions**, not a stride: a look at every 67th or 101st state (fewer than half of
  what the search solves) misses as much of the error as the table of searches says.
- **Cells that are halved, not climbs**: 85 points 16 pitches apart, 30 climbs and three looks around solved half the
  states, but of 694 random drives missed three by more than 0.01″ (0.05″ at most). The same with 6 climbs, for choosing
  among many drives, was more than 1 % low for six of them, 6.5 % at most: an extreme may be an island of a few pitches.
  It took 0.4 of the time that the cells take, the longer one 0.7. The cells missed none of 1000 such drives at 80 N·m,
  40 at 800 N·m and 80 with any deviations, clearances and torque (`python -m benchmarks.search_study`).
- **Cells half as long around the wheel around which the error varies more**: square ones found every island when 0.4 of
  what they vary was taken to be hidden (1950 states), these from 0.16 on (1330 states).
- **Every state solved where the advice rests on it**, the search elsewhere: `mount` solves the present and the advised
  position in every state, and all of them should the search have missed more than 0.01″ there.
- **The cross-check as it is**: without iterative refinement Clarabel takes 0.6 of the time, but of 112 states of 28
  drives 8 then ended as inaccurate.
- **Processes, not threads**: the matrices are too small for threads of BLAS, which are switched off.
"""

DRAWN = """\
Random drives: `vzp160` and `synthetic-160-162` in turns with all deviations, phases, `j_n`, `g_b` and the torque drawn
anew (`benchmarks/search.py`, seeded). Hard cases: `vzp160` with e_hb of 0, 80 and 120 µm, in the positions of the wheel
with the least and the greatest error, at both torques.
"""
