"""The log viewer: what it finds in a folder, what it shows of a trial, and its page in a real browser."""

import dataclasses
import json
import re
import shutil
import threading
import urllib.error
import urllib.request

import numpy as np
import pytest

from drake_shared.analysis.glossary import OF_TRIALS
from drake_shared.analysis.metrics import metrics
from drake_shared.analysis.viewer import Catalogue, Viewer, write_page
from drake_shared.analysis.viewer.details import MOST_POINTS, details
from drake_shared.analysis.viewer.page import MOST_EMBEDDED
from drake_shared.cli.main import main
from drake_shared.cockpit.chromium import CHROMIUM_ARGUMENTS, find_chromium
from drake_shared.common.errors import InputError
from drake_shared.demonstrations import Demonstrations, write_demonstrations
from drake_shared.simulation.log import write_log, write_logs
from drake_shared.simulation.teaching import demonstration_of


def changed(trial, **metadata):
    return dataclasses.replace(trial, metadata={**trial.metadata, **metadata})


def cut(trial, rows: int):
    return dataclasses.replace(trial, columns={name: column[:rows] for name, column in trial.columns.items()})


@pytest.fixture(scope="module")
def folder(human_trial, tmp_path_factory):
    """Logs of every kind: one driven by a person that failed, with NaN, of one row, several in one file."""
    root = tmp_path_factory.mktemp("logs")
    write_log(human_trial, root / "a.parquet")
    person = changed(human_trial, operator="MouseInput", status="stopped", route=None)
    write_log(person, root / "monday" / "b.parquet")
    lost = {name: column.astype(float) for name, column in human_trial.columns.items() if name != "contact"}
    for name in ("x", "human_left", "confidence"):
        lost[name] = np.where(np.arange(len(lost[name])) % 7 == 3, np.nan, lost[name])
    write_log(dataclasses.replace(human_trial, columns={**human_trial.columns, **lost}), root / "nan.parquet")
    write_log(cut(human_trial, 1), root / "one_row.parquet")
    write_logs({3: human_trial, 5: changed(human_trial, seed=6, route="left_left")}, root / "several.parquet")
    demonstration = demonstration_of(human_trial, score=0.1)
    metadata = {"scenario": "two_obstacles"}
    write_demonstrations(
        root / "demos.parquet", Demonstrations(items=(demonstration,) * 2, metadata=metadata)
    )
    (root / "broken.parquet").write_bytes(b"no table")
    (root / "notes.txt").write_text("ignored")
    return root


def found(folder) -> dict:
    return {entry.name: entry for entry in Catalogue(folder).read()}


def test_a_folder_holds_its_logs_and_demonstrations_and_those_in_its_folders(folder):
    catalogue = Catalogue(folder)
    names = {entry.name: entry.kind for entry in catalogue.read()}
    assert names == {
        "a.parquet": "log",
        "monday/b.parquet": "log",
        "nan.parquet": "log",
        "one_row.parquet": "log",
        "several.parquet#3": "log",
        "several.parquet#5": "log",
        "demos.parquet: demonstration 0": "demonstration",
        "demos.parquet: demonstration 1": "demonstration",
    }
    assert set(catalogue.skipped) == {"broken.parquet"}


def test_the_metadata_alone_tell_who_drove_which_route_and_how_it_ended(folder, human_trial):
    entries = found(folder)
    first = entries["a.parquet"]
    assert (first.status, first.driver, first.route) == ("reached", "simulated operator", "left_right")
    assert first.duration == pytest.approx(human_trial["t"][-1])
    assert entries["monday/b.parquet"].driver == "person"
    assert entries["several.parquet#5"].route == "left_left"
    assert entries["several.parquet#5"].seed == 6


def test_one_file_can_be_given_and_nothing_else(folder, tmp_path):
    assert [entry.name for entry in Catalogue(folder / "a.parquet").read()] == ["a.parquet"]
    for path in (tmp_path, tmp_path / "none"):
        with pytest.raises(InputError) as caught:
            Catalogue(path)
        assert caught.value.source == str(path)


