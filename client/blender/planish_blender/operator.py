"""UV > Unwrap with planish."""

import bpy
import numpy as np

from . import engines, meshes, textures, transfer
from .preferences import settings

_POLL_SECONDS = 0.1
#: View operations that are allowed while an unwrap runs; meshes must not change.
_VIEW_EVENTS = ("MIDDLEMOUSE", "WHEEL", "MOUSEMOVE", "TRACKPAD", "MOUSEROTATE", "NUMPAD_", "NDOF", "WINDOW_", "TIMER")


class UV_OT_planish_unwrap(bpy.types.Operator):
    """Unwrap the selected objects by Angle Based Flattening, on a planish server"""

    bl_idname = "uv.planish_unwrap"
    bl_label = "Unwrap with planish"
    bl_options = {"REGISTER", "UNDO"}

    seams: bpy.props.EnumProperty(
        name="Seams",
        description="Edges to cut at",
        items=(
            ("SEAM", "Marked", "Edges that are marked as seams"),
            ("SHARP", "Sharp", "Edges that are marked as sharp"),
            ("MATERIAL", "Materials", "Edges between faces of different materials"),
            ("UV", "Islands", "Borders of the islands of the active UV map"),
        ),
        options={"ENUM_FLAG"},
        default={"SEAM"},
    )
    cuts: bpy.props.EnumProperty(
        name="More Seams",
        description="Where else may be cut",
        items=(
            ("AUTO", "For Stretch", "As many more as keep the stretch of every chart below the limit"),
            ("NEEDED", "Where Needed", "Only where a part between the seams cannot lie flat otherwise"),
            ("KEEP", "Nowhere", "A part with holes is slit where it has no other map; a closed part is an error"),
        ),
        default="AUTO",
    )
    prefer: bpy.props.EnumProperty(
        name="Prefer",
        description="What seams are placed for",
        items=(
            ("SEAMS", "Seams", "Few, short and hidden seams"),
            ("TEXTURE", "Texture", "Charts that pack well: more of them"),
        ),
        default="SEAMS",
    )
    max_stretch: bpy.props.FloatProperty(
        name="Stretch",
        description="Root mean square stretch above which a chart is cut",
        default=1.25,
        min=1.001,
        max=100,
        soft_max=2,
        precision=3,
    )
    texture_size: bpy.props.IntProperty(
        name="Texture Size", description="Texels per side", default=1024, min=16, max=65536, subtype="PIXEL"
    )
    texels_per_unit: bpy.props.FloatProperty(
        name="Texels per Unit",
        description="Texel density on the surface; 0: as many as the texture has room for",
        default=0,
        min=0,
        soft_max=4096,
    )
    finds_texture_size: bpy.props.BoolProperty(
        name="Find Texture Size",
        description="Take the smallest power of two, as the texture size, that has room for the texels per unit",
        default=True,
    )
    padding: bpy.props.IntProperty(
        name="Padding", description="Texels between charts, half as many at the rim", default=2, min=0, max=64, subtype="PIXEL"
    )
    boundary: bpy.props.EnumProperty(
        name="Boundary",
        items=(
            ("FREE", "Free", "Charts have the outline that distorts least"),
            ("CONVEX", "Convex", "The outline of each chart is a convex polygon"),
        ),
        default="FREE",
    )
    one_atlas: bpy.props.BoolProperty(
        name="One Atlas", description="The objects share one texture; off: each has its own", default=True
    )
    transfer_textures: bpy.props.BoolProperty(
        name="Transfer Textures",
        description="Where materials read images with the UV map: the new one becomes a UV map of its own, for which these images are "
        "redrawn, with the same texel density. Off: the UV map is replaced",
        default=True,
    )

    @classmethod
    def poll(cls, context):
        return any(True for _ in _objects(context))

    def draw(self, _context):
        layout = self.layout
        layout.use_property_split = True
        layout.column(heading="Seams").prop(self, "seams")
        layout.prop(self, "cuts")
        column = layout.column()
        column.active = self.cuts == "AUTO"
        column.prop(self, "prefer")
        column.prop(self, "max_stretch")
        layout.prop(self, "texels_per_unit")
        column = layout.column()
        column.active = self.texels_per_unit > 0
        column.prop(self, "finds_texture_size")
        for name in ("texture_size", "padding", "boundary", "one_atlas", "transfer_textures"):
            layout.prop(self, name)

    # For scripts, and when an option is changed in the redo panel: waits for the end.

    def execute(self, context):
        if not self._begin(context):
            return {"CANCELLED"}
        manager = context.window_manager
        manager.progress_begin(0, 1)
        try:
            while not self._batch.step():
                manager.progress_update(self._batch.fraction)
                self._batch.wait(_POLL_SECONDS)
        except BaseException:  # Ctrl-C in a terminal
            self._batch.cancel()
            raise
        finally:
            manager.progress_end()
        return self._end(context)

    # For interactive use: Blender continues meanwhile.

    def invoke(self, context, _event):
        if bpy.app.background:
            return self.execute(context)
        if not self._begin(context):
            return {"CANCELLED"}
        self._timer = context.window_manager.event_timer_add(_POLL_SECONDS, window=context.window)
        context.window_manager.modal_handler_add(self)
        self._show(context)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC" and event.value == "PRESS":
            self._batch.cancel()
            self._show(context)
            return {"RUNNING_MODAL"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"} if event.type.startswith(_VIEW_EVENTS) else {"RUNNING_MODAL"}
        is_over = self._batch.step()
        if not is_over:
            self._show(context)
            return {"PASS_THROUGH"}
        self._hide(context)
        result = self._end(context)
        for area in context.screen.areas:
            area.tag_redraw()
        return result

    def cancel(self, context):
        """Called when Blender loads another file, or quits."""
        self._batch.cancel()
        self._hide(context)

    def _show(self, context):
        context.workspace.status_text_set(f"Unwrap with planish: {self._batch} (Esc cancels)")

    def _hide(self, context):
        context.window_manager.event_timer_remove(self._timer)
        context.workspace.status_text_set(None)

    # Shared by execute() and modal()

    def _begin(self, context):
        try:
            start = engines.engine(settings(context))
            parts = [meshes.read(each, self.seams, self.transfer_textures) for each in _objects(context)]
            sheets = [meshes.Sheet(parts)] if self.one_atlas else [meshes.Sheet([part]) for part in parts]
            self._textures = textures.find(sheets, settings(context)) if self.transfer_textures else {}
        except (engines.Failed, meshes.Unusable) as error:
            self.report({"ERROR"}, str(error))
            return False
        named = {"texture_size": self.texture_size, "padding": self.padding, "boundary": self.boundary.lower()}
        if self.cuts == "AUTO":
            named.update(max_stretch=self.max_stretch, prefer=self.prefer.lower())
        if self.texels_per_unit > 0:
            named.update(texels_per_unit=self.texels_per_unit)
            if self.finds_texture_size:
                del named["texture_size"]
        options = engines.Options(self.cuts.lower(), **named)
        self._batch = engines.Batch(start, sheets, options)
        self._batch.step()
        return True

    def _end(self, context):
        batch, self._batch = self._batch, None  # Blender may keep the operator, for the redo panel
        found, self._textures = self._textures, {}
        try:
            return self._finish(context, batch, found)
        finally:
            for each in found.values():
                each.close()

    def _finish(self, context, batch, found):
        if batch.cancelled:
            self.report({"INFO"}, "Unwrap with planish: cancelled")
            return {"CANCELLED"}
        good = [(sheet, outcome) for sheet, outcome in batch.outcomes if isinstance(outcome, engines.Outcome)]
        if context.mode == "EDIT_MESH" and any(sheet in found for sheet, _ in good):
            # The undo steps of edit mode know no materials.
            bpy.ops.object.mode_set(mode="OBJECT")
        for sheet, outcome in good:
            self._take(sheet, outcome, found.get(sheet))
        if good:
            charts = sum(outcome.charts for _, outcome in good)
            stretch = max(outcome.stretch for _, outcome in good)
            efficiency = np.mean([outcome.efficiency for _, outcome in good])
            self.report({"INFO"}, f"{charts} chart{'s' if charts != 1 else ''}, stretch {stretch:.3f}, {efficiency:.0%} of the texture used")
        selects = False
        for sheet, error in batch.outcomes:
            if not isinstance(error, engines.Failed):
                continue
            elements = (error.faces, error.edges, error.vertices)
            selected = sheet.select(*elements)
            note = f"; at {sheet.places(*elements)} (selected)" if selected else ""
            self.report({"ERROR"}, f"{sheet.name}: {error}{note}")
            if selected and not selects:
                selects = True
                _show_selection(context, error)
        if selects and not good:
            bpy.ops.ed.undo_push(message="Faulty Elements")
        return {"FINISHED"} if good else {"CANCELLED"}

    def _take(self, sheet, outcome, found):
        if found is None:
            changed, torn = sheet.write(outcome.uv)
        else:
            new_map = found.new_map()
            changed, torn = sheet.write(outcome.uv, new_map, found.parts)
            if not changed:
                self._take_textures(sheet, outcome, found, new_map)
        for name in changed:
            self.report({"WARNING"}, f"{name} was changed meanwhile and keeps its UV")
        if torn:
            self.report({"WARNING"}, f"{torn} faces had to be cut along a diagonal, and are not mapped properly")
        for warning in outcome.warnings:
            self.report({"WARNING"}, f"{sheet.name}: {warning}")


    def _take_textures(self, sheet, outcome, found, new_map):
        notes, warnings = found.apply(outcome.images or transfer.Images(), new_map)
        for part in found.parts:
            if found.becomes_default(part):
                part.object.data.uv_layers[new_map].active_render = True
        for kind, sentences in (("INFO", notes), ("WARNING", warnings)):
            for sentence in sentences:
                self.report({kind}, f"{sheet.name}: {sentence}")


def _objects(context):
    """The meshes to unwrap: those in edit mode, else the selected ones; each mesh once."""
    if context.mode == "EDIT_MESH":
        objects = context.objects_in_mode_unique_data
    else:
        objects = context.selected_objects if context.mode == "OBJECT" else ()
    seen = set()
    for each in objects:
        if each.type == "MESH" and each.data not in seen:
            seen.add(each.data)
            yield each


def _show_selection(context, error):
    """Shows the selected elements: switches to edit mode, unless Blender runs in the background."""
    context.tool_settings.mesh_select_mode = (bool(error.vertices), bool(error.edges), not error.vertices and not error.edges)
    if context.mode == "OBJECT" and not bpy.app.background and context.object is not None:
        bpy.ops.object.mode_set(mode="EDIT")


def _draw_menu(menu, _context):
    menu.layout.separator()
    menu.layout.operator(UV_OT_planish_unwrap.bl_idname)


_MENUS = ("VIEW3D_MT_uv_map", "IMAGE_MT_uvs_unwrap", "VIEW3D_MT_object")


def register():
    bpy.utils.register_class(UV_OT_planish_unwrap)
    for name in _MENUS:
        getattr(bpy.types, name).append(_draw_menu)


def unregister():
    for name in _MENUS:
        getattr(bpy.types, name).remove(_draw_menu)
    bpy.utils.unregister_class(UV_OT_planish_unwrap)
