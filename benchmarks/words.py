"""What docs/performance.md says beside its numbers: reasons, ideas and choices, written by hand."""

WALK, NUMPY, WARM_DAQP = "compiled walk, AVX2", "numpy engine", "DAQP, warm from state to state"  # engines in a table

HEAD = """\
# Speed and memory

Made by `python -m benchmarks --json second.json --first first.json --write`, which measures everything below in one
run of some ten minutes and has the run before beside it; `--from` with `--anew` measures parts of an earlier run again.
Ratios count; absolute times belong to the machine named here and to its other work.

Times are processor time: of whole processes that of the command and its workers, over that of an import which every
answer needs or could do with; of all else that of one thread. Whole processes have all that a user waits for: the
interpreter, imports, worker processes; their table has seconds on the clock too. Memory is that of a command and its
workers together, pages that they share counted once (PSS, looked at every 0.2 s; at least the kernel's peak of the
largest of them).
"""

SOLVERS = """\
Microseconds of processor time a state of `vzp160` with flanks that bear as a whole (`numerics.stations: 1`; below is
as much as coned ones), sums and certificate included: over the cycle, where each state is next to the one before, and
over the states that proposals of its extremes solve, in their order and batches.
"""

# Why a target is missed, and what to try next; a row that is met says nothing. Shares are of processor time.
REASONS = {
    "state": "the certificate takes 2.4 µs (AVX2) whatever the state; pivots, 1.5 a state at 80 N·m and 0.7 at 800, "
    "and the values of all candidates that follow from them are the rest. Without a compiler it is the numpy engine. "
    "Next: a certificate that takes over the gaps of the state before.",
    "daqp": "warm DAQP takes one or two steps for a state that is next to the one before. Of the walk in AVX2 the "
    "certificate is 2.4 µs, a third at 80 N·m and half at 800: a floor as long as every state keeps it; pivots, 1.5 "
    "and 0.7 a state, and the values of all candidates that follow from them are the rest. AVX-512 takes two thirds "
    "to four fifths of these times. Next: a certificate that takes over the gaps of the state before.",
    "cvxpy": "a solver through cvxpy has the programme stated once and only its parameters changed; what is left is "
    "cvxpy's own work on each of them. Next: nothing, as long as every state keeps its certificate.",
    "draws": "crests where a mesh zone lets go: the error jumps by arcseconds over a few steps of the wheels, and a "
    "climb that begins beside one may end before it. Next: the state where the share of a zone is 0, solved by "
    "itself.",
    "mount own.yaml": "as `mount vzp160`, and of each draw also what `check own.yaml` says: three contact systems, one "
    "of them with play, and the stiffness that the catalogue is held against. Its teeth are rough: more hills, and "
    "more contacts that change from state to state. Next: as there.",
    "report own.yaml": "mount, the parts of check that are not samples, and stiffness; its samples are those of mount, "
    "and the process of the cross-check is one for all three. Next: as for mount.",
    "report own.yaml again": "check searches no holes: it would take as long as mount. The report takes over all that "
    "check has kept; its samples in all other holes, the curve of the seat and the stiffness are left (14 times "
    "as long as the import, on a loaded machine; after mount too 2.1 times). Next: a table of each draw, from which "
    "all holes are read.",
    "trials own.yaml": "draws with a table of the error each at two torques; 62 % are in C, the rest numpy around few "
    "states. It was 33 times: a point of a table was solved at two torques for its slopes, of twice the points, "
    "and each slope was read by itself. Next: tables at further torques only for draws that keep weight after the "
    "trials.",
    "proposals": "a hill between the points of the grid, or a long crease, along which a climb ends early. The values "
    "of one drive as it is given do not rest on proposals: they solve every state; drawn drives do. Next: a "
    "fourth grid where one zone takes nearly all.",
    "check": "of one process on a loaded machine: 64 drives drawn from all that is not known 36 % (of a drive 30 ms: "
    "the contact systems' references, one a torque, a third, states of its grids and climbs in C a quarter, "
    "contacts and rules of the drive a seventh, the rest numpy around batches of few states), what it would "
    "take, twelve drives in other holes, with tighter tolerances and another coupling, 15 %, "
    "the self error 13 % (400 pairs of phases, each with "
    "contacts and a programme of its own), ten states by another solver 11 % and the import of cvxpy without "
    "scipy.stats 4 %, every state of both torques 7 %, all other imports 9 % (a quarter scipy.special, which "
    "cvxpy has too). Without any drawn drive it is more than half. "
    "Next: the self error's programmes in C.",
    "check own.yaml": "72 drives, of which each takes twice as long as one of vzp160, are 49 %: its search at two "
    "torques 28 %, "
    "the profile shift at which its teeth mesh, which is another contact system, 9 %, the stiffness that its "
    "catalogue is held against 5 %. What it would take is 17 %, the self error 12 %, the cross-check with its import "
    "of cvxpy 14 %, every state 9 %. Of all of it a third is in C. Next: the mesh from its gaps, without a contact "
    "system; as above.",
    "mount": "64 drives, each in twelve holes at both torques, were 73 % before their searches took fewer states, of "
    "which two thirds in C; the curve of the drive as given, by finer grids and by every state in two holes, 14 %, "
    "twelve states of the cross-check 8 %, all imports 7 %. A search of a hole is 84 to 108 states, of which 61 to 74 "
    "its grid and first states on hills. Tried: half a turn on taken as alike, which doubles a grid, misses up to 1.2 "
    "arcsec where an offset turns with the cam; fewer hills miss 0.8. Next: hills of neighbouring holes, of which the "
    "same states tell; grids of every other hole, a seventh by estimate.",
    "trials": "a table of the error for each draw of stiffnesses and clearances, where one of the preset served "
    "before. Next: tables at further torques only for draws that keep weight after the trials.",
    "tolerance": "of 150 drives: states solved in C 45 %, proposals 12 %, deviation scalars 10 % and tables read 4 % "
    "in numpy, walks and their references made 7 %, imports 5 %; by purpose, tables of the error 15 % and the self "
    "error 11 %. Next: fewer states where a table is sure.",
    "sensitivity": "flanks in five stations take half as long again as whole ones. States solved in C 43 %, "
    "proposals and their climbs in numpy 20 %, walks and their references made 17 %, deviation scalars 10 %; by "
    "purpose, slopes by every number of the drive 14 %, tables of the error 5 %. Next: walks of neighbouring systems "
    "that share a reference, proposals in C.",
    "stiffness": "the import of cvxpy 58 % (1.0 of it), all other imports 25 %, four states again by another "
    "solver 10 %. Next: imports of pages that are not shown.",
    "first output": "the bar begins when the modules of the answer are there: numpy and scipy.linalg are most of "
    "their import. Next: head and bar before numpy is imported.",
    "--help": "typer is two thirds of it, files and streams of a run most of the rest; no command and no option of one "
    "is imported. Next: hashes and gzip when a file is read.",
    "memory": "each worker holds its own share of numpy and scipy (45 to 50 MB in check, of which the C library keeps "
    "a third that was freed: giving that back after each draw takes an eighth of its time; it was 80 MB while a "
    "formulation and its references held each other, so that matrices of drives that were done stayed), the process of "
    "the cross-check cvxpy besides (100 MB), the command itself 50 MB; report has the most. Next: the cross-check's "
    "process without what the command has imported for its pages.",
    "explorer": "the first number is one search of a typical drive; the proven one adds every state of its cycle at "
    "each torque, and the process that solves them. Next: torques of one cycle solved together.",
    "coned": "five times the flanks are candidates, and most of what a state costs goes with all of them. Next: "
    "leave out stations that bounds prove never to touch.",
    "growth": "a pivot costs the square of the candidates that change sides anywhere. Next: pivot on those near alone.",
    "random drives": "some thousand states a drive, most of them for light errors whose hills are all alike. Next: "
    "look at fewer hills where the error is below an arc second.",
    "two processes": "the machine had other work to do. Next: measure on a quiet one.",
}

