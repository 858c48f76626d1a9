# SPDX-License-Identifier: MIT
"""Degradation of the modulus with counted cycles: Idriss, Dobry and Singh (1978), ASTM E1049."""

import io
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fenics_hytf.soil import (
    CyclicState,
    DegradationLaw,
    continue_count,
    open_cycles,
)

LAW = DegradationLaw()
ASTM = [-2, 1, -3, 5, -1, 3, -4, 4, -2]  # E1049-85, figure 6

# whole numbers, so that ranges are equal often; and what is not
HISTORY = st.lists(st.one_of(st.integers(-4, 4).map(float), st.floats(-4, 4)), min_size=1)
CUTS = st.lists(st.integers(1, 50), max_size=5)


def pieces(history, cuts):
    return [piece for piece in np.split(np.asarray(history), sorted(cuts)) if piece.size]


def listed(cycles, above=0.0):
    both = zip(cycles.amplitude.tolist(), cycles.count.tolist(), strict=True)
    return [(amplitude, count) for amplitude, count in both if 2 * amplitude > above]


def counted(history):
    """Cycles of a whole history, what is open at its end as half cycles."""
    closed, residue = continue_count(history)
    return listed(closed) + listed(open_cycles(residue))


def index_after(history):
    """The index after a whole history, one cycle after the other."""
    index = 1.0
    for amplitude, count in counted(history):
        index = LAW.degrade(index, amplitude, count)
    return index


def in_pieces(history, cuts, smallest=0.0):
    found, residue = [], ()
    for piece in pieces(history, cuts):
        cycles, residue = continue_count(piece, residue, smallest)
        found += listed(cycles)
    return found, residue


def shaking(num_cells, num_samples=400, amplitude=5e-3, seed=0):
    rng = np.random.default_rng(seed)
    time = np.arange(num_samples) / 100
    waves = [
        np.sin(2 * np.pi * (f * time + rng.uniform(size=(num_cells, 1)))) for f in (0.7, 1.9, 3.7)
    ]
    return amplitude * sum(waves) / 3


def test_parameter_takes_strains_as_ratios():
    # by hand: 0.075 (1 % - 0.1 %)^0.495 with strains in percent
    assert LAW.parameter(0.01) == pytest.approx(0.075 * 0.9**0.495, rel=1e-14)
    assert LAW.parameter([0.0, 5e-4, 1e-3]).tolist() == [0.0, 0.0, 0.0]
    assert DegradationLaw(threshold=2e-4, s=0.1, r=1.0).parameter(52e-4) == pytest.approx(0.05)


@pytest.mark.parametrize("num", [1, 2, 10, 1000])
def test_the_index_of_uniform_cycles_is_that_of_the_definition(num):
    # the modulus in cycle N over that in cycle 1: N - 1 cycles lie before it
    t = float(LAW.parameter(0.02))
    assert LAW.degrade(1.0, 0.02, num - 1) == pytest.approx(num**-t, rel=1e-14)
    one_by_one = 1.0
    for _ in range(num - 1):
        one_by_one = LAW.degrade(one_by_one, 0.02)
    assert one_by_one == pytest.approx(num**-t, rel=1e-12)  # a thousand roundings
    halves = LAW.degrade(LAW.degrade(0.9, 0.02, 0.5), 0.02, 0.5)
    assert halves == pytest.approx(LAW.degrade(0.9, 0.02, 1.0), rel=1e-14)


def test_other_amplitudes_go_on_from_the_equivalent_number_of_cycles():
    # by hand: nine cycles of 0.5 %, then four of 2 %
    t1, t2 = (float(LAW.parameter(strain)) for strain in (0.005, 0.02))
    index = 10**-t1
    equivalent = index ** (-1 / t2)
    assert 1 < equivalent < 10  # few cycles of the larger strain do the same
    expected = (equivalent + 4) ** -t2
    found = LAW.degrade(LAW.degrade(1.0, 0.005, 9), 0.02, 4)
    assert found == pytest.approx(expected, rel=1e-13)


