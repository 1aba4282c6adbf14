/* The walk over states of one contact system at one torque: principal pivots, sums and certificate of each state.
 *
 * At a fixed contact set the values (forces of contacts, gaps of the others, duals) are linear in the gaps without force.
 * Of every candidate that changed sides, value and other (gap of a contact, force of the others) trade places by one
 * principal pivot of a small dense tableau, which holds only candidates that change sides now and then; a state is solved
 * where all its values are positive. The next state starts from the contact set of the one before.
 * pivoting.py is the same in numpy, and the oracle of this file.
 *
 * Candidates stand at places: the stations of a flank share one, and differ in their gap and in how they yield themselves.
 * What all candidates at a place see of the structure is one number, its coordinate: the approach there, or the value itself
 * where a candidate stands alone. So all sums over the structure are made of places, of which there are much fewer.
 *
 * States are given by deviation scalars s: gaps = delta_p + map' s (+ gaps of measured teeth). The certificate is made of
 * D (compliance between places, and local), G, C and these gaps alone, in mm, N and rad; all else is in the programme's units.
 */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#if defined(__x86_64__)
#include <cpuid.h>
#endif
#if defined(_WIN32) /* its C library has no aligned_alloc */
#include <malloc.h>
#define aligned_alloc(alignment, bytes) _aligned_malloc(bytes, alignment)
#define free_aligned _aligned_free
#else
#define free_aligned free
#endif

#define FREEDOMS 9
#define ZERO 1e-10       /* programme's units: a value this far below zero counts as zero */
#define SMALLEST 1e-9    /* pivot, where those of the reference are one */
#define REFINED 5e-13    /* a value that should be zero: beyond it answers are refined */
#define INACCURATE 1e-9  /* a value that should be zero: beyond it the tableau is made anew */
#define GREEDY 3         /* pivots a candidate, after which the least index goes first, which can't cycle (Murty) */
#define LIMIT 30         /* pivots a candidate, after which a state is given up */
#define LOST 8           /* states given up, after which no more are tried */
#define REFRESH 1000     /* pivots, after which the tableau is made anew, against rounding */
#define KEEP 6           /* states without a change of sides, after which a candidate leaves the tableau: at 30 searches take a tenth longer */
#define KEEP_FAR 2       /* the same where states lie far apart, as those that slopes are asked for do: a tenth faster than at 6 */
#define SWEEP 4          /* states between two looks for such candidates */
#define CHANGES 2        /* mark of a candidate that is to change sides */
#define PATIENCE 10      /* steps in which no fewer candidates change sides, after which one at a time does (Murty) */
#define FEW 64           /* candidates that the tableau has room for at first */
#define TOGETHER 4       /* pivots that are carried out together */
#define BATCH 64         /* states that are certified together */
#define TOUR 1024        /* states that are put in order together, a multiple of BATCH */

#if defined(__AVX512F__)
#define WIDTH 8
#elif defined(__AVX__)
#define WIDTH 4
#else
#define WIDTH 2
#endif
#define ABREAST (WIDTH == 8 ? 8 : 4) /* states whose gaps are summed in registers */

#define SIMD(clause) _Pragma(#clause)
#define SUM(x) SIMD(omp simd reduction(+ : x))
#define LEAST(x) SIMD(omp simd reduction(min : x))
#define GREATEST(x) SIMD(omp simd reduction(max : x))

typedef double vector __attribute__((vector_size(WIDTH * 8), aligned(8)));
typedef int64_t bits __attribute__((vector_size(WIDTH * 8), aligned(8)));

/* What the caller lends; it has to outlive the walk. M candidates at m places, R = m + free coordinates, p scalars in use. */
typedef struct {
    int32_t M, m, free, flanks, columns, rotation;
    const double *by_places;   /* (m, R) what a unit that a candidate at each place puts in adds to all coordinates */
    const double *law;         /* (2 + columns, R) coordinates at the reference: constant, by torque [N*mm], and by each scalar */
    const int32_t *place;      /* (M) of each candidate, in ascending order */
    const uint8_t *contact;    /* (M) whether the reference has contact */
    const double *gain;        /* (M) value by the coordinate of the place; values are scaled, others the other way round */
    const double *constant;    /* (M) value where that coordinate is 0 */
    const double *weight;      /* (M) what a unit of the other puts in at the place */
    const double *own;         /* (M) what a unit of the other adds to the value of the same candidate alone */
    const double *value_force; /* (M) force [N] of a value, 0 where it is a gap */
    const double *other_force; /* (M) force [N] of an other, 0 where it is a gap */
    const double *dual_unit;   /* (free) displacement [mm, rad] of a dual */
    const double *compliance;  /* (m, m) mm/N */
    const double *local;       /* (M) mm/N */
    const double *G;           /* (9, m) */
    const double *C;           /* (9) N/mm, 0 where there is no support */
    const double *delta_p;     /* (M) mm */
    const double *map;         /* (columns, m) gaps by a unit of each scalar of a drive */
    const double *lever;       /* (2, flanks) N*mm a N of the flanks of each mesh zone, 0 of the other's */
} contact_system;

typedef struct {
    double *rotation;    /* (states) rad */
    double *moment;      /* (states, 2) N*mm of each mesh zone */
    double *tooth_force; /* (states) N, greatest on a flank */
    double *residual;    /* (states, 4) negative force, negative gap, complementarity, equilibrium */
    double *slope;       /* (states, p) rad/mm, rotation by each scalar in use, or NULL */
} answers;

typedef struct {
    contact_system held;
    const contact_system *system; /* held */
    double torque;       /* N*mm */
    int freedom[FREEDOMS]; /* place of a freedom among the free ones, -1 where it has a support */
    int n, padded;       /* candidates in the tableau; columns of a row */
    int *candidate;      /* (n) */
    int *position;       /* (M) in the tableau, or -1 */
    uint8_t *changed;    /* (n) whether value and other have traded places */
    long *last;          /* (n) state in which it did so last */
    double *tableau;     /* (n, padded) */
    int found;           /* pivots that are not carried out yet */
    int at[TOGETHER];    /* their rows in the tableau */
    double *rows[TOGETHER], *columns[TOGETHER]; /* (padded) of theirs; rows are scratch besides */
    double *value;       /* (n) values in the tableau */
    double *correction;  /* (n) of a refinement */
    double *start;       /* (R) coordinates at the reference */
    double *all;         /* (R) coordinates at the contact set */
    double *input;       /* (m) scratch: what candidates put in at each place */
    int *first;          /* (m + 1) first candidate at each place */
    int *touching;       /* candidates that have contact at the reference, -1 behind the last one */
    double *lower, *upper; /* (m) coordinates of a place between which no value there is negative at the reference */
    double *least, *most; /* (m) gaps without force of a drive without deviations, least and greatest at a place */
    double *unloaded;    /* (m) scratch of the certificate: least at places without load, else infinite */
    int *candidates;     /* (M) scratch of the certificate: candidates at places with load */
    double *panels;      /* compliance in panels of WIDTH columns */
    double *force, *at_place, *moved, *gap, *free, *blocks; /* of a batch */
    int *loaded;
    int *order;          /* (TOUR) states in the order in which they are solved */
    double *left;        /* (columns + 1, TOUR) scratch: scalars of those that are left, and how far off they are */
    long states, since_made;
    int lost;
    int keep;            /* KEEP or KEEP_FAR */
} walk;

static inline void add_multiple(int n, double a, const double *restrict x, double *restrict y) {
    SIMD(omp simd)
    for (int i = 0; i < n; i++) y[i] += a * x[i];
}

