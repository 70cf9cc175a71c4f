"""OpenGL in a process of its own: one window that is kept, and meshes that are updated in place from frame to frame."""

from __future__ import annotations

import os
import pickle
import sys

import numpy as np

from .render import FINE, Balls, Surface

SUPERSAMPLING = 2
AMBIENT, DIFFUSE, POWER = 0.45, 0.62, 20.0
MOST_CORNERS = 1_000_000
"""Corners of tubes above which lines are drawn as wires: they are then a few pixels wide, and no roundness is seen."""
MOST_OF_BALLS = 200_000
"""Corners of all balls together; many are coarser."""


def serve():
    """Read views, their sizes and models from standard input and write images to standard output, until it ends.

    Whatever a library writes to standard output goes to the error stream.
    """
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    window = Window(*pickle.load(sys.stdin.buffer))
    while True:
        try:
            model = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        pickle.dump(window.images(model), answers, protocol=5)
        answers.flush()


class Window:
    """A window off screen in which views stand one above the other, and the meshes in it.

    Parameters
    ----------
    views : list of `refweb.pictures.camera.View`
    sizes : list of (width, height)
        Size of each view [pixel].
    sides : int
        Of a tube.
    """

    def __init__(self, views, sizes, sides):
        import vtkmodules.vtkRenderingOpenGL2  # noqa: F401  # brings the classes that draw
        from vtkmodules.vtkRenderingCore import vtkRenderer, vtkRenderWindow

        self._sizes, self._sides, self._meshes = sizes, sides, []
        self._width = SUPERSAMPLING * max(width for width, _ in sizes)
        self._height = SUPERSAMPLING * sum(height for _, height in sizes)
        self._window = vtkRenderWindow()
        self._window.SetOffScreenRendering(True)
        self._window.SetMultiSamples(0)
        self._window.SetSize(self._width, self._height)
        self._renderers, bottom = [], 0
        for view, (width, height) in zip(views, sizes, strict=True):
            renderer = vtkRenderer()
            top = bottom + SUPERSAMPLING * height
            renderer.SetViewport(0, bottom / self._height, SUPERSAMPLING * width / self._width, top / self._height)
            renderer.SetBackground(1.0, 1.0, 1.0)
            _light(renderer)
            self._window.AddRenderer(renderer)
            self._renderers.append((renderer, view))
            bottom = top

    def images(self, model):
        """A model in each view, RGB, shape (height, width, 3), uint8."""
        for number, part in enumerate(model):
            if number == len(self._meshes):
                self._meshes.append(_mesh_of(part, self._sides, self._pixels))
                for renderer, _ in self._renderers:
                    renderer.AddActor(self._meshes[-1].actor)
            self._meshes[number].show(part)
        for renderer, view in self._renderers:
            _aim(renderer, view)
        self._window.Render()
        return self._read(bool(model))

    def _pixels(self, area):
        """Pixels of the window that a metre takes at a place [m], shape (3,): the mean over views."""
        return SUPERSAMPLING * np.mean(
            [
                view.project(area)[2] * height / (2 * view.half[1])
                for (_, view), (_, height) in zip(self._renderers, self._sizes, strict=True)
            ]
        )

    def _read(self, filled):
        from PIL import Image
        from vtkmodules.util.numpy_support import vtk_to_numpy
        from vtkmodules.vtkCommonCore import vtkUnsignedCharArray

        pixels = vtkUnsignedCharArray()
        self._window.GetPixelData(0, 0, self._width - 1, self._height - 1, 0, pixels, 0)
        image = vtk_to_numpy(pixels).reshape(self._height, self._width, 3)
        if filled and np.ptp(image[:: SUPERSAMPLING + 1]) == 0:
            raise SystemExit("the window stays blank")
        images, bottom = [], 0
        for width, height in self._sizes:
            top = bottom + SUPERSAMPLING * height
            part = np.ascontiguousarray(image[bottom:top, : SUPERSAMPLING * width][::-1])
            images.append(np.asarray(Image.fromarray(part).reduce(SUPERSAMPLING)))
            bottom = top
        return images


