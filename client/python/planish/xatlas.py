"""Replaces xatlas's Python binding: scripts written for it only change an import.

    import planish as xatlas            # or: import planish.xatlas as xatlas
    vmapping, indices, uvs = xatlas.parametrize(vertices, faces)

Names, ranks and types are those of the binding. The method is planish's: charts are cut for stretch and flattened by
ABF, and nothing overlaps. Each option of xatlas without a meaning here causes one warning per process
(:class:`OptionIgnored`).
"""

from __future__ import annotations



import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, List, Optional, Set, Tuple

import numpy as np


from .client import default_client
from .job import UnwrapOptions
from .mesh import VertexSplit, chart_of_faces, split_vertices

if TYPE_CHECKING:
    import numpy.typing as npt

    Mesh = Tuple[npt.NDArray[np.uint32], npt.NDArray[np.uint32], npt.NDArray[np.float32]]


class OptionIgnored(UserWarning):
    """An option of xatlas was set that has no meaning in planish."""


_warned: Set[str] = set()


def _ignore(name: str, instead: str = "") -> None:
    if name not in _warned:
        _warned.add(name)
        text = f"{name} means nothing to planish and is ignored"
        warnings.warn(f"{text}; {instead}" if instead else text, OptionIgnored, stacklevel=4)


# Options ----------------------------------------------------------------------------------------------------------------


class _Options:
    def __setattr__(self, name: str, value: Any) -> None:
        if name not in getattr(type(self), "__dataclass_fields__"):  # a misspelled name is an error, as in the binding
            raise AttributeError(f"{type(self).__name__} has no option {name!r}")
        object.__setattr__(self, name, value)


@dataclass
class ChartOptions(_Options):
    """How xatlas cuts charts. planish cuts only for stretch: only max_stretch has an effect."""

    max_chart_area: float = 0.0
    max_boundary_length: float = 0.0
    normal_deviation_weight: float = 2.0
    roundness_weight: float = 0.01
    straightness_weight: float = 6.0
    normal_seam_weight: float = 4.0
    texture_seam_weight: float = 0.5
    max_cost: float = 2.0
    max_iterations: int = 1
    use_input_mesh_uvs: bool = False
    fix_winding: bool = False
    #: Not in xatlas: planish's limit of a chart's stretch, in [1.001, 100]; None: 1.05.
    max_stretch: Optional[float] = None


@dataclass
class PackOptions(_Options):
    """How charts are packed: `padding`, `resolution`, `bilinear` and `bruteForce` have an effect."""

    max_chart_size: int = 0
    #: Texels between charts.
    padding: int = 0
    texels_per_unit: float = 0.0
    #: Texels per side of the atlas; 0: 1024.
    resolution: int = 0
    #: Adds one texel of padding, for bilinear sampling.
    bilinear: bool = True
    blockAlign: bool = False
    #: The best packing, with more charts: takes a minute or more.
    bruteForce: bool = False
    create_image: bool = False
    rotate_charts_to_axis: bool = True
    rotate_charts: bool = True


_CHART_OPTIONS_USED = ("max_stretch",)
_PACK_OPTIONS_USED = ("padding", "resolution", "bilinear", "bruteForce")
_INSTEAD = {
    "max_cost": "ChartOptions.max_stretch says how much stretch a chart may have",
    "texels_per_unit": "charts fill the texture, all at one density, which Atlas.texels_per_unit tells",
}


def _options(chart: ChartOptions, pack: PackOptions) -> UnwrapOptions:
    for given, default, used in (
        (chart, ChartOptions(), _CHART_OPTIONS_USED),
        (pack, PackOptions(), _PACK_OPTIONS_USED),
    ):
        for name, value in vars(given).items():
            if name not in used and value != getattr(default, name, value):
                _ignore(f"{type(default).__name__}.{name}", _INSTEAD.get(name, ""))
    return UnwrapOptions(
        prefer="texture",  # what xatlas makes charts for
        max_stretch=chart.max_stretch,
        texture_size=pack.resolution or None,
        padding=int(pack.padding) + (1 if pack.bilinear else 0),
        effort="best" if pack.bruteForce else "normal",
    )


# Arrays -----------------------------------------------------------------------------------------------------------------


def _array(name: str, value: Any, dtype: Any, columns: int, rows: Optional[int] = None) -> Any:
    """Converts and checks arguments as the binding does."""
    array = np.ascontiguousarray(value, dtype=dtype)
    if array.ndim != 2 or array.shape[1] != columns:
        raise ValueError(f"{name} array expected to be Nx{columns}.")
    if rows is not None and len(array) != rows:
        raise ValueError(
            f"{name} array has invalid number of elements in the first dimension (expected {rows}, got {len(array)})"
        )
    return array


