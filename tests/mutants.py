"""Bugs of one line, put into a copy of the code one at a time, and the tests that notice them.

    python tests/mutants.py [--list] [--trusted] [--keep FOLDER] [NUMBERS or WORDS]

runs, for each bug or for those of some numbers or words in it, the test files that mirror the changed file, and says
which test noticed it first. Its exit status is 1 where one survives that is not a named equivalent, and where tests
fail without any. Kernels with a bug, and those that are compiled with them, are compiled anew.

`test_mutants.py` sees to it that the list stays true: every text stands in its file exactly once.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import time
from typing import NamedTuple

ROOT = pathlib.Path(__file__).resolve().parents[1]
COPIED = ("refweb", "tests", "validation", "README.md", "CONTRIBUTING.md", "pyproject.toml", "LICENSE", "CITATION.cff")
LONGEST = 1800.0
"""Time that the tests of a bug may take [s]; one that makes them hang is noticed as well."""
MIRRORS = {
    "compiled": "compiled/test_kernel.py compiled/test_pointers.py compiled/test_keys.py compiled/test_store.py",
    "compiled/keys": "compiled/test_keys.py compiled/test_kernel.py",
    "compiled/store": "compiled/test_store.py compiled/test_kernel.py",
    "net/web": "net/test_webs.py",
    "net/lattices": "net/test_webs.py net/test_window_sizes.py",
    "net/faces": "net/test_faces.py",
    "net/obj_file": "net/test_faces.py net/test_boundary.py",
    "net/csv_files": "net/test_faces.py net/test_mesh_files.py",
    "commands/doubts": "commands/test_doubts.py",
    "net/single_cable": "net/test_webs.py",
    "net/discretisation": "net/test_elements.py system/test_orders.py",
    "net/elements": "net/test_elements.py system/test_orders.py",
    "net/cable": "net/test_elements.py test_scene.py studies/test_form.py",
    "net/sag": "studies/test_form.py",
    "statics/bars": "studies/test_form.py statics/test_statics.py",
    "system/dissection": "system/test_multifrontal.py",
    "system/multifrontal": "system/test_multifrontal.py",
    "system/supernodal": "system/test_supernodal.py",
    "system/weak_form": "net/test_elements.py",
    "system/kernel_trial": "test_plugins.py",
    "net/laws": "net/test_laws.py net/test_elements.py",
    "net/laws/curve": "net/test_curves.py effects/test_viscous.py",
    "net/laws/law": "how_to/test_law.py",
    "net/law_keys": "net/test_curves.py how_to/test_law.py effects/test_viscous.py",
    "net/rigid_body": "effects/test_contact.py test_contract.py effects/test_tumbling.py effects/test_axles.py",
    "net/rotation": "net/test_rotation.py effects/test_tumbling.py effects/test_axles.py",
    "effects/axle": "effects/test_axles.py",
    "effects/motion": "effects/test_moved_bodies.py",
    "effects/body_load": "dynamics/test_attitude.py",
    "net/quaternions": "dynamics/test_attitude.py effects/test_moved_bodies.py",
    "results/observables/fuel": "dynamics/test_control.py",
    "results/observables/support": "effects/test_axles.py",
    "net/rotation_bounds": "net/test_rotation.py",
    "net/solid": "net/test_rotation.py",
    "effects/contact/rotational_stiffness": "effects/test_tumbling.py",
    "net/shapes": "effects/test_contact.py",
    "net/shapes/plane": "effects/test_ground.py",
    "net/shapes/terrain": "effects/test_ground.py",
    "net/boundary/heights": "effects/test_ground.py",
    "net/boundary/repair": "net/test_repair.py",
    "net/boundary/winding": "net/test_repair.py",
    "net/boundary/polygons": "net/test_repair.py",
    "net/grown_core": "effects/test_deep_contact.py",
    "effects/contact/overlap": "effects/test_overlap.py",
    "effects/contact/line_body_ccd": "effects/test_passage.py",
    "dynamics/integrators/passages": "effects/test_passage.py effects/test_between_bodies.py",
    "dynamics/integrators/ccd": "effects/test_passage.py effects/test_self_contact.py",
    "effects/self_contact/line_line_ccd": "effects/test_self_contact.py",
    "effects/self_contact/line_line_penalty": "effects/test_self_contact.py",
    "effects/self_contact/line_line_friction": "effects/test_self_contact.py",
    "effects/contact/line_body_friction": "effects/test_contact_losses.py effects/test_contact.py",
    "effects/contact_solver": "effects/test_contact_losses.py effects/test_attached_contact_losses.py "
    "effects/test_contact.py",
    "effects/contact/body_body_penalty": "effects/test_between_bodies.py",
    "effects/contact/bodies": "effects/test_between_bodies.py",
    "effects/contact/pair_overlap": "effects/test_between_bodies.py",
    "effects/contact/body_body_detection": "effects/test_between_bodies.py",
    "effects/contact/undetected_overlap": "effects/test_between_bodies.py",
    "effects/contact/body_body_friction": "effects/test_between_bodies.py",
    "net/skeleton": "effects/test_between_bodies.py",
    "effects/contact/pair": "effects/test_tumbling.py test_contract.py",
    "effects/contact/penalty": "results/test_contact_force.py dynamics/integrators/test_nearby.py test_contract.py",
    "effects/contact/contact_points": "dynamics/integrators/test_nearby.py test_contract.py effects/test_contact.py "
    "effects/test_overlap.py effects/test_deep_contact.py",
    "effects/contact": "test_contract.py effects/test_contact.py effects/test_overlap.py effects/test_deep_contact.py",
    "dynamics/integrators/rupture": "effects/test_rupture.py effects/test_plastic.py",
    "net/laws/consistency": "how_to/test_law.py",
    "net/mesh_file": "effects/test_rupture.py effects/test_thread.py",
    "net/threads": "effects/test_thread.py effects/test_around.py effects/test_thread_friction.py",
    "effects/around": "effects/test_around.py",
    "statics/thread_bars": "effects/test_thread.py",
    "effects/half_turns": "effects/test_around.py",
    "dynamics/half_turns": "effects/test_around.py",
    "effects/winding": "effects/test_around.py test_contract.py",
    "effects/thread_slips": "effects/test_thread_friction.py effects/test_winch.py",
    "effects/winch_power": "effects/test_winch.py test_contract.py",
    "effects/wound_lines": "effects/test_wound_lines.py test_contract.py",
    "effects/wound_mass": "effects/test_winch_mass.py",
    "effects/thread_friction": "effects/test_thread_friction.py effects/test_winch.py test_contract.py "
    "effects/test_winch_mass.py",
    "results/observables/thread": "effects/test_thread.py effects/test_thread_friction.py",
    "system/broken_lines": "effects/test_rupture.py",
    "effects/base": "test_contract.py dynamics/integrators/test_ida.py",
    "effects/elasticity": "net/test_elements.py test_contract.py",
    "effects/line_blocks": "net/test_elements.py dynamics/integrators/test_line_blocks.py",
    "effects/line_kernels": "net/test_elements.py test_contract.py",
    "effects/temperature": "effects/test_temperature.py",
    "effects/natural_lengths": "effects/test_viscous.py",
    "effects/damping": "test_contract.py effects/test_damping.py effects/test_viscous.py system/test_system.py",
    "effects/rupture": "effects/test_rupture.py effects/test_plastic.py",
    "effects/outer_load": "test_contract.py",
    "effects/mass_flow": "effects/test_reel_mass.py effects/test_winch_mass.py",
    "effects/sliding_material": "effects/test_reel_mass.py",
    "effects/drag": "test_contract.py effects/test_drag.py",
    "effects/turning_axes": "test_contract.py effects/test_frame.py effects/test_orbit.py",
    "effects/body_damping": "dynamics/test_bodies_come_to_rest.py",
    "effects": "test_contract.py effects/test_{}.py",
    "system/links": "dynamics/integrators/test_ida.py",
    "system/attached_nodes": "effects/test_attach.py statics/test_free_bodies.py studies/test_modes_with_bodies.py",
    "system/resting_bodies": "effects/test_axles.py statics/test_free_bodies.py studies/test_modes_with_bodies.py",
    "system/material_flow": "effects/test_reel_mass.py effects/test_winch_mass.py",
    "system/static_system": "dynamics/test_bodies_come_to_rest.py dynamics/test_starts.py",
    "system": "system/test_system.py test_contract.py dynamics/integrators/test_cvode.py",
    "system/system": "system/test_system.py test_contract.py dynamics/integrators/test_cvode.py effects/test_thread.py "
    "effects/test_axles.py",
    "statics/body_penetration": "effects/test_overlap.py",
    "effects/contact/sharp_edges": "statics/test_sharp_edges.py",
    "statics/contact_kinks": "statics/test_contact_kinks.py",
    "statics/shared_push": "statics/test_contact_kinks.py",
    "system/contact_shares": "statics/test_contact_kinks.py",
    "statics/smoothing_error": "dynamics/test_accuracy.py",
    "statics/critical_speed": "effects/test_frame.py",
    "statics/dynamic_relaxation": "statics/test_relaxation.py statics/test_free_bodies.py",
    "statics/predictor": "statics/test_reused_factorization.py",
    "system/conjugate_gradients": "statics/test_reused_factorization.py",
    "statics/floating": "statics/test_floating.py",
    "statics/interval": "statics/test_floating.py",
    "statics/lowest": "statics/test_lowest.py",
    "statics/energy_search": "statics/test_stability.py",
    "statics/stability": "statics/test_stability.py",
    "statics/slowest_vibrations": "statics/test_stability.py",
    "statics/snap_through": "statics/test_stability.py",
    "statics/simulation": "statics/test_statics.py results/test_frames.py",
    "statics/duality_bound": "net/test_curves.py statics/test_reused_factorization.py statics/test_statics.py "
    "dynamics/test_accuracy.py",
    "statics/adjoint": "statics/test_gradients.py",
    "statics/responses": "statics/test_gradients.py",
    "statics/gradients": "statics/test_gradients.py effects/test_reel_mass.py",
    "studies/modes": "effects/test_reel_mass.py studies/test_modes.py",
    "studies/frequency_gradients": "studies/test_frequency_gradients.py",
    "statics/monotone_loading": "statics/test_monotone_loading.py",
    "statics/newton": "statics/test_stability.py statics/test_reused_factorization.py statics/test_statics.py",
    "statics": "statics/test_reused_factorization.py statics/test_statics.py dynamics/test_accuracy.py",
    "dynamics/accuracy_loop": "dynamics/test_budget.py test_faults.py dynamics/test_accuracy.py",
    "dynamics/budget": "dynamics/test_budget.py",
    "dynamics/twin_error": "dynamics/test_coarser_twin.py dynamics/test_agreement_by_chance.py "
    "dynamics/test_one_row.py dynamics/test_events.py dynamics/test_dynamics.py",
    "dynamics/gradients": "dynamics/test_dynamic_gradients.py dynamics/test_gradient_jumps.py",
    "dynamics/kinks": "dynamics/test_dynamic_gradients.py dynamics/test_gradient_jumps.py",
    "dynamics/linear_run": "dynamics/test_dynamic_gradients.py dynamics/test_gradient_jumps.py",
    "dynamics/responses": "dynamics/test_dynamic_gradients.py",
    "dynamics/peaks": "dynamics/test_dynamic_gradients.py dynamics/test_gradient_jumps.py",
    "dynamics/parameters": "dynamics/test_dynamic_gradients.py dynamics/test_gradient_jumps.py",
    "dynamics/integrators/snaps": "dynamics/test_gradient_jumps.py",
    "dynamics/integrators/tangent": "dynamics/test_dynamic_gradients.py dynamics/test_gradient_jumps.py",
    "dynamics/history": "dynamics/test_agreement_by_chance.py dynamics/test_dynamics.py results/test_remarks.py "
    "effects/test_plastic.py",
    "dynamics/initial_state": "dynamics/test_starts.py dynamics/test_internal_start.py",
    "dynamics/internal_start": "dynamics/test_internal_start.py",
    "dynamics/commands": "dynamics/test_stepped_run.py effects/test_wound_lines.py",
    "dynamics/stepped_run": "dynamics/test_stepped_run.py",
    "dynamics/controllers": "dynamics/test_control.py dynamics/test_attitude.py effects/test_winch.py",
    "gym": "gym/test_environment.py",
    "sweeps/episodes": "gym/test_environment.py",
    "dynamics/control_laws": "dynamics/test_control.py",
    "dynamics/schedule": "dynamics/test_one_row.py dynamics/test_default_rows.py dynamics/test_dynamics.py",
    "dynamics/simulation": "test_faults.py dynamics/test_dynamics.py dynamics/test_starts.py",
    "dynamics/integrators/central_difference": "dynamics/test_coarser_twin.py dynamics/test_agreement_by_chance.py "
    "dynamics/test_dynamics.py",
    "dynamics/integrators/explicit_loop": "dynamics/integrators/test_joined_kicks.py "
    "dynamics/integrators/test_nearby.py dynamics/test_dynamics.py dynamics/test_impact.py",
    "dynamics/integrators/energy_balance": "dynamics/test_agreement_by_chance.py test_readme.py "
    "dynamics/test_corners.py dynamics/test_impact.py effects/test_moved_bodies.py effects/test_axles.py",
    "dynamics/integrators/ida": "dynamics/integrators/test_ida.py",
    "dynamics/integrators/yielding": "effects/test_plastic.py",
    "dynamics/integrators/averages": "dynamics/test_averages.py",
    "dynamics/integrators/events": "dynamics/test_bodies_come_to_rest.py dynamics/test_events.py",
    "dynamics/integrators": "dynamics/integrators/test_cvode.py dynamics/test_dynamics.py",
    "dynamics": "dynamics/test_dynamics.py",
    "results/observables/observable": "statics/test_supported_lines.py results/test_observable_contract.py "
    "dynamics/test_accuracy.py statics/test_statics.py",
    "results/observables/distances": "results/test_distances.py",
    "results/observables/overlap": "results/test_contact_force.py results/test_every_number.py",
    "system/contact_forces": "results/test_every_number.py results/test_contact_force.py",
    "dynamics/integrators/contacts": "results/test_contact_force.py",
    "results/probes": "results/test_probes.py results/test_observable_contract.py effects/test_plastic.py",
    "tables": "test_tables.py",
    "results/progress": "results/test_loaded.py",
    "results/observables": "results/test_observable_contract.py results/test_selections.py "
    "dynamics/test_accuracy.py statics/test_statics.py",
    "runner": "results/test_remarks.py",
    "build": "test_build.py",
    "effects/self_contact/table": "effects/test_self_contact.py",
    "effects/self_contact/search": "dynamics/integrators/test_nearby.py effects/test_self_contact.py",
    "dynamics/integrators/neighbour_list": "dynamics/integrators/test_nearby.py",
    "dynamics/integrators/step_bound": "dynamics/integrators/test_nearby.py effects/test_self_contact.py",
    "results/columns": "test_build.py effects/test_winch_mass.py",
    "results/units": "results/test_loaded.py",
    "results/strength": "results/test_strength.py",
    "results/throw": "results/test_throw.py",
    "results/comparison": "results/test_comparison.py",
    "results/state": "results/test_results.py results/test_observable_contract.py results/test_remarks.py",
    "results": "results/test_results.py test_faults.py",
    "pages": "pages/test_page.py",
    "pictures/paraview": "pictures/test_viewers.py",
    "pictures/camera": "pictures/test_pictures.py pictures/test_large.py",
    "pictures/frames": "pictures/test_pictures.py",
    "pictures/record": "pictures/test_pictures.py",
    "pictures/movie_writer": "pictures/test_pictures.py",
    "pictures/balances": "pictures/test_plots.py",
    "pictures/spectra": "pictures/test_plots.py",
    "pictures/histories": "pictures/test_plots.py",
    "pictures/sheet": "pictures/test_plots.py",
    "pictures/distances": "pictures/test_plots.py",
    "studies/predictability": "studies/test_horizon.py dynamics/test_control.py",
    "studies/further_runs": "studies/test_further_runs.py",
    "results/error_budget": "results/test_error_budget.py studies/test_further_runs.py",
    "dynamics/divergence": "results/test_error_budget.py dynamics/test_dynamic_gradients.py",
    "studies/discretisation_error": "dynamics/test_accuracy.py",
    "studies/spectrum": "studies/test_modes.py",
    "studies/turning": "studies/test_turning.py",
    "studies/pencil": "studies/test_modes.py",
    "sweeps/expressions": "sweeps/test_expressions.py",
    "sweeps/chances": "sweeps/test_chances.py",
    "sweeps": "sweeps/test_sweep.py sweeps/test_chances.py",
    "sizing": "sizing/test_size.py",
    "results/case_rows": "sweeps/test_sweep.py",
    "studies/form": "studies/test_form.py",
    "studies": "studies/test_cost.py",
    "reference/paths": "reference/test_paths.py",
    "reference": "reference/test_help.py reference/test_schema.py",
    "accepted": "reference/test_schema.py",
    "commands/new": "commands/test_new.py",
    "commands": "commands/test_cli.py commands/test_values.py",
    "__main__": "commands/test_cli.py",
    "scene": "test_scene.py dynamics/test_default_rows.py",
    "solution": "dynamics/test_starts.py",
    "registry": "test_plugins.py",
}
"""Test files of a file or a folder, that with the longest name that fits; ``{}`` is the name of the file."""


class Mutant(NamedTuple):
    """A bug of one line.

    Attributes
    ----------
    file : str
        The changed file, without its ending, below the package.
    text, wrong : str
        What stands there, and what stands there instead.
    same : str
        Why nothing can be noticed, of an equivalent; empty otherwise.
    """

    file: str
    text: str
    wrong: str
    same: str = ""

    @property
    def path(self):
        """The changed file, from the root of the code."""
        return pathlib.Path("refweb") / f"{self.file}.py"

    @property
    def tests(self):
        """Test files that mirror it, from the root of the code."""
        parts = self.file.split("/")
        names = ("/".join(parts[:end]) for end in range(len(parts), 0, -1))
        files = MIRRORS[next(name for name in names if name in MIRRORS)].format(parts[-1]).split()
        return [f"tests/{file}" for file in files if (ROOT / "tests" / file).exists()]

    def changed(self, code):
        """The code of its file with the bug; an error where its text does not stand there exactly once."""
        if (count := code.count(self.text)) != 1:
            raise ValueError(f"{self.path}: {self.text!r} stands there {count} times, must be once")
        return code.replace(self.text, self.wrong)


MUTANTS = [
    # Bodies, shapes and webs
    Mutant("net/web", "len(points) + self.components()[0])", "len(points) + 1)"),
    Mutant("net/web", "for axis in (1, 0, 2):", "for axis in (0, 1, 2):"),
    Mutant("net/web", "np.roll(self.points[hull, :2], -1, axis=0)", "np.roll(self.points[hull, :2], 1, axis=0)"),
    Mutant("net/lattices", "inner & (count < 2)", "inner & (count < 1)"),
    Mutant("net/lattices", "round(min((length / self.side - more) / pitch", "round(min((length / self.side) / pitch"),
    Mutant("net/faces", "np.roll(corners, -1, axis=1)", "np.roll(corners, -2, axis=1)"),
    Mutant("net/faces", "cells[:, [0, 1, 3, 2]]", "cells[:, [0, 1, 2, 3]]"),
    Mutant("net/obj_file", "else count + corner", "else count + corner - 1"),
    Mutant("net/csv_files", "for end in pairs]) - first", "for end in pairs])"),
    Mutant("registry", "if len(entries) > 1:", "if len(entries) > 2:"),
    Mutant("registry", "(name in SHIPPED[kind] or name not in", "(name not in"),
    Mutant("compiled/keys", "and not _in_library(value.__name__)", "and _in_library(value.__name__)"),
    Mutant("commands/doubts", "0.5 * high**2 * np.sin(", "high**2 * np.sin("),
    Mutant("commands/doubts", "distances[0] > 0.0", "distances[0] < 0.0"),
    Mutant("scene", "min(max(SHORTEST_INTERVAL, ", "min(min(SHORTEST_INTERVAL, "),
    Mutant("dynamics/schedule", "((rows - 1) % scene.output.frames != 0)", "(rows % scene.output.frames != 0)"),
    Mutant("net/lattices", "3 * layers * layers - 3 * layers + 1", "3 * layers * layers + 3 * layers + 1"),
    Mutant("net/lattices", "if cells > _MOST_CELLS:", "if cells >= _MOST_CELLS:"),
    Mutant("net/lattices", '"hexagon": (45, 40)', '"hexagon": (44, 40)'),
    Mutant("net/single_cable", "scale * np.sin((n - k) * phi)", "-scale * np.sin((n - k) * phi)"),
    Mutant("net/grown_core", "past < WIDENING * width", "past < width"),
    Mutant("net/grown_core", "by_tt = g1 * g1 *", "by_tt = g1 *"),
    Mutant("effects/contact/contact_points", " or abs(step - xi) > 0.5 * moved", ""),
    Mutant("effects/contact/contact_points", "deep + reach, dot(", "deep + 0.9 * reach, dot("),
    Mutant("effects/contact/contact_points", "deep + slope * (xi - before)", "deep"),
    Mutant("effects/contact/penalty", " or nodes == 2 and not reaches(reach, x, cells, data, c, nodes, functions)", ""),
    Mutant(
        "effects/contact/penalty",
        "reaches(reach, x, cells, data, c, nodes, functions)\n            return",
        "1\n            return",
    ),
    Mutant("net/shapes/rounding", "ROUNDING = 0.02", "ROUNDING = 0.03"),
    Mutant("net/shapes/plane", "(0.0, 0.0, -1.0), (0.0", "(0.0, 0.0, 1.0), (0.0"),
    Mutant("net/shapes/terrain", "- (thickness or DEEP * longest)", "+ (thickness or DEEP * longest)"),
    Mutant("net/boundary/heights", "np.lexsort((points[:, 1], points[:, 0]))", "np.arange(len(points))"),
    Mutant("net/boundary/repair", "(beside == 0) | (beside % 2 == 1)", "(beside == 0)"),
    Mutant("net/boundary/repair", "~pieces.as_given, pieces.volume < 0.0)", "~pieces.as_given, pieces.volume > 0.0)"),
    Mutant("net/boundary/repair", "volume * np.outer(centre, centre)", "np.outer(centre, centre)"),
    Mutant("net/boundary/winding", "side != 0 and at > z", "side != 0 and at < z"),
    Mutant("net/boundary/winding", "total[5] += x * y * length", "total[5] += x * x * length"),
    Mutant("net/boundary/polygons", "(apart & apart.T).any()", "False"),
    Mutant("net/boundary/polygons", "if value > best and not _holds(flat, left, (a, b, c), size)", "if value > best"),
    Mutant("net/discretisation", "quadrature=gauss(element.maxdeg))", "quadrature=gauss(element.maxdeg + 1))"),
    Mutant("system/weak_form", "stiffness * stretching + tension / stretch", "stiffness * stretching + tension"),
    Mutant("net/elements", "np.array([0.5, 0.5])", "np.array([0.6, 0.4])"),
    Mutant("net/laws/line_data", "return 2.0 * smoothing**2 / np", "return smoothing**2 / np"),
    Mutant("net/cable", "web.natural_length / (1.0 + strain)", "web.natural_length * (1.0 - strain)"),
    Mutant("net/cable", 'density * values["natural_length"], force)', "density, force)"),
    Mutant("net/sag", "return np.sinh(u) / u", "return np.sinh(u) / u + u * u"),
    Mutant("statics/bars", "np.maximum(strain + forming, 0.0)", "np.maximum(strain, 0.0)"),
    Mutant(
        "studies/form",
        "lengths, before = np.where(net.forming, natural, web.natural_length), change",
        "before = change",
    ),
    # Laws, forces and tangents
    Mutant(
        "net/laws/smooth",
        "return 2.0 * smoothing * smoothing / (r - s), r",
        "return smoothing * smoothing / (r - s), r",
    ),
    Mutant(
        "net/laws/smooth",
        "return lines.ea * (2.0 * smoothing * smoothing / (total",
        "return lines.ea * (smoothing * smoothing / (total",
    ),
    Mutant("net/laws/curve", "slope[end] = 0.5 * chord[end]", "pass"),
    Mutant("net/laws/curve", "h * (c[2] / 3.0 + h * c[3] / 4.0)", "h * (c[2] / 3.0 + h * c[3] / 3.0)"),
    Mutant("net/laws/curve", "self.steepest = float(max(slope.max(), inner", "self.steepest = float(max(0.0, inner"),
    Mutant("net/laws/law", "if line.law == number:", "if line.law != number:"),
    Mutant("net/laws/law", "return np.where(endless, np.inf, high)", "return high"),
    Mutant("net/law_keys", 'object.__setattr__(table, "modulus", None)', "pass"),
    Mutant("effects/line_kernels", "d * (along - across) * p[i] * p[j]", "d * along * p[i] * p[j]"),
    Mutant("system/dissection", "numbers[active] = 2 * numbers[active] +", "numbers[active] = numbers[active] +"),
    Mutant("system/supernodal", "factor[u(ones[e])] = 1.0", "factor[u(ones[e])] = 0.0"),
    Mutant("system/supernodal", "(l20 * w0 + l21 * w1)", "(l20 * w0)"),
    Mutant("system/multifrontal", "later = later[later >= end]", "later = later[later > end]"),
    Mutant("system/multifrontal", "dsyrk(-1.0, rest, beta=1.0", "dsyrk(-1.0, rest, beta=0.5"),
    Mutant("effects/elasticity", "pulled = (1.0 + e) * stress", "pulled = stress"),
    Mutant("effects/line_blocks", "f[j, 1] -= d1", "f[j, 1] -= d0"),
    Mutant("effects/line_blocks", "range(behind - 1, first - 1, -1)", "range(behind - 1, first, -1)"),
    Mutant("effects/line_blocks", "element + k * stride", "element + k"),
    Mutant("effects/line_blocks", "(strides[1:] == strides[:-1])", "(strides[1:] > 0)"),
    Mutant("effects/line_blocks", "if tension > highest.tension or", "if tension > 1.1 * highest.tension or"),
    Mutant("effects/line_blocks", "RESTS if rests and all_zero(d, 3 * count) else", "RESTS if rests else"),
    Mutant("effects/line_blocks", "if rests and shows.rest == RESTS", "if rests and shows.rest != MOVES"),
    Mutant("effects/line_blocks", "larger(largest, tension)", "larger(0.0, tension)"),
    Mutant(
        "effects/damping",
        "max(time * rate * tangent(e, line), -above_floor(e, line))",
        "time * rate * tangent(e, line)",
    ),
    Mutant(
        "effects/damping",
        "power -= weights[q] * line.natural_length * pull * rate",
        "power += weights[q] * line.natural_length * pull * rate",
    ),
    Mutant("effects/damping", "along = share * (by_strain - by_rate * growth(data, c))", "along = share * by_strain"),
    Mutant("effects/natural_lengths", "lengths.growth] += slope / factor", "lengths.growth] += slope"),
    Mutant(
        "effects/plastic", "yields, ahead = slope, p + beyond / (ea + slope)", "yields, ahead = slope, p + beyond / ea"
    ),
    Mutant("effects/plastic", "slope = line.ea * yields / (line.ea + yields)", "slope = yields"),
    Mutant("effects/plastic", "length = 0.5 * (before + length) if before > 0.0 else length", "length += 0.0"),
    Mutant("dynamics/history", "limits[o.name] = max(limits[o.name], course.worst)", "limits[o.name] += 0.0"),
    Mutant("dynamics/integrators/rupture", ">= 1.0) | self._yielded(course))", ">= 1.0))"),
    Mutant(
        "net/laws/consistency", "off = (rise < low - allowed) | (rise > high + allowed)", "off = rise < low - allowed"
    ),
    Mutant("effects/plastic", "(y0 + 0.5 * (end - p0)", "(y0 + (end - p0)"),
    Mutant("effects/plastic", "return plastic + tension / numbers.ea", "return plastic"),
    Mutant("effects/rupture", "np.where(yields & ~np.isnan(plastic), strains, np.inf)", "strains"),
    Mutant(
        "results/probes",
        "share = max(lines[n, rows[0]] * data[n, 0], lines[n, rows[1]] * data[n, 1])",
        "share = lines[n, rows[0]] * data[n, 0]",
    ),
    Mutant(
        "statics/monotone_loading",
        "return bool((reached - asked > margin[:, None])",
        "return bool((0.0 > margin[:, None])",
    ),
    Mutant("statics/adjoint", "((1.0 + self.strain) * self.tangent * along)", "(self.tangent * along)"),
    Mutant(
        "statics/adjoint", "self.stretch(rows), self.net.line_data.ea", "self.stretch(-rows), self.net.line_data.ea"
    ),
    Mutant(
        "statics/responses",
        "reacting[group] = np.where(linear.system.supported[group], along, 0.0)",
        "reacting[group] = 0.0",
    ),
    Mutant("statics/responses", "explicit.area[cell] = -sign * tension", "explicit.area[cell] = 0.0 * tension"),
    Mutant("statics/gradients", "(rows - response.reacting).plus(response.explicit)", "(rows - response.reacting)"),
    Mutant("statics/adjoint", "add_moves(self.x, rows[None])", "add_moves(self.x, 0.0 * rows[None])"),
    Mutant(
        "statics/gradients",
        "strains = np.hstack([strains, corners_of(self.state.system.net)])",
        "strains = strains * 1",
    ),
    Mutant("statics/gradients", "near & felt & kinked", "near & kinked"),
    Mutant("studies/frequency_gradients", "total.axial[:] -= linear", "total.axial[:] += linear"),
    Mutant("studies/frequency_gradients", "across = 2.0 * excess", "across = 1.0 * excess"),
    Mutant("studies/frequency_gradients", "count - 1 - at], error", "at], error"),
    Mutant("studies/frequency_gradients", "total.mass[:] += 4.0 * omega", "total.mass[:] += 2.0 * omega"),
    Mutant("studies/frequency_gradients", "if number < len(pairs) else 1j * off", "if True else 1j * off"),
    Mutant("studies/frequency_gradients", "np.isin(system.free // 3, spins)", "np.isin(system.free // 3, [])"),
    Mutant("statics/monotone_loading", "(slope / (ea + slope)).T", "(slope / ea).T"),
    Mutant("statics/gradients", "rows - reacting + loaded", "rows - reacting + 0.0 * loaded"),
    Mutant("statics/responses", "|= system.fixed[", "|= False & system.fixed["),
    Mutant(
        "dynamics/integrators/tangent",
        "self.v += 0.5 * h * self.a\n        self.x",
        "self.v += h * self.a\n        self.x",
    ),
    Mutant("dynamics/integrators/tangent", "self.v + 0.5 * h * a\n", "self.v + h * a\n"),
    Mutant("dynamics/integrators/tangent", "dx[self._driven], dv[self._driven] = number", "_ = number"),
    Mutant("dynamics/parameters", "if self._lighter.any():", "if False:"),
    Mutant(
        "dynamics/parameters",
        "if _relative(low.net.line_data.matrix",
        "if False and _relative(low.net.line_data.matrix",
    ),
    Mutant("dynamics/parameters", "_tables(low) != _tables(high)", "False"),
    Mutant("dynamics/responses", "[(number.step, True, 0.0), *(", "[*("),
    Mutant("dynamics/responses", "weight = speeds[r] / (speeds[r] - speeds[f])", "weight = 0.5 + 0.0 * speeds[r]"),
    Mutant("dynamics/responses", "np.where(kink, right, rate)", "rate"),
    Mutant("dynamics/integrators/snaps", "change += inverse * total", "change += 0.0 * total"),
    Mutant(
        "dynamics/integrators/snaps", "change += (high - low) / (2.0 * number.step)", "change += 0.0 * (high - low)"
    ),
    Mutant("dynamics/integrators/snaps", "jump -= 0.5 * (bend", "jump -= 0.0 * (bend"),
    Mutant("dynamics/integrators/snaps", "self.kinks.setdefault(n, (since,", "_ = (n, (since,"),
    Mutant("dynamics/integrators/snaps", "        if corner:\n", "        if False:\n"),
    Mutant("dynamics/integrators/snaps", "<= MOVED * np.abs(rates)", "<= 1.0 * np.abs(rates)"),
    Mutant("dynamics/integrators/tangent", "            self._drive(t, t)\n", "            pass\n"),
    Mutant("dynamics/integrators/tangent", "-= h * (self.a - before[1])", "-= 0.0 * (self.a - before[1])"),
    Mutant("dynamics/integrators/energy_balance", "rounding ** (1 if system.works else 2)", "rounding**2"),
    Mutant("dynamics/integrators/energy_balance", "rounding * _work_of_arms(system, turns)", "0.0"),
    Mutant("dynamics/integrators/energy_balance", "times = {0.0, *system.corners.tolist()}", "times = {0.0}"),
    Mutant("dynamics/linear_run", "self.at_snaps.update(", "set().update("),
    Mutant("dynamics/gradients", "error[:-shifts], largest[-shifts:]", "error[:-shifts], 0.0"),
    Mutant("dynamics/linear_run", "value + move, left + move", "value, left"),
    Mutant("dynamics/linear_run", "if before is now or not SIGN[o.reduce]:", "if True:"),
    Mutant("dynamics/parameters", "if self._damped:", "if False:"),
    Mutant("dynamics/peaks", "near = abs(peak.value - value) <= KINK", "near = abs(peak.value - value) < 0.0 * KINK"),
    Mutant("sizing/problem", "if all(empty):", "if False:"),
    Mutant("sizing/problem", "if formula.is_decided(values):", "if True:"),
    Mutant("dynamics/responses", "values - (values * along).sum(axis=-1, keepdims=True) * along", "values"),
    Mutant("dynamics/kinks", "bent & (np.abs(second - 2.0 * half) < 0.1 * second)", "bent"),
    Mutant("dynamics/parameters", "self.number + share * self.size", "self.number"),
    Mutant("dynamics/linear_run", "sorted(kinks & before[n])[:1]", "()"),
    Mutant("dynamics/responses", "tied = scores >= scores[best] - TIED * abs(scores[best])", "tied = scores != scores"),
    Mutant("dynamics/integrators/tangent", "inverse * (start @ matrix.T)", "0.0 * inverse * (start @ matrix.T)"),
    Mutant("dynamics/integrators/tangent", "0.5 * mean @ (identity + decay)", "mean @ (identity + decay)"),
    Mutant("dynamics/linear_run", "        if time == t1:\n", "        if True:\n"),
    Mutant("dynamics/gradients", "error = factor * apart + LEAST", "error = 0.0 * factor * apart + LEAST"),
    Mutant("dynamics/gradients", "total = error[n] + spread", "total = error[n]"),
    Mutant("dynamics/gradients", "kept(first.samples.get(name, []), main.value", "kept([], main.value"),
    Mutant("dynamics/responses", "sizes[:, None], sign * change,", "sizes[:, None], change,"),
    Mutant("dynamics/peaks", "if not s0 <= s1 > s2:", "if True:"),
    Mutant(
        "dynamics/divergence",
        "np.flatnonzero(_means(times, values - refined)[: last + 1] < LOST * size)",
        "np.arange(last + 1)",
    ),
    Mutant("net/laws/curve", "np.ones(len(begin)), 0.5 * begin**2", "np.ones(len(begin)), begin**2"),
    Mutant("net/laws/curve", "if curve.first > 0.0:", "if curve.first < 0.0:"),
    Mutant("net/law_keys", 'if curves[line].unit == "N" else 1.0', 'if curves[line].unit == "Pa" else 1.0'),
    Mutant("dynamics/integrators/yielding", "self._turned = True", "self._turned = False"),
    Mutant("dynamics/commands", "course.work[-1] += energy - before[1]", "pass"),
    Mutant("dynamics/commands", "(array, array.copy()))", "(array, array))"),
    Mutant("dynamics/commands", "course.ledger.given[:] += impulse - before[2]", "pass"),
    Mutant("dynamics/commands", "integrator.renew(course, force - before[0])", "integrator.renew(course, 0.0 * force)"),
    Mutant("dynamics/commands", "last = now + rate * (end - t)", "last = now + rate * end"),
    Mutant("dynamics/controllers", "if self._body is not None:", "if self._body is None and x is None:"),
    Mutant(
        "dynamics/controllers",
        "value, target = np.zeros(3), rotation_between(",
        "value, target = np.zeros(3), -rotation_between(",
    ),
    Mutant("dynamics/controllers", "if not edge > 0.0:", "if False:"),
    Mutant("dynamics/controllers", "value = np.maximum(value, 0.0)", "pass"),
    Mutant("dynamics/controllers", "controller.meters.append(probe.data)", "pass"),
    Mutant("net/quaternions", "np.copysign(angle, w)", "angle"),
    Mutant("effects/body_load", "internal=moment, twists=moment", "internal=moment, twists=False"),
    Mutant("effects/body_load", "blocks[c, first + i, 3 + j] = -change[i]", "blocks[c, first + i, 3 + j] = change[i]"),
    Mutant("results/observables/fuel", "data[0, 1] * (t - data[0, 2])", "data[0, 1] * t"),
    Mutant(
        "results/observables/fuel",
        "system.fixed[nodes][:, pushed].all(axis=1)",
        "system.fixed[nodes][:, pushed].any(axis=1)",
    ),
    Mutant("studies/predictability", "schedule.commands.act(row, integrator, course, history)", "pass"),
    Mutant("dynamics/control_laws", "        if not measurement.limited:\n", "        if True:\n"),
    Mutant("dynamics/control_laws", "/ (2.0 * self.strength)", "/ self.strength"),
    Mutant("dynamics/controllers", "return self._spent + self._size * (time - self._since)", "return self._spent"),
    Mutant("dynamics/controllers", "len(self._measured) - 1 - self._lag, 0)", "len(self._measured) - 1, 0)"),
    Mutant("dynamics/controllers", 'self._law.restore(arrays["law"])', "pass"),
    Mutant("dynamics/stepped_run", "copy._inputs.restore(self._inputs.present)", "pass"),
    Mutant("dynamics/stepped_run", "self._inputs.take_on(changes or [])", "pass"),
    Mutant("dynamics/stepped_run", "replace(scene.solve, duration=end)", "scene.solve"),
    Mutant("gym/environment", "run.advance(self.gym.period, self.gym.budget)", "run.advance(self.gym.period)"),
    Mutant("dynamics/commands", "self._first.clear()", "pass"),
    Mutant("gym/environment", "0.5 + 0.5 * np.minimum(np.maximum(action, -1.0), 1.0)", "0.5 + 0.5 * action"),
    Mutant("gym/environment", "truncated = not terminated and (", "truncated = (not terminated or ended) and ("),
    Mutant(
        "gym/environment",
        "before, self._observed = self._observed, run.observed",
        "before = self._observed = run.observed",
    ),
    Mutant("sweeps/episodes", "parameter[int(share * len(parameter))]", "parameter[0]"),
    Mutant("sweeps/expressions", '_call("_known", side)', "side"),
    Mutant("sweeps/episodes", "formula.check_types(typical)", "pass"),
    Mutant("sweeps/episodes", "for value in bounds.tolist():", "for value in bounds[1:].tolist():"),
    Mutant("effects/viscous", "time * (1.0 - decay * decay)", "time * (1.0 - decay)"),
    Mutant("effects/viscous", "pull + max(by_law, 0.0) >= 0.0:", "pull + by_law >= 0.0 or e > 0.0:"),
    Mutant("effects/viscous", "data, c, q) - (1.0 + e) * pull)", "data, c, q) - pull)"),
    Mutant(
        "effects/viscous", "weighted += arm(data, c, k) * (slope * before - left)", "weighted -= arm(data, c, k) * left"
    ),
    Mutant(
        "effects/bending", "f[cells[c, 1], r] += first_pull + last_pull", "f[cells[c, 1], r] += first_pull - last_pull"
    ),
    Mutant("results/probes", "-value if select == 1 else abs(value)", "-value if select == 1 else value"),
    Mutant("results/probes", "1e-15 * abs(square), first", "1e-15 * abs(square), 0"),
    Mutant("tables", "if finite else None", "if values else None"),
    Mutant("tables", "math.nextafter(max(lower), math.inf)", "max(lower)"),
    Mutant("results/observables/line", '"end": net.subdivide - 1', '"end": 0'),
    Mutant(
        "results/observables/nodal",
        "best = np.maximum(*(self.scores(end) for end in ends))",
        "best = self.scores([*ends][1])",
    ),
    Mutant("effects/bending", "spring = 2.0 * self.stiffness", "spring = self.stiffness"),
    Mutant("effects/thread", "longer += segment(x, cells, data, c, s)[5]", "longer = segment(x, cells, data, c, s)[5]"),
    Mutant("effects/thread", "blocks[c, i, j] = along * g[i] * g[j]", "blocks[c, i, j] = along * g[i] * g[i]"),
    Mutant("effects/thread", "along = 2.0 * segments * abs(line.ea)", "along = 0.1 * abs(line.ea)"),
    Mutant("effects/thread", "across = 2.0 * max(tension * inverse, soon)", "across = 2.0 * soon"),
    Mutant("effects/thread", "np.add.at(mass, rows[1:], 0.5", "np.add.at(mass, rows[:-1], 0.5"),
    Mutant("net/threads", "return self.line.element_mass[0] * self.distances", "return 0.0 * self.distances"),
    Mutant("system/system", "shift = angle * (float(np.linalg.norm(body.arm)) + body.extent)", "pass"),
    Mutant("net/threads", "distances[wrap.segment] = wrap.length", "pass"),
    Mutant("statics/thread_bars", "largest = np.maximum.reduceat", "largest = np.minimum.reduceat"),
    Mutant("statics/thread_bars", "+= strained + largest *", "+= 0.0 * strained + largest *"),
    Mutant("effects/around", "angle = angle if share > 0.0 else angle", "angle = angle if share < 0.0 else angle"),
    Mutant("effects/half_turns", "0.25 if {base, node} & driven else 0.5", "0.5"),
    Mutant("dynamics/half_turns", "if turns > largest:", "if turns < largest:"),
    Mutant("effects/winding", "near += segment.sense * x[turn, 1]", "near -= segment.sense * x[turn, 1]"),
    Mutant("effects/winding", "if lies <= 0.0:", "if lies <= 1e-3:"),
    Mutant("effects/winding", "touch.force[k] = press[k] if path.wound", "touch.force[k] = press[k] if not path.wound"),
    Mutant("effects/winding", "f[spin, k] += first[k] + second[k]", "f[spin, k] += first[k] - second[k]"),
    Mutant("effects/winding", "cotangent = math.cos(path.angle) / sine", "cotangent = 1.0 / sine"),
    Mutant("effects/winding", "turned += 4.0 * max(tension, soon) * segment.radius / square", "turned *= 0.01"),
    Mutant("net/threads", "np.roll(over, 1) - over", "over - np.roll(over, 1)"),
    Mutant(
        "effects/thread_slips",
        "if error <= 1.0:\n                    break",
        "if error <= 1e6:\n                    break",
    ),
    Mutant("effects/thread_slips", "x0, x1, x2 = a1 * b2 - a2 * b1", "x0, x1, x2 = a1 * b2 + a2 * b1"),
    Mutant("effects/thread_slips", "start, rounds = trial % starts, ROUGH", "start, rounds = 0, ROUGH"),
    Mutant("effects/thread_slips", "if pull == low or pull == high:", "if high - low < 1e-3 * ea:"),
    Mutant("effects/thread_slips", "total += (high - low) * (first + slope * middle)", "total += (high - low) * first"),
    Mutant("effects/thread_slips", "w[r].slip = w[r].slip_before + math.copysign(reach, moved)", "w[r].slip += 0.0"),
    Mutant("effects/self_contact/search", "FASTER * span * (math.sqrt(speed)", "0.01 * span * (math.sqrt(speed)"),
    Mutant("dynamics/integrators/explicit_loop", "or left <= 0 and end < corner)", "or False)"),
    Mutant("dynamics/integrators/explicit_loop", "joins and not looks and step < count", "joins and not looks"),
    Mutant("results/probes", "return a - 1e-15 * abs(a) > b", "return a < b"),
    Mutant("dynamics/integrators/neighbour_list", "near(skin + first_margin + second,", "near(skin + first_margin,"),
    Mutant(
        "effects/self_contact/search",
        "of_first = from_axis(p, u, w) - approach",
        "of_first = from_axis(p, u, w) + approach",
    ),
    Mutant("effects/contact/penalty", "1.0 if touch.xi < 0.5 else 2.0", "2.0 if touch.xi < 0.5 else 1.0"),
    Mutant("effects/wound_mass", "signs[-1] = -1.0 if thread.at_last else 1.0", "signs[-1] = 1.0"),
    Mutant("effects/wound_mass", "rate = b[r, size] * given", "rate = 0.0"),
    Mutant("results/columns", '"work" in books or system.works', '"work" in books'),
    Mutant("effects/wound_lines", "np.array([SLIP, TAKEN])", "np.array([SLIP, TAKEN + 1])"),
    Mutant("effects/mass_flow", "p = n if n < count else 2 * count - 1 - n", "p = n % count"),
    Mutant("effects/winch", "of_table = [(t, value) for t, _ in given]", "of_table = list(given)"),
    Mutant("effects/winch_power", "mean = 0.5 * (first + pulled_over(data, c, w))", "mean = pulled_over(data, c, w)"),
    Mutant("effects/winch_power", "return power / pull, -power / pull**2", "return power / pull, power / pull**2"),
    Mutant("effects/winch_power", "f[q, m] -= rate * pull /", "f[q, m] -= rate * abs(pull - 1.0) /"),
    Mutant("effects/winch_power", "if pull * largest <= abs(power):", "if pull <= 0.0:"),
    Mutant("effects/thread_friction", "if r == rings - 1 and abs(w[r].direction) != 1.0:", "if r == rings:"),
    Mutant("effects/wound_lines", "out[c] -= by_law[0]", "pass"),
    Mutant("effects/wound_lines", "numbers_in(net, x)[:, UNTIL] = 0.0", "pass"),
    Mutant("effects/wound_lines", "shows.damped_tension = shows.tension", "pass"),
    Mutant("effects/winch", "holds = self.tension, self.tension", "holds = -math.inf, self.tension"),
    Mutant("effects/winch", "(thread.friction[start:] + thread.friction[:start])[:-1]", "thread.friction[:-1]"),
    Mutant("effects/winch", "vectors=np.roll(thread.vectors, -start, axis=0)", "vectors=thread.vectors"),
    Mutant("effects/thread_friction", "energy = 0.5 * (now + before) * paid_out", "energy = now * paid_out"),
    Mutant("effects/thread_friction", "total += 0.5 * (before + now) *", "total += now *"),
    Mutant(
        "effects/thread_friction",
        "blocks[c, 3 * s + k, m] -= p[k] * slopes[s, m]",
        "blocks[c, 3 * s + k, m] += p[k] * slopes[s, m]",
    ),
    Mutant(
        "effects/thread_friction",
        "shortest = min(shortest, natural(w, s))",
        "shortest = 9.0 * natural(w, s)",
    ),
    Mutant("system/system", "tension.mean() * term.tangent.across", "0.0 * term.tangent.across"),
    Mutant("net/mesh_file", 'np.asarray(block.data["thread"]) == 0.0', 'np.asarray(block.data["thread"]) >= 0.0'),
    Mutant("effects/bending", "inner = ~np.isin(rows[:, 1], clamped)", "inner = rows[:, 1] >= 0"),
    Mutant("effects/turning_axes", "to, m = cells[c, a], 2.0 * velocity", "to, m = cells[c, a], -2.0 * velocity"),
    Mutant("effects/turning_axes", "2.0 * at[b, 0], 2.0 * at[b, 1]", "at[b, 0], 2.0 * at[b, 1]"),
    Mutant(
        "effects/drag/force",
        "(1.0 if i == j else 0.0) - e[i] * e[j]",
        "(1.0 if i == j else 0.0)",
    ),
    Mutant("effects/drag/implicit_drag", "1 if contact.group else 0", "1"),
    Mutant("effects/drag/implicit_drag", "node.velocity[0] + 0.5 * h * rate[0]", "node.velocity[0] + h * rate[0]"),
    Mutant("effects/drag/table", "[self.normal, math.pi * self.tangential]", "[self.normal, self.tangential]"),
    Mutant("system/kernel_trial", "column >= arguments[array].shape[1]", "column > arguments[array].shape[1]"),
    Mutant("system/kernel_trial", "isinstance(value, int) and name not in asked", "isinstance(value, int)"),
    Mutant("system/kernel_trial", " or _by_trial(kernel.py_func, arguments)", ""),
    Mutant("system/contact_forces", "partner.force[k] -= force[k]", "partner.force[k] += force[k]"),
    Mutant("system/contact_forces", "float(cell % term.elements)", "float(cell)"),
    Mutant("dynamics/integrators/contacts", 'if term["number"] in near:', "if False:"),
    Mutant("results/observables/overlap", "forces.pair_rows(body_b, bodies)", "[forces.row(body_b)]"),
    Mutant("results/observables/overlap", "if body_b is None else", "if body is None else"),
    Mutant("effects/contact/penalty", "shows.force[k] += push * g[k]", "shows.force[k] -= push * g[k]"),
    Mutant("effects/contact_solver", "shows.force[k] -= past", "shows.force[k] += past"),
    Mutant("results/observables/distances", "m = n - 1 if n > 0 else rows.size - 1", "m = n - 1 if n > 0 else 0"),
    Mutant("results/observables/angular_momentum", "sum((body.spin_about_centre(state.x, state.v) for", "sum((0.0 for"),
    Mutant("results/observables/angular_momentum", "momentum += system.mass", "momentum -= system.mass"),
    Mutant("net/rigid_body", "self.axes.T @ self.inertia @ self.mobility @ self.axes", "self.moment * np.eye(3)"),
    Mutant("effects/orbit", "np.diag([3.0, 0.0, -1.0])", "np.diag([2.0, 0.0, -1.0])"),
    Mutant("effects/pressure", "d0 += couple * x[column, 0]", "d0 -= couple * x[column, 0]"),
    Mutant(
        "effects/outer_load",
        "(0.0, 1.0) if net.quasi_static else (1.0, 0.0)",
        "(1.0, 0.0) if net.quasi_static else (0.0, 1.0)",
    ),
    Mutant("effects/temperature", "1.0 + expanding.expansion * value", "1.0 - expanding.expansion * value"),
    Mutant("effects/base", "return ((2.0 * self.data[:, :3] + u) * u)", "return ((2.0 * self.data[:, :3] - u) * u)"),
    Mutant(
        "effects/base",
        "return (self.between(v) ** 2).sum(axis=1) / self.length",
        "return (self.between(v) ** 2).sum(axis=1)",
    ),
    # Contact and friction
    Mutant(
        "effects/contact/table", "slip_velocity: float = real(default=1e-2", "slip_velocity: float = real(default=1e-3"
    ),
    Mutant(
        "effects/contact/table", "return getattr(self, key) if given is None else given", "return getattr(self, key)"
    ),
    Mutant(
        "effects/contact/friction",
        "damped, rate = max(pair.damping * dot(g, u), -1.0)",
        "damped, rate = pair.damping * dot(g, u)",
    ),
    Mutant(
        "effects/contact/friction",
        "        -push * damped * g[0] - drag * q[0],",
        "        -push * damped * g[0] + drag * q[0],",
    ),
    Mutant(
        "effects/contact/overlap",
        "self.exponent + self.moving)\n        return rounded_up(max(factor",
        "self.exponent)\n        return rounded_up(max(factor",
    ),
    Mutant("effects/contact/overlap", "1.0 if body.shape.once or body.shape.planar else 2.0", "1.0"),
    Mutant("effects/contact/sphere", "shows.value = ball.radius - distance", "shows.value = distance"),
    Mutant("effects/contact/line_body_ccd", "if largest < limit:", "if seen < limit:"),
    Mutant(
        "effects/contact/line_body_ccd",
        "square += (velocity - v[b, k] - kick * inverse[b, k] * f[b, k]) ** 2",
        "square += velocity**2",
    ),
    Mutant(
        "effects/contact/line_body_ccd",
        "return abs(drift) * math.sqrt(fastest)",
        "return 0.5 * abs(drift) * math.sqrt(fastest)",
    ),
    Mutant("effects/contact/line_body_ccd", "met[3] = 0 if below", "met[3] = 1 if below"),
    Mutant("dynamics/integrators/ccd", "kind == THROUGH and met[3] == 0)", "kind == THROUGH and met[3] == 1)"),
    Mutant("dynamics/integrators/ccd", "    paths.free -= path\n", ""),
    Mutant("effects/self_contact/line_line_friction", "(1.0 - a, a, b - 1.0, -b)", "(1.0 - a, a, -b, b - 1.0)"),
    Mutant(
        "effects/self_contact/line_line_penalty", "ROWS, ROWS_DEEP, SHALLOW = 1.15,", "ROWS, ROWS_DEEP, SHALLOW = 1.0,"
    ),
    Mutant("effects/self_contact/line_line_penalty", "if touches or not in_span", "if not touches or not in_span"),
    Mutant("effects/self_contact/search", "toward + (FASTER - 1.0) * speed", "toward"),
    Mutant("effects/self_contact/line_line_penalty", "if square > (REACH * of.touch) ** 2", "if square > of.touch**2"),
    Mutant("dynamics/integrators/ccd", "due[NEXT].path - paths.past - path)", "due[NEXT].path - paths.past)"),
    Mutant("dynamics/integrators/ccd", "due[PAST].path = paths.past", "due[PAST].path = 0.0"),
    Mutant("dynamics/integrators/ccd", "CALM * skin.last < left", "CALM * skin.last < 20.0 * left"),
    Mutant("effects/self_contact/line_line_ccd", "due[count].path + start", "due[count].path + 2.0 * start"),
    Mutant("effects/self_contact/line_line_ccd", "following = min(following, due[c].path)", "following = math.inf"),
    Mutant("dynamics/integrators/ccd", "collides(time, 0.5 * h, h, FORESEE, model, running)", "False"),
    Mutant("dynamics/integrators/passages", "if not (depth + nearer <", "if not (depth <"),
    Mutant("dynamics/integrators/passages", "or nearer < self._apart(pair, x)", "or 0.0 < self._apart(pair, x)"),
    Mutant("dynamics/integrators/passages", "+ _nearer(pair, bend)", ""),
    Mutant("dynamics/integrators/passages", "2.0 * body.extent * np.hypot", "0.0 * body.extent * np.hypot"),
    Mutant("statics/shared_push", "slopes -= slopes.mean(axis=0)", "pass"),
    Mutant("statics/shared_push", "largest[:, None] - energies, 0.0)", "0.0, 0.0)"),
    Mutant("system/contact_shares", "*= shares", "*= 1.0"),
    Mutant("statics/body_penetration", "if element is not None and len(path):", "if element is not None and False:"),
    Mutant("statics/body_penetration", "around[(around > 0.0) & (around < 1.0)]", "around[around > 1.0]"),
    Mutant("effects/contact/sharp_edges", "0.25 * self.angle * max", "0.125 * self.angle * max"),
    Mutant("effects/contact/sharp_edges", "bend = -float(", "bend = float("),
    Mutant("effects/contact/sharp_edges", "state.element_tension, 0.0)", "1.0, 0.0)"),
    Mutant("effects/contact_solver", "1.0 / (1.0 - math.exp(-z)) - 1.0 / z", "1.0 / (1.0 - math.exp(-z))"),
    Mutant("effects/contact_solver", "p, normal, change = 0.0, contact", "p, normal, change = 0.0, 2.0 * contact"),
    Mutant("net/rotation", "share = h / (m + 1.0)", "share = h / (m + 2.0)"),
    Mutant("net/rotation", " - 0.5 * turns.doubled[n] * omega[k] ** 2", ""),
    Mutant("effects/axle", "out[c, 0] = torque * rate", "out[c, 0] = 0.5 * torque * rate"),
    Mutant("system/resting_bodies", "(np.eye(3) - along)[row[block]", "(np.eye(3) + along)[row[block]"),
    Mutant("results/observables/support", "faster * p[0] + square", "faster * p[0] - square"),
    Mutant("effects/motion", "angle += 2.0 * np.pi", "angle += 0.0 * np.pi"),
    Mutant("effects/mass_flow", "x[r, k] += 0.5 * h * (v[r, k] - old)", "x[r, k] += 0.0 * h * (v[r, k] - old)"),
    Mutant("effects/mass_flow", "+= 0.5 * brought * v[r, k]", "+= brought * v[r, k]"),
    Mutant("effects/sliding_material", "f[b, i] += push", "f[b, i] += 0.0 * push"),
    Mutant("effects/sliding_material", "v[a, i] - v[b, i] + turned[i]", "v[a, i] - v[b, i]"),
    Mutant("effects/sliding_material", "half = 0.5 * jump", "half = jump"),
    Mutant("effects/sliding_material", "apart = jump_of(t, data, c), ", "apart = 0.0 * jump_of(t, data, c), "),
    Mutant("effects/sliding_material", "share = 1.0 / np.repeat", "share = np.repeat"),
    Mutant("system/material_flow", "np.inf, self.masses(t, x)", "np.inf, self._net.mass"),
    Mutant("effects/mass_flow", "- (w[i] * along_j - w[j] * along_i)", "+ (w[i] * along_j - w[j] * along_i)"),
    Mutant("system/material_flow", "np.intersect1d(net.line[at_risk], flow.lines)[:1]", "[]"),
    Mutant("effects/thread_friction", "<= STILL * abs(now - before)", "< 0.0"),
    Mutant("effects/thread_friction", "abs(first) > friction + STILL * abs(now - before)", "abs(first) > math.inf"),
    Mutant("studies/modes", "rest.at(equilibrium.step, equilibrium.x)", "rest"),
    Mutant("statics/gradients", "if system.net.flows:", "if net.flows:"),
    Mutant("system/material_flow", "incoming * speed - 0.5 * speed**2", "incoming * speed - 0.4 * speed**2"),
    Mutant("results/observables/support", "inward = -data[0, 0]", "inward = data[0, 0]"),
    Mutant("net/rotation", "third = min(third, w[2] * math", "third = min(third, math"),
    Mutant("net/rotation_bounds", "far[0] * w[0] * abs(m[0])", "far[0] * abs(m[0])"),
    Mutant("effects/contact_solver", "moment = cross(arm, g)", "moment = cross(g, arm)"),
    Mutant("effects/contact_solver", "spin, i, turning, moment)", "spin, i, moment, moment)"),
    Mutant("effects/contact_solver", "row, i, g, g)", "row, i, g, (0.0, 0.0, 0.0))"),
    Mutant("effects/contact_solver", "parts[m].jacobian[i, k] = 0.0", "parts[m].jacobian[i, k] *= 0.5"),
    Mutant("effects/contact/nearest_point", "if lightest > 0.0 else 1.0", "if lightest > 0.0 else 0.0"),
    Mutant("net/rotation", "q1 += a * u0 + c * u2 - d * u1", "q1 += a * u0 - c * u2 + d * u1"),
    Mutant("net/solid", "c * c * ball + 2.0 * c * first + second", "c * c * ball + c * first + second"),
    Mutant(
        "effects/contact/rotational_stiffness",
        "add_cross(block, at, at, moment, 1.0)",
        "add_cross(block, at, at, moment, -1.0)",
    ),
    Mutant("effects/contact/body_body_detection", "(thickness - 0.5 * contact.depth)", "thickness"),
    Mutant("effects/contact/body_body_penalty", "steep * total / lever", "steep / lever"),
    Mutant("effects/contact/body_body_penalty", "turned * mass[cells[c, 2", "turned * 0.07 + 0.0 * mass[cells[c, 2"),
    Mutant(
        "effects/contact/body_body_friction",
        "force = (-lever[0], -lever[1], -lever[2]), (-arm[0]",
        "force = (lever[0], -lever[1], -lever[2]), (-arm[0]",
    ),
    Mutant(
        "effects/contact/pair_overlap",
        "if not pair.overlap + (path := self._path_limit(pair)) < pair.thickness",
        "if False",
    ),
    Mutant("effects/contact/undetected_overlap", "if deep > LEAST * min(a.thickness, b.thickness)", "if False"),
    Mutant("net/skeleton", "begin + 2.0 * math.pi / ARCS", "begin + 1.9 * math.pi / ARCS"),
    Mutant("effects/contact/pair", "across = np.sqrt((reach**2).sum() - reach**2)", "across = 0.3 * reach"),
    Mutant("effects/contact/line_body_friction", "arm = cross(axis, y)", "arm = cross(y, axis)"),
    # Systems and links
    Mutant(
        "system/links",
        "return [G, turn, -turn[self._both], G, G, G, rate]",
        "return [G, turn, turn[self._both], G, G, G, rate]",
    ),
    Mutant(
        "system/links",
        "self._sign * self.pairs.between(v)[self._link, self._axis] / length",
        "self._sign * self.pairs.between(v)[self._link, self._axis]",
    ),
    Mutant("system/mass", "lumped if self._consistent_minus_lumped is None else lumped + self.passed_on(v)", "lumped"),
    Mutant("system/mass", "jump - self.moved_by(self.passed_on(jump))", "jump + self.moved_by(self.passed_on(jump))"),
    # Statics and its bounds
    Mutant(
        "statics/duality_bound",
        "2.0 * np.sqrt(straight * gap) + gap",
        "0.5 * (2.0 * np.sqrt(straight * gap) + gap)",
    ),
    Mutant("statics/duality_bound", "_gaps(bars, force, size).sum() + rounding)", "_gaps(bars, force, size).sum())"),
    Mutant("statics/duality_bound", "* bars.natural[curved] * far - apart[curved]", "* bars.natural[curved] * 0.0"),
    Mutant("statics/duality_bound", "np.maximum(energies[0] - energies[1], energies[2] - energies[0])", "0.0 * error"),
    Mutant("statics/duality_bound", "np.sqrt(2.0 * bars.stiffness * gap)", "np.sqrt(bars.stiffness * gap)"),
    Mutant(
        "statics/duality_bound", "np.where(bars.tension > 0.0, 0.0, bars.unstressed - bars.length)", "0.0 * bars.length"
    ),
    Mutant("statics/floating", "tension > equilibrium.duality_bound.tension[:, None]", "tension > -1.0"),
    Mutant("statics/floating", "limits[side, open_, axis] = sign * far[open_]", "pass"),
    Mutant("statics/interval", "between = (ends[:, 0] != ends[:, 1])", "between = (ends[:, 0] < ends[:, 1])"),
    Mutant("statics/lowest", "starts[1] < starts[0] - none", "starts[1] > starts[0] + none"),
    Mutant("results/observables/observable", "/ SHARE * ROUNDING", "/ SHARE * ROUNDING / 27.0"),
    Mutant("statics/smoothing_error", "/ rest for", "* rest for"),
    Mutant("statics/newton", "((-self._tiny, 1), (self._tiny, 0))", "((-self._tiny, 1), (self._tiny, -1))"),
    Mutant(
        "statics/stability", "0 if self.definite >= 0 else int(_negative", "0 if self.definite >= -1 else int(_negative"
    ),
    Mutant("statics/stability", "-K / scale**2, -C / scale", "-K / scale**2, C / scale"),
    Mutant("statics/stability", "complex_ = abs(values.imag) > off", "complex_ = abs(values.imag) > 1e99"),
    Mutant(
        "statics/slowest_vibrations", "[-self.omega * self._root * self.soft", "[self.omega * self._root * self.soft"
    ),
    Mutant("statics/snap_through", "< -SHORTER).any()", "> -SHORTER).any()"),
    Mutant(
        "statics/newton",
        "np.abs(state.tension) + stiffness * moved",
        "0.0 * (np.abs(state.tension) + stiffness * moved)",
    ),
    Mutant("statics/newton", "None if self.system.pattern.size < SMALL else shift", "None"),
    Mutant("dynamics/integrators/energy_balance", "* out[c, POWER]) ** 2 / 12.0", "* out[c, POWER]) ** 2 / 12e4"),
    Mutant("dynamics/integrators/energy_balance", "if out[c, LAST_STRAIN] <= slackness <", "if slackness <"),
    Mutant("dynamics/integrators/central_difference", "= course.snapped if course.snapped.size else", "="),
    Mutant("dynamics/twin_error", "for doubt, gap in known)", "for doubt, gap in known[:1])"),
    Mutant("statics/newton", 'sigma=0.0, which="SA"', 'sigma=0.0, which="LA"'),
    Mutant("statics/energy_search", "ROUNDING = 0.1, 30", "ROUNDING = 0.1, 0"),
    Mutant("statics/predictor", "if energy < lowest:", "if energy > lowest:"),
    Mutant("system/conjugate_gradients", "p = z + _over(size, last) * p", "p = z"),
    Mutant("system/resting_bodies", "np.eye(3) - cross_matrix(u))", "np.eye(3) + cross_matrix(u))"),
    Mutant("system/attached_nodes", "(force @ arm) * np.eye(3) - np.outer(arm, force)", "(force @ arm) * np.eye(3)"),
    Mutant("system/resting_bodies", "0.5 * (matrix + matrix.T)[row, column]", "matrix[row, column]"),
    Mutant("system/resting_bodies", "R @ np.linalg.pinv(self.turns.mobility[n]) @ R.T", "R @ R.T"),
    Mutant("system/static_system", "any(b.velocity) or any(b.angular_velocity) or not", "not"),
    Mutant("statics/dynamic_relaxation", "rates[row] += 2.0 * rates[node]", "rates[row] += 0.02 * rates[node]"),
    Mutant(
        "effects/body_damping", "out[c, 0] -= data[c, 0] * v[s, k] * omega[k]", "out[c, 0] -= data[c, 0] * v[s, k] ** 2"
    ),
    Mutant("dynamics/integrators/events", "        event.since = math.inf\n", "        pass\n"),
    # Dynamics, its books and its ±
    Mutant("dynamics/integrators/simpson_balance", "np.where(self._supported, 0.0, v)", "v"),
    Mutant("dynamics/integrators/simpson_balance", "s - 1.5 * s**2 + s**3 / 1.5", "s - 1.5 * s**2 + s**3 / 3.0"),
    Mutant("dynamics/integrators/simpson_balance", "np.bincount(self._axes,", "np.bincount(self._fixed // 3 % 3,"),
    Mutant("dynamics/integrators/rows", "if inertia.inverse[r, k] > 0.0 else", "if inertia.mass[r] > 0.0 else"),
    Mutant("dynamics/integrators/energy_balance", "DRIFT = 1e-2", "DRIFT = 2e-2"),
    Mutant("dynamics/integrators/energy_balance", "+= (kick * before[d", "+= 2.0 * (kick * before[d"),
    Mutant("dynamics/integrators/averages", "11.0 / 24.0 * d4", "11.0 / 12.0 * d4"),
    Mutant("dynamics/integrators/averages", "averages.integral[n] -= integral", "pass"),
    Mutant("dynamics/integrators/averages", "if passed >= CELLS:", "if passed > 0:"),
    Mutant("dynamics/integrators/averages", "third * min(third", "0.0 * min(third"),
    Mutant("dynamics/integrators/averages", "averages.open[n] += h", "averages.open[n] += 0.0"),
    Mutant("dynamics/integrators/tolerances", "near = 1e-3 * length.min()", "near = 1e-1 * length.min()"),
    Mutant("dynamics/integrators/step_limits", "stop = self._corners[ahead] if", "stop = self._corners[-1] if"),
    Mutant("dynamics/history", "SPREAD = 3.0", "SPREAD = 1.5"),
    Mutant("dynamics/twin_error", "MOST_CHANCE, TELLING = 10.0", "MOST_CHANCE, TELLING = 1.0"),
    Mutant("dynamics/twin_error", "self._course.stopped != stopped", "False"),
    Mutant("effects/line_blocks", "places[runs[1]] = np.arange(len(cells))", "places = runs[1].copy()"),
    Mutant("dynamics/twin_error", "self._left = [AGAIN] if self._by is None else [None, AGAIN]", "self._left = [None]"),
    Mutant("dynamics/integrators/central_difference", "FEWEST, SHORT = 1.5, 0.8,", "FEWEST, SHORT = 1.5, 1.0,"),
    Mutant("dynamics/integrators/central_difference", "return min(ratio, 1.0 / ratio)", "return ratio"),
    Mutant("dynamics/history", "distances[name] = 0.5 * time * float(along.max())", "distances[name] = 0.0"),
    Mutant(
        "dynamics/twin_error",
        "factor = 1.0 / (1.0 - simulation.integrator.error_share(first_run, refined))",
        "factor = 1.0",
    ),
    Mutant("dynamics/twin_error", "error=result.error + float(change[i])", "error=result.error"),
    Mutant("dynamics/history", 'scales["stress"] = tension, 1.0 / net.area', 'scales["stress"] = tension, net.area'),
    Mutant(
        "dynamics/history",
        "float(extremes.values[slot]), float(extremes.times[slot])",
        "float(extremes.values[slot]), course.time",
    ),
    Mutant("dynamics/schedule", "if duration - times[-1] > 1e-9 * interval:", "if duration - times[-1] > interval:"),
    Mutant("dynamics/initial_state", "positions - displacements + x, x", "positions + x, x"),
    Mutant("dynamics/initial_state", "moving = v.copy(), bool(velocities.any())", "moving = v.copy(), True"),
    Mutant("dynamics/internal_start", "(alike and title == before)", "alike"),
    Mutant("dynamics/internal_start", "if before == now:", "if now:"),
    Mutant("dynamics/initial_state", "x[going_on] = before", "pass"),
    Mutant("dynamics/initial_state", "ratio = lengths / before", "ratio = lengths"),
    Mutant("dynamics/initial_state", "omega = spin if axle.any() else", "omega ="),
    Mutant("dynamics/initial_state", "return omega if body.axle else now", "return now"),
    # Checkpoints and folders
    Mutant("dynamics/accuracy_loop", 'int(kept["repeated"])', "0"),
    Mutant("dynamics/accuracy_loop", 'float(kept["drift"])', "np.inf"),
    Mutant("dynamics/accuracy_loop", "0.5 * 10.0**-digits", "5.0 * 10.0**-digits"),
    Mutant(
        "dynamics/accuracy_loop",
        "standing.knob, standing.repeated, standing.drift, budget.kept = reached,",
        "standing.repeated, standing.drift, budget.kept =",
    ),
    Mutant("dynamics/budget", "if spent > left or", "if"),
    Mutant("dynamics/budget", "last.price * (last.knob / knob) ** power", "last.price"),
    Mutant("dynamics/budget", "max(LEAST, RUNS * first)", "LEAST"),
    Mutant("results/progress", "share < self._last:", "False:"),
    Mutant("results/progress", "/ (share - self._first))", "/ share)"),
    Mutant("results/units", "scale_of(larger(value, error), unit)", "scale_of(value, unit)"),
    Mutant("results/solution", "max(self.value - lower, upper - self.value, 0.0)", "np.inf"),
    Mutant("results/columns", ", *dynamic_energies(system), *components(VECTORS)]", ", *dynamic_energies(system)]"),
    Mutant("build", 'named += [("[[body]] name = ", body.name) for body in system.net.bodies]', "pass"),
    Mutant("runner", "acts & ~system.fixed", "acts & ~system.supported"),
    Mutant("effects/self_contact/table", "self._refuse_too_large(net)", "pass"),
    Mutant(
        "dynamics/simulation",
        "return course, len(times) if course.stopped else row + 1",
        "return course, len(times) if course.stopped else row",
    ),
    Mutant("dynamics/simulation", 'if "twin_begin_x" in kept:', "if False:"),
    Mutant("results/vtu", '"reaction": state.reaction}', '"reaction": state.v}'),
    Mutant("results/vtu", "state.element_tension / net.area", "state.element_tension * net.area"),
    Mutant("results/vtu", "*np.arange(1, order) / order", "*np.arange(1, order) / (order + 1)"),
    Mutant(
        "statics/simulation",
        "        if folder is None:\n            self.solution.frames",
        "        if True:\n            self.solution.frames",
    ),
    Mutant("pictures/camera", "for i in range(0, len(points), MANY)", "for i in range(0, MANY, MANY)"),
    Mutant("results/folder", "int(number[1]) <= row", "int(number[1]) < row"),
    Mutant("results/folder", 'timestep="{number(time)}"', 'timestep="{number(row)}"'),
    Mutant("results/files", "return repr(float(value))", 'return f"{value:.9g}"'),
    Mutant("pictures/frames", "further = scale * phase - 1.0", "further = scale * phase + 1.0"),
    Mutant("pictures/record", "max(candidates, key=lambda pair: pair[0])[1]", "candidates[-1][1]"),
    Mutant(
        "pictures/movie_writer",
        "colours[colours.min(axis=1) <= ALMOST_WHITE]",
        "colours",
    ),
    Mutant("pictures/camera", "large.wider(1 / wider), small.wider(wider)", "large, small"),
    Mutant("pictures/balances", "top[:1] + work - work[:1]", "top[:1] - work + work[:1]"),
    Mutant(
        "pictures/balances", "area = axes.fill_between(at, below, above,", "area = axes.fill_between(at, 0.0, above,"
    ),
    Mutant("pictures/spectra", "2.0 * np.abs(np.fft.rfft(", "np.abs(np.fft.rfft("),
    Mutant("pictures/sheet", "np.where(np.isnan(parts), np.inf, -parts)", "np.where(np.isnan(parts), np.inf, parts)"),
    Mutant(
        "pictures/distances", 'key=lambda body: touched[body]["overlap"]', 'key=lambda body: -touched[body]["overlap"]'
    ),
    Mutant("pictures/histories", "error = bar(result, factor)", "error = bar(result)"),
    # Results and observables
    Mutant(
        "results/observables/nodal",
        "np.linalg.norm(vectors, axis=1) if component is None",
        "np.abs(vectors).max(axis=1) if component is None",
    ),
    Mutant(
        "results/observables/line",
        "return proven.strain",
        "return proven.strain / 2.0",
    ),
    Mutant("results/observables/observable", "changes[0] + 3.0 * max(changes[1:])", "changes[0]"),
    Mutant("results/state", "self.element_strain <= slack_below", "self.element_strain <= 0.0"),
    Mutant("results/state", "(strain, 0), thread.title", "(0.5 * strain, 0), thread.title"),
    # Studies and modes
    Mutant("sizing/sqp", "penalty = max(penalty, 2.0 *", "penalty = min(penalty, 2.0 *"),
    Mutant("sizing/formulas", "_less(a.low, b.high) / scale", "_less(a.low, b.low) / scale"),
    Mutant("sizing/runs", " and run[0].key not in self.rows", ""),
    Mutant("sizing/formulas", "isinstance(node.op, ast.Or) is not false", "isinstance(node.op, ast.Or)"),
    Mutant("sizing/search", "min(ends, key=lambda end: end[0])", "ends[-1]"),
    Mutant("sizing/case", "if gradient.left is None:", "if gradient.left is not gradient:"),
    Mutant("sizing/smooth", "value - point.wide[part]", "value"),
    Mutant("sizing/case", "factor=-part.factor", "factor=part.factor"),
    Mutant("sizing/smooth", "point.f - point.rows", "0.0 * point.rows"),
    Mutant(
        "sizing/search",
        "j for j in judged if j.feasible is True and",
        "j for j in judged if j.feasible is not False and",
    ),
    Mutant("sweeps/chances", "between + float(np.mean(np.square(within)))", "between"),
    Mutant("sweeps/expressions", "return True if holds(a.high, b.low)", "return True if holds(a.low, b.low)"),
    Mutant("sweeps/design", "[:, column] = second[:, column]", "[:, column] = first[:, column]"),
    Mutant("sweeps/sweep", ' and row["status"] != "lost"', ""),
    Mutant("studies/predictability", "ddof=1)", "ddof=0)"),
    Mutant("studies/further_runs", "return max(left, MARGIN", "return min(left, MARGIN"),
    Mutant("studies/further_runs", "times * value for name", "value for name"),
    Mutant("studies/further_runs", "if variant.price > left:", "if False:"),
    Mutant("studies/further_runs", "self._lost(observable) >= LOST", "self._lost(observable) >= 11"),
    Mutant("results/error_budget", "float(sum(numbers))", "float(max(numbers))"),
    Mutant("results/error_budget", "if error <= ALLOWED * value", "if error < value"),
    Mutant("results/error_budget", 'reasons["contact_stiffness"] = "nothing touches"', "pass"),
    Mutant("results/error_budget", "terms <= EXACT:", "True:"),
    Mutant("results/error_budget", "0.5 * mass * speed**2", "mass * speed**2"),
    Mutant("dynamics/divergence", "IN_TURN, FACTOR = 5, 2.5", "IN_TURN, FACTOR = 3, 2.0"),
    Mutant("studies/predictability", "end is not None and r.time > end]", "end is not None]"),
    Mutant(
        "studies/predictability",
        "np.log(np.maximum(apart, 1e-300))[known]",
        "np.log10(np.maximum(apart, 1e-300))[known]",
    ),
    Mutant("studies/discretisation_error", "first * ratio / (ratio - 1.0)", "first / (ratio - 1.0)"),
    Mutant("studies/turning", "across = 2.0 * np.cross(", "across = np.cross("),
    Mutant("studies/turning", "split = np.sqrt(turned**2 + 4.0 * stiff)", "split = np.sqrt(turned**2 + stiff)"),
    Mutant("studies/spectrum", "/ (2.0 * np.pi)", "/ np.pi"),
    Mutant("studies/spectrum", "modal_mass=1.0 / size**2", "modal_mass=1.0 / size"),
    Mutant("studies/budget", "SHARE = 1.0 / 3.0", "SHARE = 1.0"),
    # The command line
    Mutant(
        "__main__",
        "interruption.args)]), file=sys.stderr)\n        return 130",
        "interruption.args)]), file=sys.stderr)\n        return 1",
    ),
    Mutant(
        "scene",
        'if self.supports is not None:\n            given["supports"]',
        'if self.supports:\n            given["supports"]',
        "a table is never false",
    ),
    # Machine code
    Mutant("compiled/keys", "constants = constants[1:]", "pass"),
    Mutant("compiled/keys", "return value.machine_code_key()", 'return "a kernel"'),
    Mutant("compiled/keys", "described(given, visited), *parts)", "*parts)"),
    Mutant("compiled/keys", "'' if followed else ONCE", "''"),
    Mutant("compiled/keys", 'given = "" if function is value else _options(value)', 'given = ""'),
    Mutant("compiled/keys", "sources, *settings]", "sources]"),
    Mutant("compiled/numba_internals", "and not result.library.has_dynamic_globals:", "and True:"),
    Mutant("compiled/kernel", 'if "_key" in self.__dict__ and (changed', "if False and (changed"),
    Mutant("compiled/store", "if NAMES.fullmatch(path.name) and", "if"),
    Mutant("compiled/store", "if content[:CHECK] == _checksum(content[CHECK:]):", "if content:"),
    Mutant("compiled/kernel", "if features is None or k.apart <= features", "if features is None or not k.apart"),
    Mutant("compiled/numba_internals", 'function.linkage = "internal"', "pass"),
    Mutant("compiled/numba_internals", "if inside or step not in", "if step not in"),
    Mutant("compiled/numba_internals", "if known is not None:", "if False:"),
    Mutant("compiled/numba_internals", 'or array.layout != "C"', ""),
    Mutant("compiled/numba_internals", 'shape, None, "C", at)', 'shape, None, "F", at)'),
    Mutant("compiled/numba_internals", "if role == _SEQUENCE else", "if role == _MAPPING else"),
    Mutant("compiled/tables", "(flags := value.flags).c_contiguous", "(flags := value.flags).aligned"),
    Mutant("compiled/tables", "for _ in range(2):  # what", "for _ in range(1):  # what"),
    # Values by path, new scenes and comparisons
    Mutant("reference/paths", "int(key) <= last + tables", "int(key) < last + tables"),
    Mutant("reference/paths", "return {**value_here, key: _put", "return {key: _put"),
    Mutant("commands/new", "os.path.relpath(folder / name, target)", "os.path.relpath(folder / name, folder)"),
    Mutant("pages/packed", "[changes >> 8, changes & 0xFF]", "[changes & 0xFF, changes >> 8]"),
    Mutant("pages/packed", "size = written.nbytes + -written.nbytes % 4", "size = written.nbytes"),
    Mutant("pages/space", "Rotation.align_vectors(after, before)", "Rotation.align_vectors(before, after)"),
    Mutant("pages/markup", 'written.replace("<", "\\\\u003c")', "written"),
    Mutant("pages/page", r'hashlib.sha256(f"\n{script}".encode())', "hashlib.sha256(script.encode())"),
    Mutant("pages/page", "if not len(next(iter(history.values()), [])):", "if history is None:"),
    Mutant("pages/markup", "zip(columns, cells, strict=True)", "zip(columns[::-1], cells, strict=True)"),
    Mutant("pictures/paraview", '"vector": points.get(options.field, 1) > 1', '"vector": options.field in points'),
    Mutant("net/mesh_file", "np.flatnonzero(broken[of])", "np.zeros(0, dtype=np.int64)"),
    Mutant(
        "system/system",
        "self.per_cell() if per_cell is",
        "self.__dict__.setdefault('one', self.per_cell()) if per_cell is",
    ),
    Mutant("system/broken_lines", "changed.terms.append(held_energy(net))", "pass"),
    Mutant(
        "dynamics/integrators/rupture", "_holding(self.inner.system.net.broken)", "_holding(course.breaks.elements)"
    ),
    Mutant("solution", "out.keep_twin(self.twin_end)", "pass"),
    Mutant("accepted", '"exclusiveMinimum": above is not None or None', '"exclusiveMinimum": None'),
    Mutant("reference/schema", "without=every - set(keys_of)", "without=()"),
    Mutant("reference/pages", 'f"[[{name}]]" if several', 'f"[[{name}]]" if not several'),
    Mutant("results/comparison", "for lower, _ in spans) <= min(", "for lower, _ in spans) < min("),
    Mutant("results/comparison", "len(spans) == len(results) and max", "max"),
    # ± of derived numbers
    Mutant(
        "results/comparison", "verdicts = [verdict for verdict in MEANINGLESS if verdict in given]", "verdicts = []"
    ),
    Mutant("results/strength", "abs(value - 1.0) <= error", "value - 1.0 <= error"),
    Mutant("results/strength", "error += utilisation.smoothing or 0.0", "pass"),
    Mutant("results/throw", "decided = error is not None and abs(value) > error", "decided = error is not None"),
    Mutant("results/throw", "return inside and (side or", "return inside or (side or"),
    Mutant("results/throw", '{*values["bounds"], *(refined', '{*values["bounds"], *(() and refined'),
    Mutant("sweeps/chances", '1.0 - count["false"] / n', 'count["true"] / n'),
    Mutant(
        "sweeps/chances", "0.0 if sampled else math.inf if error is None", "0.0 if sampled else 0.0 if error is None"
    ),
]


def copied(root):
    """A copy of the code."""
    for name in COPIED:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, root / name, ignore=shutil.ignore_patterns("__pycache__", "report"))
        else:
            shutil.copy2(source, root / name)


def tested(root, files, cache):
    """How tests end in a copy of the code: status of pytest, None for those that hang, and what fails first."""
    environment = {**os.environ, "PYTHONPATH": str(root), "REFWEB_CACHE": str(cache), "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-n0", "-p", "no:cacheprovider", *files]
    try:
        done = subprocess.run(
            command, cwd=root, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=LONGEST
        )
    except subprocess.TimeoutExpired:
        return None, "they hang"
    said = done.stdout.decode(errors="replace")
    found = re.search(r"^(?:FAILED|ERROR) (\S.*?)(?: - .*)?$", said, re.MULTILINE)
    return done.returncode, found[1] if found else said.strip().rpartition("\n")[2]


def tried(mutant, root, cache):
    """The test that notices a bug, None where none does."""
    place = root / mutant.path
    code, times = place.read_text(encoding="utf-8"), place.stat()
    try:
        place.write_text(mutant.changed(code), encoding="utf-8")
        status, first = tested(root, mutant.tests, cache)
        if status not in (0, 1, 2, None):
            raise RuntimeError(f"pytest ended with {status}: {first}")
        return None if status == 0 else first
    finally:
        place.write_text(code, encoding="utf-8")
        os.utime(place, ns=(times.st_atime_ns, times.st_mtime_ns))


def chosen(words):
    """Numbers and bugs that some words ask for, all without any."""
    numbered = list(enumerate(MUTANTS, 1))
    if not words:
        return numbered
    return [
        (n, m) for n, m in numbered if any(w == str(n) or not w.isdigit() and w in f"{m.file} {m.text}" for w in words)
    ]


def main(arguments=None):
    """Run; the status is 1 where a bug survives that is no equivalent, and where tests fail without any."""
    parser = argparse.ArgumentParser(prog="python tests/mutants.py", description=__doc__.split("\n\n")[0])
    parser.add_argument("words", nargs="*", metavar="NUMBERS or WORDS", help="bugs to try, by default all")
    parser.add_argument("--list", action="store_true", help="print the bugs and their tests and stop")
    parser.add_argument("--trusted", action="store_true", help="do not run the tests without any bug first")
    parser.add_argument("--keep", type=pathlib.Path, help="folder in which machine code stays for another time")
    given = parser.parse_args(arguments)
    bugs = chosen(given.words)
    if given.list:
        for number, mutant in bugs:
            print(f"{number:3d}  {mutant.file}: {mutant.text!r} → {mutant.wrong!r}  {' '.join(mutant.tests)}")
        return 0
    with contextlib.ExitStack() as stack:
        folder = given.keep or pathlib.Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="refweb-mutants-")))
        return hunt(bugs, folder.absolute(), given.trusted)


def hunt(bugs, folder, trusted):
    """Try bugs in a copy of the code in a folder; the exit status."""
    root, cache, survivors = folder / "code", folder / "cache", []
    shutil.rmtree(root, ignore_errors=True)
    root.mkdir(parents=True)
    copied(root)
    files = list(dict.fromkeys(file for _, mutant in bugs for file in mutant.tests))
    if not trusted:
        status, first = tested(root, files, cache)
        if status != 0:
            print(f"tests fail without any bug: {first}")
            return 1
    for number, mutant in bugs:
        began = time.perf_counter()
        noticed = tried(mutant, root, cache)
        verdict = f"noticed by {noticed}" if noticed else f"equivalent: {mutant.same}" if mutant.same else "SURVIVES"
        print(f"{number:3d}  {mutant.file}: {mutant.text!r} → {mutant.wrong!r}")
        print(f"     {verdict}, {time.perf_counter() - began:.0f} s", flush=True)
        if not noticed and not mutant.same:
            survivors.append(number)
    print(f"{len(bugs)} bugs, {len(survivors)} survive{': ' + ', '.join(map(str, survivors)) if survivors else ''}")
    return int(bool(survivors))


if __name__ == "__main__":
    sys.exit(main())
