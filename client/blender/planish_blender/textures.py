"""The image textures of materials that read the UV map which an unwrap replaces.

The old UV map stays, and the new one is added beside it. Nodes whose image was drawn for the new map read that one. All others
read the old one, by name, so that no material looks different. Nodes are described by names before the unwrap and changed after
it, since materials are copied where other objects use them.
"""

import os
import struct
import zlib
from dataclasses import dataclass, field
from typing import Any

import bpy
import numpy as np

from . import engines, transfer
from .meshes import Unusable

_MOST_UV_MAPS = 8
_DATA_SPACES = ("Non-Color", "Raw", "Generic Data")
_IDENTITY = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)


@dataclass
class _Node:
    """A node that reads the old map, and what becomes of it."""

    path: tuple  # names of group nodes, and its own
    reading: Any = None  # transfer.Reading: its image can be redrawn
    normal_maps: tuple = ()  # names of nodes beside it that read the image as directions
    by_default: bool = False  # it reads the map only as long as that is the one for rendering


@dataclass
class _Use:
    """A material on meshes that have the same UV maps."""

    material: Any
    old: str  # the UV map that is replaced
    by_default: bool  # whether nodes that name no map read it
    holders: list = field(default_factory=list)  # (mesh or object, slot)
    parts: list = field(default_factory=list)
    mask: Any = None  # the triangles of the sheet
    nodes: list = field(default_factory=list)
    kept: list = field(default_factory=list)  # why images are not redrawn
    keeps_default: bool = False  # a node reads the map for rendering, and cannot name another


