"""planish: UV unwrapping of triangle meshes by Angle Based Flattening, on a running or a private server.

    import planish
    result = planish.unwrap(positions, triangles)       # (V, 3) and (F, 3)
    result.uv                                           # (F, 3, 2)
    result.per_vertex()                                 # vertices at seams split

:class:`Client` blocks, :class:`AsyncClient` is for asyncio, :func:`parametrize` and :class:`Atlas` replace xatlas's.
"""

import os as _os

# gRPC's fork support makes a fork wait for calls under way, and may hang. This package does not use it (see
# _bridge.py). The variable has an effect only if it is set before gRPC is imported.
_os.environ.setdefault("GRPC_ENABLE_FORK_SUPPORT", "0")

from ._connection import ConnectionOptions
from ._follow import Callbacks
from ._request import NewJob
from ._retry import RetryPolicy
from ._version import __version__
from .aio import AsyncClient
from .client import Call, Client, unwrap
from .errors import (
    Aborted,
    AlreadyExists,
    ArrayError,
    Cancelled,
    DataLoss,
    DeadlineExceeded,
    Error,
    FailedPrecondition,
    Internal,
    InvalidArgument,
    NotFound,
    OutOfRange,
    PermissionDenied,
    ResourceExhausted,
    Unauthenticated,
    Unavailable,
    Unimplemented,
)
from .job import (
    AtlasPart,
    AtlasReport,
    BoundaryReport,
    Capabilities,
    ChartReport,
    ChartTotals,
    Event,
    Job,
    JobError,
    JobEstimate,
    JobWarning,
    Progress,
    Quality,
    Report,
    Residual,
    Scheduling,
    StageSeconds,
    UnwrapOptions,
)
from .mesh import VertexSplit, split_vertices
from .private_server import PrivateServer, close_default_server, find_planishd
from .result import Result
from .textures import find_command, transfer
from .xatlas import Atlas, ChartOptions, OptionIgnored, PackOptions, export, parametrize

__all__ = [
    "Aborted",
    "AlreadyExists",
    "ArrayError",
    "AsyncClient",
    "Atlas",
    "AtlasPart",
    "AtlasReport",
    "BoundaryReport",
    "Call",
    "Callbacks",
    "Cancelled",
    "Capabilities",
    "ChartOptions",
    "ChartReport",
    "ChartTotals",
    "Client",
    "ConnectionOptions",
    "DataLoss",
    "DeadlineExceeded",
    "Error",
    "Event",
    "FailedPrecondition",
    "Internal",
    "InvalidArgument",
    "Job",
    "JobError",
    "JobEstimate",
    "JobWarning",
    "NewJob",
    "NotFound",
    "OptionIgnored",
    "OutOfRange",
    "PackOptions",
    "PermissionDenied",
    "PrivateServer",
    "Progress",
    "Quality",
    "Report",
    "Residual",
    "ResourceExhausted",
    "Result",
    "RetryPolicy",
    "Scheduling",
    "StageSeconds",
    "Unauthenticated",
    "Unavailable",
    "Unimplemented",
    "UnwrapOptions",
    "VertexSplit",
    "__version__",
    "close_default_server",
    "export",
    "find_command",
    "find_planishd",
    "parametrize",
    "split_vertices",
    "transfer",
    "unwrap",
]
