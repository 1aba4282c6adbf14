"""The texts of docs/performance.md next to its numbers: reasons, ideas and choices, written by hand."""

WALK, NUMPY, WARM_DAQP = "compiled walk, AVX2", "numpy engine", "DAQP, warm from state to state"  # names of engines

HEAD = """\
# Speed and memory

This page gives the times and the memory of hdassist, compares them with targets, and states the reason for each missed
target. `python -m benchmarks --json second.json --first first.json --write` measures all values in one run of about ten
minutes and generates this page. With `--first`, a previous run is shown as well. The options `--from` and `--anew`
repeat parts of an earlier run. Ratios can be compared between machines, whereas absolute times depend on the machine
named below and on its load.

All times are processor times. The time of a whole process includes the command and its workers, the start of the
interpreter, and all imports. In the targets, this time is given relative to the time of an import: cvxpy for commands
that compute, and typer and rich for the help. The table of whole processes also gives the elapsed time. All other times
refer to a single thread. The memory of a command includes its workers, with shared pages counted once. It is the
proportional set size (PSS), sampled every 0.2 s. If the kernel reports a larger peak for the largest process, this peak
is used instead.

This page uses the following terms. The [theory](theory.md#equilibrium-of-the-contacts) explains the method:

- A *state* is a mesh position at one torque. Its *certificate* is the check of its residuals.
- A *walk* solves one state after another, beginning each with the contact set of the previous state. Its *reference* is
  the contact set of the drive without deviations, with the matrices of this set.
- A *search* finds the extremes of the error without solving every state. It solves a *grid* of states, and begins a
  *local search* near each maximum and each minimum. The maximum and the minimum found in this way are the *proposed
  extremes*, which are then solved and verified.
- The *cross-check* solves some states again with another solver.
- A *table of the error* gives the error as a function of the deviations, and replaces the solution of states.
"""

SOLVERS = """\
The table gives the processor time in µs per state of `vzp160` with whole flanks (`numerics.stations: 1`). The section
[Coned flanks](#coned-flanks) compares the times for coned flanks with these times. The times include the computation of
the reported sums and of the certificate. In the columns "cycle", the states are consecutive states of the mesh cycle.
In the columns "search", they are the states of a search for the extremes, in the same sequence and in the same groups.
"""