# The atlas --------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Chart:
    """One chart of a mesh."""

    faces: npt.NDArray[np.uint32]  #: (N,): ids of its triangles
    atlas_index: int = 0
    material: int = 0


class Atlas:
    """Several meshes in one texture. Not thread-safe, like that of xatlas."""

    def __init__(self) -> None:
        self._inputs: List[Tuple[Any, Any]] = []
        self._meshes: List[VertexSplit] = []
        self._charts: List[Any] = []  # of each mesh: the chart of each triangle; computed on demand
        self._chart_count = 0
        self._utilization = 0.0
        self._texels_per_unit = 0.0
        self._size = 0

    # In

    def add_mesh(self, positions: Any, indices: Any, normals: Any = None, uvs: Any = None) -> None:
        """`positions` (N, 3) and `indices` (F, 3) of any real types. `normals` and `uvs` are checked and ignored."""
        vertices = _array("Position", positions, np.result_type(np.asarray(positions), np.float32), 3)
        faces = _array("Index", indices, np.uint32, 3)
        if normals is not None:
            _array("Normal", normals, np.float32, 3, len(vertices))
        if uvs is not None:
            _array("Texture coordinate", uvs, np.float32, 2, len(vertices))
            _ignore("uvs of a mesh", "charts are cut anew")
        if faces.size > 0 and int(faces.max()) >= len(vertices):
            raise RuntimeError("Adding mesh failed: Index out of range")
        self._inputs.append((vertices, faces))

    def add_uv_mesh(self, uvs: Any, indices: Any, face_materials: Any = None) -> None:
        """planish's server makes UV and does not repack those of others. Raises NotImplementedError."""
        raise NotImplementedError("planish.Atlas does not repack UV that exist; the command `planish pack` does")

    def generate(
        self,
        chart_options: Optional[ChartOptions] = None,
        pack_options: Optional[PackOptions] = None,
        verbose: bool = False,
    ) -> None:
        """Unwraps and packs all meshes together, on the server named by $PLANISH_SERVER or a private one, started by
        the first call of the process. Raises :class:`planish.Error`."""
        chart, pack = chart_options or ChartOptions(), pack_options or PackOptions()
        options = _options(chart, pack)
        if pack.resolution:
            self._size = int(pack.resolution)
        if not any(len(faces) for _, faces in self._inputs):
            self._meshes = [_no_faces(faces) for _, faces in self._inputs]
            self._charts, self._chart_count = [None] * len(self._meshes), 0
            return
        first_vertex = np.cumsum([0] + [len(vertices) for vertices, _ in self._inputs])
        positions = np.concatenate([vertices for vertices, _ in self._inputs])
        triangles = np.concatenate(
            [faces.astype(np.int64) + start for (_, faces), start in zip(self._inputs, first_vertex)]
        )
        result = default_client().unwrap(positions, triangles, options=options)
        report = result.report
        self._meshes, self._charts = [], [None] * len(self._inputs)
        first_face = 0
        for vertices, faces in self._inputs:
            uv = result.uv[first_face : first_face + len(faces)].astype(np.float32, copy=False)
            first_face += len(faces)
            self._meshes.append(_compact(split_vertices(len(vertices), faces, uv)) if len(faces) else _no_faces(faces))
        self._chart_count = report.chart_totals.charts
        self._utilization = report.quality.packing_efficiency
        self._texels_per_unit = report.atlas.texels_per_unit
        self._size = report.atlas.texture_size
        if verbose:
            print(f"Charts: {self._chart_count}, utilization: {100 * self._utilization:.1f} %, size: {self._size}")

    # Out

    def get_mesh(self, mesh_index: int) -> Mesh:
        """`vmapping` uint32 (V',): the original vertex of each vertex; `indices` uint32 (F, 3); `uvs` float32 (V', 2),
        in [0, 1]. Raises IndexError."""
        split = self._mesh(mesh_index)
        return split.source_vertex, split.triangles, split.uv

    def __getitem__(self, mesh_index: int) -> Mesh:
        return self.get_mesh(mesh_index)

    def __len__(self) -> int:
        return self.mesh_count

    def get_mesh_vertex_assignment(self, mesh_index: int) -> Tuple[npt.NDArray[np.uint32], npt.NDArray[np.uint32]]:
        """The atlas and the chart of each vertex, (V',) each. Charts are numbered over all meshes."""
        split, before = self._mesh(mesh_index), sum(self.get_mesh_chart_count(i) for i in range(mesh_index))
        chart = np.zeros(len(split.source_vertex), np.uint32)
        chart[split.triangles.reshape(-1)] = np.repeat(self._face_charts(mesh_index) + before, 3)
        return np.zeros(len(chart), np.uint32), chart

    def get_mesh_chart_count(self, mesh_index: int) -> int:
        self._mesh(mesh_index)
        of_face = self._face_charts(mesh_index)
        return int(of_face.max()) + 1 if len(of_face) else 0

    def get_mesh_chart(self, mesh_index: int, chart_index: int) -> Chart:
        count = self.get_mesh_chart_count(mesh_index)
        if not 0 <= chart_index < count:
            raise IndexError(f"Chart index {chart_index} out of bounds for mesh with {count} charts.")
        return Chart(np.flatnonzero(self._face_charts(mesh_index) == chart_index).astype(np.uint32))

    def get_utilization(self, atlas_index: int) -> float:
        """UV area over the area of the texture."""
        if atlas_index != 0 or not self._meshes:
            raise IndexError(f"Atlas index {atlas_index} out of bounds.")
        return self._utilization

    def get_chart_image(self, atlas_index: int) -> Any:
        """planish makes no picture of the charts. Raises RuntimeError, as the binding does if none was requested."""
        raise RuntimeError("The atlas does not have an image.")

    @property
    def atlas_count(self) -> int:
        return 1 if self._meshes else 0

    @property
    def mesh_count(self) -> int:
        return len(self._meshes) or len(self._inputs)

    @property
    def chart_count(self) -> int:
        return self._chart_count

    @property
    def width(self) -> int:
        return self._size

    @property
    def height(self) -> int:
        return self._size

    @property
    def texels_per_unit(self) -> float:
        return self._texels_per_unit

    @property
    def utilization(self) -> float:
        return self.get_utilization(0)

    @property
    def chart_image(self) -> Any:
        return self.get_chart_image(0)

    def _mesh(self, index: int) -> VertexSplit:
        if not 0 <= index < len(self._meshes):
            raise IndexError(f"Mesh index {index} out of bounds for atlas with {len(self._meshes)} meshes.")
        return self._meshes[index]

    def _face_charts(self, index: int) -> Any:
        if self._charts[index] is None:
            self._charts[index] = chart_of_faces(self._meshes[index])
        return self._charts[index]


