"""From the browser's event to MouseInput's state. Its speed is for an idle machine to measure; here nothing
may be lost on the way."""

import pytest

from drake_shared.cockpit.latency import measure_latency

pytestmark = pytest.mark.browser


def test_no_displacement_is_lost_between_the_mouse_and_the_stick(browser_path):
    latency = measure_latency(events=120, rate=60.0, chromium=browser_path)
    assert latency.events == latency.sent == 120
    assert latency.counted == latency.sent
    assert latency.stick == pytest.approx(latency.sent, abs=1e-6)
    assert 0.0 < latency.p50 < latency.p99