/* Add multiples x of columns, shape (..., n), to y; index: which columns, NULL for the first ones. */
static void add_columns(int n, int count, const double *x, const double *columns, const int32_t *index, double *restrict y) {
    int k = 0;
    for (; k + 4 <= count; k += 4) {
        const double *c[4];
        for (int i = 0; i < 4; i++) c[i] = columns + (size_t)(index ? index[k + i] : k + i) * n;
        SIMD(omp simd)
        for (int i = 0; i < n; i++)
            y[i] += (x[k] * c[0][i] + x[k + 1] * c[1][i]) + (x[k + 2] * c[2][i] + x[k + 3] * c[3][i]);
    }
    for (; k < count; k++) add_multiple(n, x[k], columns + (size_t)(index ? index[k] : k) * n, y);
}

/* Sum of products, and of their sizes where asked for. Lanes are added in one order wherever the arrays begin in memory: a
 * compiler left to itself peels loops by alignment, and the last digits of an answer would depend on it. */
static double product(int n, const double *restrict x, const double *restrict y, double *sizes) {
    vector sum = {0}, size = {0};
    int k = 0;
    for (; k + WIDTH <= n; k += WIDTH) {
        const vector z = *(const vector *)(x + k) * *(const vector *)(y + k);
        sum += z;
        if (sizes) size += (vector)((bits)z & INT64_MAX); /* without its sign */
    }
    double total = 0, total_size = 0;
    for (int lane = 0; lane < WIDTH; lane++) total += sum[lane], total_size += size[lane];
    for (; k < n; k++) total += x[k] * y[k], total_size += fabs(x[k] * y[k]);
    if (sizes) *sizes = total_size;
    return total;
}

static inline const double *column(const walk *w, int candidate) {
    return w->system->by_places + (size_t)w->system->place[candidate] * (w->system->m + w->system->free);
}

/* What a unit of another's other adds to the value of a candidate, at the reference. */
static inline double entry(const walk *w, int candidate, int another) {
    const contact_system *s = w->system;
    const double through = s->gain[candidate] * column(w, another)[s->place[candidate]] * s->weight[another];
    return candidate == another ? through + s->own[candidate] : through;
}

static inline double value_at(const walk *w, const double *coordinates, int candidate) {
    const contact_system *s = w->system;
    return s->gain[candidate] * coordinates[s->place[candidate]] + s->constant[candidate];
}

/* Room for more candidates: rows move apart. Short rows stay in the cache, in an odd number of its lines spread over it. */
static void widen(walk *w, int padded) {
    padded = (padded / 8 | 1) * 8;
    for (int i = w->n - 1; i > 0; i--)
        memmove(w->tableau + i * (size_t)padded, w->tableau + i * (size_t)w->padded, sizeof(double) * w->n);
    w->padded = padded;
}

/* Take a candidate into the tableau as it stands. Between candidates on the same side the tableau is symmetric, else
 * antisymmetric. */
static void take_in(walk *w, int candidate) {
    const int n = w->n;
    if (n == w->padded) widen(w, n + n / 2);
    const size_t padded = w->padded;
    double *new_row = w->tableau + n * padded;
    for (int j = 0; j < n; j++) new_row[j] = w->changed[j] ? 0.0 : entry(w, candidate, w->candidate[j]);
    for (int k = 0; k < n; k++)
        if (w->changed[k]) add_multiple(n, entry(w, candidate, w->candidate[k]), w->tableau + k * padded, new_row);
    double diagonal = entry(w, candidate, candidate);
    for (int j = 0; j < n; j++) {
        const int same = (w->system->contact[w->candidate[j]] ^ w->changed[j]) == w->system->contact[candidate];
        w->tableau[j * padded + n] = same ? new_row[j] : -new_row[j];
        if (w->changed[j]) diagonal += entry(w, candidate, w->candidate[j]) * w->tableau[j * padded + n];
    }
    new_row[n] = diagonal;
    w->candidate[n] = candidate;
    w->position[candidate] = n;
    w->changed[n] = 0;
    w->last[n] = w->states;
    w->n = n + 1;
}

static void leave_out(walk *w, int k) {
    const int m = --w->n;
    const size_t padded = w->padded;
    w->position[w->candidate[k]] = -1;
    if (k == m) return;
    memcpy(w->tableau + k * padded, w->tableau + m * padded, sizeof(double) * (m + 1));
    for (int i = 0; i <= m; i++) w->tableau[i * padded + k] = w->tableau[i * padded + m];
    w->candidate[k] = w->candidate[m];
    w->position[w->candidate[k]] = k;
    w->changed[k] = w->changed[m];
    w->last[k] = w->last[m];
}

/* Value and other of the candidate in row r are to trade places; values follow. 0 where the pivot is too small. It is carried
 * out later, with those before it: a tableau larger than the nearest cache is gone over once for all of them. */
static int find_pivot(walk *w, int r, double *values) {
    const int n = w->n;
    double *row = w->rows[w->found], *column = w->columns[w->found];
    memcpy(row, w->tableau + r * (size_t)w->padded, sizeof(double) * n);
    for (int i = 0; i < n; i++) column[i] = w->tableau[i * (size_t)w->padded + r];
    for (int q = 0; q < w->found; q++) { /* as those before it will leave them */
        const double in_row = w->rows[q][r];
        row[w->at[q]] = 0;
        add_multiple(n, w->columns[q][r], w->rows[q], row);
        add_multiple(n, in_row, w->columns[q], column);
        column[w->at[q]] = in_row;
    }
    if (!(row[r] > SMALLEST)) return 0;
    const double inverse = 1 / row[r];
    for (int j = 0; j < n; j++) row[j] *= -inverse;
    row[r] = inverse;
    column[r] = 0;
    if (values) {
        const double other = -values[r] * inverse;
        add_multiple(n, other, column, values);
        values[r] = other;
    }
    w->changed[r] ^= 1;
    w->last[r] = w->states;
    w->since_made++;
    w->at[w->found++] = r;
    return 1;
}

/* Carry out the pivots that were found. */
static void carry_out(walk *w) {
    const int n = w->n, found = w->found, wide = (n + WIDTH - 1) / WIDTH * WIDTH;
    const size_t padded = w->padded;
    if (!found) return;
    for (int q = 0; q < found; q++) {
        for (int later = q + 1; later < found; later++) w->rows[q][w->at[later]] = 0;
        for (int j = n; j < wide; j++) w->rows[q][j] = 0;
    }
    for (int i = 0; i < n; i++) {
        double *target = w->tableau + i * padded;
        for (int q = 0; q < found; q++) target[w->at[q]] = 0;
        int q = 0;
        for (; q + 4 <= found; q += 4) {
            const double a = w->columns[q][i], b = w->columns[q + 1][i], c = w->columns[q + 2][i], d = w->columns[q + 3][i];
            const double *A = w->rows[q], *B = w->rows[q + 1], *C = w->rows[q + 2], *D = w->rows[q + 3];
            SIMD(omp simd)
            for (int j = 0; j < wide; j++) target[j] += (a * A[j] + b * B[j]) + (c * C[j] + d * D[j]);
        }
        for (; q < found; q++) add_multiple(wide, w->columns[q][i], w->rows[q], target);
    }
    for (int q = 0; q < found; q++) {
        for (int later = q + 1; later < found; later++)
            add_multiple(n, w->columns[later][w->at[q]], w->rows[later], w->rows[q]);
        memcpy(w->tableau + w->at[q] * padded, w->rows[q], sizeof(double) * n);
    }
    w->found = 0;
}