class Textures:
    """The textures of a sheet. Raises Unusable."""

    def __init__(self, sheet):
        self.sheet = sheet
        self.transfer = transfer.Transfer()
        self._files = {}  # name of a file in the transfer's folder: image
        try:
            self.uses = [use for use in self._find_uses() if self._scan(use)]
            for part in self.parts:
                if len(part.object.data.uv_layers) >= _MOST_UV_MAPS:
                    raise Unusable(
                        f"{part.object.name} has {_MOST_UV_MAPS} UV maps, and its textures need another one: remove one, or switch "
                        "Transfer Textures off"
                    )
        except BaseException:
            self.close()
            raise
        if self.uses:
            self.transfer.geometry = _geometry(sheet)

    def close(self):
        self.transfer.close()

    @property
    def parts(self):
        """The parts whose UV map stays, as materials read it."""
        return [part for part in self.sheet.parts if any(part in use.parts for use in self.uses)]

    # Before the unwrap

    def _find_uses(self):
        uses = {}
        for part, first, end in self.sheet.ranges():
            if part.uv_map is None:
                continue
            mesh = part.object.data
            of_face = part.material[part.polygon]
            objects = [each for each in bpy.data.objects if each.data == mesh]
            for slot in np.unique(of_face).tolist():
                for each in objects:
                    if not each.material_slots:
                        continue
                    place = min(slot, len(each.material_slots) - 1)
                    material = each.material_slots[place].material
                    if material is None or not material.use_nodes:
                        continue
                    key = (material, part.uv_map, part.uv_map == part.render_uv_map)
                    use = uses.setdefault(key, _Use(*key, mask=np.zeros(len(self.sheet.triangles), bool)))
                    holder = (each if each.material_slots[place].link == "OBJECT" else mesh, place)
                    if holder not in use.holders:
                        use.holders.append(holder)
                    if part not in use.parts:
                        use.parts.append(part)
                    use.mask[first:end] |= of_face == slot
        return list(uses.values())

    def _scan(self, use):
        """Finds the nodes that read the map; returns whether there are any."""
        self._scan_tree(use, use.material.node_tree, ())
        for node in use.nodes:
            if node.reading is not None:
                readings = self.transfer.readings
                readings[node.reading] = readings.get(node.reading, False) | use.mask
        return bool(use.nodes) or use.keeps_default

    def _scan_tree(self, use, tree, path):
        for node in tree.nodes:
            if node.type == "GROUP":
                if node.node_tree is not None:
                    self._scan_tree(use, node.node_tree, (*path, node.name))
            elif not any(socket.is_linked for socket in node.outputs):
                continue
            elif node.type == "TEX_IMAGE":
                self._scan_image(use, node, path)
            elif node.type == "VECT_DISPLACEMENT":
                use.keeps_default |= use.by_default and node.space == "TANGENT"
            elif node.type == "ATTRIBUTE":
                if node.attribute_type == "GEOMETRY" and node.attribute_name == use.old:
                    use.nodes.append(_Node((*path, node.name)))
            elif _names_map(node) or node.type == "TEX_COORD":
                if _reads(node, use):
                    use.nodes.append(_Node((*path, node.name), by_default=node.type == "TEX_COORD" or not node.uv_map))

    def _scan_image(self, use, node, path):
        if node.image is None:
            return
        transform = _transform(node, use)
        described = _Node((*path, node.name), by_default=use.by_default and not node.inputs["Vector"].is_linked)
        if transform is not None:
            try:
                described.reading, described.normal_maps = self._reading(use, node, transform)
            except _Kept as why:
                use.kept.append(f"{use.material.name}: image {node.image.name} {why}")
        elif any(_reads(each, use) for each in _upstream(node)):
            use.kept.append(f"{use.material.name}: image {node.image.name} is read at places that other nodes compute")
        if described.reading is not None or described.by_default:
            use.nodes.append(described)

    def _reading(self, use, node, transform):
        """How a node reads its image, and the normal maps that it feeds. Raises _Kept."""
        image = node.image
        if node.projection != "FLAT":
            raise _Kept("is projected on a solid")
        space = image.colorspace_settings.name
        is_data = space in _DATA_SPACES or space.startswith("Linear")
        if not is_data and space != "sRGB":
            raise _Kept(f"has the colour space {space}")
        wrap = {"REPEAT": transfer.REPEAT, "EXTEND": transfer.CLAMP, "CLIP": transfer.CLAMP, "MIRROR": transfer.MIRROR}[node.extension]
        if node.extension == "CLIP" and not self._is_inside(use, transform):
            raise _Kept("is clipped, and the UV map leaves it")
        readers = _readers_of(node.outputs["Color"])
        normal_maps = [each for each in readers if each.type == "NORMAL_MAP" and _reads(each, use)]
        a, b, _, d, e, _ = transform
        keeps_frame = b == d == 0 and a > 0 and e > 0
        if is_data and keeps_frame and readers and len(normal_maps) == len(readers):
            role = "NORMAL"
        else:
            role = "DATA" if is_data else "BLENDED" if image.alpha_mode == "STRAIGHT" else "COLOR"
            normal_maps = ()
        reading = transfer.Reading(self._file_of(image), role, wrap, node.interpolation == "Closest", transform)
        return reading, tuple(each.name for each in normal_maps)

    def _is_inside(self, use, transform):
        uv = [part.uv[part.loops][use.mask[first:end]] for part, first, end in self.sheet.ranges() if part in use.parts]
        a, b, c, d, e, f = transform
        u, v = np.concatenate(uv).reshape(-1, 2).astype(np.float64).T
        both = np.concatenate([a * u + b * v + c, d * u + e * v + f])
        return both.size == 0 or (both.min() >= -1e-5 and both.max() <= 1 + 1e-5)

    def _file_of(self, image):
        """The name of the image's file in the folder of the transfer."""
        for name, known in self._files.items():
            if known == image:
                return name
        data = _image_bytes(image)
        name = f"{len(self._files)}.{_extension(data)}"
        with open(os.path.join(self.transfer.folder, name), "wb") as file:
            file.write(data)
        self._files[name] = image
        return name

    # After it

    def new_map(self):
        """A name for the new UV map that none of the meshes has."""
        taken = {layer.name for part in self.sheet.parts for layer in part.object.data.uv_layers}
        base = self.parts[0].uv_map.partition(".planish")[0][:40] + ".planish"
        return next(name for name in [base, *(f"{base}.{n:03}" for n in range(1, 1000))] if name not in taken)

    def becomes_default(self, part):
        """Whether the new map becomes the one for rendering."""
        uses = [use for use in self.uses if part in use.parts]
        return part.uv_map == part.render_uv_map and not any(use.keeps_default for use in uses)

    def apply(self, images, new_map):
        """Makes the materials read the images that were drawn, with the new map. Returns sentences for INFO, and for WARNING."""
        notes, warnings = [], list(images.warnings)
        if images.failure:
            warnings.append(f"no texture was moved, and materials read the old UV map: {images.failure}")
        made = {reading: self._load(reading, path) for reading, path in images.files.items()}
        for use in self.uses:
            material = self._own(use, notes)
            for node in use.nodes:
                self._change(use, material, node, made.get(node.reading), new_map)
            warnings += [f"{why}; it reads UV map {use.old} as before" for why in dict.fromkeys(use.kept)]
            if use.keeps_default:
                warnings.append(f"{use.material.name}: vector displacement in tangent space needs {use.old} as the UV map for rendering")
        if made:
            count = len(made)
            notes.insert(0, f"{count} image{'s' if count > 1 else ''} drawn for UV map {new_map}: " + ", ".join(each.name for each in made.values()))
        return notes, warnings

    def _load(self, reading, path):
        old = self._files[reading.path]
        new = bpy.data.images.load(path)
        name = os.path.splitext(old.name)[0].partition(".planish")[0]
        new.name = name[:50] + ".planish"
        new.colorspace_settings.name = old.colorspace_settings.name
        new.alpha_mode = old.alpha_mode
        new.pack()
        new.filepath_raw = "//" + new.name + os.path.splitext(path)[1]
        return new

    def _own(self, use, notes):
        """The material, or a copy if others use it too."""
        material = use.material
        others = bpy.data.user_map(subset={material})[material] - {holder for holder, _ in use.holders}
        if not others and material.library is None:
            return material
        copy = material.copy()
        for holder, slot in use.holders:
            if isinstance(holder, bpy.types.Object):
                holder.material_slots[slot].material = copy
            else:
                holder.materials[slot] = copy
        notes.append(f"material {material.name} was copied as {copy.name}, since others use it too")
        return copy

    def _change(self, use, material, described, image, new_map):
        tree = material.node_tree
        for name in described.path[:-1]:
            group = tree.nodes[name]
            if group.node_tree.users > 1 or group.node_tree.library is not None:
                group.node_tree = group.node_tree.copy()
            tree = group.node_tree
        node = tree.nodes[described.path[-1]]
        if image is not None:
            old = node.image
            node.image = image
            _read_map(tree, node, new_map)
            for name in described.normal_maps:
                tree.nodes[name].uv_map = new_map
            if old.users == 0 and (old.packed_file is not None or old.is_dirty):
                old.use_fake_user = True  # Blender would not save it
        elif described.by_default:
            if node.type == "TEX_COORD":
                map_node = _map_node(tree, use.old, node)
                for link in list(node.outputs["UV"].links):
                    tree.links.new(map_node.outputs["UV"], link.to_socket)
            elif node.type == "TEX_IMAGE":
                _read_map(tree, node, use.old)
            elif not node.uv_map:
                node.uv_map = use.old


