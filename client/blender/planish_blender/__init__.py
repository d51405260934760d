"""Unwrap with planish: UV maps of the selected objects by Angle Based Flattening, on a planish server."""

bl_info = {
    "name": "planish",
    "author": "The planish authors",
    "version": (0, 0, 0),  # the build puts the project's version here
    "blender": (3, 4, 0),
    "location": "UV > Unwrap with planish; Object > Unwrap with planish",
    "description": "Unwraps meshes by Angle Based Flattening, without flipped or overlapping faces",
    "category": "UV",
}

from . import engines, operator, preferences


def register():
    preferences.register()
    operator.register()


def unregister():
    operator.unregister()
    preferences.unregister()
    engines.close()
