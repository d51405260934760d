# blender -b --factory-startup -P blender_unwrap.py -- abf|smart MESH.obj MAP.obj [MARGIN]: Blender's ABF unwrap operator,
# or Smart UV Project at its default 66 degrees and then Pack Islands. MARGIN, a fraction of the texture, stays free round
# every chart: between two of them twice as much. Prints wall-clock and CPU seconds of the operators alone, and writes the
# UV that they leave behind.
import sys
import time

import bpy

method, path, out, *margin = sys.argv[sys.argv.index("--") + 1 :]
bpy.ops.object.select_all(action="SELECT")
bpy.ops.object.delete()
bpy.ops.wm.obj_import(filepath=path)
mesh = bpy.context.selected_objects[0]
bpy.context.view_layer.objects.active = mesh
bpy.ops.object.mode_set(mode="EDIT")
bpy.ops.mesh.select_all(action="SELECT")
start, cpu_start = time.perf_counter(), time.process_time()
if method == "abf":
    bpy.ops.uv.unwrap(method="ANGLE_BASED", fill_holes=False, correct_aspect=False, margin=0)
else:
    # The default margin method scales with the area of the charts; this one is exact.
    bpy.ops.uv.smart_project(margin_method="FRACTION", island_margin=float(margin[0]))
    bpy.ops.uv.pack_islands(margin_method="FRACTION", margin=float(margin[0]))
seconds, cpu_seconds = time.perf_counter() - start, time.process_time() - cpu_start
bpy.ops.object.mode_set(mode="OBJECT")
uv = mesh.data.uv_layers.active.data
with open(out, "w") as file:
    for loop in uv:
        file.write("vt %.9g %.9g\n" % tuple(loop.uv))
    for polygon in mesh.data.polygons:
        corners = ["%d/%d" % (mesh.data.loops[i].vertex_index + 1, i + 1) for i in polygon.loop_indices]
        file.write("f %s\n" % " ".join(corners))
print('RESULT "map_seconds":%.6f,"map_cpu_seconds":%.6f' % (seconds, cpu_seconds))