/* Whether the pivot in row r has to wait until those that were found are carried out. */
static int has_to_wait(const walk *w, int r) {
    for (int q = 0; q < w->found; q++)
        if (w->at[q] == r) return 1;
    return w->found == TOGETHER;
}

/* Make the tableau anew from the reference, with the same candidates changed as far as pivots allow. */
static void make_anew(walk *w) {
    const int n = w->n;
    int *candidate = w->loaded; /* scratch of the certificate, unused here */
    uint8_t *wanted = w->changed + w->system->M;
    long *last = w->last + w->system->M;
    memcpy(candidate, w->candidate, sizeof(int) * n);
    memcpy(wanted, w->changed, n);
    memcpy(last, w->last, sizeof(long) * n);
    w->n = 0;
    for (int k = 0; k < n; k++) take_in(w, candidate[k]);
    for (;;) {
        int r = -1;
        double greatest = SMALLEST;
        for (int k = 0; k < n; k++) {
            const double d = w->tableau[k * (size_t)w->padded + k];
            if (w->changed[k] != wanted[k] && d > greatest) greatest = d, r = k;
        }
        if (r < 0 || !find_pivot(w, r, NULL)) break;
        carry_out(w);
    }
    memcpy(w->last, last, sizeof(long) * n);
    w->since_made = 0;
}

static void back_to_reference(walk *w) {
    for (int k = 0; k < w->n; k++) w->position[w->candidate[k]] = -1;
    w->n = w->found = 0;
    w->since_made = 0;
    widen(w, FEW);
}

/* Values in the tableau at its contact set, from those at the reference. */
static void enter(walk *w) {
    const int n = w->n;
    double *value = w->value, *moved = w->rows[0];
    int any = 0;
    for (int k = 0; k < n; k++) {
        const double at_reference = value_at(w, w->start, w->candidate[k]);
        value[k] = w->changed[k] ? 0.0 : at_reference;
        moved[k] = w->changed[k] ? at_reference : 0.0;
        any |= w->changed[k];
    }
    if (!any) return;
    for (int i = 0; i < n; i++) value[i] -= product(n, w->tableau + i * (size_t)w->padded, moved, NULL);
}

static double least(int n, const double *x) {
    double low = 0;
    LEAST(low)
    for (int i = 0; i < n; i++) low = x[i] < low ? x[i] : low;
    return low;
}

static int first_below(int n, const double *x, double bound) {
    for (int i = 0; i < n; i++)
        if (x[i] <= bound) return i;
    return -1;
}

/* What the others of changed candidates add to all coordinates. */
static void add_others(walk *w, const double *others) {
    const contact_system *s = w->system;
    for (int k = 0; k < w->n; k++)
        if (w->changed[k]) w->input[s->place[w->candidate[k]]] += others[k] * s->weight[w->candidate[k]];
    double *amount = w->rows[1];
    int count = 0;
    for (int k = 0; k < w->n; k++) {
        const int place = s->place[w->candidate[k]];
        if (w->input[place] == 0) continue;
        w->loaded[count] = place, amount[count++] = w->input[place];
        w->input[place] = 0;
    }
    add_columns(s->m + s->free, count, amount, s->by_places, w->loaded, w->all);
}

/* Value of a candidate in the tableau by the coordinates: 0 of one that changed sides, in exact arithmetic. */
static double value_of(const walk *w, int k) {
    const int candidate = w->candidate[k];
    const double through = value_at(w, w->all, candidate);
    return w->changed[k] ? through + w->system->own[candidate] * w->value[k] : through;
}

/* Greatest rounding error: values of what changed sides are zero in exact arithmetic, and none in the tableau negative. */
static double off(const walk *w) {
    double greatest = 0;
    for (int k = 0; k < w->n; k++) {
        const double x = value_of(w, k), error = w->changed[k] ? fabs(x) : -x;
        greatest = error > greatest ? error : greatest;
    }
    return greatest;
}

/* The next place, from r on, at which a value is negative as far as its coordinate decides it; m behind the last one. */
static int next_outside(const walk *w, int r) {
    const int m = w->system->m;
    for (; r < m && r % 32; r++)
        if (w->all[r] < w->lower[r] || w->all[r] > w->upper[r]) return r;
    for (; r + 32 <= m; r += 32) { /* mostly there is none */
        int outside = 0;
        SIMD(omp simd reduction(| : outside))
        for (int i = r; i < r + 32; i++) outside |= (w->all[i] < w->lower[i]) | (w->all[i] > w->upper[i]);
        if (outside) break;
    }
    for (; r < m; r++)
        if (w->all[r] < w->lower[r] || w->all[r] > w->upper[r]) return r;
    return m;
}

/* Find the contact set of the state whose values at the reference are in w->start; 0 where it is given up. */
static int settle(walk *w) {
    const contact_system *s = w->system;
    const int R = s->m + s->free;
    long count = 0, made = 0;
    for (;;) {
        enter(w);
        for (;;) {
            const double low = least(w->n, w->value);
            if (!(low < -ZERO)) break;
            const int r = first_below(w->n, w->value, count < (long)GREEDY * w->n ? low : -ZERO);
            if (++count > (long)LIMIT * (w->n > 20 ? w->n : 20)) {
                w->lost++;
                return 0;
            }
            if (has_to_wait(w, r)) carry_out(w);
            if (!find_pivot(w, r, w->value)) return 0;
        }
        carry_out(w);
        memcpy(w->all, w->start, sizeof(double) * R);
        add_others(w, w->value);
        double wrong = off(w);
        if (wrong > REFINED) { /* one step of refinement: what should be zero is entered as one more start */
            double *more = w->correction;
            for (int k = 0; k < w->n; k++) w->rows[0][k] = w->changed[k] ? value_of(w, k) : 0.0;
            for (int k = 0; k < w->n; k++) {
                more[k] = w->changed[k] ? -product(w->n, w->tableau + k * (size_t)w->padded, w->rows[0], NULL) : 0.0;
                w->value[k] += more[k];
            }
            add_others(w, more);
            wrong = off(w);
        }
        /* rounding may have hidden that a value is negative, where the pivot of its candidate is large */
        if (wrong > INACCURATE || least(w->n, w->value) < -ZERO) {
            if (made++) return 0;
            make_anew(w);
            continue;
        }
        int more = 0;
        for (int r = next_outside(w, 0); r < s->m; r = next_outside(w, r + 1))
            for (int i = w->first[r]; i < w->first[r + 1]; i++)
                if (value_at(w, w->all, i) < -ZERO && w->position[i] < 0) take_in(w, i), more = 1;
        if (!more) return 1; /* what is negative is in the tableau, and within rounding */
    }
}

/* Residuals of system (1) for a batch of states, each a share of its scale: from compliance, G, C and the gaps alone.
 * w->moved has what the deviations add to the gaps at each place. */
