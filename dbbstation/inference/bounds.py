"""Limits of searches for every client.

The limits save time, memory or output. A search that ends at a limit reports it, or finds the same with twice the limit.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Bounds:
    """Limits of a search."""

    rounds: int = 12
    """Most iterations of hypotheses, noise and scans."""

    looks: int = 15
    """Most successive scans of the residual."""

    seeds: int = 3
    """Most probable hypotheses that are examined again after each change."""

    grown: int = 40
    """Most causes that are added greedily before the search."""

    placed: int = 3
    """Most optimisations of places of found features in the remaining noise."""

    places: int = 17
    """Tried values between the neighbours of a grid point, then between the neighbours of the best of these: a place is
    found to a sixty-fourth of the spacing, less than a row for points sixty rows apart. With 9 and 33 the dead times of
    `tests/inference/test_memory.py` are also within 3 u of the truth."""

    steps: int = 3
    """Iterations of a law's nonlinear parameters, and of amplitudes with nonlinear effects."""

    expanded_of_table: int = 8
    """Most hypotheses whose neighbours are examined in a table's search: a table may have dozens of members."""

    expanded: int = 40
    """Most hypotheses whose neighbours are examined."""

    paired_hypotheses: int = 3
    """Best pairs of named causes that are examined as hypotheses."""

    paired: int = 60
    """Most named causes of which all pairs are scored: the best single ones."""

    sweeps: int = 2
    """Sweeps that optimise every member's variant and size, given the others."""

    scores: int = 20_000
    """First scores that are stored before negligible ones are discarded."""

    many: int = 6
    """Fewest members whose sizes are optimised together by one inversion, if each has a single form."""

    replaced: int = 28
    """Most pairs of members that one cause may replace: all pairs of eight members, the most in explained sessions. Of
    more members the pairs with least evidence are tried, because strong causes are seldom replaced."""

    members: int = 12
    """Most causes of a hypothesis; explained sessions have at most 8."""

    alternatives: int = 6
    """Most causes in one ambiguity; more do not help a reader."""

    rivals: int = 3
    """Rivals of each member that are refined before comparison."""

    noise_draws: int = 4
    """Draws of white noise that determine how much noise a model absorbs."""

    noise_rounds: int = 8
    """Iterations of the noise estimate and the causes that it admits."""

    frequencies: int = 4096
    """Frequencies of a spectrum for computing predictions: a line with a width of one in a thousand rows keeps its
    height."""

    detectable_draws: int = 100
    """Drawn random effects, which determine the found share to 3 %."""

    variables_of_class: int = 5
    """Most variables of a class; a larger class does not help a reader."""

    candidates: int = 12
    """Most causes scored for one class; causes with less evidence predict no better."""

    locations: int = 12
    """Listed places of a misfit, the largest first."""

    strongest: int = 2
    """Kept forms of each kind and variable."""

    strongest_coloured: int = 6
    """Kept forms of each kind and variable in correlated noise, in which the first scan does not know how much of a
    form whitening leaves."""

    pieces: int = 2048
    """Most bins of a variable."""

    cycles: int = 400
    """Most periods over the range of a variable."""

    step_places: int = 40
    """Tried places of a step."""

    memory_lengths: int = 10
    """First tried time constants, and dead times; each is then optimised."""

    memory_starts: int = 5
    """Most runs with separate initial states; more runs share one, to save columns."""

    selection_draws: int = 20
    """Draws of a selection frequency, which determine one half to a tenth."""

    pieces_of_time: int = 4096
    """Most possible starts and ends of a stretch in the first scan."""

    stretches: int = 40
    """Most stretches of one scan."""

    ends_moved: int = 3
    """Optimisations of both ends of the best window."""

    stretches_at_once: int = 4096
    """Windows whose columns are in memory together."""

    lengths_per_octave: int = 2
    """Tried lengths per octave."""

    sums_at_once: int = 32
    """Directions of the base transformed together; all of a joint fit would take a hundred megabytes."""

    slab: int = 512
    """Rows factored together: with 32 columns 128 kB, which fit a core's cache."""

    tail_rounds: int = 12
    """Iterations of weights and scale."""

    room: int = 4096
    """Reserved columns of causes: thirty circles have 1100 to 1500, and up to 2200 if causes are refined several times.
    More would require a copy, which briefly doubles the memory: 0.4 GB at 25,000 samples."""

    found_again: int = 6
    """Named causes with the greatest evidence that compete in each draw of tests."""

    steps_of_rivals: int = 2
    """Iterations of a rival's nonlinear parameters."""

    proposed: int = 3
    """Most proposed tests."""

    closer_look: int = 12
    """Proposals evaluated in both directions for each choice."""

    made_finer: int = 6
    """Waves of a grid that are refined: one between two grid points loses a fifth, and side lobes from gaps between
    runs may be higher."""

    pieces_of_travel: int = 8192
    """Most bins of time or travel on circles."""

    waves_at_once: int = 200
    """Waves of a drive whose power is computed together."""

    looked_at: int = 60
    """Hypotheses, most probable first, that are tested for impossible values."""

    likely_sets: int = 12
    """Hypotheses, most probable first, that may contribute to an uncertainty."""

    challenged: int = 6
    """Most terms tried as the first of a pair: the best single ones."""

    starts: int = 12
    """Tried starting points of a fit, evenly distributed over the parameters [Sobol]; the best are continued."""

    gone_on: int = 3
    """Starts that are continued, the model's values included."""

    fit_steps: int = 40
    """Most steps of a fit."""

    refits: int = 4
    """Most refits of the same terms with re-estimated noise."""

    noises: int = 4
    """Most refits with the same terms, each with the noise of the previous one."""

    separations: int = 3
    """Most pairs with proposals."""

    repeats: int = 1000
    """Most repeats in a proposal."""

    answer_lengths: int = 5
    """Most time constants, widths and places with simulated responses; others are interpolated."""

    derivative_rounds: int = 8
    """Most changes of a dose until its response has the right size."""

    fold_rows: int = 3000
    """Most rows, evenly spaced, for a selection without a held-out part; fewer rows can only increase its error."""

    work: float = 2e6
    """Work of all searches over all rows [`SearchWork`]: half a minute of one processor. 1,200 rows of a damper reach
    it."""

    work_without: float = 2e5
    """Work of a search without one held-out part, so that ten of these cost as much as all rows."""

    measurements: int = 4
    """Most suggestions."""

    rows_apart: float = 0.1
    """Largest share of rows that is whitened separately. Of 3,500 rows with predictions of order 6, 200 rows take 20
    µs, 400 rows 30 µs, all rows 26 µs. Of 6,000 rows with order 40, 400 take 104 µs, 800 take 201 µs, all 168 µs. Only
    the time depends on it."""

    columns_at_first: int = 512
    """Columns reserved at first, if their number is unknown."""

    columns_apart: float = 0.5
    """Largest share of columns that is computed separately."""

    mirrored_at_once: int = 256
    """Columns mirrored together: half a megabyte on the diagonal."""

    group_work: float = 1e6
    """Least work, rows times squared columns, that repays the search for groups: a millisecond."""

    samples_at_once: int = 2048
    """Samples whose waves are computed together: half a megabyte."""

    spectrum_rounds: int = 6
    """Iterations of a spectrum's floor and height with the weights that follow from them."""

    spectra_at: int = 65
    """Frequencies at which spectra are compared."""

    pulses: int = 120
    """Stretches of a turn searched for a pulse: three degrees each."""

    waves_of_drive: int = 4000
    """Most searched waves over position."""

    friction_points: int = 81
    """Points of the drawn friction curve."""

    notes_of_stuck: int = 3
    """Most stretches of a stuck force that a message lists."""

    trace_points: int = 360
    """Points of a trace: means of a degree."""

    proposed_samples: int = 180
    """Samples of a proposed test: every two degrees."""

    workspace_steps: int = 5
    """Places along each axis."""

    common_angles: int = 180
    """Common angles per turn at the most: every two degrees, so that 30 undulations per turn are well seen."""

    samples_of_angle: int = 8
    """Most samples per sector at which a cause's effect is computed and averaged: readings are averages too, and
    effects at reversals are shorter than a sector."""

    line_of_values: int = 160
    """Most characters of values in a line; `--json` contains all."""

    samples_per_turn: int = 720
    """Most samples per turn in a diagnosis: every half degree."""

    curve_pieces: int = 14
    """Pieces of a variable's range over which readings are averaged."""

    samples_per_sector: int = 2
    """Fewest samples per sector of a turn; sectors with fewer are widened."""

    power_stretches: int = 16
    """Stretches of samples for the scatter of the power."""

    arcs_told: int = 36
    """Arcs of a turn with reported mean differences: ten degrees each."""

    amplitudes_alike: int = 3
    """Most amplitudes of an effect that is compared with forms of named causes: a shift in space has three. With 1 a
    bumped jig is ambiguous with a step over time in two of two sessions; with 6 four sessions do not change."""

    noise_settled: float = 0.03
    """Negligible relative change of the noise, about its uncertainty."""

    derivative_step: float = 1e-3
    """Step for the derivative by a nonlinear parameter, in units of its grid spacing."""

    order: int = 60
    """Largest order of a prediction of noise."""

    rows_per_order: int = 5
    """Least rows per coefficient of a prediction; Akaike's corrected criterion requires so many."""

    band_frequencies: int = 6
    """Fewest frequencies in a band of a spectrum."""

    band_ratio: float = 1.2
    """Ratio of the widths of neighbouring bands."""

    rows_of_spectrum: int = 64
    """Fewest rows of a stretch for a spectrum, if such a stretch exists."""

    points_per_wave: int = 8
    """Printed points per wave."""

    points_per_width: int = 3
    """Printed points per width of a bump or step."""

    tails_shown: float = 4.0
    """Widths before and after a bump or step, and decay times of a ringing, that are printed: 2 % of a ringing remain."""

    periods_shown: float = 100.0
    """Most periods printed point by point; of more, only one is printed."""

    harmonics_averaged: int = 9
    """Harmonics over which the remaining share is averaged."""

    harmonics_at_once: int = 16
    """Harmonics per coarse wave: the root of the usual number."""

    lags: int = 201
    """Number of lags of a correlation in samples; longer correlations are structure that a model should name."""

    likely: float = 8.0
    """Largest log odds against a hypothesis, relative to the best, whose neighbours are examined; less likely ones have
    a probability of 3e-4."""

    close: float = 1.0
    """The same limit if only the most probable hypothesis is wanted: clearly less probable ones seldom lead to a better
    neighbour. With 1, 3 and 8 the selections of ten groups of tests in the slowest known session were equal."""

    negligible: float = 40.0
    """Log odds against the best hypothesis above which first scores are discarded to save memory: a million such sets
    have a total probability of 4e-12."""

    rows_per_piece: int = 4
    """Least average rows per bin of a variable; 1 for waves except over time, because four rows can be a wave."""

    pieces_per_wave: int = 4
    """Bins in the shortest wave."""

    flexible: int = 12
    """Fewest amplitudes of a form that can imitate two causes: two per strut."""

    wide: int = 100
    """Fewest amplitudes of a form for which a factorisation for each size takes less time than eigenvectors: 1.2 for 2.8
    ms of 209 amplitudes of a wandering bar, 0.10 for 0.14 ms of 48. Only the time depends on it."""

    memory_rows: float = 2.0
    """Shortest time constant in rows; faster effects are no memory."""

    memory_share: float = 1.0 / 3.0
    """Longest time constant over the longest block; of longer ones only the drift at the start is visible."""

    delay_share: float = 0.1
    """Longest dead time over the longest block; earlier rows contain no information on it."""

    folds: int = 10
    """Largest number of held-out parts; with fewer than `folds.ENOUGH_BLOCKS` blocks the exact number."""

    folds_of_an_error: int = 5
    """Number of groups of tests for the prediction error alone, without a new selection."""

    wave_mm: float = 4.0
    """Shortest searched wave of strut length [mm]."""

    wave_s: float = 3.0
    """Shortest searched wave of time [s]; four bins in recordings too long for it."""

    ringing_s: float = 12.0
    """Longest time of a ringing after a reversal [s]."""

    place_mm: float = 5.0
    """Bins of the platform's position in each coordinate [mm]."""

    samples_of_sharp: int = 4
    """Most samples per sector at which sharp effects are evaluated: a step's share of a sector is known to an eighth."""


BOUNDS = Bounds()
"""Limits for tables, and for all clients."""

CIRCLES = Bounds(rounds=10)
"""For circles, rounds count hypotheses with joint fits."""

DRIVES = Bounds(rounds=6, expanded_of_table=4, looks=2)
"""For drives, each round excludes an impossible hypothesis and compares again. Causes are few, and each scan finds
dozens of pulses; more remain only if a law is wrong."""

SIMULATORS = Bounds(rounds=20)
"""For simulators, each round inserts, removes or refutes a term, or refits all."""
