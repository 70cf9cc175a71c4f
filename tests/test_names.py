"""Names and docstrings in plain words: nouns of the field, verbs with an object, no bare filler words.

The glossary of the reference has the words; here is what no name and no first line of a docstring may be.
"""

import ast
import inspect
import itertools
import re

from import_graph import MODULES, nodes_of

BARE = set(
    "told found own one other most least whole way room place look note give take meet keep held shown seen here "
    "there".split()
)
"""Words that are no name by themselves."""
CONTRACT = {"sweeps.study": {"keep"}, "sizing.requirements": {"whole"}}
"""Keys of files that are read, whose names stay."""
VAGUE = {"What", "Whether", "Of", "That", "How", "Where", "Which", "Who", "Why", "As", "One", "When", "If", "By"}
"""Words that begin no docstring: it begins with a verb, or with the quantity."""
SENTENCE = re.compile(r"(?:^|[.:;?!]\s+)((?:What|Whether)\s.*?)(?=[.:;?!]\s|$)")
"""Sentence that begins with a what-clause, in a passage on one line."""


def defined(name):
    """Names that a module defines, with their lines."""
    for node in nodes_of(name):
        if isinstance(node, ast.Name | ast.Attribute) and isinstance(node.ctx, ast.Store):
            yield node.id if isinstance(node, ast.Name) else node.attr, node.lineno
        elif isinstance(node, ast.arg):
            yield node.arg, node.lineno
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield node.name, node.lineno


def test_names_say_what_they_are():
    bare = [
        f"{word} in line {line} of {name}"
        for name in MODULES
        for word, line in defined(name)
        if word.strip("_") in BARE - CONTRACT.get(name, set())
    ]
    assert not bare


def test_docstrings_say_what_they_are():
    parts = [
        (name, node)
        for name in MODULES
        for node in nodes_of(name)
        if isinstance(node, ast.FunctionDef | ast.ClassDef | ast.Module)
    ]
    texts = [(name, text) for name, node in parts if (text := ast.get_docstring(node))]
    vague = [(name, text.splitlines()[0]) for name, text in texts if text.split()[0].rstrip(",") in VAGUE]
    assert not vague


def passages(text):
    """Passages of a docstring, each on one line: paragraphs and descriptions, without examples."""
    literal, kept = None, []
    for line in inspect.cleandoc(text).splitlines():
        indent = len(line) - len(line.lstrip())
        if literal is not None and line and indent <= literal:
            literal = None
        kept.append("" if literal is not None or line.lstrip().startswith(">>>") else line)
        if literal is None and line.endswith("::"):
            literal = indent
    groups = itertools.groupby(kept, key=lambda line: len(line) - len(line.lstrip()) if line else None)
    return [" ".join(" ".join(group).split()) for indent, group in groups if indent is not None]


def test_no_sentence_begins_with_a_what_clause():
    texts = [
        (name, node.value.value)
        for name in MODULES
        for node in nodes_of(name)
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
    ]
    clauses = [
        (name, found) for name, text in texts for passage in passages(text) for found in SENTENCE.findall(passage)
    ]
    assert not clauses