# Why a target is missed, and what to try next; a row that is met says nothing. Shares are of processor time.
REASONS = {
    "state": "The certificate takes 2.4 µs per state with AVX2, independently of the torque. The pivots and the "
    "update of all other candidates take the remaining time. A state needs 1.5 pivots on average at 80 N·m and 0.7 "
    "at 800 N·m. Without a compiler, the numpy engine is used instead. Next attempt: reuse the gaps of the previous "
    "state in the certificate.",
    "daqp": "DAQP with a warm start needs only one or two steps for a state next to the previous one. In the "
    "compiled walk with AVX2 the certificate takes 2.4 µs, which is a third of the time at 80 N·m and half of the "
    "time at 800 N·m. This time is a lower bound as long as every state has a certificate. The pivots (1.5 per state "
    "at 80 N·m and 0.7 at 800 N·m) and the update of all other candidates take the remaining time. With AVX-512 the "
    "times are two thirds to four fifths of those with AVX2. Next attempt: reuse the gaps of the previous state in "
    "the certificate.",
    "cvxpy": "The programme is stated once in cvxpy, and only its parameters change from state to state. cvxpy itself "
    "takes the remaining time for each set of parameters. No change is planned, as long as every state has a "
    "certificate.",
    "draws": "The largest differences occur at places where a mesh zone loses contact. At such a place the error "
    "changes by arc seconds within a few positions of the splines. A local search that begins nearby may end before "
    "it reaches the maximum. Next attempt: solve the position in which the torque of one mesh zone becomes 0 "
    "separately.",
    "mount own.yaml": "The reasons are those of `mount vzp160`. In addition, each sample contains the computations "
    "of `check own.yaml`: three contact systems, one of them with backlash, and the stiffness for the comparison "
    "with the catalogue. This drive also has single pitch deviations, so the error has more maxima, and more "
    "contacts change from state to state. Next attempt: the same as for `mount vzp160`.",
    "report own.yaml": "The report contains the results of `mount` and `stiffness`, and the results of `check` that "
    "need no samples. It uses the samples of `mount`. A single process performs the cross-check for all three "
    "commands. Next attempt: the same as for `mount vzp160`.",
    "report own.yaml again": "`check` does not compute the samples in other holes, because this would take as long "
    "as `mount`. The report reuses the stored results of `check`, but it computes the samples in the other holes, "
    "the curve of F'_ior over the hole angle and the stiffness. On a busy machine, the report after `check` took 14 "
    "times as long as the import of cvxpy, and the report after `check` and `mount` took 2.1 times as long. Next "
    "attempt: one table of the error for each sample, from which F'_ior in all holes is read.",
    "trials own.yaml": "A table of the error at two torques is computed for each sample. The compiled program takes "
    "62 % of the time. The remaining time is computation in numpy for small groups of states. In an earlier version "
    "the command took 33 times as long as the import of cvxpy. That version solved each point of a table at two "
    "torques to obtain the slopes, used twice as many points, and read each slope separately. Next attempt: compute "
    "tables at further torques only for samples with a significant weight after the trials.",
    "proposals": "The search misses a maximum between the points of its grid, or it ends too early on a long ridge. "
    "The values of sampled drives are affected. The values of a nominal drive are not affected, because every state "
    "of its mesh cycle is solved. Next attempt: a fourth grid for the positions in which one mesh zone carries "
    "nearly the whole torque.",
    "check": "The table gives the shares of the processor time of `check vzp160`, measured with a profiler in one "
    "process:\n\n| part of the work | share |\n| --- | --- |\n| options: drives with tighter tolerances, another "
    "coupling or another accuracy | 24 % |\n| options: the sampled drives in other holes | 13 % |\n| options: "
    "corrections | 3 % |\n| 64 sampled drives | 15 % |\n| cross-check of ten states by another solver, with its "
    "import | 15 % |\n| self error: 400 pairs of phases, each with its own contacts and programme | 6 % |\n| solution "
    "of every state at both torques | 3 % |\n| all other imports and the page | 21 % |\n\nThe options take the "
    "largest part, because each of them is solved as an edit of the preset with all samples. In an earlier version, "
    "which estimated the effect of most options, the command took 7 times as long as the import of cvxpy. Next "
    "attempt: end the solution of an option as soon as its interval excludes that it is among the best ones.",
    "check own.yaml": "The sampled drives take 41 % of the time, the options 21 %, and the cross-check with its "
    "import of cvxpy 13 %. The self error takes 6 %, the solution of every state 4 %, and the stiffness for the "
    "comparison with the catalogue 2 %. A sampled drive takes longer than one of `vzp160`, because its profile shift "
    "and its stiffness need further contact systems. Next attempt: find the profile shift from the gaps, without a "
    "contact system, and solve fewer samples of options that are not among the best ones.",
    "mount": "The error of 64 sampled drives is searched in twelve holes at both torques. In an earlier version, "
    "whose searches needed more states, this took 73 % of the time, and two thirds of these 73 % were spent in C. "
    "The curve of the nominal drive takes 14 %, because it uses finer grids and, in two holes, every state. The "
    "cross-check of twelve states takes 8 %, and all imports take 7 %. The search in one hole solves 84 to 108 "
    "states, of which 61 to 74 are the grid and the first states of the local searches.\n\nTwo changes were tried "
    "without success. The first change treats half a revolution as symmetric, which doubles the density of a grid. "
    "If an eccentricity rotates with the wave generator, F'_ior is then too small by up to 1.2 arcsec. The second "
    "change starts fewer local searches, and F'_ior is then too small by up to 0.8 arcsec. Next attempts: local "
    "searches that share states between neighbouring holes, and grids in every second hole only, which would save an "
    "estimated seventh of the time.",
    "trials": "The command computes a table of the error for each sample of stiffnesses and clearances, instead of a "
    "single table for the preset. Next attempt: compute tables at further torques only for samples with a "
    "significant weight after the trials.",
    "tolerance": "For 150 drives, the solution of states in C takes 45 % of the time. The search in numpy takes 12 "
    "%, and the computation of the scalars of the deviations takes 10 %. Walks and their references take 7 %, "
    "imports 5 %, and the reading of tables 4 %. In a breakdown by purpose, the tables of the error take 15 % and "
    "the self error takes 11 %. Next attempt: solve fewer states, and use the table of the error instead.",
    "sensitivity": "Flanks with five stations take 1.5 times as long as whole flanks. The solution of states in C "
    "takes 43 % of the time. The search and its local searches in numpy take 20 %, walks and their references 17 %, "
    "and the computation of the scalars of the deviations 10 %. In a breakdown by purpose, the slopes with respect "
    "to every input of the drive take 14 %, and the tables of the error take 5 %. Next attempts: walks of similar "
    "contact systems that share one reference, and a search in C.",
    "stiffness": "The import of cvxpy takes 58 % of the time, all other imports take 25 %, and the cross-check of "
    "four states by another solver takes 10 %. Next attempt: do not import the modules of pages that are not shown.",
    "first output": "The progress bar appears after the modules of the result have been loaded. numpy and "
    "scipy.linalg take most of this time. Next attempt: show heading and progress bar before numpy is imported.",
    "--help": "The import of typer takes two thirds of the time. The handling of files and streams takes most of the "
    "remainder. The modules of the commands are not imported. Next attempt: import hashes and gzip only when a file "
    "is read.",
    "memory": "Each worker process has its own copy of numpy and scipy, which takes 45 to 50 MB in `check`. The C "
    "library keeps a third of the memory that Python frees. Returning this third to the system after each sample "
    "would take an eighth of the time. The process of the cross-check needs another 100 MB for cvxpy, and the "
    "process of the command itself needs 50 MB. `report` needs the most memory. In an earlier version a worker "
    "needed 80 MB, because a formulation and its references refer to each other and were not freed after a drive was "
    "finished. Next attempt: start the process of the cross-check without the imports of the command's pages.",
    "explorer": "The first number comes from one search for a typical drive. The verified number requires every state "
    "of the mesh cycle at each torque, and the start of the process that solves these states. Next attempt: solve "
    "several torques of one cycle together.",
    "coned": "With five stations there are five times as many candidates, and most of the work in a state grows with "
    "their number. Next attempt: omit stations that cannot come into contact according to bounds of their gaps.",
    "growth": "The time of a pivot grows with the square of the number of candidates that open or close in any state. "
    "Next attempt: pivot only on the candidates near the present state.",
    "random drives": "A drive needs some thousand states. Most of these belong to drives with a small error, whose "
    "maxima are nearly equal. Next attempt: start fewer local searches if the error is below an arc second.",
    "two processes": "The machine was also occupied by other work. Next attempt: repeat the measurement on an idle "
    "machine.",
}