def test_a_trial_is_shown_with_its_figures_and_its_scene(folder, human_trial):
    shown = details(found(folder)["a.parquet"])
    assert shown["path"][0] == pytest.approx(human_trial["x"], abs=1e-3)
    measured = metrics(human_trial)
    assert [figure["name"] for figure in shown["figures"]] == [name for name in OF_TRIALS if name in measured]
    assert [item["name"] for item in shown["scene"]["obstacles"]] == ["first", "second"]
    (least,) = shown["marks"]["least_clearance"]
    assert least[0] == pytest.approx(human_trial["x"][np.argmin(human_trial["clearance"])])
    assert shown["marks"]["contact"] == []


@pytest.mark.parametrize("name", ["nan.parquet", "one_row.parquet", "demos.parquet: demonstration 1"])
def test_logs_with_nan_or_one_row_and_demonstrations_are_shown_in_json(folder, name):
    shown = json.loads(json.dumps(details(found(folder)[name]), allow_nan=False))
    assert len(shown["t"]) == len(shown["path"][0])
    assert shown["scene"]["workspace"]
    if name == "nan.parquet":
        assert shown["path"][0][3] is None


def test_a_long_log_is_thinned_out_and_keeps_its_ends(human_trial, tmp_path):
    count = 4 * MOST_POINTS
    long = {name: np.resize(column, count) for name, column in human_trial.columns.items()}
    long["t"] = np.arange(count) * 0.05
    write_log(dataclasses.replace(human_trial, columns=long), tmp_path / "long.parquet")
    shown = details(found(tmp_path)["long.parquet"])
    assert shown["thinned"]
    assert len(shown["t"]) == MOST_POINTS
    assert (shown["t"][0], shown["t"][-1]) == (0.0, pytest.approx((count - 1) * 0.05, rel=1e-4))


@pytest.fixture
def viewer(folder):
    served = Viewer(Catalogue(folder))
    thread = threading.Thread(target=served.serve)
    thread.start()
    yield served
    served.stop()
    thread.join()


def get(address: str) -> tuple[int, bytes]:
    try:
        with urllib.request.urlopen(address) as answer:
            return answer.status, answer.read()
    except urllib.error.HTTPError as error:
        return error.code, error.read()


def test_nothing_is_served_without_the_key(viewer):
    root = viewer.address.rsplit("/", 2)[0]
    for path in ("", "/", "/rows", "/key/rows", "/../rows"):
        assert get(root + path)[0] == 403
    assert get(viewer.address)[0] == 200
    assert get(viewer.address + "details?id=99")[0] == 404
    assert get(viewer.address + "details?id=../../etc")[0] == 200  # Read as 0.


def test_rows_are_served_while_files_are_read(viewer):
    rows: list = []
    complete = False
    while not complete:
        answer = json.loads(get(f"{viewer.address}rows?from={len(rows)}")[1])
        rows += answer["rows"]
        complete = answer["complete"]
    assert len(rows) == 8
    assert set(answer["skipped"]) == {"broken.parquet"}


def test_a_folder_that_vanishes_is_said_and_the_rest_is_shown(human_trial, tmp_path):
    for name in ("first", "second"):
        write_log(human_trial, tmp_path / "logs" / f"{name}.parquet")
    catalogue = Catalogue(tmp_path / "logs")
    reading = catalogue.read()
    next(reading)
    shutil.rmtree(tmp_path / "logs")
    assert list(reading) == []
    assert set(catalogue.skipped) == {"second.parquet"}
    assert write_page(catalogue, tmp_path / "page.html") == 0
    with pytest.raises(InputError) as caught:
        details(catalogue.entries[0])
    assert caught.value.source.endswith("first.parquet")


def test_a_page_embeds_no_more_than_it_says(folder, tmp_path, monkeypatch):
    assert MOST_EMBEDDED >= 100
    monkeypatch.setattr("drake_shared.analysis.viewer.page.MOST_EMBEDDED", 3)
    assert write_page(Catalogue(folder), tmp_path / "page.html") == 3
    text = (tmp_path / "page.html").read_text()
    data = json.loads(re.search(r"const EMBEDDED = (.*);\n", text)[1].replace("<\\/", "</"))
    assert (len(data["rows"]), len(data["details"])) == (8, 3)


