"""Generated meshes, as image-to-3D pipelines have them, through the functions in the shape of xatlas's.

    python3 test_shared_meshes.py [all]

The smallest one of group j of the collection, or all of them. Exit code 77: the collection is not here.
"""

import csv
import sys
import time
import unittest
import warnings

import numpy as np

import planish
import planish as xatlas
import support

COLLECTION = support.SOURCE_TREE.parent / "shared/meshes"


def files(group):
    with open(COLLECTION / "MANIFEST.tsv", newline="", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file, delimiter="\t") if row["group"] == group]
    return [COLLECTION / row["file"] for row in sorted(rows, key=lambda row: int(row["F"]))]


class SharedMeshes(unittest.TestCase):
    everything = False

    def test_group_j(self):
        paths = files("j")
        self.assertGreater(len(paths), 1)
        for path in paths if self.everything else paths[:1]:
            with self.subTest(path.name):
                positions, triangles, _ = support.read_obj(path)
                start = time.monotonic()
                vmapping, indices, uvs = xatlas.parametrize(positions, triangles)
                seconds = time.monotonic() - start
                np.testing.assert_array_equal(vmapping[indices], triangles)
                self.assertTrue(((uvs >= 0) & (uvs <= 1)).all())
                areas = support.uv_areas(uvs[indices].astype(float))
                report = planish.client.default_client().list_jobs(1)[0]
                report = planish.client.default_client().get_job(report.name).report
                if self.everything:
                    quality = report.quality
                    print(path.name, f"{seconds:.1f} s", report.chart_totals.charts, "charts,", quality.flipped, "flipped,",
                          quality.overlapping, "overlapping,", [warning.reason for warning in report.warnings])
                self.assertEqual(int((areas < 0).sum()), report.quality.flipped)
                self.assertEqual((report.quality.flipped, report.quality.overlapping), (0, 0))
                self.check_atlas(positions, triangles)

    def check_atlas(self, positions, triangles):
        """As public pipelines use it, with options."""
        atlas = xatlas.Atlas()
        atlas.add_mesh(positions, triangles)
        chart_options, pack_options = xatlas.ChartOptions(), xatlas.PackOptions()
        chart_options.max_iterations = 4
        pack_options.resolution, pack_options.padding = 2048, 4
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", xatlas.OptionIgnored)
            atlas.generate(chart_options, pack_options)
        vmapping, indices, uvs = atlas[0]
        np.testing.assert_array_equal(vmapping[indices], triangles)
        self.assertEqual((atlas.width, atlas.height), (2048, 2048))
        used = np.abs(support.uv_areas(uvs[indices].astype(float))).sum()
        self.assertAlmostEqual(atlas.utilization, used, delta=1e-3)
        self.assertGreater(atlas.chart_count, 0)


if __name__ == "__main__":
    if not (COLLECTION / "MANIFEST.tsv").exists():
        print("SKIPPED: the collection of meshes is not beside this checkout")
        sys.exit(77)
    SharedMeshes.everything = sys.argv[1:] == ["all"]
    unittest.main(argv=sys.argv[:1])
