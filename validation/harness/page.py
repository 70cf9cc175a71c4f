"""The report of the cases: one HTML page that holds its own figures and loads nothing, and the same as Markdown."""

from __future__ import annotations

import base64
import html
import platform
import re
from dataclasses import dataclass

from refweb.results.provenance import versions

from .. import how_it_works
from .case import CASES, Case, text
from .plots import image

HEADS = ("quantity", "refweb", "reference", "source", "difference", "tolerance, and why", "agrees")
STYLE = """
:root { color-scheme: light; }
body { font: 16px/1.5 system-ui, sans-serif; color: #1c1c1c; background: #fff; margin: 0 auto; padding: 0 1rem 4rem;
  max-width: 76rem; overflow-wrap: break-word; }
p, ul, pre, figure, blockquote { max-width: 60rem; }
h1, h2, h3 { line-height: 1.25; } h2 { margin-top: 3rem; border-bottom: 2px solid #1b5e8c; }
h3 { margin-top: 2.5rem; }
a { color: #1b5e8c; }
pre { overflow-x: auto; background: #f4f4f2; padding: .6rem .8rem; }
.scroll { overflow-x: auto; margin: 1rem 0; }
table { border-collapse: collapse; font-size: .875rem; font-variant-numeric: tabular-nums; }
th, td { text-align: left; vertical-align: top; padding: .3rem .7rem .3rem 0; border-bottom: 1px solid #ddd; }
td { min-width: 4rem; max-width: 22rem; } td.value { white-space: nowrap; } td:first-child { min-width: 11rem; }
.number td:nth-child(6) { min-width: 16rem; }
.yes { color: #22553a; } .no { color: #a3201a; font-weight: bold; }
td.yes span::before, .badge.yes::before, .result.yes::before { content: "✓ "; }
td.no span::before, .badge.no::before, .result.no::before { content: "✗ "; }
.result { font-size: 1.25rem; padding: .6rem .9rem; } .badge { font-size: .8rem; padding: .1rem .5rem; }
.result, .badge { border-radius: .4rem; background: #e3f1e6; }
.result.no, .badge.no { background: #fbe4e1; }
.up { font-size: .8rem; font-weight: normal; margin-left: .5rem; }
figure { margin: 1.5rem 0; } img { max-width: 100%; height: auto; } figcaption { font-size: .9rem; color: #444; }
blockquote { margin: 1rem 0; padding: .2rem 0 .2rem 1rem; border-left: 3px solid #1b5e8c; }
@media (max-width: 45rem) {
  ul { padding-left: 1.2rem; } td:first-child { min-width: 6rem; }
  .number thead, .contents thead { display: none; }
  .number, .number tbody, .number tr, .contents, .contents tbody { display: block; }
  .number tr { border: 1px solid #ccc; border-radius: .4rem; margin: .7rem 0; padding: .3rem .7rem; }
  .number td { display: grid; grid-template-columns: 7rem 1fr; gap: .7rem; min-width: 0; max-width: none; border: 0;
    padding: .15rem 0; white-space: normal; }
  .number td::before { content: attr(data-label); color: #555; }
  .contents tr { display: flex; justify-content: space-between; border-bottom: 1px solid #ddd; }
  .contents td { display: none; border: 0; }
  .contents td:nth-child(2), .contents td:last-child { display: block; }
  .contents td:last-child { white-space: nowrap; padding-left: .7rem; }
}
"""


@dataclass(frozen=True)
class Done:
    """A case that was run: its name, what it handed over and how long it took [s]."""

    name: str
    case: Case
    seconds: float


def write(folder, done, quick):
    """Write ``index.html``, ``report.md`` and the figures beside it; gives the path of the page."""
    folder.mkdir(parents=True, exist_ok=True)
    images = {}
    for one in done:
        for number, figure in enumerate(one.case.figures, 1):
            name = f"{one.name}-{number}.png"
            images[name] = image(figure.draw())
            (folder / name).write_bytes(images[name].png)
    page = folder / "index.html"
    page.write_text(_page(_blocks(done, quick), images), encoding="utf-8")
    (folder / "report.md").write_text(_markdown(_blocks(done, quick)), encoding="utf-8")
    return page


def write_text(path, done, quick):
    """Write the report as Markdown without its figures."""
    path.write_text(_markdown(_blocks(done, quick), figures=False), encoding="utf-8")


