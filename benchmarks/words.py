"""What docs/performance.md says beside its numbers: reasons, ideas and choices, written by hand."""

HEAD = """\
# Speed and memory

Made by `python -m benchmarks --write`, which measures everything below in one run and takes about ten minutes. Ratios
count; absolute times belong to the machine named here and to what else it had to do.

Seconds of whole processes are seconds on the clock (median), with all that a user waits for: the interpreter, imports,
worker processes. All else is processor time of one thread. Memory is that of a command and its workers together, pages
that they share counted once (PSS, looked at every 0.2 s; at least the kernel's peak of the largest of them).
"""

# Why a target is missed, and what to try next; a row that is met says nothing.
REASONS = {
    "state": "pivots, certificate and the sums that keep what is reported each take about a third, all of them in "
    "numpy and BLAS already. Next: a compiled loop over the pivots; or bounds that prove of most candidates that they "
    "never touch, so that their gaps need not be looked at in every state.",
    "cvxpy": "the fastest solver through cvxpy takes about 6 ms a state, the programme compiled once and only its "
    "parameters changed. A thousandth of that is 6 µs, and the certificate alone takes 4. Against the solver that the "
    "cross-check uses (Clarabel) and against a cold call the factor is above 1000. Next: nothing that keeps the "
    "certificate of every state.",
    "daqp": "see the time a state.",
    "cycle": "see the time a state; the rest is the table of gaps and the bookkeeping of 20 200 states.",
    "search time": "about half is set-up: the contact system and cvxpy's compilation of it (25 ms), which a search "
    "at several positions or torques pays once. Next: take the compiled programme from a neighbouring system wherever "
    "there is one.",
    "search difference": "two extremes of nearly the same height, of which the lower one is climbed, or an edge where "
    "contacts change that is narrower than the coarse grid. Next: a finer grid where the error bends most.",
    "check": "imports take a quarter (cvxpy alone 0.7 s), the cross-check by an interior-point method 0.4 s a torque. "
    "Next: a lighter way to start cvxpy.",
    "mount": "alternatives and what a micrometre does are searched for too.",
    "every state": "every position proves its own extremes by another solver.",
    "--help": "typer and click are most of it.",
    "--version": "typer and click are most of it.",
    "memory": "each worker holds its own share of numpy, scipy and cvxpy.",
    "growth": "candidates that carry force grow with the teeth, and a pivot with the square of those that swing.",
}

CHOSEN = """\
## What was chosen, on which comparison

- **Principal pivots that neighbouring states share**, not one active-set solve after another (DAQP, warm): the table
  of solvers above. Both run the matrices that cvxpy compiled; states that pivots give up go to DAQP.
- **A search on the torus of tooth positions**, not a stride: a look at every 67th or 101st state (a third or a fifth
  of what the search solves) misses as much of the error as the table of searches says.
- **Every state solved where the advice rests on it**, the search elsewhere: `mount` solves the present and the advised
  position in every state, and all of them should the search have missed more than 0.01″ there.
- **Processes, not threads**: the matrices are too small for threads of BLAS, which are switched off.
"""

DRAWN = """\
Random drives: `vzp160` and `synthetic-160-162` in turns with all deviations, phases, `j_n`, `g_b` and the torque drawn
anew (`benchmarks/search.py`, seeded). Hard cases: `vzp160` with e_hb of 0, 80 and 120 µm, in the positions of the wheel
with the least and the greatest error, at both torques.
"""
