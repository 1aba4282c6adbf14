"""What docs/performance.md says beside its numbers: reasons, ideas and choices, written by hand."""

WALK, NUMPY, WARM_DAQP = "compiled walk, AVX2", "numpy engine", "DAQP, warm from state to state"  # engines in a table

HEAD = """\
# Speed and memory

`python -m benchmarks --json second.json --first first.json --write` made this page. It measures everything below in one
run of some ten minutes, and shows the previous run for comparison. `--from` with `--anew` measures parts of an earlier
run again. The ratios are comparable between machines. Absolute times are those of the machine named here and of its
other work.

Times are processor time. For whole processes they include the command and its workers, divided by the time of an import
that every result needs or could use. Other times are those of one thread. Whole processes contain all waiting times of
a user: the interpreter, imports and worker processes. Their table also gives elapsed seconds. Memory is
that of a command and its workers together, with shared pages counted once (PSS, sampled every 0.2 s, and at least the
kernel's peak of the largest process). A *state* is a mesh position.
"""

SOLVERS = """\
The table gives microseconds of processor time per state of `vzp160` with whole flanks (`numerics.stations: 1`). [Coned
flanks](#coned-flanks) shows the factor for coned ones. Sums and certificate are included. In the cycle, each state is
next to the previous one. In a search, the states are those that proposals of its extremes solve, in the same sequence
and batches.
"""

