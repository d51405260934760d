"""The result of an unwrap."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, List, Optional

import numpy as np

from .errors import DataLoss, FailedPrecondition
from .job import ChartReport, JobWarning, Report
from .mesh import PackedMesh, VertexSplit, chart_of_faces, split_vertices
from .v1 import options_pb2

if TYPE_CHECKING:
    import numpy.typing as npt


@dataclass(frozen=True, eq=False)
class Result:
    """UV and their report."""

    #: (F, 3, 2): (u, v) of each corner of each triangle, in the caller's order. float32 or float64, as delivered.
    uv: npt.NDArray[Any]
    #: Stage times, quality, charts, warnings.
    report: Report
    #: Name of the job, "jobs/...".
    job: str
    #: The id of the call's W3C trace, 32 hex digits, as in the server's log.
    trace_id: str
    _triangles: Any = field(repr=False, default=None)
    _vertex_count: int = field(repr=False, default=0)

    @property
    def charts(self) -> List[ChartReport]:
        """How each chart was flattened; if there are more than 1024, those that did not converge, then those with
        the largest stretch."""
        return self.report.charts

    @property
    def chart_count(self) -> int:
        return self.report.chart_totals.charts

    @property
    def warnings(self) -> List[JobWarning]:
        """Promises that were not kept, and other things the caller should know. Empty if all is well."""
        return self.report.warnings

    @property
    def is_usable(self) -> bool:
        """Every chart converged and no UV triangle is flipped or degenerate. (Overlaps are warnings.)"""
        quality = self.report.quality
        return self.report.chart_totals.not_converged == 0 and quality.flipped == 0 and quality.degenerate == 0

    def per_vertex(self) -> VertexSplit:
        """The mesh with one UV for each vertex: vertices at seams become several. Takes linear time, and no server."""
        if self._triangles is None:
            raise FailedPrecondition("the mesh was not given to attach(), so there are no triangles to split", reason="NO_MESH")
        return split_vertices(self._vertex_count, self._triangles, self.uv)

    def face_charts(self) -> npt.NDArray[np.int64]:
        """The chart of each triangle, (F,), numbered by first appearance. Not for results without packing."""
        return chart_of_faces(self.per_vertex())


def parse_uv(description: Any, data: bytearray, mesh: Optional[PackedMesh]) -> Any:
    """The UV of a job as an array, checked against the server's description and, if given, the mesh."""
    if mesh is not None and not _is_of(description.mesh_sha256, mesh):
        raise FailedPrecondition("the job was made from other positions or triangles", reason="MESH_MISMATCH")
    corners = description.corner_count
    if mesh is not None and corners != 3 * mesh.triangle_count:
        raise _corrupt(f"{corners} corners for {mesh.triangle_count} triangles")
    kind = np.dtype("<f8" if description.precision == options_pb2.PRECISION_DOUBLE else "<f4")
    if len(data) != 2 * corners * kind.itemsize:
        raise _corrupt(f"{len(data)} bytes instead of {2 * corners * kind.itemsize}")
    if hashlib.sha256(data).digest() != description.uv_sha256:
        raise _corrupt("their SHA-256 differs")
    return np.frombuffer(data, kind).reshape(-1, 3, 2)


def _is_of(digest: bytes, mesh: PackedMesh) -> bool:
    return digest == mesh.sha256() or digest == hashlib.sha256(mesh.draco()).digest()  # an upload is a Draco file


def _corrupt(what: str) -> DataLoss:
    return DataLoss(f"the UV that arrived are not the ones that the server made: {what}", reason="UV_CORRUPT")
