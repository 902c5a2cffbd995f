"""The HTML report as a browser takes it: well-formed, complete in itself, its figures valid Vega specifications."""

import base64
import html.parser
import json
import os
import pathlib
import re
import subprocess

import pytest

VOID = {"meta", "img", "br", "link", "input", "hr"}
NAMES = ["named", "ambiguous", "none_without_dots", "unknown_hostile_names", "single_frames", "unlit", "bare"]
HOSTILE = "</script><img src=x onerror=alert(1)>"


class Page(html.parser.HTMLParser):
    """Elements must nest; attributes, texts and script contents are kept."""

    def __init__(self):
        super().__init__(convert_charrefs=True)
        self.open, self.elements, self.scripts, self.text = [], [], [], []

    def handle_starttag(self, tag, attrs):
        attributes = dict(attrs)
        assert len(attributes) == len(attrs), f"<{tag}> has an attribute twice"
        self.elements.append((tag, attributes))
        if tag == "script":
            self.scripts.append((attributes, ""))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open and self.open[-1] == tag, f"</{tag}> within {self.open}"
        self.open.pop()

    def handle_data(self, data):
        if self.open and self.open[-1] == "script":
            attributes, text = self.scripts[-1]
            self.scripts[-1] = (attributes, text + data)
        elif not (self.open and self.open[-1] == "style"):
            self.text.append(data)


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    folder = tmp_path_factory.mktemp("reports")
    program = pathlib.Path(os.environ["CLSPECKLE_BIN"]) / "gap_report_samples"
    written = subprocess.run([program, folder], check=True, capture_output=True, text=True).stdout.split()
    assert written == NAMES
    return {name: (folder / f"{name}.html").read_bytes().decode("utf-8") for name in NAMES}


@pytest.fixture(params=NAMES)
def report(request, sources):
    page = Page()
    page.feed(sources[request.param])
    page.close()
    return request.param, sources[request.param], page


def specifications(page):
    return [(a, json.loads(t)) for a, t in page.scripts if a.get("type") == "application/json"]


def test_well_formed(report):
    name, source, page = report
    assert page.open == [], f"{name}: {page.open} is never closed"
    assert source.startswith("<!DOCTYPE html>")
    ids = [a["id"] for _, a in page.elements if "id" in a]
    assert len(ids) == len(set(ids))
    for tag in ("summary", "where", "cause", "shrink", "downstream", "advice", "notes", "reading"):
        assert tag in ids
    for tag, attributes in page.elements:
        if tag == "a":
            assert attributes["href"].lstrip("#") in ids


def test_measurements_are_shown(sources):
    """In words and units, of all versions; and what was put aside."""
    text = sources["named"]
    section = text[text.index('id="measurements"') : text.index("</section>", text.index('id="measurements"'))]
    for words in (
        "temporal_noise",
        "dot_width_x",
        "system_gain",
        "standard deviation of the dots",
        "simulator with effects",
        " ± ",
    ):
        assert words in section
    assert "All effects that were looked at" in text and "put aside" in text


def test_needs_no_network(report):
    """Nothing that a browser would load, and a policy that forbids it."""
    _, source, page = report
    for tag, attributes in page.elements:
        assert tag not in ("link", "iframe", "object", "embed", "base")
        assert not any(key.startswith("on") for key in attributes)
        if "src" in attributes:
            assert tag == "img" and attributes["src"].startswith("data:image/png;base64,")
        assert attributes.get("href", "#").startswith("#")
    policy = [
        a["content"] for t, a in page.elements if t == "meta" and a.get("http-equiv") == "Content-Security-Policy"
    ]
    assert len(policy) == 1 and "default-src 'none'" in policy[0] and "unsafe-eval" not in policy[0]
    style = re.search(r"<style>(.*?)</style>", source, re.S).group(1)
    assert "url(" not in style and "@import" not in style
    for _, specification in specifications(page):
        assert "http" not in json.dumps(specification)
        assert all("url" not in data for data in specification.get("data", []))


def test_pictures_are_png(report):
    _, _, page = report
    for tag, attributes in page.elements:
        if tag == "img":
            assert attributes["alt"]
            data = base64.b64decode(attributes["src"].split(",")[1], validate=True)
            assert data[:8] == b"\x89PNG\r\n\x1a\n" and data[-8:-4] == b"IEND"


def walk(marks):
    for mark in marks:
        yield mark
        yield from walk(mark.get("marks", []))


def test_specifications(report):
    """Each has its place; marks, scales and axes name what is there."""
    name, _, page = report
    ids = {a["id"] for _, a in page.elements if "id" in a}
    all_of_them = specifications(page)
    assert len(all_of_them) >= {"bare": 0}.get(name, 4)
    for attributes, specification in all_of_them:
        assert attributes["data-figure"] in ids
        assert specification["width"] > 0 and specification["height"] > 0
        marks = list(walk(specification["marks"]))
        data = {d["name"] for d in specification["data"]}
        data |= {m["from"]["facet"]["name"] for m in marks if "facet" in m.get("from", {})}
        scales = {s["name"] for s in specification["scales"]}
        for mark in marks:
            source = mark.get("from", {})
            assert source.get("data", source.get("facet", {}).get("data")) in data | {None}
            for channel in mark.get("encode", {}).get("enter", {}).values():
                assert channel.get("scale") in scales | {None}
        for axis in specification.get("axes", []) + [a for m in marks for a in m.get("axes", [])]:
            assert axis["scale"] in scales
        for table in specification["data"]:
            assert table["values"], "a figure without data"