class _Kept(Exception):
    """Why an image is not redrawn, after its name."""


def find(sheets, settings):
    """Finds the textures of sheets, and gives each sheet that has some its transfer. Returns them by sheet; to be closed. Raises
    Unusable, and engines.Failed if there is no command that draws images."""
    found = {}
    try:
        for sheet in sheets:
            textures = Textures(sheet)
            if not textures.uses:
                textures.close()
                continue
            found[sheet] = textures
            sheet.transfer = textures.transfer
            if textures.transfer.readings:
                textures.transfer.command = _command(settings)
    except BaseException:
        for textures in found.values():
            textures.close()
        raise
    return found


def _command(settings):
    try:
        return engines.find_command(settings)
    except engines.Failed as error:
        raise engines.Failed(
            f"Textures are moved by the command planish, and {error}. The preferences of the add-on name it; without Transfer Textures "
            "the unwrap needs none"
        ) from error


# Nodes ------------------------------------------------------------------------------------------------------------------


def _names_map(node):
    """Whether the node has the name of a UV map that it reads, or none for that for rendering."""
    if node.type == "UVMAP":
        return not node.from_instancer
    return (node.type == "NORMAL_MAP" and node.space == "TANGENT") or (node.type == "TANGENT" and node.direction_type == "UV_MAP")


def _reads(node, use):
    if node.type == "TEX_COORD":
        return use.by_default and not node.from_instancer and node.outputs["UV"].is_linked
    return _names_map(node) and (node.uv_map == use.old or (not node.uv_map and use.by_default))


def _source(socket):
    """The node and output that a linked input reads, through reroutes; None if there are none."""
    while socket.is_linked and socket.links:
        output = socket.links[0].from_socket
        if output.node.type != "REROUTE":
            return output
        socket = output.node.inputs[0]
    return None


def _readers_of(output):
    """The nodes that read an output, through reroutes."""
    nodes = []
    for link in output.links:
        node = link.to_node
        nodes += _readers_of(node.outputs[0]) if node.type == "REROUTE" else [node]
    return nodes


def _upstream(node):
    seen, left = set(), [node]
    while left:
        for socket in left.pop().inputs:
            for link in socket.links:
                if link.from_node.name not in seen:
                    seen.add(link.from_node.name)
                    left.append(link.from_node)
                    yield link.from_node


def _transform(node, use):
    """The transform with which an image node reads the UV map; None if it reads others, or computed places."""
    socket = node.inputs["Vector"]
    if not socket.is_linked:
        return _IDENTITY if use.by_default else None
    output = _source(socket)
    transform = _IDENTITY
    if output is not None and output.node.type == "MAPPING":
        transform = _IDENTITY if output.node.mute else _mapping(output.node)
        output = _source(output.node.inputs["Vector"])
    if output is None or transform is None or output.name != "UV":
        return None
    return transform if output.node.type in ("UVMAP", "TEX_COORD") and _reads(output.node, use) else None