static void certify(walk *w, int states, double *residual) {
    const contact_system *s = w->system;
    const int M = s->M, m = s->m, panels = (m + WIDTH - 1) / WIDTH, groups = (states + ABREAST - 1) / ABREAST;
    double a[BATCH][FREEDOMS], balance[BATCH][FREEDOMS], size[BATCH][FREEDOMS];
    double *restrict gap = w->gap;
    int count[BATCH]; /* places that are loaded in a group of states: a force of 0 closes no gap */
    for (int group = 0; group < groups; group++) {
        const int first = group * ABREAST, last = first + ABREAST < states ? first + ABREAST : states;
        int *loaded = w->loaded + (size_t)group * m;
        memset(gap, 0, sizeof(double) * m);
        for (int j = first; j < last; j++) add_multiple(m, 1.0, w->at_place + (size_t)j * m, gap); /* none is negative */
        count[group] = 0;
        for (int i = 0; i < m; i++)
            if (gap[i] != 0) loaded[count[group]++] = i;
        double *x = w->blocks + (size_t)group * (m + FREEDOMS) * ABREAST;
        memset(x, 0, sizeof(double) * (count[group] + FREEDOMS) * ABREAST);
        for (int j = first; j < last; j++) {
            const double *F = w->at_place + (size_t)j * m, *free = w->free + (size_t)j * s->free;
            double *block = x + j - first;
            for (int l = 0; l < count[group]; l++) block[l * ABREAST] = F[loaded[l]];
            for (int f = 0; f < FREEDOMS; f++) {
                double sizes;
                const double sum = product(m, F, s->G + (size_t)f * m, &sizes);
                a[j][f] = w->freedom[f] < 0 ? sum / s->C[f] : free[w->freedom[f]];
                balance[j][f] = sum - a[j][f] * s->C[f] + (f == s->rotation ? w->torque : 0.0);
                size[j][f] = sizes + (f == s->rotation ? fabs(w->torque) : 0.0);
                block[(count[group] + f) * ABREAST] = a[j][f];
            }
        }
    }
    for (int panel = 0; panel < panels; panel++) {
        const int first = panel * WIDTH, wide = m - first < WIDTH ? m - first : WIDTH;
        const double *D = w->panels + (size_t)panel * m * WIDTH;
        double G[FREEDOMS][WIDTH] = {{0}};
        for (int f = 0; f < FREEDOMS; f++)
            for (int i = 0; i < wide; i++) G[f][i] = s->G[(size_t)f * m + first + i];
        for (int group = 0; group < groups; group++) {
            const double *x = w->blocks + (size_t)group * (m + FREEDOMS) * ABREAST;
            const int *loaded = w->loaded + (size_t)group * m, rows = count[group];
            vector sum[ABREAST] = {{0}};
            for (int l = 0; l < rows; l++) {
                const vector d = *(const vector *)(D + (size_t)loaded[l] * WIDTH);
                for (int j = 0; j < ABREAST; j++) sum[j] += x[l * ABREAST + j] * d;
            }
            for (int f = 0; f < FREEDOMS; f++) {
                const vector g = *(const vector *)G[f];
                for (int j = 0; j < ABREAST; j++) sum[j] += x[(rows + f) * ABREAST + j] * g;
            }
            for (int j = 0; j < ABREAST && group * ABREAST + j < states; j++)
                for (int i = 0; i < wide; i++) gap[(size_t)(group * ABREAST + j) * m + first + i] = sum[j][i];
        }
    }
    int among = 0; /* candidates at places with load in a group of states: elsewhere the least gap at a place decides */
    for (int j = 0; j < states; j++) {
        const double *F = w->force + (size_t)j * M, *closed = gap + (size_t)j * m, *moved = w->moved + (size_t)j * m;
        double force = 2.3e-308, gap_size = 2.3e-308, pushed = 0, pulled = 0, both = 0, off = 0, finite = 0;
        if (j % ABREAST == 0) {
            const int *loaded = w->loaded + (size_t)(j / ABREAST) * m;
            memcpy(w->unloaded, w->least, sizeof(double) * m);
            among = 0;
            for (int l = 0; l < count[j / ABREAST]; l++) {
                w->unloaded[loaded[l]] = INFINITY;
                for (int i = w->first[loaded[l]]; i < w->first[loaded[l] + 1]; i++) w->candidates[among++] = i;
            }
        }
        SIMD(omp simd reduction(max : gap_size, pushed) reduction(+ : finite))
        for (int r = 0; r < m; r++) {
            const double low = fabs(w->least[r] + moved[r]), high = fabs(w->most[r] + moved[r]);
            const double widest = low > high ? low : high, negative = -(w->unloaded[r] + moved[r] + closed[r]);
            gap_size = widest > gap_size ? widest : gap_size;
            pushed = negative > pushed ? negative : pushed;
            finite += widest + fabs(closed[r]);
        }
        SIMD(omp simd reduction(max : force, pushed, pulled, both) reduction(+ : finite))
        for (int c = 0; c < among; c++) {
            const int i = w->candidates[c];
            const double g0 = s->delta_p[i] + moved[s->place[i]], g = g0 + closed[s->place[i]] + F[i] * s->local[i];
            const double size_F = fabs(F[i]), product = fabs(F[i] * g);
            force = size_F > force ? size_F : force;
            pulled = -F[i] > pulled ? -F[i] : pulled;
            pushed = -g > pushed ? -g : pushed;
            both = product > both ? product : both;
            finite += size_F + fabs(g); /* comparisons pass over what is not a number; a sum does not */
        }
        for (int f = 0; f < FREEDOMS; f++) {
            finite += fabs(balance[j][f]);
            if (balance[j][f] != 0) {
                const double share = fabs(balance[j][f]) / size[j][f];
                off = share > off ? share : off;
            }
        }
        double *r = residual + (size_t)j * 4;
        r[0] = pulled / force, r[1] = pushed / gap_size, r[2] = both / (force * gap_size), r[3] = off;
        if (!isfinite(finite))
            for (int k = 0; k < 4; k++) r[k] = NAN;
    }
}

/* Sums of the forces of one state at the places. */
static void sum_up(const walk *w, const double *F, size_t j, answers *out) {
    const contact_system *s = w->system;
    double greatest = 0;
    GREATEST(greatest)
    for (int flank = 0; flank < s->flanks; flank++) greatest = F[flank] > greatest ? F[flank] : greatest;
    for (int zone = 0; zone < 2; zone++)
        out->moment[2 * j + zone] = product(s->flanks, F, s->lever + (size_t)zone * s->flanks, NULL);
    out->tooth_force[j] = greatest;
}

/* Slope of the rotation by each scalar in use while contacts stay as they are: one adjoint product with the tableau. */
static void differentiate(const walk *w, int p, double *slope) {
    const contact_system *s = w->system;
    const int n = w->n, R = s->m + s->free, rotation = s->m + w->freedom[s->rotation];
    double *adjoint = w->rows[0];
    memset(adjoint, 0, sizeof(double) * n);
    for (int i = 0; i < n; i++)
        if (w->changed[i])
            add_multiple(n, s->weight[w->candidate[i]] * column(w, w->candidate[i])[rotation],
                         w->tableau + i * (size_t)w->padded, adjoint);
    for (int c = 0; c < p; c++) {
        const double *law = s->law + (2 + c) * (size_t)R;
        double by_scalar = law[rotation];
        for (int k = 0; k < n; k++)
            if (w->changed[k]) by_scalar -= adjoint[k] * s->gain[w->candidate[k]] * law[s->place[w->candidate[k]]];
        slope[c] = by_scalar * s->dual_unit[w->freedom[s->rotation]];
    }
}

static void give_up(size_t j, int p, answers *out) {
    out->rotation[j] = out->tooth_force[j] = NAN;
    out->moment[2 * j] = out->moment[2 * j + 1] = NAN;
    for (int k = 0; k < 4; k++) out->residual[4 * j + k] = NAN;
    if (out->slope)
        for (int c = 0; c < p; c++) out->slope[j * p + c] = NAN;
}

static void *bare_room(size_t count, size_t size) {
    const size_t bytes = (count * size + 63) / 64 * 64;
    return aligned_alloc(64, bytes ? bytes : 64);
}

static void *room(size_t count, size_t size) {
    void *memory = bare_room(count, size);
    if (memory) memset(memory, 0, count * size);
    return memory;
}