def test_no_name_becomes_markup(sources):
    """What a capture or a hypothesis is called stays text, in the page and in the figures."""
    page = Page()
    page.feed(sources["unknown_hostile_names"])
    assert any(HOSTILE in text for text in page.text)
    assert HOSTILE not in sources["unknown_hostile_names"]
    assert not any(t == "img" and a.get("src") == "x" for t, a in page.elements)
    assert any(HOSTILE in json.dumps(s) for _, s in specifications(page))


def test_reads_without_javascript(sources):
    """Verdict, numbers and the worst statistics are text."""
    page = Page()
    page.feed(sources["named"])
    text = " ".join(" ".join(page.text).split())
    for words in (
        "Verdict: named",
        "its cause is named: defocus",
        "0.97",
        "8.8",
        "1.15",
        "standard deviations",
        "dot_profile",
        "light in a ring around the dots",
        "focal length f = 72 px",
        "clSpeckle",
        "seed 3",
        "real",
        "baseline simulator",
        "simulator with effects",
    ):
        assert words in text, words
    assert any(t == "noscript" for t, _ in page.elements)


def test_kinds_of_captures(sources):
    def text(name):
        page = Page()
        page.feed(sources[name])
        return " ".join(" ".join(page.text).split())

    assert "no frames of dots" in text("none_without_dots")
    assert "No gap in what could be tested" in text("none_without_dots")
    assert "real ones of dark and flat by any of" in text("none_without_dots")
    assert (
        "Not judged: board_static. Not tested, since they cannot show in these sequences: defocus and glare."
        in text("none_without_dots")
    )
    assert "Left open: motion during the exposure. None of this is shown to be right." in text("none_without_dots")
    assert "in standard deviations of half captures simulated with the effects" in text("named"), (
        "scales are told apart"
    )
    assert "cannot tell which of several effects causes it" in text("ambiguous")
    assert "metallic diffuser" in text("ambiguous"), "the advice for the pair"
    assert "explained by no effect that the simulator knows" in text("single_frames")
    assert "Standard deviation of each pixel" not in text("single_frames")
    assert "Standard deviation of each pixel" in text("named")
    assert "nothing could be measured" in text("bare")
    assert "Each statistic's own distance on frames that the fit has not seen" in text("named")
    assert "distance before after gone 95 % from to" in text("named")
    assert "No single statistic differed beyond chance" in text("unknown_hostile_names"), "no frames are held out there"
    assert "black level 64.10 DN, read noise 4.05 DN; light of board_moving 120.1 DN." in text("named")
    assert "Nothing could be judged. Verdict: none, on the dark frames alone" in text("unlit")
    assert "Nothing could be judged of light: every sequence that has some was left out (board_static)" in text("unlit")


def test_what_a_reader_needs_first_comes_first(sources):
    """Verdict, pictures, what to capture next; only then the evidence."""
    source = sources["named"]
    places = [source.index(f'id="{name}"') for name in ("summary", "strip", "advice", "where", "cause", "evidence")]
    assert places == sorted(places)


def test_screens_and_paper(sources):
    """A dark screen has its colors, paper is white, and print unfolds what is folded."""
    style = re.search(r"<style>(.*?)</style>", sources["named"], re.S).group(1)
    assert "@media screen and (prefers-color-scheme: dark)" in style
    named = set(re.findall(r"var\((--\w+)\)", style))
    assert named == set(re.findall(r"(--\w+):", style))
    assert "beforeprint" in sources["named"]


UNCERTAIN = re.compile(r"(-?[\d.]+(?:e-?\d+)?) ± ([\d.]+(?:e-?\d+)?)")


def decimals(number):
    return len(number.partition(".")[2])


@pytest.mark.parametrize("name", NAMES)
def test_digits_end_where_the_uncertainty_s_second_one_does(name, sources):
    found = UNCERTAIN.findall(re.sub(r"<script.*?</script>|<style.*?</style>", "", sources[name], flags=re.S))
    assert len(found) > {"bare": -1, "unlit": -1}.get(name, 10)
    for value, uncertainty in found:
        if float(uncertainty) == 0 or "e" in value + uncertainty:
            continue
        assert len(uncertainty.replace(".", "").lstrip("0")) == 2 or float(uncertainty) >= 100, uncertainty
        assert float(value) == 0 or decimals(value) == decimals(uncertainty), f"{value} ± {uncertainty}"


def test_rows_that_do_not_differ_are_folded(sources):
    """Of the measurements: those within twice the scatter of the simulator without effects."""
    source = sources["named"]
    section = source[source.index('id="measurements"') : source.index("</section>", source.index('id="measurements"'))]
    folded = "".join(re.findall(r"<details>.*?</details>", section, re.S))

    def differ(rows):
        found = []
        for row in re.findall(r"<tr><td.*?</tr>", rows, re.S):
            cells = [re.sub("<[^>]+>", "", cell) for cell in re.findall(r"<td.*?</td>", row, re.S)]
            for version in cells[5:6]:
                pair = UNCERTAIN.fullmatch(version)
                if pair and cells[4] != "–" and abs(float(cells[4]) - float(pair[1])) > 2.05 * float(pair[2]):
                    found.append(cells)
        return found

    assert len(re.findall("<tr><td", folded)) > 10
    assert differ(folded) == []
    assert len(differ(section)) > 3
    assert "which do not differ beyond chance" in source or "in which no statistic differs beyond chance" in source
