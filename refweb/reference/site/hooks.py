"""Pages of the site that are made when it is built: parts of the README, references, docstrings, the validation report.

A page of ``pages/`` is written by hand and is also what ``refweb help`` prints. All others come from `PAGES`, so that
nothing is said in a second place.

May change: the order of parts and `FIRST`; `PLUG_INS` names what plug-ins are made of. Must stay: names of pages in
`PAGES`, which ``mkdocs.yml`` has; titles of sections of the README, which stand here letter by letter; `on_config` and
`on_files`, which mkdocs calls by these names. Tests: ``tests/reference/test_site.py``.
"""

from __future__ import annotations

import inspect
import re
from pathlib import Path

from mkdocs.structure.files import File  # pyright: ignore[reportMissingImports]

from refweb import kernels, registry
from refweb.reference import glossary, words

ROOT = Path(__file__).parents[3]
"""Folder of the clone."""
PICTURES = re.compile(r"validation/pictures/[\w.-]+")
KNOWN = {
    "validation/REFERENCE.md": "scene-files.md",
    "validation/REPORT.md": "validation.md",
    "validation/PEERS.md": "peers.md",
    "CONTRIBUTING.md": "",
}
"""Pages of the site for what the README links to."""
FIRST = """[Quick start](quick-start.md) · [A net of your own](own-net.md) · [How far can I trust it?](trust.md) ·
[Scene files](scene-files.md) · [Python](api.md) · [Theory](theory.md) · [Plug-ins](plug-ins.md)"""
"""Pages to begin with."""
PLUG_INS = (
    "refweb.tables:Table",
    "refweb.tables:table",
    "refweb.tables:real",
    "refweb.tables:vector",
    "refweb.tables:nodes",
    "refweb.effects.base:ForceTerm",
    "refweb.effects.base:Tangent",
    "refweb.effects.base:VelocityForce",
    "refweb.effects.base:Balance",
    "refweb.effects.base:Timing",
    "refweb.compiled.kernel:kernel",
    "refweb.net.net:Net",
    "refweb.net.rigid_body:Shape",
    "refweb.net.laws.law:TensionLaw",
    "refweb.results.observables.observable:Observable",
    "refweb.results.observables.balances:Booked",
    "refweb.results.probes:Probe",
    "refweb.dynamics.integrators.step_observer:StepObserver",
)
"""Parts that plug-ins are made of."""


def readme(*titles):
    """Sections of the README by their titles; "" is what stands before the first one."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    sections = dict(re.findall(r"(?ms)^## ([^\n]+)\n(.*?)(?=^## |\Z)", text))
    sections[""] = text.partition("\n## ")[0]
    return "\n\n".join((f"## {title}\n" if title else "") + linked(sections[title]) for title in titles)


def linked(text):
    """Text of a file at the root with links for the site; what has no page there stays as its name."""

    def link(match):
        label, target = match.groups()
        if PICTURES.fullmatch(target):
            return f"[{label}]({target.removeprefix('validation/')})"
        page = {**KNOWN, "CONTRIBUTING.md": "contributing.md"}.get(target)
        return f"[{label}]({page})" if page else f"{label} (`{target}`)" if "://" not in target else match.group()

    text = re.sub(r"<!--.*?-->\n", "", text)
    return re.sub(r"\[([^\]]*)\]\(([^)\s]+)\)", link, text)


def report():
    """The validation report without the figures, which stand beside it where it is run."""
    text = (ROOT / "validation" / "REPORT.md").read_text(encoding="utf-8")
    text = re.sub(r"!\[[^\]]*\]\([^)]*\)\n?", "", text)
    return re.sub(r"\[([^\]]*)\]\((?!#|https?:)[^)]*\)", r"\1", text)


def api():
    """Names of the package, and what plug-ins are made of, by their docstrings."""
    exported = {name: reference.replace(":", ".") for name, reference in registry.exports().items()}
    functions = sorted(name for name in exported if name[0].islower())
    effects = {reference.split(":")[1] for reference in registry.EFFECTS.values()}
    webs = {reference.split(":")[1] for reference in registry.WEBS.values()}
    others = sorted(exported.keys() - {*functions} - effects - webs)
    groups = {"Functions": functions, "Scenes and results": others, "Webs": sorted(webs), "Effects": sorted(effects)}
    parts = ["# Python", "Names of the package `refweb`, which are imported when they are used."]
    for title, members in groups.items():
        parts += [f"## {title}", *(f"::: {exported[name]}" for name in members)]
    parts += ["## Parts of plug-ins", *(f"::: {name.replace(':', '.')}" for name in PLUG_INS)]
    signatures = (inspect.getdoc(kernels) or "").split("\n\n", 1)[1].replace("`", "")
    return "\n\n".join([*parts, "## Signatures of kernels", f"```text\n{signatures}\n```"]) + "\n"


def text_of(name):
    """Text of a file at the root."""
    return lambda: linked((ROOT / name).read_text(encoding="utf-8"))


PAGES = {
    "index.md": lambda: "\n\n".join([readme(""), FIRST, readme("What it prints", "Recipes", "More")]),
    "trust.md": lambda: readme("How far can I trust it?").replace("## ", "# ", 1),
    "command-line.md": lambda: readme("Command line", "What it does not do").replace("## ", "# ", 1),
    "gallery.md": lambda: readme("Gallery").replace("## ", "# ", 1),
    "scene-files.md": lambda: words.as_markdown().replace(glossary.as_markdown(), "").strip() + "\n",
    "glossary.md": lambda: "# Glossary\n\n" + glossary.as_markdown().partition("\n\n")[2],
    "api.md": api,
    "validation.md": report,
    "peers.md": lambda: (ROOT / "validation" / "PEERS.md").read_text(encoding="utf-8"),
    "contributing.md": text_of("CONTRIBUTING.md"),
    "changes.md": text_of("CHANGELOG.md"),
    **{f"how-to/{name}.md": (lambda name=name: words.guide(f"own-{name}")) for name in words.HOW_TO},
}
"""Texts of the pages that are made, by their name."""


def on_config(config):
    """Let blocks of equations be set as MathML, which browsers show without a script."""
    fences = [{"name": "math", "class": "math", "format": equation}]
    config.mdx_configs["pymdownx.superfences"] = {"custom_fences": fences}
    return config


def equation(source, language, css_class, options, md, **more):
    """An equation in TeX as MathML."""
    from latex2mathml.converter import convert  # pyright: ignore[reportMissingImports]

    return f'<div class="{css_class}">{convert(source, display="block")}</div>'


def on_files(files, config):
    """Add the pages that are made, and the pictures of the README."""
    for name, made in PAGES.items():
        files.append(File.generated(config, name, content=made()))
    for path in sorted((ROOT / "validation" / "pictures").iterdir()):
        files.append(File.generated(config, f"pictures/{path.name}", abs_src_path=str(path)))
    return files
