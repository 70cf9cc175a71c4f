"""What users hold of a run: its results, the fields of its last state as arrays, and its result folder."""

from __future__ import annotations

import numpy as np

from .results.solution import SolutionData


class Solution(SolutionData):
    """A solved scene, as `refweb.run` returns it.

    What the run fills in has the names of `refweb.results.solution.SolutionData`: ``results``, ``history``, ``steps``,
    ``events``, ``status``, ``warnings`` and more. The arrays are read off its last state.

    Attributes
    ----------
    positions, displacement, velocities, reaction : ndarray, shape (nodes, 3)
        Of nodes; those of order and subdivision come last.
    tension, stress, strain, slack : ndarray, shape (lines,)
        Of lines.
    """

    @property
    def positions(self) -> np.ndarray:
        """Positions of the nodes in the last state [m], shape (nodes, 3); those of order and subdivision come last."""
        return self.state.position[: self.state.system.net.nodes]

    @property
    def displacement(self) -> np.ndarray:
        """Displacement of the nodes in the last state [m], shape (nodes, 3)."""
        return self.state.x[: self.state.system.net.nodes]

    @property
    def tension(self) -> np.ndarray:
        """Tension of the lines in the last state [N], shape (lines,)."""
        return self.state.tension

    @property
    def stress(self) -> np.ndarray:
        """Stress of the lines in the last state [Pa], shape (lines,)."""
        return self.state.stress

    @property
    def strain(self) -> np.ndarray:
        """Strain of the lines in the last state [1], shape (lines,)."""
        return self.state.strain

    @property
    def slack(self) -> np.ndarray:
        """Lines that are slack in the last state, bool, shape (lines,)."""
        return self.state.slack

    @property
    def velocities(self) -> np.ndarray:
        """Velocities of the nodes in the last state [m/s], shape (nodes, 3)."""
        return self.state.v[: self.state.system.net.nodes]

    @property
    def reaction(self) -> np.ndarray:
        """Force of the supports on the nodes in the last state [N], shape (nodes, 3)."""
        return self.state.reaction[: self.state.system.net.nodes]

    def __repr__(self):
        found = ", ".join(f"{name} = {result.value:.6g} {result.unit}" for name, result in self.results.items())
        return f'<Solution of "{self.scene.title}": {self.status}; {found}>'

    def save(self, folder, force=False):
        """Write the result folder.

        Parameters
        ----------
        folder : path-like
            Made where it does not exist.
        force : bool
            Replace the results of an earlier run.

        Raises
        ------
        InputError
            Where the folder is not empty or cannot be written.
        """
        from .results.folder import Folder, check_folder, copy

        check_folder(folder, force)
        if self.table is None:
            copy(self.path, folder)
            return
        out = Folder(folder, self.scene, self.columns, {**self.summary(), "status": "running"})
        for row in zip(*self.history.values(), strict=True):
            out.row(row)
        for number, state in self.frames:
            out.frame(number, state)
        out.close()
        out.summary(self.summary())