CHOSEN = """\
## Choices, and the comparisons behind them

- **Principal pivots that neighbouring states share**, not one active-set solve after another (DAQP, warm): the table
  of solvers above. All run the matrices of the formulation; states that pivots give up go to DAQP.
- **A reference for each torque**, not one for both: draws of `vzp160` without turns took a tenth less, of a data sheet
  2 % less, and those in twelve holes a fifth more, as each state at the other torque has more pivots. Answers were the
  same to 1e-10 arcsec.
- **The pivots in C**, with numpy behind it where there is no compiler: the same table. Both agree to 1e-9 arcsec in a
  test, and each state keeps its certificate.
- **Every state of one drive**, proposals only of very many: at the walk's speed the whole cycle costs about as much
  as a search for its extremes did, and misses no state. The misses of proposals are the table above.
- **Three grids of states with slopes** (9 x 9, 14 x 14, 19 x 19), not one of 60 x 60 without: some 800 states for
  3 700, and the islands of the error that were the hard cases of the latter are all found. One grid of 15 x 15 missed
  two of eight of them, by 0.7 arcsec, one of 25 x 25 another one: what one grid overlooks another one shows.
- **One grid of 7 x 7 and one ring of eight states for draws**, not 9 x 9 and two rings: 768 searches of `vzp160` miss
  rms 0.011 and at most 0.13 arcsec of a grid of 60 x 60 at 80 N·m, 0.013 and 0.26 at 800 (before: 0.013 and 0.23,
  0.003 and 0.06), 192 of a data sheet with rough teeth 0.016 and 0.14; a grid of 5 misses up to 1.1.
- **A table of the error with slopes by all deviations**, one solution a point, and between two points the mean of the
  line and of both tangents, exact for a parabola: read at 9 x 5 x 7 x 7 points it misses less than the line alone did
  at 13 x 5 x 9 x 9 with two solutions each (standard deviation 0.9 and 1.4 % at the torques of `vzp160`, not 1.1 and
  2.4).
- **Four pivots carried out together**, not two: a sixth less of a search whose teeth are rough.
- **Each pair of phases of the self error by itself**, not flanks and balls by a Schur complement over bore contacts
  that are factored once: of `check vzp160` the self error is 10 %, and of that all 800 states solved in C are a
  quarter, some 2.4 % of the command, more than which no factoring can save. Sums and residuals in numpy are another
  quarter, contact systems a fifth, programmes an eighth.
- **Every flank that overlaps the other wheel as a candidate**, not those within a window: tried with 30 degrees, the
  gaps of all flanks beyond in each state's certificate, a state took 0.9 and a reference 0.7 of the time, but 9 of 12
  drives of a data sheet touch beyond and are solved twice. Answers were the same to 1e-9 arcsec.
- **HIGHS for the cross-check**, with CLARABEL behind it: 20 ms a state with five stations where CLARABEL
  takes 70, within 2e-4 arcsec of the engine over all presets.
- **Processes, not threads**: the matrices are too small for threads of BLAS, which are switched off.
"""

DRAWN = """\
Extremes that three grids propose against every state (`python -m benchmarks.proposals`): states and processor
time are medians a drive. Hard cases: `vzp160` with e_hb of 0, 80 and 120 µm, in the positions of the wheel with the
least and the greatest error, at both torques. Random drives: `vzp160` with cam offsets and phases drawn anew, at 80
N·m (light), at 800 N·m (heavy), and at any torque with all other deviations, `j_n` and `g_b` drawn too (seeded). The
share in brackets is the greatest of those that miss more than 0.01″.
"""

SEARCHED = """\
## Searches of draws

Draws of `vzp160`, each with its wheel in twelve holes, searched from a grid of 7 x 7 states with slopes, as draws are,
against one of 60 x 60 (`python -m benchmarks.draws`): F'_ior is of states of the cycle by both, so a negative miss is
one of the coarse grid.
"""