void walk_free(walk *w) {
    if (!w) return;
    void *rooms[] = {w->candidate, w->position, w->changed, w->last, w->tableau, w->value, w->correction, w->start,
                     w->rows[0], w->columns[0],
                     w->all, w->input, w->first, w->touching, w->lower, w->least, w->unloaded,
                     w->candidates, w->panels, w->force, w->at_place, w->moved, w->gap, w->free, w->blocks,
                     w->loaded, w->order, w->left};
    for (size_t k = 0; k < sizeof rooms / sizeof *rooms; k++) free_aligned(rooms[k]);
    free(w);
}

/* sizes and arrays: those of a contact_system, in its order. NULL where memory is short. */
walk *walk_new(const int32_t *sizes, const void *const *arrays) {
    walk *w = calloc(1, sizeof(walk));
    if (!w) return NULL;
    memcpy(&w->held, sizes, offsetof(contact_system, columns) + 2 * sizeof *sizes);
    memcpy(&w->held.by_places, arrays, sizeof w->held - offsetof(contact_system, by_places));
    const contact_system *s = &w->held;
    const size_t M = s->M, m = s->m, R = m + s->free, panels = (m + WIDTH - 1) / WIDTH;
    w->system = s;
    const size_t widest = M + M / 2 + 2 * FEW;
    w->candidate = room(M, sizeof(int)), w->position = room(M, sizeof(int)), w->loaded = room(M + BATCH / ABREAST * m, sizeof(int));
    w->changed = room(2 * M, 1), w->last = room(2 * M, sizeof(long));
    w->tableau = bare_room(M * widest, sizeof(double)); /* of which little is ever in use */
    w->rows[0] = room(TOGETHER * widest, sizeof(double)), w->columns[0] = room(TOGETHER * widest, sizeof(double));
    for (int q = 1; q < TOGETHER && w->rows[0] && w->columns[0]; q++)
        w->rows[q] = w->rows[0] + q * widest, w->columns[q] = w->columns[0] + q * widest;
    w->value = room(M, sizeof(double)), w->correction = room(M, sizeof(double));
    w->start = room(R, sizeof(double)), w->all = room(R, sizeof(double));
    w->input = room(m, sizeof(double)), w->unloaded = room(m, sizeof(double));
    w->first = room(m + 1, sizeof(int)), w->touching = room(M + 1, sizeof(int)), w->candidates = room(M, sizeof(int));
    w->lower = room(2 * m, sizeof(double)), w->least = room(2 * m, sizeof(double));
    w->panels = room(panels * m * WIDTH, sizeof(double));
    w->force = room(BATCH * M, sizeof(double)), w->at_place = room(BATCH * m, sizeof(double));
    w->moved = room(BATCH * m, sizeof(double)), w->gap = room(BATCH * m, sizeof(double));
    w->free = room(BATCH * (size_t)s->free, sizeof(double));
    w->blocks = room((BATCH + ABREAST) * (m + FREEDOMS), sizeof(double));
    w->order = room(TOUR, sizeof(int)), w->left = room((s->columns + 1) * (size_t)TOUR, sizeof(double));
    if (!(w->candidate && w->position && w->loaded && w->changed && w->last && w->tableau && w->rows[0] && w->columns[0] && w->value && w->correction &&
          w->start && w->all && w->input && w->first && w->touching && w->lower && w->least && w->unloaded &&
          w->candidates && w->panels && w->force && w->at_place && w->moved && w->gap && w->free &&
          w->blocks && w->order && w->left)) {
        walk_free(w);
        return NULL;
    }
    widen(w, FEW);
    for (int f = 0, free = 0; f < FREEDOMS; f++) w->freedom[f] = s->C[f] > 0 ? -1 : free++;
    for (size_t i = 0; i < M; i++) w->position[i] = -1;
    w->upper = w->lower + m, w->most = w->least + m;
    int *touching = w->touching;
    for (size_t i = 0; i < M; i++) {
        const int r = s->place[i];
        if (i == 0 || r != s->place[i - 1]) {
            w->first[r] = i;
            w->lower[r] = -INFINITY, w->upper[r] = INFINITY;
            w->least[r] = w->most[r] = s->delta_p[i];
        }
        const double bound = (-ZERO - s->constant[i]) / s->gain[i];
        if (s->gain[i] > 0) w->lower[r] = fmax(w->lower[r], bound);
        else w->upper[r] = fmin(w->upper[r], bound);
        w->least[r] = fmin(w->least[r], s->delta_p[i]), w->most[r] = fmax(w->most[r], s->delta_p[i]);
        if (s->contact[i]) *touching++ = i;
    }
    w->first[m] = M, *touching = -1;
    for (size_t k = 0; k < m; k++)
        for (size_t i = 0; i < m; i++) w->panels[(i / WIDTH * m + k) * WIDTH + i % WIDTH] = s->compliance[k * m + i];
    return w;
}

/* Put states in an order in which their scalars, shape (states, p), change little from one to the next, and so few candidates
 * change sides: always the nearest of those that are left, where that is a shorter way than the order given. */
static void arrange(walk *w, int states, int p, const double *scalars) {
    double *left = w->left, *distance = left + (size_t)p * TOUR, given = 0, way = 0;
    int *order = w->order;
    for (int i = 0; i < states; i++) {
        double step = 0;
        for (int c = 0; c < p; c++) {
            left[c * TOUR + i] = scalars[(size_t)i * p + c];
            if (i) step += (left[c * TOUR + i] - left[c * TOUR + i - 1]) * (left[c * TOUR + i] - left[c * TOUR + i - 1]);
        }
        order[i] = i;
        given += sqrt(step);
    }
    for (int k = 1; k < states && way < given; k++) {
        const int n = states - k;
        double *off = distance + k, nearest = INFINITY;
        memset(off, 0, sizeof(double) * n);
        for (int c = 0; c < p; c++) {
            const double *restrict x = left + c * TOUR + k, here = x[-1];
            SIMD(omp simd)
            for (int i = 0; i < n; i++) off[i] += (x[i] - here) * (x[i] - here);
        }
        LEAST(nearest)
        for (int i = 0; i < n; i++) nearest = off[i] < nearest ? off[i] : nearest;
        const int at = k + first_below(n, off, nearest), other = order[at];
        order[at] = order[k], order[k] = other;
        for (int c = 0; c < p; c++) {
            const double x = left[c * TOUR + at];
            left[c * TOUR + at] = left[c * TOUR + k], left[c * TOUR + k] = x;
        }
        way += sqrt(nearest);
    }
    if (!(way < given)) /* or not a number */
        for (int i = 0; i < states; i++) order[i] = i;
}

/* Go on to the next state: the coordinates that it has at the reference. */
static void begin_state(walk *w, int p, const double *scalars) {
    const contact_system *s = w->system;
    const int R = s->m + s->free;
    w->states++;
    if (w->since_made > REFRESH) make_anew(w);
    if (w->keep < KEEP || w->states % SWEEP == 0)
        for (int k = w->n - 1; k >= 0; k--)
            if (!w->changed[k] && w->states - w->last[k] > w->keep) leave_out(w, k);
    memcpy(w->start, s->law, sizeof(double) * R);
    add_multiple(R, w->torque, s->law + R, w->start);
    add_columns(R, p, scalars, s->law + 2 * R, NULL, w->start);
}

/* Find its contact set; 0 where it is given up. */
static int find_state(walk *w) {
    const int R = w->system->m + w->system->free;
    double sum = 0;
    SUM(sum)
    for (int i = 0; i < R; i++) sum += w->start[i];
    if (isfinite(sum) && w->lost < LOST && settle(w)) return 1;
    back_to_reference(w);
    return 0;
}