# Why a target is missed, and what to try next; a row that is met says nothing. Shares are of processor time.
REASONS = {
    "state": "The certificate takes 2.4 µs (AVX2) in any state. Pivots take the remaining time (1.5 per state at 80 "
    "N·m and 0.7 at 800), with the values of all candidates that follow from them. Without a compiler the numpy engine "
    "is used. Next: a certificate that reuses the gaps of the previous state.",
    "daqp": "Warm DAQP takes one or two steps for a state next to the previous one. In the walk with AVX2 the "
    "certificate takes 2.4 µs, a third of the time at 80 N·m and half at 800. This is a lower bound as long as every "
    "state has its certificate. Pivots take the remaining time (1.5 and 0.7 per state), with the values of all "
    "candidates that follow from them. AVX-512 takes two thirds to four fifths of these times. Next: a certificate "
    "that reuses the gaps of the previous state.",
    "cvxpy": "A solver through cvxpy has the programme stated once, and only its parameters change. The remaining time "
    "is cvxpy's own work for each set of parameters. Next: no change, as long as every state has its certificate.",
    "draws": "The causes are crests at which a mesh zone loses contact. The error jumps by arc seconds over a few "
    "steps of the splines, and a climb that begins next to such a crest may end before it. Next: solve the state in "
    "which the share of a zone is 0 separately.",
    "mount own.yaml": "As for `mount vzp160`. In addition, each sample has the results of `check own.yaml`: three "
    "contact systems, one of them with backlash, and the stiffness to compare with the catalogue. Its teeth are rough, "
    "so it has more hills, and more contacts that change from state to state. Next: as for `mount vzp160`.",
    "report own.yaml": "The report contains mount, the parts of check other than its samples, and stiffness. Its "
    "samples are those of mount, and one process does the cross-check for all three. Next: as for mount.",
    "report own.yaml again": "check searches no holes, because this would take as long as mount. The report reuses "
    "the stored results of check. Its samples in the other holes, the curve of the seat and the stiffness remain "
    "(14 times as long as the import, on a busy machine, and 2.1 times after mount). Next: a table of each sample, "
    "from which all holes are read.",
    "trials own.yaml": "Each sample has a table of the error at two torques. 62 % of the time is in C, and the "
    "remainder is numpy for few states. It was 33 times: each point of a table was solved at two torques for its "
    "slopes, with twice the points, and each slope was read separately. Next: tables at further torques only for "
    "samples that keep weight after the trials.",
    "proposals": "The cause is a hill between points of the grid, or a long crease, along which a climb ends early. "
    "The values of one nominal drive do not depend on proposals, because every state is solved. Those of sampled "
    "drives do. Next: a fourth grid in the region in which one zone carries nearly all of the torque.",
    "check": "Shares of one process on a busy machine: 64 sampled drives 36 %; options (twelve drives in other holes, "
    "with tighter tolerances and another coupling) 15 %; self error 13 % (400 pairs of phases, each with its "
    "own contacts and programme); ten states by another solver 11 %, and the import of cvxpy without "
    "scipy.stats 4 %; every state of both torques 7 %; all other imports 9 % (a quarter is scipy.special, which "
    "cvxpy has too). One sampled drive takes 30 ms: a third for the references of the contact systems, one per "
    "torque; a quarter for states of its grids and climbs in C; a seventh for contacts and rules of the drive; "
    "the remainder for numpy around batches of few states. Without any sampled drive the time is more than "
    "half. Next: the programmes of the self error in C.",
    "check own.yaml": "72 drives, each of which takes twice as long as one of vzp160, are 49 %. The search at "
    "two torques is 28 %, the profile shift at which the teeth mesh, which is another contact system, 9 %, and the "
    "stiffness for the comparison with the catalogue 5 %. Options are 17 %, the self error 12 %, the cross-check with "
    "its import of cvxpy 14 %, and every state 9 %. A third of the whole time is in C. Next: the mesh from its gaps, "
    "without a contact system; and as for `check vzp160`.",
    "mount": "64 drives, each in twelve holes at both torques, were 73 % before their searches took fewer states, two "
    "thirds of this in C. The curve of the nominal drive, by finer grids and by every state in two holes, is 14 %, "
    "twelve states of the cross-check 8 %, and all imports 7 %. A search of a hole takes 84 to 108 states, of which 61 "
    "to 74 are its grid and the first states on hills. Tried: half a revolution treated as symmetric, which doubles a "
    "grid, misses up to 1.2 arcsec if an eccentricity rotates with the wave generator. Fewer hills miss 0.8. Next: "
    "hills of neighbouring holes, which share states; grids of every second hole, with an estimated gain of a seventh.",
    "trials": "There is one table of the error for each sample of stiffnesses and clearances, instead of one for the "
    "preset. Next: tables at further torques only for samples that keep weight after the trials.",
    "tolerance": "Shares for 150 drives: states solved in C 45 %, proposals 12 %, deviation scalars 10 % and reading "
    "of tables 4 % in numpy, walks and their references 7 %, imports 5 %. By purpose, tables of the error are 15 % and "
    "the self error 11 %. Next: fewer states for which a table is sufficient.",
    "sensitivity": "Flanks in five stations take half as long again as whole ones. States solved in C are 43 %, "
    "proposals and their climbs in numpy 20 %, walks and their references 17 %, deviation scalars 10 %. By "
    "purpose, slopes by every number of the drive are 14 %, and tables of the error 5 %. Next: walks of neighbouring "
    "systems that share a reference; proposals in C.",
    "stiffness": "The import of cvxpy is 58 % (1.0 of it), all other imports 25 %, four states again by another "
    "solver 10 %. Next: imports of pages that are not shown.",
    "first output": "The progress bar begins when the modules of the result are loaded. numpy and scipy.linalg take "
    "most of this time. Next: heading and progress bar before numpy is imported.",
    "--help": "typer takes two thirds, and files and streams of a run most of the remainder. No command and no option "
    "of a command is imported. Next: hashes and gzip when a file is read.",
    "memory": "Each worker has its own copy of numpy and scipy (45 to 50 MB in check). The C library keeps a third of "
    "this after it was freed, and returning it after each sample takes an eighth of the time. It was 80 MB while a "
    "formulation and its references held each other, so that matrices of finished drives stayed in memory. The process "
    "of the cross-check has cvxpy in addition (100 MB), and the command itself 50 MB. report needs the most. Next: the "
    "process of the cross-check without the imports of the command's pages.",
    "explorer": "The first number is one search of a typical drive. The verified number needs every state of its cycle "
    "at each torque, and the process that solves them. Next: torques of one cycle solved together.",
    "coned": "Five times as many flanks are candidates, and most of the work in a state grows with their number. Next: "
    "leave out stations that cannot touch, as bounds show.",
    "growth": "A pivot costs the square of the number of candidates that change sides anywhere. Next: pivot only on "
    "candidates nearby.",
    "random drives": "A drive needs some thousand states, most of them for light errors whose hills are all alike. "
    "Next: fewer hills if the error is below an arc second.",
    "two processes": "The machine had other work to do. Next: measure on an idle one.",
}

