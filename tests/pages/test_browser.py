"""A page in a browser without a window: it is drawn, turns, plays and says nothing on the console; on a phone as well.

It takes Playwright for Python and a Chromium, its own or the system's; where one is not there the tests are skipped.
"""

import shutil

import nets
import numpy as np
import pytest
from unpacked import positions, unpack

import refweb
from refweb.pages import page
from refweb.pages.space import space_of
from refweb.pictures.record import of_folder

pytestmark = pytest.mark.slow  # a browser without a graphics card takes its time
SOFTWARE = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
PIXELS = """() => { const c = document.getElementById("canvas"), o = document.createElement("canvas");
  [o.width, o.height] = [240, 150]; const d = o.getContext("2d"); d.drawImage(c, 0, 0, 240, 150);
  return [...d.getImageData(0, 0, 240, 150).data]; }"""
HANDS = ("hand", "webgl")
"""What may draw: the page by itself, or WebGL."""


@pytest.fixture(scope="module")
def browser():
    """A Chromium with WebGL by software."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="there is no Playwright, which drives a browser")
    system = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    with sync_api.sync_playwright() as driver:
        try:
            found = driver.chromium.launch(executable_path=system, args=SOFTWARE)
        except sync_api.Error as error:
            pytest.skip(f"there is no browser: {str(error).splitlines()[0]}")
        yield found
        found.close()


@pytest.fixture(scope="module")
def hit(tmp_path_factory):
    """The folder of a web that a ball hits, and its page."""
    folder = tmp_path_factory.mktemp("browser") / "hit"
    refweb.run(nets.hit_web("Web <b>hit</b> by a ball"), out=folder)
    page.report(folder)
    return folder


@pytest.fixture(params=HANDS)
def opened(request, browser, hit):
    """The page in a tab, drawn by one of the `HANDS`; what it says on the console is empty in the end."""
    tab = browser.new_page(viewport={"width": 1100, "height": 900})
    said = []
    tab.on("console", lambda message: said.append(message.text))
    tab.on("pageerror", lambda error: said.append(str(error)))
    tab.on("request", lambda asked: said.append(asked.url) if asked.url.startswith("http") else None)
    tab.goto(f"{(hit / 'report.html').as_uri()}?draw={request.param}")
    until(tab, "Boolean(window.refweb)")
    tab.evaluate("document.getElementById('view').scrollIntoView()")
    settle(tab)
    kind = tab.evaluate("refweb.painter.constructor.name")
    assert kind == {"hand": "ByHand", "webgl": "ByWebGL"}[request.param]
    yield tab
    assert said == []
    tab.close()


def until(tab, expression):
    """Wait until an expression is true; the page's policy keeps Playwright's own way of waiting out."""
    for _ in range(400):
        if tab.evaluate(expression):
            return
        tab.wait_for_timeout(50)
    raise AssertionError(f"{expression} does not become true")


def settle(tab):
    """Wait until what is drawn is what stays."""
    until(tab, "refweb.still")


def pixels(tab):
    return np.array(tab.evaluate(PIXELS), dtype=int).reshape(150, 240, 4)[..., :3]


def changed(before, after):
    """Share of the pixels that differ clearly."""
    return float((np.abs(after - before).max(axis=-1) > 40).mean())


def drag(tab, right, down, **held):
    box = tab.locator("#canvas").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    for key in held.get("keys", ()):
        tab.keyboard.down(key)
    tab.mouse.move(x, y)
    tab.mouse.down()
    tab.mouse.move(x + right, y + down, steps=4)
    tab.mouse.up()
    for key in held.get("keys", ()):
        tab.keyboard.up(key)
    settle(tab)


def test_the_view_turns_moves_grows_and_comes_back(opened):
    first = pixels(opened)
    assert 0.02 < (first.min(axis=-1) < 200).mean() < 0.9, "something is drawn, and not all over"
    drag(opened, 150, 60)
    turned = pixels(opened)
    assert changed(first, turned) > 0.02
    drag(opened, 80, 0, keys=["Shift"])
    moved = pixels(opened)
    assert changed(turned, moved) > 0.02
    opened.mouse.wheel(0, -400)
    settle(opened)
    assert (pixels(opened).min(axis=-1) < 200).sum() > 1.1 * (moved.min(axis=-1) < 200).sum()
    opened.get_by_role("button", name="Reset view").click()
    settle(opened)
    assert changed(first, pixels(opened)) < 0.002


def test_frames_follow_the_slider_the_keys_and_play(opened):
    time, slider = opened.locator("#time"), opened.locator("#frame")
    slider.fill("0")
    settle(opened)
    assert time.inner_text() == "t = 0 s"
    first = pixels(opened)
    slider.fill("10")
    settle(opened)
    assert time.inner_text() == "t = 0.05 s" and changed(first, pixels(opened)) > 0.005
    opened.locator("#canvas").focus()
    opened.keyboard.press("ArrowLeft")
    assert time.inner_text() == "t = 0.045 s"
    opened.keyboard.press("Home")
    assert time.inner_text() == "t = 0 s"
    opened.keyboard.press("Space")
    until(opened, "document.getElementById('time').textContent === 't = 0.05 s'")
    assert opened.get_by_role("button", name="Pause").is_visible()
    opened.keyboard.press("Space")
    assert opened.get_by_role("button", name="Play").is_visible()


def test_fields_ranges_and_the_undeformed_web(opened):
    scale, ticks = opened.locator("#scale"), opened.locator("#ticks")
    assert scale.inner_text().startswith("stress [")
    whole, slack = ticks.inner_text(), opened.locator("#slack")
    assert slack.is_visible()
    first = pixels(opened)
    opened.locator("#field").select_option(label="displacement")
    settle(opened)
    assert scale.inner_text() == "displacement [mm]" and changed(first, pixels(opened)) > 0.005
    assert not slack.is_visible()
    opened.locator("#field").select_option(label="stress")
    opened.locator("#frame").fill("1")
    opened.get_by_label("range of this frame alone").check()
    settle(opened)
    assert ticks.inner_text() != whole
    opened.locator("#field").select_option(label="slack")
    settle(opened)
    assert ticks.inner_text().split() == ["taut", "slack"]
    opened.locator("#frame").fill("10")
    settle(opened)
    before = pixels(opened)
    opened.get_by_label("undeformed").check()
    settle(opened)
    assert changed(before, pixels(opened)) > 0.001
    opened.get_by_label("displacements ×").select_option("5")
    settle(opened)
    assert changed(before, pixels(opened)) > 0.01


def test_points_are_where_they_are_in_python(opened, hit):
    """Unpacked by the browser as in Python, to single precision."""
    found = space_of(of_folder(hit))
    there = positions(unpack(found.text, found.head["arrays"]), found.head, 10)
    got = opened.evaluate("(refweb.show(10), refweb.draw(1), [...refweb.model.points])")
    np.testing.assert_allclose(np.reshape(got, (-1, 3)), there, atol=1e-6)


def test_both_hands_draw_the_same(browser, hit):
    shown = []
    for name in HANDS:
        tab = browser.new_page(viewport={"width": 900, "height": 800})
        tab.goto(f"{(hit / 'report.html').as_uri()}?draw={name}")
        until(tab, "Boolean(window.refweb)")
        settle(tab)
        shown.append(pixels(tab))
        tab.close()
    assert changed(*shown) < 0.01 < changed(shown[0], np.full_like(shown[0], 255))


def test_it_is_readable_on_a_phone(browser, hit):
    """390 pixels wide: nothing sticks out, pictures are shown as wide as the page, letters are not small."""
    tab = browser.new_page(viewport={"width": 390, "height": 844}, has_touch=True)
    tab.goto((hit / "report.html").as_uri())
    until(tab, "Boolean(window.refweb)")
    assert tab.evaluate("document.documentElement.scrollWidth") <= 390
    widths = tab.evaluate("[...document.images].map((i) => [i.naturalWidth, i.getBoundingClientRect().width])")
    assert len(widths) >= 5 and all(own > 0 and 300 < shown <= 390 for own, shown in widths)
    sizes = tab.evaluate(
        "[...document.querySelectorAll('p, td, dd, label')].map((e) => parseFloat(getComputedStyle(e).fontSize))"
    )
    assert min(sizes) >= 12
    cut = "(e) => e.scrollWidth > e.clientWidth || e.getBoundingClientRect().right > innerWidth"
    assert tab.evaluate(f"[...document.querySelectorAll('.wide, .wide th, .wide td')].filter({cut}).length") == 0
    named = tab.evaluate(
        "[...document.querySelectorAll('.wide td')].map((e) => getComputedStyle(e, '::before').content)"
    )
    assert named and "none" not in named
    assert tab.title() == "Web <b>hit</b> by a ball"
    tab.close()


def test_a_browser_that_is_too_old_shows_the_pictures(browser, hit):
    tab = browser.new_page()
    tab.add_init_script("delete window.DecompressionStream")
    tab.goto((hit / "report.html").as_uri())
    assert tab.locator("#without").is_visible() and not tab.locator("#canvas").is_visible()
    assert tab.locator("#pictures img").first.is_visible()
    tab.close()


def test_a_script_that_is_not_ours_does_not_run(browser, hit, tmp_path):
    """The policy of the page names its script by its hash: another in its text does not run."""
    text = (hit / "report.html").read_text()
    (tmp_path / "bad.html").write_text(text.replace("</main>", "<script>window.foreign = 1</script></main>"))
    tab = browser.new_page()
    tab.goto((tmp_path / "bad.html").as_uri())
    until(tab, "Boolean(window.refweb)")
    assert tab.evaluate("window.foreign") is None
    tab.close()