@given(
    st.floats(0.1, 1.0),
    st.floats(0.0, 1e3),
    st.floats(0.0, 1e9),
    st.builds(DegradationLaw, st.floats(1e-9, 0.09), st.floats(1e-9, 1e3), st.floats(1e-3, 9.0)),
)
def test_the_index_never_rises_and_has_a_floor(index, amplitude, cycles, law):
    after = float(law.degrade(index, amplitude, cycles))
    assert law.minimum <= after <= index
    if amplitude <= law.threshold or cycles == 0.0:
        assert after == index
    assert law.degrade(index, amplitude, 2 * cycles) <= after * (1 + 1e-12)


def test_the_floor():
    # 2e4 cycles of 10 % strain
    assert LAW.degrade(1.0, 0.1, 1e4) > 0.1
    assert LAW.degrade(1.0, 0.1, 2e4) == 0.1
    assert DegradationLaw(minimum=0.5).degrade(1.0, 0.1, 1e4) == 0.5


def test_arrays_go_together():
    found = LAW.degrade([1.0, 0.8], [[0.01], [5e-4]], 3)
    assert found.shape == (2, 2)
    assert found[1].tolist() == [1.0, 0.8]
    assert found[0, 1] == LAW.degrade(0.8, 0.01, 3)


def test_counting_gives_the_table_of_the_standard():
    table = {}
    for amplitude, count in counted(ASTM):
        table[2 * amplitude] = table.get(2 * amplitude, 0.0) + count
    assert table == {3.0: 0.5, 4.0: 1.5, 6.0: 0.5, 8.0: 1.0, 9.0: 0.5}


def test_a_cycle_that_a_lapse_cuts_is_complete_in_a_later_one():
    # 0.5, 0.1 and back: closed in the piece after that in which it began
    first, residue = continue_count([0.0, 2.0, 1.0])
    assert not first.count.size and residue.tolist() == [0.0, 2.0, 1.0]
    second, residue = continue_count([0.0, -1.0, 0.5], residue)
    assert listed(second) == [(1.0, 0.5)]  # 0 to 2, as 2 to -1 is larger
    assert residue.tolist() == [2.0, -1.0, 0.5]
    third, residue = continue_count([0.1, 1.0, 3.0], residue)
    assert listed(third) == [(0.2, 1.0), (1.5, 0.5)]
    assert residue.tolist() == [-1.0, 3.0]
    assert listed(open_cycles(residue)) == [(2.0, 0.5)]


@given(HISTORY, CUTS)
def test_counting_in_pieces_is_counting_at_once(history, cuts):
    whole, residue = continue_count(history)
    found, left = in_pieces(history, cuts)
    assert found == listed(whole)
    assert left.tolist() == residue.tolist()
    assert left[-1] == history[-1]
    assert np.all(np.diff(np.abs(np.diff(left))) < 0.0)
    assert counted(history) == found + listed(open_cycles(left))


@given(HISTORY, CUTS, st.floats(0.0, 8.0))
def test_what_is_left_out_of_the_residue_is_small(history, cuts, smallest):
    whole, residue = continue_count(history)
    found, left = in_pieces(history, cuts, smallest)
    assert [cycle for cycle in found if 2 * cycle[0] > smallest] == listed(whole, smallest)
    assert listed(open_cycles(left), smallest) == listed(open_cycles(residue), smallest)
    assert np.sum(np.abs(np.diff(left)) <= smallest) <= 1


def test_a_history_of_uniform_cycles():
    t = float(LAW.parameter(0.01))
    history = np.tile([0.01, -0.01], 7)  # thirteen half cycles
    assert index_after(history) == pytest.approx(7.5**-t, rel=1e-13)
    # and the offset of a strain that stays does not matter
    assert index_after(history + 0.5) == pytest.approx(7.5**-t, rel=1e-12)