static double rotation_of(const walk *w) {
    const int rotation = w->freedom[w->system->rotation];
    return w->all[w->system->m + rotation] * w->system->dual_unit[rotation];
}

/* Solve states and certify each; how many were given up, whose answers are NaN.
 * torque: N*mm; scalars: (states, p); tooth_gaps: (states, m) added to the gaps at each place, and tooth_values:
 * (states, R) what they add to the coordinates at the reference, both NULL without measured teeth. */
long walk_solve(walk *w, long states, double torque, int p, const double *scalars, const double *tooth_gaps,
                const double *tooth_values, double *rotation, double *moment, double *tooth_force, double *residual,
                double *slope) {
    answers made = {rotation, moment, tooth_force, residual, slope}, *out = &made;
    const contact_system *s = w->system;
    const int M = s->M, m = s->m, R = m + s->free;
    long given_up = 0;
    double shares[BATCH * 4];
    long places[BATCH];
    int held = 0;
    w->lost = 0;
    w->keep = slope ? KEEP_FAR : KEEP;
    w->torque = torque;
    for (long turn = 0; turn < states; turn++) {
        const long begun = turn / TOUR * TOUR;
        if (turn == begun && !tooth_gaps) arrange(w, states - begun < TOUR ? states - begun : TOUR, p, scalars + (size_t)begun * p);
        const long j = places[held] = tooth_gaps ? turn : begun + w->order[turn - begun];
        double *F = w->force + (size_t)held * M, *free = w->free + (size_t)held * s->free;
        double *at_place = w->at_place + (size_t)held * m, *moved = w->moved + (size_t)held * m;
        begin_state(w, p, scalars + (size_t)j * p);
        memset(moved, 0, sizeof(double) * m);
        memset(at_place, 0, sizeof(double) * m);
        memset(F, 0, sizeof(double) * M);
        add_columns(m, p, scalars + (size_t)j * p, s->map, NULL, moved);
        if (tooth_gaps) {
            add_multiple(R, 1.0, tooth_values + (size_t)j * R, w->start);
            add_multiple(m, 1.0, tooth_gaps + (size_t)j * m, moved);
        }
        if (!find_state(w)) {
            given_up++;
            memset(free, 0, sizeof(double) * s->free);
            give_up(j, p, out);
        } else {
            for (const int *i = w->touching; *i >= 0; i++) {
                const double value = value_at(w, w->all, *i);
                F[*i] = value > 0 ? value * s->value_force[*i] : 0.0;
            }
            for (int k = 0; k < w->n; k++)
                if (w->changed[k]) F[w->candidate[k]] = w->value[k] > 0 ? w->value[k] * s->other_force[w->candidate[k]] : 0.0;
            for (const int *i = w->touching; *i >= 0; i++) at_place[s->place[*i]] += F[*i];
            for (int k = 0; k < w->n; k++)
                if (w->changed[k] && !s->contact[w->candidate[k]]) at_place[s->place[w->candidate[k]]] += F[w->candidate[k]];
            for (int f = 0; f < s->free; f++) free[f] = w->all[m + f] * s->dual_unit[f];
            out->rotation[j] = rotation_of(w);
            sum_up(w, at_place, j, out);
            if (out->slope) differentiate(w, p, out->slope + (size_t)j * p);
        }
        if (++held == BATCH || turn == states - 1) {
            certify(w, held, shares);
            for (int k = 0; k < held; k++) {
                memcpy(out->residual + 4 * (size_t)places[k], shares + 4 * k, sizeof(double) * 4);
                if (isnan(out->rotation[places[k]])) give_up(places[k], p, out);
            }
            held = 0;
        }
    }
    return given_up;
}

#define POINTS 256 /* states of one climb at most: two dozen are usual */
#define RADIUS 24  /* steps along each wheel that a climb looks around, at most */
#define LOOKS 3    /* around the highest state of a climb, by each ring */

/* Where a climb has been: points, heights, slopes, and tangents, which bound all others until one is higher. */
typedef struct {
    int count, best;
    int (*point)[2];
    double *height, *slope, *scalars, *tangent; /* tangent: at no deviations */
    uint8_t *is_bound;
} climb;

/* States of drives: the scalars of one are the sum of those by the places of both wheels. */
typedef struct {
    int p, z[2], finest;         /* finest: steps along each wheel */
    const double *by_wheel[2];   /* (rows, z, p) */
    int steps;                   /* of a climb at most */
    double gain;                 /* rad that a state has to promise beyond the highest */
} torus;

static const double *by_place(const torus *t, int wheel, int row, int at) {
    return t->by_wheel[wheel] + ((size_t)row * t->z[wheel] + (at % t->z[wheel] + t->z[wheel]) % t->z[wheel]) * t->p;
}

/* Scalars of the state at a point. */
static void scalars_at(const torus *t, int row, int k, int l, double *scalars) {
    const double *b = by_place(t, 0, row, k), *g = by_place(t, 1, row, l);
    for (int i = 0; i < t->p; i++) scalars[i] = b[i] + g[i];
}

/* Add a state to a climb that has room for it, with its slope there already. */
static void add_state(const torus *t, int row, int sign, int k, int l, double rotation, climb *c) {
    const int p = t->p, n = c->count++;
    double *scalars = c->scalars + (size_t)n * p, *slope = c->slope + (size_t)n * p;
    scalars_at(t, row, k, l, scalars);
    for (int i = 0; i < p; i++) slope[i] *= sign;
    const double height = c->height[n] = sign * rotation;
    const double tangent = c->tangent[n] = height - product(p, slope, scalars, NULL);
    c->is_bound[n] = 1;
    c->point[n][0] = k, c->point[n][1] = l;
    for (int i = 0; i < n; i++) {
        if (c->tangent[i] + product(p, c->slope + (size_t)i * p, scalars, NULL) < height - t->gain) c->is_bound[i] = 0;
        if (tangent + product(p, slope, c->scalars + (size_t)i * p, NULL) < c->height[i] - t->gain) c->is_bound[n] = 0;
    }
    if (height > c->height[c->best]) c->best = n;
}

/* Solve the state at a point, and add it to a climb; 0 where it is given up or there is no room. */
static int visit(walk *w, const torus *t, int row, int sign, int k, int l, climb *c) {
    if (c->count == POINTS) return 0;
    double *scalars = c->scalars + (size_t)c->count * t->p;
    scalars_at(t, row, k, l, scalars);
    begin_state(w, t->p, scalars);
    if (!find_state(w)) return 0;
    differentiate(w, t->p, c->slope + (size_t)c->count * t->p);
    add_state(t, row, sign, k, l, rotation_of(w), c);
    return 1;
}

/* Go on to the state that all bounds, and the tangent of the highest one, let be the highest, within so many steps of that,
 * until they let none. */
