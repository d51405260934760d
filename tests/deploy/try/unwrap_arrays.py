"""Arrays in, UV out, with live progress: what a first script with the package looks like. Run by ../try_packages.sh.

    unwrap_arrays.py MESH.obj UV.txt
"""

import sys

import numpy as np
import planish

lines = [line.split() for line in open(sys.argv[1], encoding="utf-8")]
positions = np.array([words[1:4] for words in lines if words[:1] == ["v"]], dtype=np.float32)
triangles = np.array([[word.split("/")[0] for word in words[1:4]] for words in lines if words[:1] == ["f"]], dtype=np.int64) - 1


def show(progress: planish.Progress) -> None:
    print("progress:", progress.stage, progress.newton_iteration)


result = planish.unwrap(positions, triangles, on_progress=show)
print(f"{result.uv.shape[0]} triangles, {len(result.report.charts)} charts")
np.savetxt(sys.argv[2], result.uv.reshape(-1, 2), fmt="%.9g")