def _light(renderer):
    """A key light from above to the left, a fill light, and one from the viewer, all moving with the camera."""
    from vtkmodules.vtkRenderingCore import vtkLight

    for direction, strength in (((-0.45, 0.75, 1.0), 0.62), ((0.7, -0.3, 0.8), 0.28), ((0.0, 0.0, 1.0), 0.22)):
        light = vtkLight()
        light.SetLightTypeToCameraLight()
        light.SetPosition(*direction)
        light.SetFocalPoint(0.0, 0.0, 0.0)
        light.SetIntensity(strength)
        renderer.AddLight(light)


def _aim(renderer, view):
    camera = renderer.GetActiveCamera()
    position = view.centre + (0 if view.perspective else view.axes[2] * sum(view.half))
    camera.SetPosition(*position)
    camera.SetFocalPoint(*(position - view.axes[2]))
    camera.SetViewUp(*view.axes[1])
    camera.SetParallelProjection(not view.perspective)
    if view.perspective:
        camera.SetViewAngle(2 * np.degrees(np.arctan(view.half[1])))
    else:
        camera.SetParallelScale(view.half[1])
    renderer.ResetCameraClippingRange()


def _mesh_of(part, sides, pixels):
    if isinstance(part, Surface):
        return _SurfaceMesh()
    if isinstance(part, Balls):
        return _BallMesh(sides)
    return _WireMesh(pixels) if sides * part.paths[..., 0].size > MOST_CORNERS else _TubeMesh(sides)


class _Mesh:
    """A mesh of VTK and its actor; its arrays are held as long as VTK looks at them."""

    def __init__(self, specular):
        from vtkmodules.vtkCommonDataModel import vtkPolyData
        from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

        self.data, self.actor, self._mapper, self._buffers = vtkPolyData(), vtkActor(), vtkPolyDataMapper(), {}
        self._mapper.SetInputData(self.data)
        self.actor.SetMapper(self._mapper)
        properties = self.actor.GetProperty()
        properties.SetAmbient(AMBIENT)
        properties.SetDiffuse(DIFFUSE)
        properties.SetSpecular(specular)
        properties.SetSpecularPower(POWER)
        properties.SetInterpolationToPhong()

    def _points(self, points):
        from vtkmodules.vtkCommonCore import vtkPoints

        vtk_points = vtkPoints()
        vtk_points.SetData(self._array("points", points, np.float32))
        self.data.SetPoints(vtk_points)

    def _faces(self, faces):
        """Triangles or quadrangles, shape (faces, corners)."""
        self.data.SetPolys(self._cells(faces))

    def _cells(self, corners):
        """Cells with the same number of corners each, shape (cells, corners)."""
        from vtkmodules.vtkCommonDataModel import vtkCellArray

        cells = vtkCellArray()
        ends = np.arange(0, corners.size + 1, corners.shape[1])
        cells.SetData(self._array("ends", ends, np.int64), self._array("corners", corners.ravel(), np.int64))
        return cells

    def _array(self, name, values, kind):
        from vtkmodules.util.numpy_support import numpy_to_vtk

        self._buffers[name] = np.ascontiguousarray(values, dtype=kind)
        return numpy_to_vtk(self._buffers[name], deep=False)


class _TubeMesh(_Mesh):
    """Tubes whose faces stay as they are for as long as their number does."""

    def __init__(self, sides):
        super().__init__(specular=0.15)
        angle = 2 * np.pi * np.arange(sides) / sides
        self._round = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        self._shape = None
        self.actor.GetProperty().BackfaceCullingOn()

    def show(self, part):
        paths = np.asarray(part.paths, dtype=float)
        self.actor.SetVisibility(bool(len(paths)))
        if not len(paths):
            return
        outward = np.einsum("sa,alpx->lpsx", self._round, _across(paths))
        radius = np.broadcast_to(part.radius, len(paths))[:, None, None, None]
        self._points((paths[:, :, None] + radius * outward).reshape(-1, 3))
        self.data.GetPointData().SetNormals(self._array("normals", outward.reshape(-1, 3), np.float32))
        colours = np.round(255 * np.asarray(part.colours))
        each = paths.shape[1] * len(self._round)
        self.data.GetPointData().SetScalars(self._array("colours", np.repeat(colours, each, axis=0), np.uint8))
        if self._shape != paths.shape:
            self._shape = paths.shape
            self._faces(self._sides(*paths.shape[:2]))
        self.data.Modified()

    def _sides(self, lines, points):
        """Quadrangles between rings that follow each other, shape (faces, 4)."""
        sides = len(self._round)
        ring = np.arange(sides)
        first = np.stack([ring, np.roll(ring, -1), np.roll(ring, -1) + sides, ring + sides], axis=1)
        start = sides * (np.arange(points - 1) + points * np.arange(lines)[:, None])
        return (start[..., None, None] + first).reshape(-1, 4)