static void go_up(walk *w, const torus *t, int row, int sign, double radius, double highest, climb *c) {
    for (int step = 0; step < t->steps; step++) {
        const int reach = radius + 0.5 < RADIUS ? (int)(radius + 0.5) : RADIUS, wide = 2 * reach + 1, p = t->p;
        const int *centre = c->point[c->best];
        double model[2 * RADIUS + 1][2 * RADIUS + 1], along[2][2 * RADIUS + 1], greatest = -INFINITY;
        for (int x = 0; x < wide; x++)
            for (int y = 0; y < wide; y++) model[x][y] = INFINITY;
        for (int i = 0; i < c->count; i++) {
            if (!c->is_bound[i] && i != c->best) continue;
            const double *slope = c->slope + (size_t)i * p;
            for (int wheel = 0; wheel < 2; wheel++)
                for (int x = 0; x < wide; x++)
                    along[wheel][x] = product(p, slope, by_place(t, wheel, row, centre[wheel] + x - reach), NULL);
            for (int x = 0; x < wide; x++)
                for (int y = 0; y < wide; y++) {
                    const double bound = c->tangent[i] + along[0][x] + along[1][y];
                    model[x][y] = bound < model[x][y] ? bound : model[x][y];
                }
        }
        for (int i = 0; i < c->count; i++) {
            const int x = c->point[i][0] - centre[0] + reach, y = c->point[i][1] - centre[1] + reach;
            if (x >= 0 && x < wide && y >= 0 && y < wide) model[x][y] = -INFINITY;
        }
        int at[2] = {0, 0};
        for (int x = 0; x < wide; x++)
            for (int y = x % t->finest; y < wide; y += t->finest) /* states, as the corner of the square is one */
                if (model[x][y] > greatest) greatest = model[x][y], at[0] = x, at[1] = y;
        const double before = c->height[c->best];
        if (!(greatest > fmax(before, highest) + t->gain)) return;
        if (!visit(w, t, row, sign, centre[0] + at[0] - reach, centre[1] + at[1] - reach, c)) return;
        if (!(c->height[c->best] > before)) radius /= 2;
    }
}

static int climb_room(climb *c, int p) {
    c->point = room(POINTS, sizeof *c->point), c->height = room(POINTS * (2 + 2 * (size_t)p), sizeof(double));
    c->is_bound = room(POINTS, 1);
    if (!c->point || !c->height || !c->is_bound) return 0;
    c->tangent = c->height + POINTS, c->slope = c->tangent + POINTS, c->scalars = c->slope + (size_t)POINTS * p;
    return 1;
}

/* The highest states of drives (upside down where sign is -1) around hills; how many states were solved, -1 where memory is
 * short. None is certified: those found are to be solved once more.
 * Hills of one drive and sign are a group and follow each other: first (groups + 1); row, sign (groups); point (hills, 2),
 * rotation [rad] (hills) and slope [rad/mm] (hills, p) of the states there, which are solved already.
 * Around the highest that climbs within radius steps find, rings of eight states look for another slope up. sizes: z_b, z_g,
 * finest, steps of a climb, rings; radius (1 + rings); gain: rad. top (groups, 2): the points found. */
long walk_climb(walk *w, double torque, int p, const int32_t *sizes, const double *by_b, const double *by_g, double gain,
                const int32_t *radius, long groups, const int32_t *first, const int32_t *row, const int32_t *sign,
                const int32_t *point, const double *rotation, const double *slope, int32_t *top) {
    static const int ways[8][2] = {{1, 0}, {1, 1}, {0, 1}, {-1, 1}, {-1, 0}, {-1, -1}, {0, -1}, {1, -1}}; /* each beside the last */
    const torus t = {p, {sizes[0], sizes[1]}, sizes[2], {by_b, by_g}, sizes[3], gain};
    climb both[2] = {{0}}, *c = both, *best = both + 1;
    const long before = w->states;
    const int enough = climb_room(c, p) && climb_room(best, p);
    w->lost = 0;
    w->keep = KEEP_FAR;
    w->torque = torque;
    for (long group = 0; enough && group < groups; group++) {
        const int r = row[group], up = sign[group];
        double highest = -INFINITY;
        for (long hill = first[group]; hill < first[group + 1]; hill++) {
            c->count = c->best = 0;
            memcpy(c->slope, slope + (size_t)hill * p, sizeof(double) * p);
            add_state(&t, r, up, point[2 * hill], point[2 * hill + 1], rotation[hill], c);
            go_up(w, &t, r, up, radius[0], highest, c);
            if (c->height[c->best] > highest) {
                climb *const lower = best;
                highest = c->height[c->best], best = c, c = lower;
            }
        }
        for (int ring = 1; ring <= sizes[4]; ring++)
            for (int look = 0; look < LOOKS; look++) {
                const int k = best->point[best->best][0], l = best->point[best->best][1];
                for (int way = 0; way < 8; way++) {
                    const int at[2] = {k + ways[way][0] * radius[ring], l + ways[way][1] * radius[ring]};
                    int is_known = 0;
                    for (int i = 0; i < best->count; i++)
                        is_known |= 2 * abs(best->point[i][0] - at[0]) <= radius[ring] && 2 * abs(best->point[i][1] - at[1]) <= radius[ring];
                    if (!is_known) visit(w, &t, r, up, at[0], at[1], best);
                }
                go_up(w, &t, r, up, 1.5 * radius[ring], -INFINITY, best);
                if (!(best->height[best->best] > highest + gain)) break;
                highest = best->height[best->best];
            }
        for (int wheel = 0; wheel < 2; wheel++) top[2 * group + wheel] = best->point[best->best][wheel];
    }
    for (int k = 0; k < 2; k++) free_aligned(both[k].point), free_aligned(both[k].height), free_aligned(both[k].is_bound);
    return enough ? w->states - before : -1;
}

/* Factor a matrix U'U in place, of which the upper half is given; the diagonal of U is inverted. 0 where it is singular. */
static int factor(int n, double *U) {
    for (int k = 0; k < n; k++) {
        double *row = U + (size_t)k * n;
        if (!(row[k] > 0)) return 0;
        row[k] = 1 / sqrt(row[k]);
        for (int j = k + 1; j < n; j++) row[j] *= row[k];
        for (int i = k + 1; i < n; i++) add_multiple(n - i, -row[i], row + i, U + (size_t)i * n + i);
    }
    return 1;
}

/* Solve U' x = b in place, and U x = b. */
static void forward(int n, const double *U, double *x) {
    for (int k = 0; k < n; k++) {
        x[k] *= U[(size_t)k * n + k];
        add_multiple(n - k - 1, -x[k], U + (size_t)k * n + k + 1, x + k + 1);
    }
}

static void backward(int n, const double *U, double *x) {
    for (int k = n - 1; k >= 0; k--)
        x[k] = (x[k] - product(n - k - 1, U + (size_t)k * n + k + 1, x + k + 1, NULL)) * U[(size_t)k * n + k];
}

/* Solve S x = b by elimination, S (n, n) symmetric and not negative; 0 where a pivot is nothing beside what it was. */
static int eliminate(int n, double *S, double *b) {
    double before[FREEDOMS];
    for (int i = 0; i < n; i++) before[i] = S[i * n + i];
    for (int k = 0; k < n; k++) {
        if (!(S[k * n + k] > 1e-13 * before[k])) return 0;
        for (int i = k + 1; i < n; i++) {
            const double factor = S[i * n + k] / S[k * n + k];
            for (int j = k; j < n; j++) S[i * n + j] -= factor * S[k * n + j];
            b[i] -= factor * b[k];
        }
    }
    for (int k = n - 1; k >= 0; k--) {
        for (int j = k + 1; j < n; j++) b[k] -= S[k * n + j] * b[j];
        b[k] /= S[k * n + k];
    }
    return 1;
}

/* One state by sets of candidates that change sides until none has to (solve_near of near.py, which is the same in
 * numpy). M candidates at m places, the first of each in first (m + 1); all in the programme's units. contact (M) is where
 * it starts from and what it ends with. Steps it took, 0 where it gives up. */
