# SPDX-License-Identifier: MIT
"""What has slipped, at the samples of a record of longer steps than the march's."""

import numpy as np
import pytest

from fenics_hytf.lapse import Slipped
from fenics_hytf.motion import SlipHistory


def slipped(acceleration, substeps):
    """A lapse with no more to it than a history of λ̈."""
    history = SlipHistory(0 * acceleration, 0 * acceleration, acceleration)
    fields = dict.fromkeys(Slipped.__dataclass_fields__)
    return Slipped(**fields | {"history": history, "substeps": substeps})


@pytest.mark.parametrize("substeps", [1, 2, 5])
def test_a_steady_acceleration_is_what_it_is(substeps):
    acceleration = np.ones(8 * substeps + 1)
    acceleration[0] = 0.5  # the march takes half of what is there at its first step
    found = slipped(acceleration, substeps).at_samples(2)
    np.testing.assert_allclose(found, np.ones(8), rtol=1e-14)


@pytest.mark.parametrize("step", range(9, 21))
def test_a_step_of_the_march_is_shared_by_the_samples_about_it(step):
    """The impulse is kept, and so is the instant where it is: a mean weighed by 1 − |t|/dt."""
    acceleration = np.zeros(33)
    acceleration[step] = 1.0
    found = slipped(acceleration, 4).at_samples(2)
    assert found.sum() == pytest.approx(1 / 4, rel=1e-14)
    assert found @ np.arange(8) / found.sum() == pytest.approx(step / 4, rel=1e-14)
    assert np.count_nonzero(found) == (1 if step % 4 == 0 else 2)