def _compact(split: VertexSplit) -> VertexSplit:
    """`split` without unused vertices, as in xatlas."""
    used = np.zeros(len(split.source_vertex), bool)
    used[split.triangles.reshape(-1)] = True
    if used.all():
        return split
    number = (np.cumsum(used) - 1).astype(np.uint32)
    return VertexSplit(split.source_vertex[used], number[split.triangles], split.uv[used])


def _no_faces(faces: Any) -> VertexSplit:
    return VertexSplit(np.zeros(0, np.uint32), faces, np.zeros((0, 2), np.float32))


def parametrize(positions: Any, indices: Any, normals: Any = None, uvs: Any = None) -> Mesh:
    """Unwraps one mesh with default options, by :meth:`Atlas.add_mesh`, :meth:`Atlas.generate` and
    :meth:`Atlas.get_mesh`."""
    atlas = Atlas()
    atlas.add_mesh(positions, indices, normals, uvs)
    atlas.generate()
    return atlas.get_mesh(0)


def export(path: str, positions: Any, indices: Any = None, uvs: Any = None, normals: Any = None) -> None:
    """Writes arrays as an OBJ file, like the binding's helper: `uvs` and `normals` have a row for each vertex."""
    vertices = _array("Position", positions, np.float32, 3)
    columns = [("v", vertices)]
    if normals is not None:
        columns.append(("vn", _array("Normal", normals, np.float32, 3, len(vertices))))
    if uvs is not None:
        columns.append(("vt", _array("Texture coordinates", uvs, np.float32, 2, len(vertices))))
    corner = {(False, False): "{0}", (True, False): "{0}/{0}", (False, True): "{0}//{0}", (True, True): "{0}/{0}/{0}"}
    form = corner[uvs is not None, normals is not None]
    with open(path, "w", encoding="ascii") as file:
        for word, rows in columns:
            file.writelines(f"{word} {' '.join(repr(float(x)) for x in row)}\n" for row in rows)
        if indices is not None:
            for face in _array("Index", indices, np.uint32, 3).tolist():
                file.write("f " + " ".join(form.format(v + 1) for v in face) + "\n")