CHOSEN = """\
## Choices and their comparisons

- **Principal pivots shared by neighbouring states**, not one active-set solve after another (DAQP, warm): see the table
  of solvers above. All engines run the matrices of the formulation. States in which pivots fail go to DAQP.
- **A reference for each torque**, not one for both torques. Samples of `vzp160` in one hole took a tenth less time, and
  those of a data sheet 2 % less. Samples in twelve holes took a fifth more, because each state at the other torque
  needs more pivots. Results agreed within 1e-10 arcsec.
- **The pivots in C**, or in numpy without a compiler: see the same table. Both agree within 1e-9 arcsec in a
  test, and each state has its certificate.
- **Every state of one drive**, and proposals only for very many drives. At the speed of the walk the whole cycle costs
  about as much as a search for its extremes did, and misses no state. The table above shows the misses of proposals.
- **Three grids of states with slopes** (9 x 9, 14 x 14, 19 x 19), not one of 60 x 60 without slopes. They need some 800
  states instead of 3 700, and find all islands of the error, which were the hard cases of the latter. One grid of 15 x
  15 missed two of eight islands, by 0.7 arcsec. One grid of 25 x 25 missed another one. Another grid finds the island
  that one grid overlooks.
- **One grid of 7 x 7 and one ring of eight states for samples**, not 9 x 9 and two rings. The table gives the misses of
  768 searches of `vzp160` and 192 of a data sheet with rough teeth, compared with a grid of 60 x 60, in arcsec. A grid
  of 5 misses up to 1.1.

  | drive | rms | maximum | before: rms | before: maximum |
  | --- | --- | --- | --- | --- |
  | `vzp160`, 80 N·m | 0.011 | 0.13 | 0.013 | 0.23 |
  | `vzp160`, 800 N·m | 0.013 | 0.26 | 0.003 | 0.06 |
  | data sheet, rough teeth | 0.016 | 0.14 | | |
- **A table of the error with slopes by all deviations**, with one solution per point. Between two points it uses the
  mean of the line and of both tangents, which is exact for a parabola. With 9 x 5 x 7 x 7 points its error is smaller
  than that of the line alone with 13 x 5 x 9 x 9 points and two solutions each (standard deviation 0.9 and 1.4 % at the
  torques of `vzp160`, not 1.1 and 2.4).
- **Four pivots at once**, not two: this saves a sixth of a search with rough teeth.
- **Each pair of phases of the self error separately**, not flanks and balls by a Schur complement over bore contacts
  with one factorization. The self error is 10 % of `check vzp160`, and all 800 states solved in C are a
  quarter of this, some 2.4 % of the command. No factorization can save more. Sums and residuals in numpy are another
  quarter, contact systems a fifth, programmes an eighth.
- **Every flank that overlaps the other spline as a candidate**, not only those within a window. A window of 30 degrees
  was tried, with the gaps of all flanks beyond it in the certificate of each state. A state took 0.9 and a reference
  0.7 of the time, but 9 of 12 drives of a data sheet have contacts beyond the window and are solved twice. Results
  agreed within 1e-9 arcsec.
- **HIGHS for the cross-check**, and CLARABEL if it fails. HIGHS takes 20 ms per state with five stations, and CLARABEL
  takes 70. Both agree with the engine within 2e-4 arcsec over all presets.
- **Processes, not threads**: the matrices are too small for threads of BLAS, which are switched off.
"""

DRAWN = """\
The table compares extremes proposed by three grids with every state (`python -m benchmarks.proposals`). States and
processor time are medians per drive.

- Hard cases: `vzp160` with e_hb of 0, 80 and 120 µm, in the holes with the smallest and the largest error, at both
  torques.
- Random drives: `vzp160` with random eccentricities and phases, at 80 N·m (light), at 800 N·m (heavy), and at any
  torque with all other deviations, `j_n` and `g_b` random too (seeded).

The share in brackets is the largest of the differences above 0.01″.
"""

SEARCHED = """\
## Searches of samples

Samples of `vzp160`, each with its wheel in twelve holes, are searched from a grid of 7 x 7 states with slopes, as
usual. The comparison is a grid of 60 x 60 (`python -m benchmarks.draws`). Both give F'_ior of states of the cycle, so a
negative miss is one of the finer grid.
"""