def _blocks(done, quick):
    """The report as a list of blocks (kind, content), which both formats follow."""
    rows = sum(len(one.case.rows) for one in done)
    yield "title", "refweb: validation"
    yield (
        "text",
        f"{len(done)} cases, {rows} comparisons; {'quick' if quick else 'full'} run "
        f"in {sum(one.seconds for one in done):.0f} s on {platform.system()} {platform.machine()}, "
        + ", ".join(f"{name} {version}" for name, version in versions().items())
        + ".",
    )
    yield (
        "text",
        "Differences are relative to the reference unless a row says otherwise. ± is refweb's own estimate or bound.",
    )
    yield (
        "text",
        "Times and errors beside those of other programs stand in ``validation/PEERS.md``, which "
        "``python -m validation.peers`` writes.",
    )
    yield "result", (_result(done), not any(one.case.failures for one in done))
    yield "part", "Contents"
    yield (
        "table",
        ("", ("part", "case", "comparisons", "largest part of a tolerance", "agrees"), _contents(done), "contents"),
    )
    title, body = how_it_works.__doc__.split("\n\n", 1)
    yield "part", title
    yield from _described(body)
    for part, names in CASES.items():
        here = [one for one in done if one.name in names]
        if here:
            yield "part", _title(part)
        for one in here:
            title, body = text(one.name)
            yield "case", (one.name, title, not one.case.failures)
            yield from _described(body)
            yield "text", f"``python -m validation {'--quick ' * quick}{one.name}``, {one.seconds:.1f} s"
            for failure in one.case.failures:
                yield "failure", failure
            if one.case.rows:
                yield "table", ("", HEADS, [_row(row) for row in one.case.rows], "number")
            for verdict in one.case.verdicts:
                yield "verdict", verdict
            for table in one.case.tables:
                yield "table", (table.title, table.columns, [[str(c) for c in row] for row in table.rows], "plain")
            for number, figure in enumerate(one.case.figures, 1):
                yield "figure", (f"{one.name}-{number}.png", figure.caption)


def _title(part):
    return part.replace("_", " ").capitalize()


def _result(done):
    """What came out, in a sentence."""
    failed = [f"[{text(one.name)[0]}](#{one.name})" for one in done if one.case.failures]
    if failed:
        return f"{len(failed)} of {len(done)} cases fail: {', '.join(failed)}"
    return f"All {len(done)} cases agree" if len(done) > 1 else "The case agrees"


def _contents(done):
    parts = {name: part for part, names in CASES.items() for name in names}
    for one in done:
        used = [row.difference / row.tolerance for row in one.case.rows if row.tolerance > 0]
        share = f"{max(used):.2g}" if used else "no comparison of numbers"
        verdict = "no" if one.case.failures else "yes"
        part = _title(parts[one.name])
        link = f"[{part}](#{_anchor(part)})"
        yield [link, f"[{text(one.name)[0]}](#{one.name})", f"{len(one.case.rows)}", share, verdict]


def _anchor(title):
    """The name of a part as the target of a link."""
    return re.sub(r"\W+", "_", title.lower()).strip("_")


def _row(row):
    unit = "" if row.unit == "1" else f" {row.unit}"
    value = f"{row.value:.10g}" + (f" ± {row.error:.1e}" if row.error is not None else "") + unit
    reference = row.reference if isinstance(row.reference, str) else f"{row.reference:.10g}"
    measure = "" if row.scale == abs(float(row.reference)) or row.scale == 1 else f" of {row.scale:.3g}{unit}"
    if row.scale == 1 and abs(float(row.reference)) != 1:
        measure = unit or " absolute"
    return [
        row.name,
        value,
        reference + unit,
        row.source,
        f"{row.difference:.1e}{measure}",
        f"{row.tolerance:.1e}: {row.reason}",
        "yes" if row.passes else "no",
    ]


def _described(body):
    """Blocks of a docstring: paragraphs, lists, and what is indented by four as it stands."""
    for paragraph in filter(str.strip, re.split(r"\n\s*\n", body)):
        lines = paragraph.splitlines()
        if all(line.startswith("    ") for line in lines):
            yield "pre", "\n".join(line[4:] for line in lines)
        elif lines[0].startswith("- "):
            yield "list", [" ".join(item.split()) for item in re.split(r"^- ", paragraph, flags=re.MULTILINE)[1:]]
        else:
            yield "text", " ".join(paragraph.split())


def _inline(words):
    """Words as HTML: links to headings and DOIs, code."""
    words = html.escape(words, quote=False)
    words = re.sub(r"``(.+?)``", r"<code>\1</code>", words)
    words = re.sub(r"\[([^\]]+)\]\((#\w+)\)", r'<a href="\2">\1</a>', words)
    words = re.sub(r"\bdoi:(10\.\S+?)(?=[.,;:)]*(?:\s|$))", r'<a href="https://doi.org/\1">doi:\1</a>', words)
    words = re.sub(r"\*\*([^*\s][^*]*)\*\*", r"<strong>\1</strong>", words)
    return re.sub(r"\*([^*\s][^*]*)\*", r"<em>\1</em>", words)


