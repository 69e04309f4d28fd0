"""The report of a sweep: what it says, and how it behaves in a browser."""

import json
import re
import shlex
import shutil
from html.parser import HTMLParser

import pyarrow as pa
import pytest

from runner import aggregate, chart, config, report
from runner.columns import FIGURES

HOSTILE = "<script>document.title = 'owned'</script><img src=x onerror=\"document.title='owned'\"> & ' \" ]]> </code>"
EXPERIMENT = f"""\
# What does it say about
# {HOSTILE}?
name: many
scene: {{wall_mass: 1.0e+4, surfaces: {{floor: {{shape: plane}}}}}}
balls: {{released: [{{position: [0, 1, 0]}}]}}
solver: {{method: explicit_euler, step: 0.01}}
duration: 0.2
matrix: {{balls.mass: [MASSES]}}
expect:
  - {{column: status, equals: finished}}
  - {{column: bounces, min: 0, where: {{balls.mass: 10}}}}
  - {{column: bounces, min: 0, where: {{balls.mass: 99}}}}
charts:
  - {{kind: lines, x: balls.mass, y: bounces}}
  - {{kind: lines, x: balls.mass, y: energy_lost, title: "Lost: 5 $ <b>"}}
"""


def made(parent, count):
    """The folder of a sweep over `count` masses, none of them run: the second failed, the third has no recording."""
    folder = parent / "it's outputs" / "many"
    folder.mkdir(parents=True)
    source = EXPERIMENT.replace("MASSES", ", ".join(str(mass) for mass in range(1, count + 1)))
    (folder / "experiment.yaml").write_text(source)
    experiment = config.load(folder / "experiment.yaml")
    for place, run in enumerate(experiment.runs()):
        mass = run.setup.balls.mass
        figures = dict.fromkeys(FIGURES) | {"balls": 1, "bounces": 10 * int(mass), "energy_lost": -1.5e-7 * mass**2}
        figures["method"] = f"RK4 {HOSTILE}" if place == 3 else "explicit_euler"
        record = {"run_id": run.run_id, "status": "finished", "error": None, "parameters": run.parameters, "figures": figures}
        if place == 1:
            record |= {"status": "failed", "error": HOSTILE, "figures": {}}
        path = folder / "runs" / run.run_id
        path.mkdir(parents=True)
        (path / "run.json").write_text(json.dumps(record))
        if place != 2:
            (path / "recording.rrd").touch()
    provenance = {"versions": {"carom": "1.2.3"}, "machine": {"cores": 2}, "command": ["carom", "sweep", HOSTILE]}
    (folder / "provenance.json").write_text(json.dumps(provenance))
    table = aggregate.summarise(folder, experiment.columns)
    charts = chart.render(list(experiment.charts), table, folder, "carom 1.2.3, a machine")
    return report.write(folder, experiment, experiment.runs(), table, charts)


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    return made(tmp_path_factory.mktemp("few"), 12)


@pytest.fixture(scope="module")
def long_page(tmp_path_factory):
    return made(tmp_path_factory.mktemp("many"), 1000)


class Text(HTMLParser):
    """What a reader sees of a page."""

    def __init__(self, page):
        super().__init__()
        self.seen, self.inside = [], ""
        self.feed(page.read_text())

    def handle_starttag(self, tag, attributes):
        self.inside = tag

    def handle_endtag(self, tag):
        self.inside = ""

    def handle_data(self, data):
        if self.inside not in ("script", "style"):
            self.seen.append(data)

    def __str__(self):
        return " ".join(" ".join(self.seen).split())


# What it says


def test_the_question_is_the_comment_at_the_top():
    assert report.question("# What\n#  happens?\nname: x\n# not this\n") == "What happens?"
    assert report.question("name: x\n") == ""


def test_columns_that_tell_nothing_are_left_out():
    columns = {"run_id": ["a", "b", "c"], "status": ["x", "x", "x"], "error": ["e", None, "f"], "started": ["u", "v", "w"]}
    columns |= {"solver.step": [1, 2, 3], "step": [1, 2, None], "balls": [3, 3, None], "work": pa.nulls(3), "bounces": [1, 2, 3]}
    same, varied = report.columns(pa.table(columns))
    assert (same, varied) == ({"balls": 3}, ["run_id", "status", "solver.step", "bounces"])


def test_it_says_what_came_out(page):
    text = str(Text(page))
    for told in (
        "12 runs", "11 finished", "1 failed", "1 of 3 expectations hold",
        "status = finished", "1 of 12 runs break it", "no run matches", "carom 1.2.3", "cores 2",
    ):  # fmt: skip
        assert told in text, told
    assert "floor: {shape: plane}" in text, "the experiment"
    assert "carom view '/" in text, "a folder's name is quoted for the shell"


def test_it_is_one_file(page):
    """Whatever it shows is in it: nothing has an address but places in the page itself and data."""
    for address in re.findall(r"""(?:src|href|action|data)=["']([^"']*)""", page.read_text()):
        assert address.startswith(("#", "data:")), address
    assert "@import" not in page.read_text() and not re.search(r"url\((?!#)", page.read_text())


