"""The HTML report: what it says is read off the page in a browser and compared with the assessment."""

from __future__ import annotations

import dataclasses
import hashlib
import html
import json
import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser, Page, sync_playwright

import assessments as examples
from rthstrack.errors import SettingError
from rthstrack.report import report_html, write_report
from rthstrack.verdict import Assessment, Limits
from rthstrack.verdict.order import in_order

FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
]

# A page of 200,000 drawn samples opens in a second or two; a loaded machine gets a minute.
PATIENCE_MS = 60_000


def wait_until(page: Page, condition: str, arg: Any = None) -> None:
    """Waits until `condition` holds in the page.

    Not Playwright's own wait_for_function: where the condition does not hold at once it polls from inside the page,
    with an eval that the page's content security policy forbids.
    """
    for _ in range(PATIENCE_MS // 50):
        if page.evaluate(condition, arg):
            return
        page.wait_for_timeout(50)
    pytest.fail(f"never came true: {condition}")


SHOWN_DIGITS = 6e-4  # half a unit of the fourth digit, relative to 1


@dataclass
class Opened:
    """A report in the browser, and everything that should not have happened there."""

    page: Page
    trouble: list[str] = field(default_factory=list)

    def panel(self, number: int = 0) -> str:
        return f"#assessment-{number}"

    def text(self, name: str, number: int = 0) -> str:
        return self.page.locator(f'{self.panel(number)} [data-field="{name}"]').first.inner_text()

    def scale(self, chart: str, axis: str = "x", number: int = 0) -> tuple[float, float]:
        low, high = self.page.evaluate(
            '([panel, name, axis]) => { const s = document.querySelector(`${panel} [data-chart="${name}"]`)'
            ".chart.u.scales[axis]; return [s.min, s.max]; }",
            [self.panel(number), chart, axis],
        )
        return low, high

    def column(self, chart: str, series: int, number: int = 0) -> list[float | None]:
        values: list[float | None] = self.page.evaluate(
            "([panel, name, series]) => Array.from(document.querySelector("
            '`${panel} [data-chart="${name}"]`).chart.u.data[series])',
            [self.panel(number), chart, series],
        )
        return values

    def results(self) -> dict[str, Any]:
        content = self.page.locator("#results").text_content()
        assert content is not None
        results: dict[str, Any] = json.loads(content)
        return results

    def drag(self, chart: str, start: float, end: float, number: int = 0) -> None:
        area = self.page.locator(f'{self.panel(number)} [data-chart="{chart}"] .u-over')
        area.scroll_into_view_if_needed()
        box = area.bounding_box()
        assert box is not None
        middle = box["y"] + box["height"] / 2
        self.page.mouse.move(box["x"] + start * box["width"], middle)
        self.page.mouse.down()
        self.page.mouse.move(box["x"] + (start + end) / 2 * box["width"], middle + 3, steps=4)
        self.page.mouse.move(box["x"] + end * box["width"], middle, steps=4)
        self.page.mouse.up()


@pytest.fixture(scope="module")
def browser(chromium: str) -> Iterator[Browser]:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture
def opened(browser: Browser, tmp_path: Path) -> Iterator[Callable[..., Opened]]:
    """Opens the report of some assessments off-line; any error, warning or request of the page fails the test."""
    all_opened: list[Opened] = []

    def open_report(*assessments: Assessment, **options: Any) -> Opened:
        path = tmp_path / "report.html"
        write_report(assessments, path)
        context = browser.new_context(viewport={"width": 1400, "height": 1000}, offline=True, **options)
        opened = Opened(context.new_page())
        opened.page.set_default_timeout(PATIENCE_MS)
        opened.page.on("console", lambda message: opened.trouble.append(f"{message.type}: {message.text}"))
        opened.page.on("pageerror", lambda error: opened.trouble.append(f"error: {error}"))
        opened.page.on("dialog", lambda dialog: opened.trouble.append(f"dialog: {dialog.message}"))
        opened.page.on(
            "request",
            lambda request: (
                None if request.url.startswith((path.as_uri(), "data:,")) else opened.trouble.append(request.url)
            ),
        )
        opened.page.goto(path.as_uri())
        opened.page.wait_for_selector('html[data-ready="true"]')
        all_opened.append(opened)
        return opened

    yield open_report
    for one in all_opened:
        assert one.trouble == []
        one.page.context.close()


def number_in(text: str) -> float:
    """The first number of a text of the page: U+2212 for minus, powers of ten raised."""
    plain = str.maketrans("\N{MINUS SIGN}\N{MULTIPLICATION SIGN}⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-x-0123456789")
    found = re.search(r"(-?[\d.]+)(?:x10(-?\d+))?", text.translate(plain))
    assert found is not None, text
    return float(found[1]) * 10.0 ** int(found[2] or "0")


def expected_numbers(a: Assessment) -> dict[str, tuple[float, float, str]]:
    """Every number of the page: as the field's name says, the factor to what is shown, and the unit shown."""
    t, i = a.tracking, a.indices
    return {
        "amplitude": (float(t.amplitude), 1, ""),
        "delay_s": (float(t.delay_s), 1e3, "ms"),
        "phase_rad": (float(t.phase_rad), 180 / math.pi, "°"),
        "equivalent_frequency_hz": (float(t.equivalent_frequency_hz), 1, "Hz"),
        "n_bins": (t.n_bins, 1, ""),
        "delta_f_hz": (t.delta_f_hz, 1, "Hz"),
        "n_samples": (a.target.size, 1, ""),
        "max_tracking_error": (i.max_tracking_error, 1, a.unit or ""),
        "max_tracking_error_percent": (i.max_tracking_error_percent, 1, "%"),
        "rms_error": (i.rms_error, 1, a.unit or ""),
        "rms_error_percent": (i.rms_error_percent, 1, "%"),
        "tracking_indicator": (i.tracking_indicator, 1, f"{a.unit}²" if a.unit else ""),
        "j1_s": (i.j1_s, 1e3, "ms"),
        "j2_percent": (i.j2_percent, 1, "%"),
        "j3_percent": (i.j3_percent, 1, "%"),
    }


@pytest.fixture(scope="module")
def plain() -> Assessment:
    return examples.judged(
        *examples.synthetic(),
        200.0,
        start_s=2.5,
        limits=Limits(delay_s=0.02, amplitude=0.1),
        warnings=("the first warning", "the second <b>warning</b>"),
    )


def test_every_number_on_the_page_is_the_assessments_number(opened: Callable[..., Opened], plain: Assessment) -> None:
    report = opened(plain)
    for name, (value, factor, unit) in expected_numbers(plain).items():
        text = report.text(name)
        assert number_in(text) == pytest.approx(value * factor, rel=SHOWN_DIGITS), name
        assert text.endswith(unit), name
        exact = report.page.locator(f'{report.panel()} [data-field="{name}"]').first.get_attribute("value")
        assert float(exact or "nan") == value, name


def test_a_real_sweep_shows_what_plain_numpy_finds(opened: Callable[..., Opened], shared: Path) -> None:
    sweep = examples.chirp(shared)
    report = opened(sweep)
    for name, (value, factor, _) in expected_numbers(sweep).items():
        assert number_in(report.text(name)) == pytest.approx(value * factor, rel=SHOWN_DIGITS), name


def test_the_results_block_holds_the_numbers_in_full(opened: Callable[..., Opened], plain: Assessment) -> None:
    results = opened(plain).results()
    (result,) = results["results"]
    t = plain.tracking
    for name in ("amplitude", "delay_s", "phase_rad", "equivalent_frequency_hz", "n_bins", "delta_f_hz"):
        assert result[name] == getattr(t, name), name
    assert result["indices"] == dataclasses.asdict(plain.indices)
    assert result["limits"] == dataclasses.asdict(Limits(delay_s=0.02, amplitude=0.1))
    assert result["warnings"] == list(plain.warnings)
    assert result["exceeded"] == list(plain.exceeded)
    assert result["settings"]["weight_power"] == 2
    assert result["settings"]["rate_source"] == "time column t_s"
    assert plain.moving is not None
    assert result["moving"]["n_valid"] == int(plain.moving.valid.sum())
    assert results["program"]["name"] == "rthstrack"


def test_the_heading_is_the_verdict_and_warnings_and_limits_stand_below_it(
    opened: Callable[..., Opened], plain: Assessment
) -> None:
    report = opened(plain)
    assert report.text("verdict").lower() == plain.verdict.lower()
    assert report.page.locator('[data-field="warnings"] li').all_inner_texts() == list(plain.warnings)
    assert report.text("conclusion") == plain.conclusion
    assert plain.conclusion.startswith("FAIL: ")
    assert "exceeded" in report.text("limit_delay_s_state")
    assert report.text("limit_amplitude_state") == "kept"
    assert number_in(report.text("limit_delay_s")) == 20


def test_charts_show_the_samples_at_the_recordings_own_time(opened: Callable[..., Opened], plain: Assessment) -> None:
    report = opened(plain)
    time_s = np.array(report.column("history", 0))
    np.testing.assert_allclose(time_s, 2.5 + np.arange(plain.target.size) / 200.0, rtol=1e-12)
    span = float(np.ptp(plain.target))
    np.testing.assert_allclose(np.array(report.column("history", 1)), plain.target, atol=1e-7 * span)
    np.testing.assert_allclose(np.array(report.column("history", 2)), plain.measured, atol=1e-7 * span)
    np.testing.assert_allclose(np.array(report.column("error", 1)), plain.measured - plain.target, atol=2e-7 * span)
    assert report.scale("history") == pytest.approx((2.5, 2.5 + (plain.target.size - 1) / 200.0))


def test_a_large_offset_costs_the_curves_no_resolution(opened: Callable[..., Opened]) -> None:
    target, measured = examples.synthetic(4000)
    moved = examples.judged(1e5 + target / 1e3, 1e5 + measured / 1e3, 200.0)
    report = opened(moved)
    error = (measured - target) / 1e3
    drawn = np.array(report.column("error", 1))
    # single precision of values at 1e5 would be steps of 0.008, as large as the motion itself
    np.testing.assert_allclose(drawn, error, atol=1e-6 * float(np.ptp(target / 1e3)))


def test_one_wild_value_does_not_round_the_others_away(opened: Callable[..., Opened], plain: Assessment) -> None:
    assert plain.response is not None
    wild = plain.response.gain.copy()
    wild[-1] = 1e9  # a bin at which the target has next to no energy
    response = dataclasses.replace(plain.response, gain=wild)
    drawn = np.array(opened(dataclasses.replace(plain, response=response)).column("gain", 1))
    np.testing.assert_allclose(drawn, wild[plain.response.frequency_hz > 0], rtol=1e-6)


def test_windows_that_cannot_be_judged_are_gaps(opened: Callable[..., Opened], plain: Assessment) -> None:
    report = opened(plain)
    moving = plain.moving
    assert moving is not None
    assert 0 < int(moving.valid.sum()) < moving.valid.size
    # The published average is drawn first, what is judged before it.
    for chart, values, factor in (("moving-amplitude", moving.amplitude, 1.0), ("moving-delay", moving.delay_s, 1e3)):
        drawn = report.column(chart, 2)
        assert [v is not None for v in drawn] == moving.valid.tolist()
        shown = np.array([v for v in drawn if v is not None])
        np.testing.assert_allclose(shown, values[moving.valid] * factor, rtol=1e-5)
    np.testing.assert_allclose(np.array(report.column("moving-delay", 0)), 2.5 + moving.time_s, rtol=1e-6)


def test_gain_and_delay_are_coloured_only_where_the_coherence_is_high(
    opened: Callable[..., Opened], plain: Assessment
) -> None:
    report = opened(plain)
    response = plain.response
    assert response is not None
    sure = response.coherence[response.frequency_hz > 0] >= 0.8
    assert 0 < int(sure.sum()) < sure.size
    for chart in ("gain", "delay", "coherence"):
        assert [v is not None for v in report.column(chart, 2)] == sure.tolist()
        assert None not in report.column(chart, 1)


def test_dragging_zooms_every_chart_over_time_and_a_double_click_leads_back(
    opened: Callable[..., Opened], plain: Assessment
) -> None:
    report = opened(plain)
    whole = report.scale("history")
    report.drag("history", 0.25, 0.5)
    wait_until(
        report.page,
        "limit => document.querySelector('[data-chart=history]').chart.u.scales.x.max < limit",
        arg=whole[1] - 10,
    )
    zoomed = report.scale("history")
    width = whole[1] - whole[0]
    assert zoomed == pytest.approx((whole[0] + width / 4, whole[0] + width / 2), abs=0.01 * width)
    for chart in ("error", "moving-amplitude", "moving-delay", "running-errors", "indicator"):
        assert report.scale(chart) == zoomed, chart
    wait_until(
        report.page,
        "n => document.querySelector('[data-chart=loop]').chart.u.data[1][0].length < n",
        arg=plain.target.size // 2,
    )
    inside = [zoomed[0] <= t <= zoomed[1] for t in 2.5 + np.arange(plain.target.size) / 200.0]
    assert report.page.evaluate(
        "document.querySelector('[data-chart=loop]').chart.u.data[1].map(column => column.length)"
    ) == [sum(inside), sum(inside)]
    most = max(np.abs(plain.target[inside]).max(), np.abs(plain.measured[inside]).max())
    low, high = report.scale("loop")
    assert high - low <= 2.2 * most
    assert low < plain.target[inside].min() < plain.target[inside].max() < high
    area = report.page.locator("[data-chart=history] .u-over")
    area.dblclick()
    wait_until(
        report.page, "end => document.querySelector('[data-chart=history]').chart.u.scales.x.max === end", arg=whole[1]
    )
    assert report.scale("indicator") == whole


def test_buttons_and_keys_zoom_without_a_mouse(opened: Callable[..., Opened], plain: Assessment) -> None:
    report = opened(plain)
    whole = report.scale("history")
    report.page.get_by_role("button", name="Strongest 4 s").press("Enter")
    low, high = report.scale("error")
    assert high - low == pytest.approx(4.0, abs=0.02)
    burst = 2.5 + np.argmax(np.abs(plain.target)) / 200.0
    assert low < burst < high
    chart = report.page.locator("[data-chart=history]")
    chart.focus()
    report.page.keyboard.press("+")
    report.page.keyboard.press("ArrowRight")
    nearer = report.scale("error")
    assert nearer[1] - nearer[0] == pytest.approx(2.0, abs=0.02)
    assert nearer[0] > low + 1
    report.page.keyboard.press("0")
    assert report.scale("error") == whole


def test_all_frequencies_can_be_seen_and_zooming_one_curve_zooms_all(
    opened: Callable[..., Opened], plain: Assessment
) -> None:
    report = opened(plain)
    frequency = plain.tracking.frequency_hz
    assert frequency is not None
    first = report.scale("spectra")
    assert frequency[0] <= first[0] < plain.tracking.equivalent_frequency_hz < first[1] < frequency[-1]
    report.page.get_by_role("button", name="All frequencies").click()
    for chart in ("spectra", "weights", "gain", "delay", "coherence"):
        assert report.scale(chart) == pytest.approx((frequency[0], frequency[-1])), chart
    report.drag("gain", 0.5, 0.75)
    low, high = report.scale("spectra")
    decades = math.log(frequency[-1] / frequency[0])
    assert math.log(low / frequency[0]) / decades == pytest.approx(0.5, abs=0.01)
    assert math.log(high / frequency[0]) / decades == pytest.approx(0.75, abs=0.01)


def test_the_parts_of_a_test_are_tabs_below_a_table_of_all(opened: Callable[..., Opened]) -> None:
    parts = examples.parts_of_a_test(Limits(delay_s=0.02))
    report = opened(*parts)
    page = report.page
    for number, part in enumerate(parts):
        row = page.locator(f'tr[data-assessment="{number}"]')
        shown = number_in(row.locator('[data-field="delay_s"]').inner_text())
        assert shown == pytest.approx(1e3 * float(part.tracking.delay_s), rel=SHOWN_DIGITS)
        assert ("limit exceeded" in row.inner_text()) == bool(part.exceeded)

    def visible() -> list[int]:
        return [n for n in range(3) if page.locator(report.panel(n)).is_visible()]

    # The worst is open first.
    (worst,) = visible()
    order = [int(row.get_attribute("data-assessment") or "") for row in page.locator(".summary tbody tr").all()]
    assert worst == order[0] == parts.index(in_order(parts)[0])
    tabs = page.get_by_role("tab")
    assert tabs.count() == 3
    tabs.nth(1).click()
    assert visible() == [1]
    assert "command" in page.locator("#assessment-1 [data-chart=history] .u-legend").inner_text()
    page.keyboard.press("ArrowRight")
    assert visible() == [2]
    page.keyboard.press("ArrowRight")
    assert visible() == [0]
    page.keyboard.press("End")
    assert visible() == [2]
    assert page.evaluate("document.activeElement.id") == "tab-2"
    page.locator('tr[data-assessment="1"] a').click()
    page.wait_for_selector("#assessment-1", state="visible")
    assert visible() == [1]
    assert tabs.nth(1).get_attribute("aria-selected") == "true"
    for number, part in enumerate(parts):
        tabs.nth(number).click()
        for name, (value, factor, _) in expected_numbers(part).items():
            assert number_in(report.text(name, number)) == pytest.approx(value * factor, rel=SHOWN_DIGITS), name


HOSTILE = (
    "<script>document.title='hacked'</script>",
    "</script><img src=x onerror=\"document.title='hacked'\">",
    '"><svg onload=alert(1)>&amp;&lt;',
    "' onmouseover='alert(1)\u2028\u2029<!--",
)


def test_names_that_look_like_markup_are_only_names(opened: Callable[..., Opened]) -> None:
    file, target, measured, other = HOSTILE
    hostile = dataclasses.replace(
        examples.judged(
            *examples.synthetic(2000), 200.0, names=(target, measured), unit=other, limits=Limits(delay_s=0.02)
        ),
        file=file,
        verdict=target,
        warnings=(file, measured),
        conclusion=other,
        settings={file: target, other: [measured, {measured: other}]},
        moving_note=file,
    )
    report = opened(hostile, dataclasses.replace(hostile, part="compensator"))
    assert "hacked" not in report.page.title().replace(file, "")
    assert report.page.evaluate("document.querySelectorAll('main img, main svg').length") == 0
    assert report.page.locator("script").count() == html_scripts(report_html([hostile, hostile]))
    assert report.text("verdict").lower() == target.lower()
    assert report.page.locator(f"{report.panel()} .facts").inner_text().startswith(file)
    legend = report.page.locator("#assessment-0 [data-chart=history] .u-legend").inner_text()
    assert target in legend
    assert report.results()["results"][0]["measured"] == measured
    report.page.get_by_role("tab").nth(1).click()
    report.page.mouse.move(400, 600)


def html_scripts(page: str) -> int:
    """How many script elements the page is meant to have: results, drawing, three programs, and its sample blocks."""
    return 5 + len(set(re.findall(r'id="(block-[0-9a-f]+)"', page)))


def test_what_is_not_determined_says_so_and_why(opened: Callable[..., Opened]) -> None:
    bare = examples.without_a_number(
        examples.judged(*examples.synthetic(1000), 200.0, moving_evaluation=False, response=False, unit=None)
    )
    report = opened(bare)
    assert report.text("delay_s").startswith("not determined")
    assert "did not settle" in report.text("delay_s")
    assert "needs the measured force" in report.text("energy_error")
    assert report.text("moving") == "A(t) and d(t) not determined: the record is shorter than two windows"
    assert report.text("response").endswith("not determined: the record is too short for two segments")
    (result,) = report.results()["results"]
    assert result["delay_s"] is None
    assert result["moving"] is None
    assert result["not_determined"]["moving"] == "the record is shorter than two windows"
    assert "NaN" not in report.page.locator("main").inner_text()


def test_a_record_of_a_hundred_thousand_samples_is_drawn_in_full(opened: Callable[..., Opened]) -> None:
    long = examples.judged(*examples.synthetic(100_000, 1000.0), 1000.0, hop_s=2.0)
    report = opened(long)
    assert report.page.evaluate("document.querySelector('[data-chart=history]').chart.u.data[1].length") == 100_000
    assert report.page.locator("[data-chart=error] + figcaption").count() == 0
    report.drag("history", 0.3, 0.6)
    low, high = report.scale("error")
    assert high - low == pytest.approx(30.0, abs=0.5)


def test_a_million_samples_are_drawn_by_their_extremes_and_the_page_says_so(opened: Callable[..., Opened]) -> None:
    n = 1_000_000
    target, measured = examples.synthetic(n, 1000.0)
    target[123_456] = 99.0
    measured[654_321] = -77.0
    long = examples.judged(target, measured, 1000.0, moving_evaluation=False, hop_s=10.0)
    report = opened(long)
    count, most, least = report.page.evaluate(
        "(() => { const d = document.querySelector('[data-chart=history]').chart.u.data;"
        "return [d[0].length, d[1].reduce((a, b) => Math.max(a, b)), d[2].reduce((a, b) => Math.min(a, b))]; })()"
    )
    assert count <= 200_010
    assert (most, least) == (pytest.approx(99.0, rel=1e-6), pytest.approx(-77.0, rel=1e-6))
    caption = report.page.locator("[data-chart=error] + figcaption").inner_text()
    assert f"{count} of {n} samples" in caption
    assert number_in(report.text("n_samples")) == n
    report.drag("history", 0.3, 0.6)


def test_the_page_loads_nothing_and_weighs_little_more_than_its_samples(tmp_path: Path) -> None:
    target, measured = examples.synthetic(100_000, 1000.0)
    path = tmp_path / "one.html"
    write_report([examples.judged(target, measured, 1000.0, hop_s=2.0)], path)
    text = path.read_text(encoding="utf-8")
    assert re.findall(r"<(?:script|link|img|iframe)[^>]*\s(?:src|href)=\"(?!data:)", text) == []
    assert "@import" not in text
    assert "url(" not in text
    assert path.stat().st_size < 100_000 * 8 * 4 / 3 + 500_000


def test_a_channel_that_several_assessments_share_is_stored_once(tmp_path: Path) -> None:
    parts = examples.parts_of_a_test()
    text = report_html(parts)
    blocks = re.findall(r'id="(block-[0-9a-f]+)">', text)
    assert len(blocks) == len(set(blocks))
    samples = [b for b in re.findall(r'id="block-[0-9a-f]+">([^<]*)<', text) if len(b) == 12_000 * 4 // 3 * 4]
    assert len(samples) == 3  # target, command, measured


def test_dark_surroundings_and_white_paper(opened: Callable[..., Opened], plain: Assessment) -> None:
    report = opened(plain, color_scheme="dark")
    ground = "getComputedStyle(document.body).backgroundColor"
    pixel = (
        "(() => { const c = document.querySelector('[data-chart=history] canvas');"
        "const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;"
        "let most = 0; for (let i = 0; i < d.length; i += 4) if (d[i + 3] > 200) most = Math.max(most, d[i + 2]);"
        "return most; })()"
    )
    assert report.page.evaluate(ground) == "rgb(21, 24, 27)"
    assert report.page.evaluate(pixel) > 200  # the target's line is nearly white
    report.page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert report.page.evaluate(ground) == "rgb(255, 255, 255)"
    width = report.page.evaluate("document.querySelector('[data-chart=history]').chart.u.width")
    assert width < 180 / 25.4 * 96
    report.page.evaluate("dispatchEvent(new Event('afterprint'))")
    assert report.page.evaluate(ground) == "rgb(21, 24, 27)"
    report.page.emulate_media(color_scheme="light")
    assert report.page.evaluate(ground) == "rgb(255, 255, 255)"


def test_no_window_is_too_narrow_for_the_page(opened: Callable[..., Opened]) -> None:
    report = opened(*examples.parts_of_a_test(Limits(delay_s=0.02)))
    for width in (1400, 800, 390):
        report.page.set_viewport_size({"width": width, "height": 900})
        wait_until(
            report.page,
            "document.querySelector('[data-drawn]:not([hidden]) [data-chart=history]').chart.u.width < innerWidth",
        )
        assert report.page.evaluate("document.documentElement.scrollWidth") == width
        for inner in (".scroll", ".tabs"):
            cut = "e => e.scrollWidth > e.clientWidth || e.scrollHeight > e.clientHeight"
            assert width < 600 or not report.page.locator(inner).evaluate(cut), (inner, width)


def pixel(page: Page, chart: str, time_s: float, down: float) -> list[int]:
    """The colour of a chart at a time, so far down its height; the browser complains where one is read twice."""
    found: list[int] = page.evaluate(
        "([name, x, down]) => { const { u } = document.querySelector(`[data-chart=${name}]`).chart;"
        "const y = u.bbox.top + down * u.bbox.height;"
        "return [...u.ctx.getImageData(Math.round(u.valToPos(x, 'x', true)), Math.round(y), 1, 1).data].slice(0, 3); }",
        [chart, time_s, down],
    )
    return found


def many_runs(n: int = 4) -> list[Assessment]:
    """Runs of one test, each later than the one before, in another order; the latest two exceed 30 ms."""
    found = []
    for k in np.roll(np.arange(n), 1).tolist():
        target, measured = examples.synthetic(delay_s=0.02 + 0.01 * k, gain=1 + 0.01 * k)
        limits = Limits(delay_s=0.035)
        found.append(examples.judged(target, measured, 200.0, file=f"runs/day_{k:02d}.csv", limits=limits))
    return found


def test_the_title_says_the_outcome_and_the_judged_numbers(opened: Callable[..., Opened], plain: Assessment) -> None:
    title = opened(plain).page.title()
    assert title.startswith("FAIL · test.csv: delay ")
    assert number_in(title.partition("delay ")[2]) == pytest.approx(
        1e3 * float(plain.trusted.delay_s), rel=SHOWN_DIGITS
    )
    assert number_in(title.partition("amplitude ")[2]) == pytest.approx(
        float(plain.trusted.amplitude), rel=SHOWN_DIGITS
    )
    runs = many_runs()
    assert opened(*runs).page.title() == "FAIL · 4 pairs in 4 files: 2 exceed a limit, 2 are within the limits"
    free = [dataclasses.replace(one, gates=()) for one in runs]
    assert opened(*free).page.title().startswith("4 pairs in 4 files: delay 20.")


def test_the_summary_is_sorted_worst_first_and_by_a_head(opened: Callable[..., Opened]) -> None:
    runs = many_runs()
    page = opened(*runs).page

    def column(place: int) -> list[str]:
        return page.locator(f".summary tbody tr:visible > :nth-child({place})").all_inner_texts()

    delays = [1e3 * float(one.trusted.delay_s) for one in runs]
    assert column(1) == ["day_03.csv", "day_02.csv", "day_01.csv", "day_00.csv"]
    head = page.get_by_role("columnheader", name="Delay (ms)", exact=True)
    place = page.locator(".summary thead th").all_inner_texts().index("Delay (ms)") + 1
    assert page.locator("[aria-sort]").count() == 0
    head.get_by_role("button").press("Enter")
    assert head.get_attribute("aria-sort") == "descending"
    shown = [number_in(text) for text in column(place)]
    assert shown == sorted(shown, reverse=True)
    np.testing.assert_allclose(shown, sorted(delays, reverse=True), rtol=SHOWN_DIGITS)
    head.get_by_role("button").click()
    assert head.get_attribute("aria-sort") == "ascending"
    assert [number_in(text) for text in column(place)] == shown[::-1]
    page.get_by_role("columnheader", name="File").get_by_role("button").click()
    assert page.locator("[aria-sort]").count() == 1
    assert column(1) == ["day_00.csv", "day_01.csv", "day_02.csv", "day_03.csv"]
    page.get_by_role("searchbox").fill("exceeded 03")
    assert column(1) == ["day_03.csv"]
    assert page.locator("[data-matches]").inner_text() == "1 of 4"
    page.get_by_role("searchbox").fill("")
    assert len(column(1)) == 4


def test_the_published_number_stands_beside_the_judged_one_in_the_summary(opened: Callable[..., Opened]) -> None:
    runs = many_runs()
    page = opened(*runs).page
    for number, one in enumerate(runs):
        row = page.locator(f'tr[data-assessment="{number}"]')
        for name, value in (("delay_s", one.trusted.delay_s), ("published_delay_s", one.published.delay_s)):
            shown = number_in(row.locator(f'[data-field="{name}"]').inner_text())
            assert shown == pytest.approx(1e3 * float(value), rel=SHOWN_DIGITS)
    first = dataclasses.replace(runs[0], tracking=runs[0].published)
    heads = opened(first, *runs[1:]).page.locator(".summary thead th").all_inner_texts()
    assert "Trusted delay (ms)" in heads


def pages(pdf: bytes) -> int:
    return len(re.findall(rb"/Type\s*/Page\b", pdf))


def test_every_run_is_printed_and_begins_on_a_page_of_its_own(opened: Callable[..., Opened]) -> None:
    runs = many_runs()
    report = opened(*runs)
    one = pages(opened(runs[0]).page.pdf(format="A4"))
    assert one in (2, 3)
    # The table, two pages a run, and at most one for the footer.
    assert 1 + 2 * len(runs) <= pages(report.page.pdf(format="A4")) <= 2 + 2 * len(runs)
    report.page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert all(report.page.locator(report.panel(n)).is_visible() for n in range(4))
    empty = "[...document.querySelectorAll('.chart')].filter(e => !e.chart || e.chart.u.width < 100).length"
    assert report.page.evaluate(empty) == 0
    breaks = "[...document.querySelectorAll('.assessment')].map(e => getComputedStyle(e).breakBefore)"
    assert report.page.evaluate(breaks) == ["page"] * 4
    report.page.evaluate("dispatchEvent(new Event('afterprint'))")
    assert sum(report.page.locator(report.panel(n)).is_visible() for n in range(4)) == 1


TICKS = """[...document.querySelectorAll('.assessment:not([hidden]) .chart')].flatMap(({ chart, dataset }) =>
  chart.u.axes.map((axis, i) => [`${dataset.chart} ${'xy'[i]}`, axis._splits.filter(v => v != null).length]))"""


@pytest.mark.parametrize("size", [(1400, 900), (800, 900)])
def test_every_axis_has_three_ticks_at_least(
    opened: Callable[..., Opened], plain: Assessment, size: tuple[int, int]
) -> None:
    report = opened(plain)
    report.page.set_viewport_size({"width": size[0], "height": size[1]})

    def few() -> list[Any]:
        return [found for found in report.page.evaluate(TICKS) if found[1] < 3]

    assert few() == []
    report.drag("history", 0.30, 0.31)
    report.drag("gain", 0.50, 0.52)
    assert few() == []
    report.page.get_by_role("button", name="All frequencies").click()
    assert few() == []


def test_windows_over_a_limit_are_shaded_on_their_own_charts(opened: Callable[..., Opened], plain: Assessment) -> None:
    report = opened(plain)
    (drawing,) = json.loads(report.page.locator("#drawing").text_content() or "")
    (gate,) = [gate for gate in plain.gates if gate.name == "delay"]
    assert plain.moving is not None
    half = plain.moving.hop_s / 2
    assert gate.over_s
    assert drawing["over"] == {"amplitude": [], "delay": [[a - half, b + half] for a, b in gate.over_s]}
    middle = (gate.over_s[0][0] + gate.over_s[0][1]) / 2
    orange, bare = (
        pixel(report.page, "moving-delay", middle, 0.97),
        pixel(report.page, "moving-amplitude", middle, 0.97),
    )
    assert orange[0] > orange[2] + 30
    assert max(bare) - min(bare) < 10
    caption = report.page.locator("[data-chart=moving-delay] + figcaption").inner_text()
    assert "Orange: over a limit" in caption


def test_a_report_of_many_long_runs_stays_small_and_says_what_is_drawn(opened: Callable[..., Opened]) -> None:
    n = 60_000
    one = examples.judged(*examples.synthetic(n, 1024.0), 1024.0)
    rng = np.random.default_rng(3)
    runs = []
    for k in range(20):
        target = one.target + 0.01 * rng.normal(size=n)
        target[1000 * k + 500] = 50.0
        runs.append(dataclasses.replace(one, target=target, file=f"run_{k:02d}.csv"))
    assert len(report_html(runs).encode()) < 4_000_000
    page = opened(*runs).page
    shown = page.locator(".assessment:visible")
    number = int((shown.get_attribute("id") or "").removeprefix("assessment-"))
    drawn = page.evaluate(
        f"Array.from(document.querySelector('#assessment-{number} [data-chart=history]').chart.u.data[1])"
    )
    assert len(drawn) <= 6_002
    assert max(drawn) == 50.0
    assert f"Drawn: {len(drawn)} of 60000 samples" in shown.locator("[data-chart=error] + figcaption").inner_text()


def test_the_parts_of_a_long_test_share_the_samples_that_are_drawn() -> None:
    target, command = examples.synthetic(70_000, 1024.0, delay_s=-0.025, gain=1.0)
    _, measured = examples.synthetic(70_000, 1024.0, delay_s=0.004, gain=0.99)
    whole = examples.judged(target, measured, 1024.0)
    other = dataclasses.replace(whole, file="other.csv", target=command)
    parts = [whole, dataclasses.replace(whole, part="compensator", measured=command)]
    drawing = json.loads(re.search(r'id="drawing">(.*?)</script>', report_html([*parts, other]), re.DOTALL)[1])  # type: ignore[index]
    first, second, third = (one["time"] for one in drawing)
    assert first["index"] == second["index"]
    assert first["target"] == second["target"]
    assert third["index"] != first["index"]


def test_gain_and_delay_over_time_and_frequency_are_shown_where_they_change_with_both(
    opened: Callable[..., Opened], plain: Assessment
) -> None:
    assert plain.time_frequency() is None
    assert opened(plain).page.locator("[data-chart=both-delay]").count() == 0
    report = opened(examples.varying_over_both())
    # The dark end of the colours is a short delay: low frequencies early on.
    assert sum(pixel(report.page, "both-delay", 15.0, 0.9)) < 300
    low, high = report.scale("both-delay", "y")
    assert low < 1.5 < 3 < high
    assert "half octaves" in report.page.locator("[data-chart=both-delay] + figcaption").inner_text()


def test_settings_program_and_date_are_in_a_table(opened: Callable[..., Opened], plain: Assessment) -> None:
    report = opened(plain)

    def setting(name: str) -> str:
        return report.page.locator(f'[data-setting="{name}"]').inner_text()

    assert setting("weight_power") == "2"
    assert setting("band_hz") == "none"
    assert setting("rate_source") == "time column t_s"
    assert setting("first_sample") == "2.5 s"
    assert setting("program").startswith("rthstrack ")
    assert re.match(r"\d{4}-\d\d-\d\d \d\d:\d\d", setting("created"))
    banded = examples.judged(
        *examples.synthetic(), 200.0, settings=dataclasses.replace(plain.tracking.settings, band_hz=(0.5, 20.0))
    )
    assert '<td data-setting="band_hz">0.5 to 20 Hz</td>' in report_html([banded])


def test_the_live_page_can_use_the_charts_alone(browser: Browser) -> None:
    """New data without a shared axis, an interval around a curve, a limit added later, a moving loop."""
    page = browser.new_page()
    trouble: list[str] = []
    page.on("console", lambda message: trouble.append(message.text))
    page.on("pageerror", lambda error: trouble.append(str(error)))
    page.set_content("<!DOCTYPE html><div id=a class=chart style='width:600px'></div><div id=b class=chart></div>")
    assets = resources.files("rthstrack") / "assets"
    for name in ("uPlot.min.css", "charts.css"):
        page.add_style_tag(content=(assets / name).read_text(encoding="utf-8"))
    for name in ("uPlot.iife.min.js", "charts.js"):
        page.add_script_tag(content=(assets / name).read_text(encoding="utf-8"))
    page.evaluate(
        """() => {
        const a = document.getElementById("a");
        window.options = {
          x: { label: "Time (s)" }, y: { label: "Delay (ms)" }, height: 200,
          data: [[0, 1, 2], [1, 2, 3], [2, 3, 4], [0, 1, 2]],
          series: [{ label: "d", colour: "value" }, { label: "upper", colour: "interval", silent: true },
                   { label: "lower", colour: "interval", silent: true }],
          intervals: [[2, 3]], limits: [],
        };
        window.chart = Charts.lines(a, window.options);
        const axes = { x: { label: "x" }, y: { label: "y" }, data: [[0, 1], [0, 1]] };
        window.loop = Charts.loop(document.getElementById("b"), axes);
      }"""
    )
    page.evaluate(
        "options.limits.push({ value: 20, label: 'limit' });"
        "chart.setData([[5, 6, 7], [11, 12, 13], [12, 13, 14], [10, 11, 12]])"
    )
    page.evaluate("loop.setData([0, 2, 4], [0, 3, 4])")
    wait_until(page, "chart.u.scales.x.max === 7")
    scales = page.evaluate("[chart.u.scales.x.min, chart.u.scales.y.min, chart.u.scales.y.max, loop.u.scales.x.max]")
    assert scales[0] == 5
    assert scales[1] < 10
    assert scales[2] > 20  # the limit is in view
    assert 4 < scales[3] < 5  # the loop follows its data
    assert trouble == []
    page.close()


def test_no_assessment_and_an_unwritable_place_are_one_clear_line(tmp_path: Path, plain: Assessment) -> None:
    with pytest.raises(SettingError, match="at least one assessment"):
        write_report([], tmp_path / "none.html")
    with pytest.raises(SettingError, match="cannot write the report") as caught:
        write_report([plain], tmp_path / "missing" / "report.html")
    assert "\n" not in str(caught.value)
    assert "missing" in str(caught.value)


def test_a_file_name_that_is_not_text_can_be_reported(tmp_path: Path) -> None:
    odd = examples.judged(*examples.synthetic(2000), 200.0, file="run_\udcff.csv")
    write_report([odd], tmp_path / "odd.html")
    assert "run_?.csv" in html.unescape((tmp_path / "odd.html").read_text(encoding="utf-8"))


def test_samples_without_a_file_are_called_that() -> None:
    page = report_html([examples.judged(*examples.synthetic(2000), 200.0, file="")])
    assert "<title>samples given in Python: delay " in page


def test_the_vendored_files_are_those_that_the_note_beside_them_names() -> None:
    assets = resources.files("rthstrack") / "assets"
    named = dict(re.findall(r"\| (uPlot\S+) \| ([0-9a-f]{64}) \|", (assets / "README.md").read_text(encoding="utf-8")))
    assert sorted(named) == ["uPlot.LICENSE", "uPlot.iife.min.js", "uPlot.min.css"]
    for name, digest in named.items():
        assert hashlib.sha256((assets / name).read_bytes()).hexdigest() == digest, name
