# blender -b --factory-startup -P blender_abf.py -- MESH.obj: seconds of Blender's ABF unwrap operator alone.
import sys
import time

import bpy

path = sys.argv[sys.argv.index("--") + 1]
bpy.ops.object.select_all(action="SELECT")
bpy.ops.object.delete()
bpy.ops.wm.obj_import(filepath=path)
mesh = bpy.context.selected_objects[0]
bpy.context.view_layer.objects.active = mesh
bpy.ops.object.mode_set(mode="EDIT")
bpy.ops.mesh.select_all(action="SELECT")
start = time.perf_counter()
bpy.ops.uv.unwrap(method="ANGLE_BASED", fill_holes=False, correct_aspect=False, margin=0)
print("SECONDS %.4f" % (time.perf_counter() - start))