# How it behaves

ENERGY = "energy lost at impacts (J)"



def find(*names):
    return next(filter(None, map(shutil.which, names)), None)


@pytest.fixture(scope="module")
def browser():
    webdriver = pytest.importorskip("selenium.webdriver", reason="needs selenium, of the extra `test`")
    chromium, driver = find("chromium", "chromium-browser", "google-chrome"), find("chromedriver")
    if not (chromium and driver):
        pytest.skip("needs Chromium and chromedriver: apt-get install chromium chromium-driver")
    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    for argument in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"performance": "ALL", "browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
    yield driver
    driver.quit()


@pytest.fixture
def show(browser):
    """Open a page at a width of so many pixels, in a colour scheme."""

    def open_(page, width=1200, scheme="light"):
        size = {"width": width, "height": 800, "deviceScaleFactor": 1, "mobile": width < 500}
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        features = [{"name": "prefers-color-scheme", "value": scheme}]
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
        browser.get("about:blank")
        for kind in ("performance", "browser"):
            browser.get_log(kind)  # what was before
        browser.get(page.as_uri())
        return browser

    return open_


def cells(browser, column):
    script = "return [...document.querySelectorAll('#table tbody tr')].map(row => row.cells[arguments[0]].textContent)"
    return browser.execute_script(script, column)


def heads(browser):
    return browser.find_elements("css selector", "#table thead button")


def press(browser, *keys):
    from selenium.webdriver import ActionChains

    ActionChains(browser).send_keys(*keys).perform()


def test_the_table_sorts_by_click_and_by_keyboard(show, page):
    from selenium.webdriver import Keys

    browser = show(page)
    assert [each.text for each in heads(browser)] == ["run", "status", "ball mass (kg)", "method", "bounces", ENERGY]
    masses = [str(mass) for mass in range(1, 13)]
    bounces = heads(browser)[4]
    head = bounces.find_element("xpath", "..")
    assert head.get_attribute("aria-sort") is None and cells(browser, 2) == masses
    bounces.click()
    assert head.get_attribute("aria-sort") == "ascending"
    press(browser, Keys.ENTER)
    assert head.get_attribute("aria-sort") == "descending"
    found = [f"{mass}0" for mass in masses if mass != "2"]
    assert cells(browser, 4) == [*reversed(found), ""], "by size, and what is empty at the end"
    press(browser, Keys.SPACE)
    assert cells(browser, 4) == [*found, ""]
    heads(browser)[1].click()
    assert head.get_attribute("aria-sort") is None and cells(browser, 1)[0] == "failed"
    heads(browser)[5].click()
    assert cells(browser, 2)[0] == "12", "-2.16e-05 is less than -1.5e-07"


def test_the_filter_keeps_rows_with_all_words(show, page):
    browser = show(page)
    field, count = browser.find_element("id", "filter"), browser.find_element("id", "count")
    assert count.text == "12 of 12 runs"
    field.send_keys("FINISHED m1")
    assert cells(browser, 2) == ["1", "10", "11", "12"] and count.text == "4 of 12 runs"
    heads(browser)[2].click()
    heads(browser)[2].click()
    assert cells(browser, 2) == ["12", "11", "10", "1"], "sorting keeps the filter"
    field.clear()
    field.send_keys("rk4")
    assert cells(browser, 2) == ["4"]
    field.clear()
    field.send_keys("nothing has this")
    assert cells(browser, 2) == [] and count.text == "0 of 12 runs"


def test_a_long_table_is_shown_in_parts_but_sorted_and_filtered_whole(show, long_page):
    browser = show(long_page)
    assert len(cells(browser, 0)) == 200
    assert browser.find_element("id", "count").text == "1000 of 1000 runs, the first 200 shown"
    heads(browser)[4].click()
    heads(browser)[4].click()
    assert cells(browser, 4)[0] == "10000"
    more = browser.find_element("id", "more")
    more.click()
    assert len(cells(browser, 0)) == 700
    more.click()
    assert len(cells(browser, 0)) == 1000 and not more.is_displayed()


def test_copy_gives_the_command_that_opens_a_recording(show, page):
    browser = show(page)
    buttons = browser.find_elements("css selector", "#table .copy")
    assert len(buttons) == 11, "a run without a recording has none"
    buttons[0].click()
    run_id = json.loads(browser.execute_script("return document.getElementById('data').textContent"))["rows"][0][0]
    from selenium.webdriver.support.wait import WebDriverWait

    toast = browser.find_element("id", "toast")
    WebDriverWait(browser, 10).until(lambda _: toast.text)  # the clipboard takes its time
    assert toast.text.endswith(f"carom view {shlex.quote(str(page.parent))} {run_id}")
    assert run_id in buttons[0].get_attribute("aria-label")


