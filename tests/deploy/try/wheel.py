"""What somebody does who has just installed the wheel, and what must hold then. Run by ../try_wheel.sh.

    wheel.py ten|million|pool

Ends with an exception if something does not hold.
"""

import multiprocessing
import os
import sys
import time

import numpy as np
import planish


def servers():
    """The processes that this one has started: id by name."""
    found = {}
    for pid in filter(str.isdigit, os.listdir("/proc")):
        try:
            with open(f"/proc/{pid}/stat") as file:
                name, _, rest = file.read().partition("(")[2].rpartition(")")
        except OSError:
            continue
        if int(rest.split()[1]) == os.getpid():
            found[int(pid)] = name
    return found


def sheet(cells):
    s, t = (axis.ravel() for axis in np.meshgrid(*2 * [np.linspace(0, 1, cells + 1)]))
    positions = np.stack([s, t, 0.05 * np.sin(9 * s) * np.sin(7 * t)], axis=1)
    a = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    c = a + cells + 1
    return positions, np.stack([a, a + 1, c + 1, a, c + 1, c], 1).reshape(-1, 3)


def ten():
    positions = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], float)
    triangles = np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])
    result = planish.unwrap(positions, triangles)
    assert result.is_usable and result.uv.shape == (4, 3, 2)
    first = servers()
    own = os.path.join(os.path.dirname(planish.__file__), "_server")
    assert planish.find_planishd() == os.path.join(own, "bin/planishd"), planish.find_planishd()
    assert len(first) == 1, first
    planish.unwrap(2 * positions, triangles)
    assert servers() == first, servers()


def million():
    positions, triangles = sheet(708)
    points, start = [], time.monotonic()
    result = planish.unwrap(positions, triangles, on_progress=lambda p: points.append((p.stage, time.monotonic() - start)))
    seconds = time.monotonic() - start
    stages = {stage for stage, _ in points}
    assert result.is_usable and {"solve", "pack"} <= stages, stages
    # Live: they came over the whole time, not all at its end.
    assert points[0][1] < 0.5 * seconds and len(points) > 10, points
    print(f"   {len(triangles)} triangles, {seconds:.1f} s, {len(points)} points of progress, {result.chart_count} charts")


def unwrap(i):
    positions, triangles = sheet(4 + i)
    return planish.unwrap(positions, triangles).is_usable, len(servers())


def pool():
    unwrap(0)
    with multiprocessing.get_context("fork").Pool(4) as four:
        answers = four.map(unwrap, range(8), chunksize=1)
    # Each child has one process, which makes its calls; the server is the parent's.
    assert all(usable and processes == 1 for usable, processes in answers), answers


if __name__ == "__main__":
    {"ten": ten, "million": million, "pool": pool}[sys.argv[1]]()
