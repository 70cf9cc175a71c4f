"""refweb, a reference solver for space webs: equilibrium and dynamics of cable nets, with the error of every result.

Names are imported when they are used: ``import refweb`` loads nothing that a scene does not need.

May change: nothing but `__version__` at a release, which ``CITATION.cff`` has as well. Must stay: nothing is imported
at the head of this file (``tests/test_architecture.py``); names for editors, under ``TYPE_CHECKING``, are those of
`refweb.registry.exports`: a new public name stands in both (``tests/test_tables.py``).
"""

__version__ = "0.2.0"

TYPE_CHECKING = False  # as of `typing`, which is not imported for it
if TYPE_CHECKING:  # what editors know; `refweb.registry.exports` has the same names
    from .dynamics.stepped_run import start as start
    from .effects.attach import Attach as Attach
    from .effects.bending import Bending as Bending
    from .effects.body import Body as Body
    from .effects.contact.table import Contact as Contact
    from .effects.damping import Damping as Damping
    from .effects.drag.table import Drag as Drag
    from .effects.fold import Fold as Fold
    from .effects.frame import Frame as Frame
    from .effects.gravity import Gravity as Gravity
    from .effects.link import Link as Link
    from .effects.load import Load as Load
    from .effects.motion import Motion as Motion
    from .effects.orbit import Orbit as Orbit
    from .effects.point_mass import PointMass as PointMass
    from .effects.pressure import Pressure as Pressure
    from .effects.reel import Reel as Reel
    from .effects.rupture import Rupture as Rupture
    from .effects.self_contact.table import SelfContact as SelfContact
    from .effects.temperature import Temperature as Temperature
    from .effects.thread import Thread as Thread
    from .effects.thrust import Thrust as Thrust
    from .effects.velocity import Velocity as Velocity
    from .effects.winch import Winch as Winch
    from .errors import InputError as InputError
    from .errors import SolverError as SolverError
    from .net.cable import Cable as Cable
    from .net.cable import Group as Group
    from .net.cable import Viscous as Viscous
    from .net.inline import Inline as Inline
    from .net.lattices import Layers as Layers
    from .net.lattices import Paper as Paper
    from .net.lattices import Window as Window
    from .net.mesh_file import File as File
    from .net.single_cable import SingleCable as SingleCable
    from .net.tension_laws import Law as Law
    from .net.web import Web as Web
    from .pictures.pictures import picture as picture
    from .registry import register as register
    from .results.observables.observe import Observe as Observe
    from .results.throw import Throw as Throw
    from .runner import resume as resume
    from .runner import run as run
    from .runner import trust as trust
    from .scene import Scene as Scene
    from .settings import Accuracy as Accuracy
    from .settings import Control as Control
    from .settings import Dynamic as Dynamic
    from .settings import Event as Event
    from .settings import Output as Output
    from .settings import Static as Static
    from .settings import Supports as Supports
    from .sizing.requirements import Sizing as Sizing
    from .sizing.size import Sized as Sized
    from .sizing.size import size as size
    from .solution import Solution as Solution
    from .solution import load as load
    from .studies.cost import Cost as Cost
    from .studies.form import form as form
    from .studies.modes import Modes as Modes
    from .studies.modes import modes as modes
    from .studies.work_precision import cost as cost
    from .sweeps.episodes import Gym as Gym
    from .sweeps.study import Study as Study
    from .sweeps.study_result import Sweep as Sweep
    from .sweeps.sweep import sweep as sweep
else:

    def __getattr__(name):
        from .registry import exports, load

        names = exports()
        if name == "__all__":
            return sorted(names)
        if name not in names:
            from .messages import nearest

            raise AttributeError(f"module 'refweb' has no attribute {name!r}, {nearest(name, names)}")
        return load(names[name])

    def __dir__():
        from .registry import exports

        return sorted(exports())