class _WireMesh(_Mesh):
    """Lines of one width in pixels, that of a tube of the same radius in the middle of the web.

    A tube takes a hundred times the work of a wire, by OpenGL in software.
    """

    def __init__(self, pixels):
        super().__init__(specular=0.0)
        self.actor.GetProperty().SetDiffuse(0.8 * DIFFUSE)  # half of a tube is turned away from the light
        self._pixels, self._shape = pixels, None

    def show(self, part):
        paths = np.asarray(part.paths)
        self.actor.SetVisibility(bool(len(paths)))
        if not len(paths):
            return
        points = paths.reshape(-1, 3)
        width = 2 * np.median(part.radius) * self._pixels(points.mean(axis=0))
        self.actor.GetProperty().SetLineWidth(max(1.0, float(width)))
        self._points(points)
        colours = np.round(255 * np.asarray(part.colours)).astype(np.uint8)
        self.data.GetPointData().SetScalars(
            self._array("colours", np.repeat(colours, paths.shape[1], axis=0), np.uint8)
        )
        if self._shape != paths.shape:
            self._shape = paths.shape
            self.data.SetLines(self._cells(np.arange(len(points)).reshape(paths.shape[:2])))
        self.data.Modified()


def _across(paths):
    """Two unit vectors across the lines at each of their points, shape (2, lines, points, 3)."""
    along = np.gradient(paths, axis=1)
    along /= np.linalg.norm(along, axis=2, keepdims=True) + 1e-300
    aside = np.eye(3)[np.abs(along).max(axis=1).argmin(axis=1)]
    first = np.cross(along, aside[:, None])
    first /= np.linalg.norm(first, axis=2, keepdims=True) + 1e-300
    return np.stack([first, np.cross(along, first)])


class _SurfaceMesh(_Mesh):
    """A body, smooth but at sharp edges."""

    def __init__(self):
        super().__init__(specular=0.4)
        self._last = None

    def show(self, part):
        from vtkmodules.vtkFiltersCore import vtkCleanPolyData, vtkPolyDataNormals

        self.actor.SetVisibility(bool(len(part.triangles)))
        if not len(part.triangles) or (self._last is not None and np.array_equal(part.points, self._last)):
            return
        self._last = part.points
        self._points(part.points)
        self._faces(part.triangles)
        clean, smooth = vtkCleanPolyData(), vtkPolyDataNormals()
        clean.SetInputData(self.data)
        smooth.SetInputConnection(clean.GetOutputPort())
        smooth.SetFeatureAngle(40.0)
        smooth.Update()
        self._mapper.SetInputData(smooth.GetOutput())
        self.actor.GetProperty().SetColor(*part.colour)


class _BallMesh(_Mesh):
    """Balls, made once for as long as they stay where they are."""

    def __init__(self, sides):
        super().__init__(specular=0.15)
        self._finest, self._last = 16 if sides >= FINE else 10, None

    def show(self, part):
        from vtkmodules.vtkFiltersCore import vtkGlyph3D
        from vtkmodules.vtkFiltersSources import vtkSphereSource

        self.actor.SetVisibility(bool(len(part.centres)))
        if not len(part.centres) or (self._last is not None and np.array_equal(part.centres, self._last)):
            return
        self._last = part.centres
        self._points(part.centres)
        ball, glyphs = vtkSphereSource(), vtkGlyph3D()
        ball.SetRadius(part.radius)
        resolution = int(np.clip(np.sqrt(MOST_OF_BALLS / len(part.centres)), 6, self._finest))
        ball.SetThetaResolution(resolution)
        ball.SetPhiResolution(resolution)
        glyphs.SetInputData(self.data)
        glyphs.SetSourceConnection(ball.GetOutputPort())
        glyphs.ScalingOff()
        glyphs.OrientOff()
        glyphs.Update()
        self._mapper.SetInputData(glyphs.GetOutput())
        self._mapper.ScalarVisibilityOff()
        self.actor.GetProperty().SetColor(*part.colour)