def _mapping(node):
    """The transform of a mapping node; None if it is more than one in the plane."""
    place, turn, scale = (node.inputs.get(name) for name in ("Location", "Rotation", "Scale"))
    if any(socket is not None and socket.is_linked for socket in (place, turn, scale)) or node.vector_type not in ("POINT", "TEXTURE", "VECTOR"):
        return None
    x, y, angle = turn.default_value
    if x != 0 or y != 0:
        return None
    c, s = float(np.cos(angle)), float(np.sin(angle))
    matrix = np.array([[c, -s], [s, c]]) @ np.diag(list(scale.default_value)[:2])
    offset = np.array(list(place.default_value)[:2]) if node.vector_type != "VECTOR" else np.zeros(2)
    if node.vector_type == "TEXTURE":
        if np.linalg.det(matrix) == 0:
            return None
        matrix = np.linalg.inv(matrix)
        offset = -matrix @ offset
    rows = np.column_stack([matrix, offset])
    return tuple(float(x) for x in rows.reshape(-1))


def _map_node(tree, name, beside):
    """A node for a UV map: one that is there, or a new one beside a node."""
    for node in tree.nodes:
        if node.type == "UVMAP" and node.uv_map == name and not node.from_instancer:
            return node
    node = tree.nodes.new("ShaderNodeUVMap")
    node.uv_map = name
    node.location = (beside.location.x - 200, beside.location.y - 200)
    node.parent = beside.parent
    return node


def _read_map(tree, image_node, name):
    tree.links.new(_map_node(tree, name, image_node).outputs["UV"], image_node.inputs["Vector"])


# Images -----------------------------------------------------------------------------------------------------------------

_KINDS = {b"\x89PNG": "png", b"\xff\xd8\xff": "jpg", b"RIFF": "webp"}


def _extension(data):
    for begin, extension in _KINDS.items():
        if data.startswith(begin) and (extension != "webp" or data[8:12] == b"WEBP"):
            return extension
    return None


def _image_bytes(image):
    """The bytes of its file if planish reads such files, else those of a PNG. Raises _Kept."""
    if image.source in ("TILED", "SEQUENCE", "MOVIE", "VIEWER"):
        raise _Kept({"TILED": "has tiles", "SEQUENCE": "is a sequence", "MOVIE": "is a movie", "VIEWER": "is a render"}[image.source])
    if image.source == "GENERATED" and not image.is_dirty and image.packed_file is None:
        raise _Kept("is generated")
    if not image.is_dirty:
        data = b""
        if image.packed_file is not None:
            data = bytes(image.packed_file.data)
        else:
            try:
                with open(bpy.path.abspath(image.filepath, library=image.library), "rb") as file:
                    data = file.read()
            except OSError:
                raise _Kept("cannot be read") from None
        if _extension(data) is not None:
            return data
    width, height = image.size
    if not image.has_data and len(image.pixels) == 0 or width * height == 0:
        raise _Kept("cannot be read")
    if image.is_float:
        raise _Kept("has floating-point texels")
    texels = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(texels)
    texels = np.clip(np.rint(texels * 255), 0, 255).astype(np.uint8).reshape(height, width, image.channels)[::-1]
    if image.channels == 4 and image.depth == 24:
        texels = texels[..., :3]
    return _png(texels)


def _png(texels):
    """8 bits a channel, from the top."""
    height, width, channels = texels.shape

    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    rows = np.concatenate([np.zeros((height, 1), np.uint8), np.ascontiguousarray(texels).reshape(height, -1)], axis=1)
    header = struct.pack(">IIBBBBB", width, height, 8, {1: 0, 2: 4, 3: 2, 4: 6}[channels], 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows.tobytes(), 4)) + chunk(b"IEND", b"")


# Geometry ---------------------------------------------------------------------------------------------------------------


def _geometry(sheet):
    """The corners in the space of each object, where tangents are made, but in the object's size."""
    positions, normals, uv = [], [], []
    for part in sheet.parts:
        size = abs(np.linalg.det(np.array(part.object.matrix_world.to_3x3(), np.float64))) ** (1 / 3)
        corners = part.own_positions[part.triangles]
        positions.append(corners * np.float32(size if np.isfinite(size) and size > 0 else 1))
        normals.append(part.normals[part.loops])
        uv.append(part.uv[part.loops] if part.uv is not None else np.zeros((*part.loops.shape, 2), np.float32))
    return transfer.Geometry(*(np.concatenate(each) for each in (positions, normals, uv)))