CHOSEN = """\
## Choices and their comparisons

Each item names the chosen method and the alternative, and gives the result of their comparison.

- **Principal pivots that use the contact set of a neighbouring state**, instead of a separate active-set solution of
  each state (DAQP, warm). The table of solvers above compares the times. All solvers use the matrices of the
  formulation. If the pivots fail in a state, DAQP solves this state.
- **A separate reference for each torque**, instead of a common reference for both torques. This reduced the time by a
  tenth for samples of `vzp160` in one hole. For samples of a drive known only from its data sheet (a data-sheet drive),
  the reduction was 2 %. For samples in twelve holes, the time increased by a fifth, because each state at the other
  torque needs more pivots. The results agreed within 1e-10 arcsec.
- **Pivots in C**, or in numpy if no compiler is available. The table of solvers compares the times. In the tests, the
  results of both implementations agree within 1e-9 arcsec, and each state has its certificate.
- **Solution of every state of a single drive**, and a search only for very many drives. With the compiled program, the
  solution of the whole cycle takes about as long as a search took in an earlier version, and no extreme is missed. The
  table of proposed extremes above shows the errors of the search.
- **Three grids of states with slopes** (9 x 9, 14 x 14, 19 x 19), instead of one grid of 60 x 60 states without slopes.
  The three grids need about 800 states instead of 3 700. They find all isolated extremes, which the single grid did not
  always find. One grid of 15 x 15 missed two of eight isolated extremes, by 0.7 arcsec. One grid of 25 x 25 missed a
  different extreme. An extreme that one grid misses is usually found by another grid.
- **One grid of 7 x 7 and one ring of eight states for samples**, instead of a grid of 9 x 9 and two rings. The table
  gives the errors of 768 searches of `vzp160` and 192 searches of a data-sheet drive with large single pitch
  deviations, in arcsec. The errors are differences from a search with a grid of 60 x 60. The columns "9 x 9" apply to
  the alternative. The error with a grid of 5 x 5 is up to 1.1 arcsec.

  | drive | rms | maximum | 9 x 9: rms | 9 x 9: maximum |
  | --- | --- | --- | --- | --- |
  | `vzp160`, 80 N·m | 0.011 | 0.13 | 0.013 | 0.23 |
  | `vzp160`, 800 N·m | 0.013 | 0.26 | 0.003 | 0.06 |
  | data-sheet drive | 0.016 | 0.14 | | |
- **A table of the error that includes the slopes with respect to all deviations**, with one solution per point, instead
  of straight lines between the points. Between two points the table uses the mean of the straight line and of both
  tangents, which is exact for a parabola. With 9 x 5 x 7 x 7 points, the standard deviation of the error of the table
  is 0.9 and 1.4 % at the two torques of `vzp160`. With straight lines, 13 x 5 x 9 x 9 points and two solutions per
  point, the standard deviation is 1.1 and 2.4 %.
- **Four pivots at once**, instead of two. This shortens a search by a sixth if the single pitch deviations are large.
- **A separate solution for each pair of phases of the self error**, instead of one factorization for all pairs with a
  Schur complement over the bore contacts. The self error takes 6 % of the time of `check vzp160`. The solution of all
  800 states in C takes a quarter of these 6 %. A common factorization could not save more than this quarter. Sums and
  residuals in numpy take another quarter, contact systems a fifth, and programmes an eighth.
- **All flanks that overlap the other spline as candidates**, instead of the flanks within a window. A window of 30
  degrees was tried, in which the certificate of each state includes the gaps of all flanks beyond the window. The
  window reduced the time per state by 10 %, and the time per reference by 30 %. However, 9 of 12 samples of a
  data-sheet drive have contacts beyond the window and are solved twice. The results agreed within 1e-9 arcsec.
- **HIGHS for the cross-check**, and CLARABEL if HIGHS fails or takes more than 5000 iterations. With five stations,
  HIGHS takes 20 ms per state, and CLARABEL takes 70 ms. Both agree with the results of the compiled program within 2e-4
  arcsec over all presets.
- **Processes instead of threads**. The matrices are too small for the threads of BLAS, so these threads are disabled.
"""

