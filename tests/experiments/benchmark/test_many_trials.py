"""The group that measures the memory of many trials."""

from drake_shared.experiments.benchmark import many_trials


def test_quick_run(setup, monkeypatch, check_result):
    monkeypatch.setattr(many_trials, "trials_per_second", lambda *_, **__: (2.0, 1.0))
    result = many_trials.run(setup)
    check_result(result)
    assert result.curves[0].sizes == [10, 20]
    assert all(100.0 < megabytes < 10_000.0 for megabytes in result.details["memory"]["megabytes"])
