"""Drawn sections of a page: pictures, plots, and the three-dimensional view with its controls, as HTML.

May change: sentences, `PEAK`, `HEAVIEST`, `LIKE_STRESS`, and the number of plots (`FIRST_PLOTS`, `LAST_PLOTS`). Must
stay: ids of elements in `_view`, which ``view.js`` and ``hand.js`` find; keys that `space` adds to the head, which
these scripts read; classes, which ``page.css`` knows; `frames_of`, which `page` imports. Tests:
``tests/pages/test_page.py``, ``tests/pages/test_browser.py``.
"""

from __future__ import annotations

import io

from ..errors import InputError
from ..pictures.pictures import drawn, png
from ..pictures.stage import scaled_unit
from .markup import Html, data, figure, image, section, tag
from .space import space_of

PEAK = "the frame nearest to the largest value of the first result"
HEAVIEST = 150_000
"""Size of a plot above which it is stored as pixels [byte]."""
LIKE_STRESS = ("tension-distance", "strain-distance")
"""Plots that are left out beside that of the stress, since they look alike."""
FIRST_PLOTS, LAST_PLOTS = 11, 5
"""Number of plots on a page of those of a run at most: its first observables, and its energies, momentum and others."""


def frames_of(record, frames=None, progress=None):
    """The `Space` of a record; None if none of its frames can be drawn."""
    return space_of(record, record.chosen(), frames, progress) if record.times else None


def space(record, drawn):
    """The three-dimensional view and its data; ``drawn`` is the result of `frames_of`."""
    if drawn is None:
        return section("space", "In space", tag("p", "No frame of this run can be drawn."))
    head, peak = drawn.head, record.chosen()
    head["labels"] = [record.clock(number) for number in drawn.numbers]
    head["peak"] = drawn.numbers.index(peak) if peak in drawn.numbers else len(drawn.numbers) - 1
    for field in head["fields"]:
        ends = [abs(end) for pair in field["taut"] if pair for end in pair]
        field["factor"], field["shown"] = scaled_unit(field["name"], max(ends, default=0.0))
    parts = [_view(head), tag("p", _on_frames(record, drawn, peak), class_="note")]
    return section("space", "In space", *parts, data("head", head), data("data", drawn.text))


def _on_frames(record, drawn, peak):
    """Sentence on the shown frames and their accuracy."""
    count, total = len(drawn.numbers), len(record.times)
    words = [f"{count} of {total} frames." if count < total else f"All {total} frames." if total > 1 else "One frame."]
    left = total - count - len(drawn.missing)
    if left:
        kept = f"the first, the last and {PEAK} are here" if peak in drawn.numbers else ""
        words.append(
            f"{left} are left out to keep the page small{'; ' + kept if kept else ''}; "
            "refweb report --frames N shows more."
        )
    if drawn.missing:
        words.append(f"Not to be read: {', '.join(map(str, drawn.missing))}.")
    words.append(
        f"Points are within {drawn.error / drawn.extent:.0e} of the web's extent, values of lines within 0.2 % of "
        "their range in a frame."
    )
    return " ".join(words)