def test_the_command_writes_a_page_or_says_what_is_wrong(folder, tmp_path, capsys):
    assert main(["show", str(folder), "--out", str(tmp_path / "page.html")]) == 0
    assert "8 trials and demonstrations" in capsys.readouterr().err
    for arguments in (["show", str(tmp_path / "none")], ["show", str(folder), "--port", "99999"]):
        assert main(arguments) == 2
        said = capsys.readouterr()
        assert (said.out, said.err.count("\n")) == ("", 1)


@pytest.fixture(scope="module")
def browser():
    path = find_chromium()
    if path is None:
        pytest.skip("no Chromium: install it or set DRAKE_SHARED_CHROMIUM")
    from playwright.sync_api import expect, sync_playwright

    expect.set_options(timeout=30_000)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=list(CHROMIUM_ARGUMENTS))
        yield browser
        browser.close()


@pytest.mark.browser
def test_the_page_filters_opens_and_lays_trials_over_each_other(
    browser, viewer, folder, tmp_path, violations
):
    from playwright.sync_api import expect

    write_page(Catalogue(folder), tmp_path / "page.html")
    for address in (viewer.address, f"file://{tmp_path}/page.html"):
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        errors: list = []
        page.on("pageerror", lambda error, errors=errors: errors.append(error))
        page.goto(address)
        page.wait_for_selector("#view:not([hidden])")
        expect(page.locator("#rows tr")).to_have_count(8)
        if address.startswith("file:"):
            page.wait_for_function("document.querySelectorAll('#map path').length > 3")
            assert errors == []
            continue
        page.select_option("#driver", "person")
        expect(page.locator("#rows tr")).to_have_count(1)
        page.click("#rows tr td.name button")
        page.wait_for_function("document.querySelector('#subtitle').textContent.includes('stopped')")
        page.select_option("#driver", "*")
        page.fill("#search", "several")
        expect(page.locator("#rows tr")).to_have_count(2)
        for index in range(2):
            page.locator("#rows input").nth(index).check()
        page.wait_for_function("document.querySelectorAll('#legend span').length === 3")
        page.wait_for_function("document.querySelectorAll('#figures thead th.number').length === 3")
        page.fill("#search", "nan")
        expect(page.locator("#rows tr")).to_have_count(1)
        page.click("#rows tr td.name button")
        page.wait_for_function("document.querySelector('#title').textContent === 'nan'")
        page.wait_for_selector("#charts path", state="attached")
        # NaN leaves gaps in the curves and in the path.
        curves = page.locator("#charts path").evaluate_all("all => all.map(one => one.getAttribute('d'))")
        assert any(curve.count("M") > 5 for curve in curves)
        assert not any("NaN" in curve for curve in curves)
        assert violations(page) == []
        page.set_viewport_size({"width": 390, "height": 844})
        page.wait_for_function("innerWidth === 390")
        page.click("#theme")
        page.wait_for_selector(":root[data-theme=dark]")
        assert violations(page) == []
        page.wait_for_function(
            "document.documentElement.scrollWidth === document.documentElement.clientWidth"
        )
        assert errors == []
        page.close()


@pytest.mark.browser
def test_ten_thousand_logs_are_listed_found_and_opened(browser, human_trial, tmp_path):
    from playwright.sync_api import expect

    write_logs(dict.fromkeys(range(10_000), cut(human_trial, 2)), tmp_path / "all.parquet")
    served = Viewer(Catalogue(tmp_path))
    thread = threading.Thread(target=served.serve, daemon=True)
    thread.start()
    page = browser.new_page()
    page.goto(served.address)
    page.wait_for_function("document.querySelector('#count').textContent.startsWith('10000')")
    assert page.locator("#rows tr").count() < 1000  # More than that a browser draws slowly.
    page.fill("#search", "#9999")
    expect(page.locator("#rows tr")).to_have_count(1)
    page.click("#rows tr td.name button")
    page.wait_for_function("document.querySelector('#title').textContent.includes('9999')")
    page.wait_for_selector("#map path", state="attached")
    page.close()
    served.stop()
    thread.join()