int walk_near(int M, int m, int rows, const double *H, const double *local, const int32_t *first, const double *A,
              const double *gaps, const double *right, double soft, int steps, uint8_t *contact, double *forces,
              double *duals) {
    double *memory = bare_room((size_t)m * m + (size_t)m * (7 + rows), sizeof(double));
    int *inside = bare_room(m, sizeof(int)), taken = 0, patience = PATIENCE, fewest = M + 1;
    if (!memory || !inside || rows > FREEDOMS) goto done;
    double *U = memory, *closing = U + (size_t)m * m, *series = closing + m, *offset = series + m, *wanted = offset + m;
    double *F = wanted + m, *rest = F + m, *scratch = rest + m, *Y = scratch + m;
    for (int step = 1; step <= steps; step++) {
        int n = 0;
        for (int r = 0; r < m; r++) { /* candidates in contact at a place are springs side by side */
            double stiffness = 0, apart = 0;
            for (int i = first[r]; i < first[r + 1]; i++)
                if (contact[i]) stiffness += 1 / local[i], apart += (gaps[i] - gaps[first[r]]) / local[i];
            if (stiffness == 0) continue;
            inside[n] = r, series[n] = 1 / stiffness, offset[n] = apart / stiffness;
            wanted[n] = -gaps[first[r]] - offset[n];
            n++;
        }
        for (int i = 0; i < n; i++) {
            const double *from = H + (size_t)inside[i] * m;
            for (int j = i; j < n; j++) U[(size_t)i * n + j] = from[inside[j]];
            U[(size_t)i * n + i] += series[i];
        }
        if (!factor(n, U)) goto done;
        double S[FREEDOMS * FREEDOMS], kept[FREEDOMS * FREEDOMS] = {0}, lambda[FREEDOMS] = {0}, change[FREEDOMS] = {0};
        for (int f = 0; f < rows; f++) {
            double *y = Y + (size_t)f * m;
            for (int i = 0; i < n; i++) y[i] = A[(size_t)f * m + inside[i]];
            forward(n, U, y);
            for (int g = 0; g <= f; g++) kept[f * rows + g] = kept[g * rows + f] = product(n, y, Y + (size_t)g * m, NULL);
        }
        memcpy(S, kept, sizeof S);
        const double spring = eliminate(rows, S, change) ? 0.0 : soft; /* where no contact holds the parts: until some does */
        for (int f = 0; f < rows; f++) kept[f * rows + f] += spring;
        memset(F, 0, sizeof(double) * n);
        memset(closing, 0, sizeof(double) * m);
        int moved = 0, last = 0;
        for (int round = 0; round < 2 && !moved; round++) { /* solved, and refined where no candidate changes sides */
            for (int i = 0; i < n; i++) scratch[i] = rest[i] = wanted[i] - closing[inside[i]] - series[i] * F[i];
            forward(n, U, scratch);
            for (int f = 0; f < rows; f++) {
                change[f] = product(n, Y + (size_t)f * m, scratch, NULL) - right[f] - spring * lambda[f];
                for (int i = 0; i < n; i++) change[f] += A[(size_t)f * m + inside[i]] * F[i];
            }
            memcpy(S, kept, sizeof S);
            if (!eliminate(rows, S, change)) goto done;
            for (int f = 0; f < rows; f++) {
                lambda[f] += change[f];
                for (int i = 0; i < n; i++) rest[i] -= A[(size_t)f * m + inside[i]] * change[f];
            }
            forward(n, U, rest);
            backward(n, U, rest);
            for (int i = 0; i < n; i++) F[i] += rest[i];
            memset(closing, 0, sizeof(double) * m);
            for (int i = 0; i < n; i++) add_multiple(m, F[i], H + (size_t)inside[i] * m, closing);
            for (int f = 0; f < rows; f++) add_multiple(m, lambda[f], A + (size_t)f * m, closing);
            moved = 0;
            for (int r = 0, k = 0; r < m; r++) {
                const int loaded = k < n && inside[k] == r;
                const double approach = loaded ? F[k] * series[k] + offset[k] : 0.0;
                k += loaded;
                if (!isfinite(closing[r]) || !isfinite(approach)) goto done;
                for (int i = first[r]; i < first[r + 1]; i++) {
                    forces[i] = contact[i] ? (approach - (gaps[i] - gaps[first[r]])) / local[i] : 0.0;
                    if (contact[i] ? forces[i] < -ZERO : gaps[i] + closing[r] < -ZERO) moved++, last = i, contact[i] |= CHANGES;
                }
            }
        }
        patience = moved < fewest || spring > 0 ? PATIENCE : patience - 1;
        fewest = moved < fewest || spring > 0 ? moved : fewest;
        for (int i = 0; i < M; i++)
            contact[i] = (contact[i] & 1) ^ (contact[i] & CHANGES && (patience >= 0 || i == last) ? 1 : 0);
        if (spring == 0 && !moved) {
            for (int i = 0; i < M; i++) forces[i] = forces[i] > 0 ? forces[i] : 0.0;
            memcpy(duals, lambda, sizeof(double) * rows);
            taken = step;
            break;
        }
    }
done:
    free_aligned(memory);
    free_aligned(inside);
    return taken;
}

/* Values of a table over four axes at points between its own, straight from one to the next, NaN beyond its ends.
 * table (shape, width): at each point a value and its slopes by width - 1 factors; places (points, 4) along the axes;
 * factors (points, width - 1). */
void walk_read(long points, int width, const int32_t *shape, const double *table, const double *places,
               const double *factors, double *values) {
    size_t step[4] = {0, 0, 0, width};
    for (int k = 3; k > 0; k--) step[k - 1] = step[k] * shape[k];
    for (long i = 0; i < points; i++) {
        const double *cell = table, *by = factors + (size_t)i * (width - 1);
        double share[4], sum = 0;
        for (int k = 0; k < 4; k++) {
            const double place = places[4 * i + k];
            if (!(place >= 0 && place <= shape[k] - 1)) sum = NAN;
            const int below = place >= 0 && place < shape[k] - 1 ? (int)place : shape[k] - 2;
            share[k] = place - below;
            cell += below * step[k];
        }
        for (int corner = 0; corner < 16 && !isnan(sum); corner++) {
            const double *at = cell;
            double weight = 1;
            for (int k = 0; k < 4; k++) {
                const int ahead = corner >> k & 1;
                weight *= ahead ? share[k] : 1 - share[k];
                at += ahead ? step[k] : 0;
            }
            if (weight != 0) sum += weight * (at[0] + product(width - 1, at + 1, by, NULL));
        }
        values[i] = sum;
    }
}

#if defined(__x86_64__)
/* Whether bits are all set in a word of the processor's answer. */
static int all(unsigned word, unsigned bits) { return (word & bits) == bits; }
#endif

/* The instruction set of this machine: 4 AVX-512, 3 AVX2, 1 any other. The processor is asked itself: what compilers
 * have for it (__builtin_cpu_supports) says no to everything where zig links. */
int walk_level(void) {
#if defined(__x86_64__)
    unsigned a, b, c, d, saved = 0;
    if (!__get_cpuid(1, &a, &b, &c, &d) || !all(c, bit_OSXSAVE | bit_FMA)) return 1;
    __asm__("xgetbv" : "=a"(saved), "=d"(d) : "c"(0)); /* registers that the system keeps */
    if (!all(saved, 0x06) || !__get_cpuid_count(7, 0, &a, &b, &c, &d) || !all(b, bit_AVX2 | bit_BMI2)) return 1;
    return all(saved, 0xe6) && all(b, bit_AVX512F | bit_AVX512DQ | bit_AVX512CD | bit_AVX512BW | bit_AVX512VL) ? 4 : 3;
#endif
    return 1;
}

/* SHA-256 of the source that this was compiled from, so that an old one is not taken for it. */
const char *walk_source(void) { return WALK_SOURCE; }