def test_nothing_is_asked_of_a_network_and_nothing_goes_wrong(show, page):
    browser = show(page)
    browser.find_element("id", "filter").send_keys("x")
    messages = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]
    asked = {m["params"]["request"]["url"] for m in messages if m["method"] == "Network.requestWillBeSent"}
    assert page.as_uri() in asked
    assert all(url == page.as_uri() or url.startswith("data:") for url in asked), asked
    assert browser.get_log("browser") == []


def test_what_others_wrote_is_text(show, page):
    browser = show(page)
    assert browser.title == "many · carom"
    assert browser.execute_script("return document.images.length") == 0
    assert browser.execute_script("return document.scripts.length") == 2
    assert browser.find_element("class name", "question").text == f"What does it say about {HOSTILE}?"
    assert HOSTILE in browser.find_element("class name", "failures").text
    assert cells(browser, 3)[3] == f"RK4 {HOSTILE}"
    assert browser.find_element("id", "made").text.count("onerror") == 1
    assert "Lost: 5 $ <b>" in browser.find_element("id", "charts").text


def test_a_script_that_got_in_would_not_run(show, page, tmp_path):
    torn = tmp_path / "torn.html"
    torn.write_text(page.read_text().replace("</main>", f"{HOSTILE}</main>"))
    assert show(torn).title == "many · carom"


def test_the_page_fits_a_phone_and_the_table_scrolls_in_its_own_frame(show, page):
    browser = show(page, width=360)
    assert browser.execute_script("return [innerWidth, document.documentElement.scrollWidth]") == [360, 360]
    for frame in browser.find_elements("css selector", ".scroll, .chart"):
        inside, outside = browser.execute_script("return [arguments[0].scrollWidth, arguments[0].clientWidth]", frame)
        assert inside > outside <= 360


CONTRAST = """
const channel = value => (value /= 255) <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4;
const light = ([r, g, b]) => 0.2126 * channel(r) + 0.7152 * channel(g) + 0.0722 * channel(b);
const rgba = text => text.match(/[\\d.]+/g).map(Number);
const behind = element => {
  for (; element; element = element.parentElement) {
    const colour = rgba(getComputedStyle(element).backgroundColor);
    if (colour.length === 3 || colour[3] === 1) return colour;
  }
  return [255, 255, 255];
};
const found = [];
for (const element of document.querySelectorAll("body *")) {
  const own = [...element.childNodes].some(node => node.nodeType === 3 && node.textContent.trim());
  if (!own || element.closest("svg, script, noscript, style") || !element.checkVisibility()) continue;
  const [a, b] = [light(rgba(getComputedStyle(element).color)), light(behind(element))].sort((x, y) => y - x);
  found.push([(a + 0.05) / (b + 0.05), element.tagName + "." + element.className]);
}
return found;
"""


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_stands_out_from_what_is_behind_it(show, page, scheme):
    browser = show(page, scheme=scheme)
    found = browser.execute_script(CONTRAST)
    assert len(found) > 60
    assert [each for each in found if each[0] < 4.5] == []
    page_is = browser.execute_script("return getComputedStyle(document.body).backgroundColor")
    assert (page_is == "rgb(255, 255, 255)") == (scheme == "light")
    paper = "return [...document.querySelectorAll('.chart')].map(each => getComputedStyle(each).backgroundColor)"
    assert set(browser.execute_script(paper)) == {"rgb(255, 255, 255)"}, "charts are drawn for white"


def test_all_of_it_can_be_reached_by_keyboard_and_one_sees_where_one_is(show, page):
    from selenium.webdriver import Keys

    browser, reached, hidden = show(page), [], []
    where = """
        const e = document.activeElement, tag = e.tagName.toLowerCase();
        return [tag + (e.id ? "#" + e.id : e.className ? "." + e.className.split(" ")[0] : ""), getComputedStyle(e).outlineStyle]
    """
    for _ in range(60):
        press(browser, Keys.TAB)
        name, outline = browser.execute_script(where)
        if name == "body":
            break
        reached.append(name)
        hidden += [name] if outline == "none" else []
    assert reached.count("a") == 6 and reached.count("figure.chart") == 2, "the sections, and charts that scroll"
    assert reached.count("button") == 6 and reached.count("button.copy") == 11, "heads of the table, and commands"
    assert {"input#filter", "div.scroll", "pre", "summary"} <= set(reached)
    assert hidden == []


def test_charts_side_by_side_keep_their_own_marks(show, page):
    browser = show(page)
    ids = browser.execute_script("return [...document.querySelectorAll('[id]')].map(each => each.id)")
    assert len(ids) == len(set(ids))
    marks = browser.find_elements("css selector", "svg use")
    script = "return [arguments[0].getAttribute('xlink:href'), arguments[0].getBoundingClientRect().width]"
    drawn = [browser.execute_script(script, mark) for mark in marks]
    assert len(drawn) > 20
    assert all(address[1:] in ids for address, _ in drawn)
    assert max(width for _, width in drawn) > 4, "px"
