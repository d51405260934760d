"""Settings of the add-on: the server and the credentials."""

import bpy

from .engines import Settings


class PlanishPreferences(bpy.types.AddonPreferences):
    bl_idname = __package__

    where: bpy.props.EnumProperty(
        name="Server",
        items=(
            ("AUTO", "Automatic", "What $PLANISH_SERVER names; where it is not set, a private server"),
            ("PRIVATE", "Private server", "A server on this machine, which ends with Blender"),
            ("SERVER", "Server at an address", "A server that somebody runs"),
        ),
        default="AUTO",
    )
    address: bpy.props.StringProperty(name="Address", description="host:port or unix:/path")
    tls: bpy.props.BoolProperty(name="TLS", description="Encrypt, and ask the server for a certificate")
    tls_ca_file: bpy.props.StringProperty(
        name="Certificates", description="Who must have signed the server's certificate, PEM; empty: who the system trusts", subtype="FILE_PATH"
    )
    token: bpy.props.StringProperty(
        name="Token", description="Says who you are. Blender keeps it as plain text in its preferences", subtype="PASSWORD"
    )
    token_file: bpy.props.StringProperty(
        name="Token file", description="The token in a file, in place of the field above", subtype="FILE_PATH"
    )
    engine: bpy.props.EnumProperty(
        name="Way to the server",
        items=(
            ("AUTO", "Automatic", "The Python package where Blender's Python has grpcio, else the command"),
            ("PACKAGE", "Python package", "Needs grpcio and protobuf in Blender's Python"),
            ("COMMAND", "Command", "Runs the planish command for each unwrap"),
        ),
        default="AUTO",
    )
    planishd: bpy.props.StringProperty(
        name="planishd", description="The program of private servers; empty: $PLANISHD, or planishd in PATH", subtype="FILE_PATH"
    )
    command: bpy.props.StringProperty(
        name="planish", description="The command; empty: planish in PATH", subtype="FILE_PATH"
    )

    def draw(self, _context):
        layout = self.layout
        layout.use_property_split = True
        layout.prop(self, "where")
        if self.where == "SERVER":
            layout.prop(self, "address")
        if self.where != "PRIVATE":
            for name in ("tls", "tls_ca_file", "token", "token_file"):
                layout.prop(self, name)
        layout.separator()
        for name in ("engine", "planishd", "command"):
            layout.prop(self, name)


def settings(context):
    """The user's settings; the defaults if the add-on was registered without being enabled."""
    addon = context.preferences.addons.get(__package__)
    chosen = addon.preferences if addon is not None else None
    if chosen is None:
        return Settings(online=getattr(bpy.app, "online_access", True))

    def path(value):
        return bpy.path.abspath(value) if value else ""

    return Settings(
        where=chosen.where,
        address=chosen.address.strip(),
        tls=chosen.tls,
        tls_ca_file=path(chosen.tls_ca_file),
        token=chosen.token,
        token_file=path(chosen.token_file),
        online=getattr(bpy.app, "online_access", True),  # 4.2 and later
        engine=chosen.engine,
        planishd=path(chosen.planishd),
        command=path(chosen.command),
    )


def register():
    bpy.utils.register_class(PlanishPreferences)


def unregister():
    bpy.utils.unregister_class(PlanishPreferences)
