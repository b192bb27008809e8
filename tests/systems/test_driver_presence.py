"""A driver is present while engaged and heard from."""

import numpy as np
import pytest

from drake_shared.systems.driver_presence import DriverPresence


@pytest.mark.parametrize(
    ("age", "engaged", "present"),
    [(0.0, 1.0, 1.0), (0.15, 1.0, 1.0), (0.16, 1.0, 0.0), (0.0, 0.0, 0.0), (np.nan, 1.0, 0.0)],
)
def test_presence_needs_engagement_and_a_fresh_sample(age, engaged, present):
    presence = DriverPresence(timeout=0.15)
    context = presence.CreateDefaultContext()
    presence.get_input_port().FixValue(context, [10.0, -20.0, age, 0.5, 0.0, engaged])
    assert presence.get_output_port().Eval(context)[0] == present


@pytest.mark.parametrize("timeout", [0.0, -1.0, np.nan, np.inf])
def test_the_timeout_must_be_positive_and_finite(timeout):
    with pytest.raises(ValueError, match="timeout"):
        DriverPresence(timeout=timeout)