def _view(head):
    """The canvas and its controls."""
    single = len(head["numbers"]) == 1 and head["kind"] != "modes"
    marks = [tag("span", "slack", id="slack", class_="mark slack")]
    if head["broken"]:
        colour = ",".join(map(str, head["broken"]))
        marks.append(Html(f'<span class="mark" style="--mark:rgb({colour})">{tag("span", "broken")}</span>'))
    marks += [tag("span", "support", class_="mark support")] if head["arrays"]["supports"]["length"] else []
    for body in head["bodies"]:
        colour = ",".join(str(round(255 * share)) for share in body["colour"])
        marks.append(Html(f'<span class="mark" style="--mark:rgb({colour})">{tag("span", body["name"])}</span>'))
    before = "at rest" if head["kind"] == "modes" else "undeformed"
    off = " hidden" if single else ""
    factors = "".join(f'<option value="{n}">{n}</option>' for n in (1, 2, 5, 10, 20, 50, 100, 1000))
    frame = {"modes": "mode", "static": "load step"}.get(head["kind"], "time")
    label = (
        "The web in space, its lines coloured. Arrow keys to the left and right choose a frame, with Shift all four "
        "turn it."
    )
    return Html(
        f'<figure id="view"><canvas id="canvas" tabindex="0" role="img" aria-label="{label}"></canvas>'
        '<p id="without" hidden>This browser is too old for it: the pictures below show the run.</p>'
        f'<div class="legend"><span id="scale"></span><div id="bar" role="img"></div><div id="ticks"></div>'
        f'<div class="marks">{"".join(marks)}</div></div>'
        f'<div class="controls"{off}><button type="button" id="play">Play</button>'
        f'<label class="long">{frame} <input type="range" id="frame" min="0" max="0" step="1" value="0"></label>'
        '<output id="time" for="frame"></output></div>'
        '<div class="controls"><label>colours <select id="field"></select></label>'
        '<label><input type="checkbox" id="own"> range of this frame alone</label>'
        f'<label><input type="checkbox" id="before"> {before}</label>'
        f'<label>displacements × <select id="factor">{factors}</select></label>'
        '<button type="button" id="reset">Reset view</button></div>'
        "<figcaption>Drag to turn; Shift and drag, or two fingers, to move; wheel or pinch to enlarge. "
        "Keys: space plays, "
        "← → frames, ↑ ↓ size, Shift and arrows turn, R resets. "
        '<span id="by" hidden>Drawn without WebGL, for which this browser has no hardware.</span></figcaption>'
        "<noscript><p>Without JavaScript the pictures below show the run.</p></noscript></figure>"
    )


def pictures(record):
    """Pictures of the frame nearest to the largest value of the first result, and of the last."""
    if not record.times:
        return ""
    parts, peak, last = [], record.chosen(), list(record.times)[-1]
    for number in dict.fromkeys([peak, last] if record.kind == "dynamic" else [peak]):
        when = record.clock(number)
        try:
            picture = image("png", _png(drawn(record, number)), f"The web at {when}, its lines coloured")
        except InputError as error:
            parts.append(tag("p", f"Frame {number}: {error}"))
            continue
        which = PEAK if number == peak and record.kind != "modes" else "the last frame" if number == last else ""
        parts.append(figure(picture, f"{when}, {which}." if which else f"{when}."))
    return section("pictures", "Pictures", *parts)


def plots(record):
    """Plots of histories, balances and other data of a record."""
    from ..pictures.plots import draw, kinds

    try:
        plots_of = {name: line for name, line in kinds(record).items() if name not in LIKE_STRESS}
    except InputError as error:
        return section("plots", "Plots", tag("p", str(error)))
    few, names = plots_of, list(plots_of)
    if len(names) > FIRST_PLOTS + LAST_PLOTS:
        few = {name: plots_of[name] for name in names[:FIRST_PLOTS] + names[-LAST_PLOTS:]}
    parts = []
    for name, line in few.items():
        try:
            parts.append(figure(_plot(draw(record, name, title=""), line), line))
        except InputError as error:
            parts.append(tag("p", f"{name}: {error}"))
    left = [name for name in plots_of if name not in few]
    more = tag("p", f"By refweb plot --quantity also: {', '.join(left)}.", class_="note") if left else ""
    nothing = "" if parts else tag("p", "There is nothing to plot.")
    return section("plots", "Plots", tag("div", parts, class_="plots"), more, nothing)


def _plot(figure, words):
    """A plot as vector graphics, or as pixels if that is smaller."""
    from ..pictures.plots import as_svg

    text = as_svg(figure).encode()
    return image("svg+xml", text, words) if len(text) <= HEAVIEST else image("png", _png(figure), words)


def _png(page):
    """A figure of matplotlib as PNG in 256 colours."""
    from PIL import Image

    small = io.BytesIO()
    Image.open(io.BytesIO(png(page))).convert("RGB").quantize(256, dither=Image.Dither.NONE).save(
        small, format="png", optimize=True
    )
    return small.getvalue()
