"""Materials by name: typical modulus, density and strength of fibres and ropes.

Values of fibres are those of the yarn along its axis. A braided or twisted rope is softer and weaker than its yarn, by
its construction; knots and edges take more. So a material fills in what a first calculation needs, and the keys
``modulus``, ``density`` and ``strength`` of a scene go before it.

May change: values in `MATERIALS` and new materials, which change results of scenes that name the material. Must stay:
names of materials, which are the scene format; `FILLED`, which are keys of `Cable` and `Group`; help prints the table
to ``validation/REFERENCE.md``; `remarks`, which `runner` imports; `as_markdown`, which `reference.words` imports;
`as_text`, which `commands.help` imports. Tests: ``tests/net/test_materials.py``.
"""

from __future__ import annotations

from typing import NamedTuple

TEIJIN = "Teijin, Technora technical information, table 3: tenacity × density"


class Material(NamedTuple):
    """Typical values of a material.

    Attributes
    ----------
    modulus, density, strength : float
        E [Pa], ρ [kg/m³] and the stress at which it breaks [Pa].
    kind : str
        Kind of fibre or rope.
    source : str
        Where the values are from.
    """

    modulus: float
    density: float
    strength: float
    kind: str
    source: str


MATERIALS = {
    "dyneema": Material(
        1.2e11, 975.0, 3.6e9, "polyethylene fibre (HMPE), SK75 and SK78", "DSM Dyneema, fact sheet CIS YA100 (2010)"
    ),
    "technora": Material(7.35e10, 1390.0, 3.4e9, "aramid copolymer fibre", TEIJIN),
    "kevlar-49": Material(1.124e11, 1440.0, 3.0e9, "aramid fibre", "DuPont, Kevlar aramid fiber technical guide"),
    "zylon": Material(1.8e11, 1540.0, 5.8e9, "PBO fibre, type AS", "Toyobo, Zylon technical information (2005)"),
    "steel-rope": Material(
        1e11,
        7850.0,
        1.5e9,
        "strand rope with a steel core, per metallic section, wire grade 1770",
        "EN 1993-1-11, table 3.1 (modulus); EN 12385, 0.85 of the wire grade (strength)",
    ),
    "nylon": Material(9.3e9, 1140.0, 1.04e9, "polyamide 6.6 fibre, high tenacity", TEIJIN),
    "polyester": Material(1.24e10, 1380.0, 1.12e9, "polyester fibre, high tenacity", TEIJIN),
}
"""Materials that ``[cable] material`` may name."""
FILLED = {"modulus": "Pa", "density": "kg/m³", "strength": "Pa"}
"""Keys of a cable or a group that its material gives, with their units."""


def remarks(cable):
    """Remarks on values that a material gives to a `refweb.Cable` or to one of its groups."""
    for where, table in (("cable", cable), *((f'group "{name}"', group) for name, group in cable.groups.items())):
        if table.material is None:
            continue
        material = MATERIALS[table.material]
        given = [key for key in FILLED if getattr(table, key) == getattr(material, key)]
        values = ", ".join(f"{key} = {getattr(material, key):g} {FILLED[key]}" for key in given)
        if given:
            yield f"{where}: {values}: typical of {table.material}, {material.kind} ({material.source})"


def as_text():
    """The table of materials, a line each, with their sources."""
    width = max(map(len, MATERIALS))
    lines = [f"{'material':{width}}  modulus [Pa]  density [kg/m³]  strength [Pa]  kind, and source of the values"]
    for name, material in MATERIALS.items():
        numbers = f"{material.modulus:<12.4g}  {material.density:<15g}  {material.strength:<13.4g}"
        lines.append(f"{name:{width}}  {numbers}  {material.kind}: {material.source}")
    return "\n".join(lines)


def as_markdown():
    """The materials as a table of Markdown."""
    rows = [
        "| material | modulus [Pa] | density [kg/m³] | strength [Pa] | kind, and source of the values |",
        "|---|---|---|---|---|",
    ]
    for name, material in MATERIALS.items():
        numbers = f"{material.modulus:.4g} | {material.density:g} | {material.strength:.4g}"
        rows.append(f"| `{name}` | {numbers} | {material.kind}: {material.source} |")
    return "\n".join(rows)