def _mark(agrees):
    return "yes" if agrees else "no"


def _table(title, heads, rows, kind):
    def cell(number, words):
        mark = words if words in ("yes", "no") else "value" if kind == "number" and number in (1, 2, 4) else "words"
        label = html.escape(heads[number], quote=True)
        return f'<td class="{mark}" data-label="{label}"><span>{_inline(words)}</span></td>'

    head = "".join(f"<th>{_inline(word)}</th>" for word in heads)
    body = "\n".join("<tr>" + "".join(cell(i, word) for i, word in enumerate(row)) + "</tr>" for row in rows)
    caption = f"<p><strong>{_inline(title)}</strong></p>\n" if title else ""
    table = f'<table class="{kind}"><thead><tr>{head}</tr></thead>\n<tbody>{body}</tbody></table>'
    return f'{caption}<div class="scroll">{table}</div>'


def _page(blocks, images):
    out = []
    for kind, content in blocks:
        if kind == "title":
            out.append(f"<h1>{html.escape(content)}</h1>")
        elif kind == "part":
            out.append(f'<h2 id="{_anchor(content)}">{html.escape(content)}</h2>')
        elif kind == "result":
            out.append(f'<p class="result {_mark(content[1])}">{_inline(content[0])}</p>')
        elif kind == "case":
            name, title, agrees = content
            said = f'<span class="badge {_mark(agrees)}">{"agrees" if agrees else "fails"}</span>'
            out.append(f'<h3 id="{name}">{_inline(title)} {said} <a class="up" href="#contents">contents</a></h3>')
        elif kind == "text":
            out.append(f"<p>{_inline(content)}</p>")
        elif kind == "failure":
            out.append(f'<p class="no">fails: {_inline(content)}</p>')
        elif kind == "pre":
            out.append(f"<pre>{html.escape(content)}</pre>")
        elif kind == "list":
            out.append("<ul>" + "".join(f"<li>{_inline(item)}</li>" for item in content) + "</ul>")
        elif kind == "table":
            out.append(_table(*content))
        elif kind == "verdict":
            out.append(
                f"<blockquote><p>{_inline(content.claim)}</p>"
                f"<p><strong>{content.verdict}</strong>: {_inline(content.because)}</p></blockquote>"
            )
        elif kind == "figure":
            name, caption = content
            data = base64.b64encode(images[name].png).decode("ascii")
            words = html.escape(caption, quote=True)
            least = f'style="min-width: {images[name].width}px"'
            out.append(
                f'<figure><div class="scroll"><img alt="{words}" {least} src="data:image/png;base64,{data}"></div>'
                f"<figcaption>{_inline(caption)}</figcaption></figure>"
            )
    head = '<meta charset="utf-8">\n<meta name="viewport" content="width=device-width, initial-scale=1">\n'
    head += f"<title>refweb: validation</title>\n<style>{STYLE}</style>"
    body = "\n".join(out)
    return f'<!DOCTYPE html>\n<html lang="en">\n<head>\n{head}\n</head>\n<body>\n{body}\n</body>\n</html>\n'


def _markdown(blocks, figures=True):
    def line(cells):
        return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"

    out = []
    for kind, content in blocks:
        if kind == "title":
            out.append(f"# {content}")
        elif kind == "part":
            out.append(f'## <a id="{_anchor(content)}"></a>{content}')
        elif kind == "result":
            out.append(f"**{content[0]}**")
        elif kind == "case":
            out.append(f'### <a id="{content[0]}"></a>{content[1]}')
        elif kind == "failure":
            out.append(f"**fails: {content}**")
        elif kind == "pre":
            out.append(f"```\n{content}\n```")
        elif kind == "list":
            out.append("\n".join(f"- {item}" for item in content))
        elif kind == "table":
            title, heads, rows, _ = content
            rows = [line(heads), line("---" for _ in heads), *(line(row) for row in rows)]
            out.append((f"**{title}**\n\n" if title else "") + "\n".join(rows))
        elif kind == "verdict":
            out.append(f"> {content.claim}\n>\n> **{content.verdict}**: {content.because}")
        elif kind == "figure":
            out.append(f"![{content[1]}]({content[0]})" if figures else f"*Figure: {content[1]}*")
        else:
            out.append(content)
    return "\n\n".join(out) + "\n"
