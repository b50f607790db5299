"""Bounds on searches: how often, how many and how much at once, for every client.

They spare time and memory, or ask for no more than anybody reads. A search that ends at a bound reports it, or finds the same with twice the bound.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Bounds:
    """Numbers of a search, by what they count."""

    rounds: int = 12
    """Times that hypotheses, noise and looks may settle against each other."""

    looks: int = 15
    """Scans of the residual, one beside what the other brought, at the most."""

    seeds: int = 3
    """Most probable hypotheses that are looked at again after each change."""

    grown: int = 40
    """Causes that are taken in one after the other before the search begins, at the most."""

    placed: int = 3
    """Times that what was looked for is moved to better places in the noise that is left, at the most."""

    places: int = 17
    """Values between the neighbours of a point of a grid that are tried, and again between the neighbours of the best
    of these: a place is known to a sixty-fourth of the way to the next point, less than a row where points lie
    sixty rows apart. With 9 and 33 the dead times of `tests/inference/test_memory.py` are within 3 u of the truth
    as well."""

    steps: int = 3
    """Times that the nonlinear parameters of a law are improved, and amplitudes to which its effect is not
    proportional."""

    expanded_of_table: int = 8
    """Hypotheses whose neighbours are looked at in a search, at the most: a table may have dozens of members, each
    with neighbours."""

    expanded: int = 40
    """Hypotheses whose neighbours are looked at, at the most."""

    paired_hypotheses: int = 3
    """Best pairs of named causes that are looked at together."""

    paired: int = 60
    """Named causes of which all pairs are looked at, at the most: those that are worth most alone."""

    sweeps: int = 2
    """Times that every member is given the variant and size that suit it best beside the others."""

    scores: int = 20_000
    """First scores that are kept before those that became negligible meanwhile are dropped."""

    many: int = 6
    """Members from which on their sizes are settled all at once where each has one form only: one inversion for all of
    them."""

    replaced: int = 28
    """Pairs of members in the place of which one cause is tried, at the most: all pairs of eight members, which is as
    many as sessions have that the list explains. Of more members those pairs are taken that are worth least: what
    is worth much, another cause seldom does as well."""

    members: int = 12
    """Causes of a hypothesis at the most: it grows no further. Sessions that the list explains have at most 8."""

    alternatives: int = 6
    """Causes that may stand for each other in one ambiguity, at the most; more explain nothing to anybody."""

    rivals: int = 3
    """Causes in the place of each member that are laid out at their own best values before they are compared."""

    noise_draws: int = 4
    """Draws of white noise from which it is seen how much of the noise a model takes out."""

    noise_rounds: int = 8
    """Times that the noise is measured, each time beside what the last level lets in."""

    frequencies: int = 4096
    """Frequencies of a spectrum from which predictions are worked out: a line of one in a thousand rows keeps its
    height."""

    detectable_draws: int = 100
    """Random effects that are asked about: the share found is known to 3 %."""

    variables_of_class: int = 5
    """Variables of a class at the most: one of more says nothing to anybody."""

    candidates: int = 12
    """Causes that are scored in one place: worse ones by evidence of all rows predict no better."""

    locations: int = 12
    """Places of a misfit that are listed, the largest first."""

    strongest: int = 2
    """Forms of each kind over each variable that are kept."""

    strongest_coloured: int = 6
    """Forms of each kind over each variable that are kept where noise is not white: a first look does not know there
    how much of each form whitening leaves."""

    pieces: int = 2048
    """Pieces of a variable, at the most."""

    cycles: int = 400
    """Periods over the range of a variable, at the most."""

    step_places: int = 40
    """Places where a step is looked for."""

    memory_lengths: int = 10
    """Time constants, and dead times, that are tried at first. Each is then moved to where it fits best."""

    memory_starts: int = 5
    """Runs that have a start each. Of more, all are taken to begin alike: a law has no more columns than it has use
    for."""

    selection_draws: int = 20
    """Draws: a frequency of one half is known to a tenth."""

    selection_columns: int = 128
    """Columns that are laid out at once: all of them would take as much memory as columns and blocks once more."""

    pieces_of_time: int = 4096
    """Pieces of rows that a stretch may begin and end at, at the most, in the first look."""

    stretches: int = 40
    """Stretches in one look, at the most."""

    ends_moved: int = 3
    """Times that either end of the best window is moved to where it is best."""

    stretches_at_once: int = 4096
    """Windows whose columns are held in memory at once."""

    lengths_per_octave: int = 2
    """Lengths that are tried from one to twice its length."""

    sums_at_once: int = 32
    """Directions of the base whose transforms are held at once: a hundred megabytes with all of a joint fit."""

    slab: int = 512
    """Rows that are made a triangle at once: with 32 columns 128 kB, which stay in a core's cache."""

    tail_rounds: int = 12
    """Times that weights and scale are settled against each other."""

    room: int = 4096
    """Columns of causes for which room is made: thirty circles have 1100 to 1500, and some 2200 where causes are laid
    out anew several times. More would be copied, and a copy holds all of them twice for a moment: 0.4 GB at 25,000
    samples."""

    found_again: int = 6
    """Named causes of the greatest evidence that compete in each draw of a part of the tests."""

    steps_of_rivals: int = 2
    """Times that the nonlinear parameters of a rival are improved."""

    proposed: int = 3
    """Further tests that are proposed, at the most."""

    closer_look: int = 12
    """Proposals that are looked at in both directions each time that one is chosen."""

    made_finer: int = 6
    """Waves of a grid that are looked at more finely: one that falls between two points of the grid loses a fifth
    there, and the side lobes of gaps between runs may stand out more."""

    pieces_of_travel: int = 8192
    """Pieces of time or travel on circles, at the most."""

    waves_at_once: int = 200
    """Waves of a drive whose power is worked out at once."""

    looked_at: int = 60
    """Hypotheses, most probable first, that are asked whether they can be."""

    likely_sets: int = 12
    """Hypotheses, most probable first, that may count for an uncertainty."""

    challenged: int = 6
    """Terms that are each tried as the first of a pair, at the most: those that do best alone."""

    starts: int = 12
    """Places that a fit from several starts looks at, spread evenly over what the parameters may be [Sobol]; the best
    are gone on from."""

    gone_on: int = 3
    """Starts that are gone on from; that which the model states is one of them."""

    fit_steps: int = 40
    """Steps of a fit at the most."""

    refits: int = 4
    """Refits of the same terms in noise found anew, at the most."""

    noises: int = 4
    """Refits with the same terms, each in the noise that the one before leaves, at the most."""

    separations: int = 3
    """Pairs that proposals are made for, at the most."""

    repeats: int = 1000
    """Repeats from which on they are no proposal."""

    answer_lengths: int = 5
    """Time constants, widths and places that answers are taken at, at the most; between them they are interpolated."""

    derivative_rounds: int = 8
    """Times that a dose may be changed until its answer has the right size."""

    fold_rows: int = 3000
    """Rows that a selection for a held-out part is made from, at the most, evenly spaced: fewer rows can only make its
    error larger."""

    work: float = 2e6
    """Work of all searches over all rows [`SearchWork`]: half a minute of one processor. 1,200 rows of a damper
    end at it."""

    work_without: float = 2e5
    """Work of a search without one held-out part, so that ten of these cost as much as all rows."""

    measurements: int = 4
    """Suggestions, at the most."""

    rows_apart: float = 0.1
    """Share of all rows up to which some are whitened by themselves: of 3,500 rows with 6 rows before each in a prediction 200 take 20 µs, where all
    take 26 µs; 400 take 30 µs. Of 6,000 rows with 40 before each 400 take 104 µs, all 168 µs, and 800 take 201 µs. It decides about time alone."""

    columns_at_first: int = 512
    """Columns that have room at first, if their number is unknown."""

    columns_apart: float = 0.5
    """Share of all columns up to which some are worked out by themselves."""

    mirrored_at_once: int = 256
    """Columns that are mirrored at once: half a megabyte on the diagonal."""

    group_work: float = 1e6
    """Multiplications, rows times columns squared, below which looking for groups takes longer than it saves: less than a millisecond."""

    samples_at_once: int = 2048
    """Samples whose waves are made at once: half a megabyte."""

    spectrum_rounds: int = 6
    """Times that floor and height of a spectrum are fitted to the weights that they give themselves."""

    spectra_at: int = 65
    """Frequencies at which spectra are compared."""

    pulses: int = 120
    """Stretches of a turn that a pulse is looked for in: three degrees each."""

    waves_of_drive: int = 4000
    """Waves over the position that are looked for, at the most."""

    friction_points: int = 81
    """Places of the friction curve that is drawn."""

    notes_of_stuck: int = 3
    """Most stretches of a stuck force that a message lists."""

    trace_points: int = 360
    """Points of a trace: means of a degree."""

    proposed_samples: int = 180
    """Samples of a test that is only thought of: every two degrees."""

    workspace_steps: int = 5
    """Places along each axis."""

    common_angles: int = 180
    """Common angles per turn at the most: every two degrees, so that 30 undulations per turn are well seen."""

    samples_of_angle: int = 8
    """Samples in a sector at which a cause is asked for, at the most, and averaged: readings are averages too, and what happens at a
    reversal is over in less than a sector."""

    line_of_values: int = 160
    """Characters of values that a line holds; there is more with `--json`."""

    samples_per_turn: int = 720
    """Samples per turn that a diagnosis works on, at the most: every half degree."""

    curve_pieces: int = 14
    """Pieces of a variable's range over which readings are averaged."""

    samples_per_sector: int = 2
    """Samples per sector of a turn, at the least: sectors with fewer are made wider."""

    power_stretches: int = 16
    """Stretches of all samples that the scatter of the power is read from."""

    arcs_told: int = 36
    """Arcs of a turn, each with its mean difference: ten degrees each."""


BOUNDS = Bounds()
"""Of a table, and of what all clients have in common."""

CIRCLES = Bounds(rounds=10)
"""Rounds of circles are those of hypotheses and joint fit."""

DRIVES = Bounds(rounds=6, expanded_of_table=4, looks=2)
"""Each round of a drive refuses something impossible and compares all again. Its causes are few, and each look for pulses takes
dozens of them: where more are left, it is the law that is wrong."""

SIMULATORS = Bounds(rounds=20)
"""In each round a term is put in, taken out or refuted, or everything is refitted."""