def test_lapses_go_on_where_the_last_one_ended():
    history = shaking(6)
    history[4:] *= 0.1  # these never leave the threshold
    state = CyclicState.undegraded(6)
    for piece in np.split(history, [50, 51, 130, 333], axis=1):
        before, state = state, LAW.after_lapse(state, piece)
        assert np.all(state.index <= before.index) and np.all(state.index <= state.settled)
        with io.BytesIO() as file:  # as through a checkpoint
            np.savez(file, **vars(state))
            file.seek(0)
            state = CyclicState(**np.load(file))
    at_once = LAW.after_lapse(CyclicState.undegraded(6), history)
    assert np.array_equal(state.settled, at_once.settled)
    assert state.index == pytest.approx(at_once.index, rel=1e-13)
    each = [index_after(strain) for strain in history]
    assert at_once.index == pytest.approx(each, rel=1e-13)
    assert np.all(state.index[:4] < 0.97) and np.all(state.index[4:] == 1.0)
    assert state.turning_points.shape[1] < 10


def test_large_cycles_that_build_up_from_small_pieces_are_counted():
    # no piece has a range of twice the threshold; together they are two cycles of 0.4 %
    there = np.linspace(-4e-3, 4e-3, 41)
    history = np.concatenate([there, there[-2::-1], there[1:], there[-2::-1]])
    state = CyclicState.undegraded(1)
    for piece in np.array_split(history, 40):
        assert np.ptp(piece) < 2e-3
        state = LAW.after_lapse(state, piece[None])
    expected = 3.0 ** -float(LAW.parameter(4e-3))  # four half cycles
    assert state.index[0] == pytest.approx(expected, rel=1e-13)


def test_some_cells_do_not_degrade():
    degrades = np.array([True, False, True])
    state = LAW.after_lapse(CyclicState.undegraded(3), shaking(3), degrades)
    assert (state.index < 1.0).tolist() == degrades.tolist()
    assert np.isnan(state.turning_points[1]).all()


def test_no_cells():
    state = LAW.after_lapse(CyclicState.undegraded(0), np.empty((0, 5)))
    assert state.index.shape == (0,) and state.turning_points.shape == (0, 0)


def test_without_the_library_only_what_needs_it_fails(monkeypatch):
    monkeypatch.setitem(sys.modules, "rainflow", None)
    quiet = shaking(2, amplitude=5e-4)
    assert LAW.after_lapse(CyclicState.undegraded(2), quiet).index.tolist() == [1.0, 1.0]
    with pytest.raises(ImportError, match=r"found no package rainflow; .*'pip install rainflow'"):
        LAW.after_lapse(CyclicState.undegraded(2), shaking(2))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"threshold": 0.0}, "threshold: found 0.0; expected a shear strain above 0 and below 0.1"),
        ({"threshold": 0.1}, "threshold: found 0.1; .* not in percent"),
        ({"s": -1.0}, "s: found -1.0; expected a positive number"),
        ({"r": np.inf}, "r: found inf; expected a positive number"),
        ({"minimum": 1.0}, "minimum: found 1.0; expected a number between 0 and 1"),
        ({"minimum": np.nan}, "minimum: found nan"),
    ],
)
def test_parameters_out_of_range(values, message):
    with pytest.raises(ValueError, match=f"^degradation.{message}"):
        DegradationLaw(**values)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([1.0, 0.05], 0.01, 1), "index: found 0.05; expected numbers from 0.1 to 1"),
        ((1.5, 0.01, 1), "index: found 1.5"),
        ((1.0, [0.01, np.nan], 1), "amplitude: found nan; expected strains not below 0"),
        ((1.0, 0.01, -1), "cycles: found -1.0; expected numbers not below 0"),
    ],
)
def test_values_out_of_range(arguments, message):
    with pytest.raises(ValueError, match=f"^degradation.{message}"):
        LAW.degrade(*arguments)


@pytest.mark.parametrize(
    ("history", "message"),
    [
        ([], r"found shape \(0,\); expected \(num_samples,\)"),
        ([[0.0]], r"found shape \(1, 1\)"),
        ([0.0, np.nan], r"found nan at \(1,\); expected finite strains"),
    ],
)
def test_histories_that_cannot_be_counted(history, message):
    with pytest.raises(ValueError, match=f"^history: {message}"):
        continue_count(history)


def test_a_history_of_other_cells():
    with pytest.raises(ValueError, match=r"^history: found 3 cells; expected 2"):
        LAW.after_lapse(CyclicState.undegraded(2), shaking(3))