DRAWN = """\
The table compares the extremes found by a search from three grids with the extremes of all states of the cycle (`python
-m benchmarks.proposals`). The numbers of states and the processor times are medians over the drives.

- The hard cases are `vzp160` with an e_hb of 0, 80 and 120 µm, in the holes with the smallest and the largest error, at
  both torques.
- The random drives are `vzp160` with random eccentricities and phases (from a fixed seed), at 80 N·m ("light") and at
  800 N·m ("heavy"). In the row "any", the torque, all other deviations, `j_n` and `g_b` are random as well.

The percentage in brackets is the largest difference as a share of F'_ior, among the cases with a difference above
0.01″. The last column gives the number of these cases.
"""

SEARCHED = """\
## Searches of samples

The extremes of samples of `vzp160`, each with its wheel in twelve holes, are searched from a coarse grid of 7 x 7
states with slopes, as in the commands. F'_ior from this search is compared with F'_ior from a search with a fine grid
of 60 x 60 states without slopes (`python -m benchmarks.draws`). Neither search can give a value above the true F'_ior.
If the difference is negative, the search with the coarse grid has missed an extreme. If it is positive, the search with
the fine grid has missed an extreme. The numbers of states and the times are averages per search. The states of the
local searches, which start from the coarse grid, are solved without verification, in addition to the verified states.
"""
