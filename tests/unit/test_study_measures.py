# SPDX-License-Identifier: MIT
"""Distances of responses, the front, and what is left of a reference that is a run itself."""

import numpy as np
import pytest

from fenics_hytf.motion import response_spectrum
from fenics_hytf.study.measures import DAMPING, PERIODS, Error, Yardstick
from fenics_hytf.study.records import Point, cheapest, pareto
from fenics_hytf.study.runs import Cost

DT = 0.01


@pytest.fixture
def reference():
    noise = np.random.default_rng(1).normal(size=(3, 2, 1000))
    noise[1] *= 10  # a stronger receiver
    noise[2] = 0  # one that stands still
    noise[0, 1] *= 1e-3  # a component that hardly moves
    return noise


def yardstick(reference):
    return Yardstick(reference, DT, ["weak", "strong", "still"])


def test_a_scaled_response_is_as_far_as_it_is_scaled(reference):
    error = yardstick(reference).error(1.05 * reference)
    assert error.relative_l2 == pytest.approx(0.05)
    assert error.ln_psa == pytest.approx(np.log(1.05))


def test_the_worst_receiver_counts_and_is_named(reference):
    response = reference.copy()
    response[0, 0] *= 1.2
    response[1] *= 0.9
    response[2] += 1e-3  # it stands still in the reference: nothing to be relative to
    error = yardstick(reference).error(response)
    assert (error.receiver, error.relative_l2) == ("weak", pytest.approx(0.2, rel=1e-5))
    assert error.ln_psa == pytest.approx(np.log(1.2))


def test_spectra_look_at_components_that_move_only(reference):
    response = reference.copy()
    response[0, 1] *= 2  # a thousandth of the other component
    assert yardstick(reference).error(response).ln_psa == 0
    response[1, 1] *= 2
    assert yardstick(reference).error(response).ln_psa == pytest.approx(np.log(2))


def test_the_ratio_of_spectra_is_that_of_response_spectrum(reference):
    other = reference + 0.1 * np.roll(reference, 7, axis=2)
    one, two = (response_spectrum(x[:2], DT, PERIODS, DAMPING) for x in (reference, other))
    expected = np.abs(np.log(two / one))[[0, 1, 1], [0, 0, 1]].max()
    assert yardstick(reference).error(other).ln_psa == pytest.approx(expected, rel=1e-12)
    assert (PERIODS[0], PERIODS[-1], DAMPING) == (pytest.approx(0.05), pytest.approx(5.0), 0.05)


def test_samples_that_both_have_are_compared(reference):
    measure = yardstick(reference)
    longer = np.pad(reference, ((0, 0), (0, 0), (0, 50)), constant_values=99.0)
    assert measure.error(longer).relative_l2 == 0
    assert measure.error(reference[:, :, :900]).relative_l2 == 0
    assert measure.distance(longer, reference) == 0


def test_products_are_those_of_the_norm(reference):
    measure = yardstick(reference)
    one, other = 0.1 * reference, np.roll(reference, 3, axis=2)
    gram = measure.products([one, other])
    assert gram.shape == (3, 2, 2)
    total = np.sqrt(gram.sum(axis=(1, 2)))
    np.testing.assert_allclose(total, measure.l2_by_receiver(one + other), rtol=1e-12)


def test_a_reference_without_motion_measures_nothing(reference):
    with pytest.raises(ValueError, match="no motion"):
        yardstick(0 * reference)
    reference[0, 0, 0] = np.nan
    with pytest.raises(ValueError, match="not numbers"):
        yardstick(reference)


def point(core_s: float, error: float, doubt: float = 0.0, name: str = "") -> Point:
    cost = Cost(core_s, core_s, 1, 1, 1, 1, 1)
    return Point(name, ("cells",), (), cost, Error(error, 0.0, "top"), doubt=doubt)


def test_the_front_holds_what_none_beats():
    points = [point(3, 0.1), point(1, 0.5), point(2, 0.2), point(2.5, 0.3), point(4, 0.1)]
    failed = Point("failed", (), (), None, None, "why")
    front = pareto([*points, failed])
    assert [(p.cost.core_s, p.error.relative_l2) for p in front] == [(1, 0.5), (2, 0.2), (3, 0.1)]


def test_errors_below_the_references_own_are_all_the_same():
    costs_errors = ((1, 0.1), (2, 0.02), (3, 0.001), (4, 0.05), (5, 1e-4), (6, 0.0))
    points = [point(cost, error, 0.01) for cost, error in costs_errors]
    assert [p.resolved for p in points] == [True, False, False, True, False, False]
    assert [p.cost.core_s for p in pareto(points)] == [1, 2, 3]


def test_the_cheapest_is_within_the_target_with_the_references_error():
    points = [point(1, 0.048, 0.005), point(2, 0.04, 0.005), point(3, 0.001, 0.005)]
    assert cheapest(points, 0.05) is points[1]
    assert cheapest(points, 0.01) is points[2]
    assert cheapest(points, 0.001) is None
