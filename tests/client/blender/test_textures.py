"""Textures that move with the map. Runs in Blender: run.sh."""

import contextlib
import ctypes
import os
import sys
import tempfile

import bpy
import numpy as np

# Blender does not look at PYTHONPATH.
sys.path.insert(0, os.path.join(os.environ["PLANISH_SOURCE_TREE"], "tests/client/blender"))
import addon  # noqa: E402
from addon import PREFERENCES, get, uv_of, loop_triangles, islands, unwrap  # noqa: E402


@contextlib.contextmanager
def printed():
    """Collects what Blender prints meanwhile: an operator's reports, among others."""
    lines, kept = [], os.dup(1)
    flush = ctypes.CDLL(None).fflush
    with tempfile.TemporaryFile("w+") as file:
        flush(None)
        os.dup2(file.fileno(), 1)
        try:
            yield lines
        finally:
            flush(None)
            os.dup2(kept, 1)
            os.close(kept)
            file.seek(0)
            lines += file.read().splitlines()


def waves(n, channels=3):
    """Smooth texels, (n, n, 4) float32 from the lower left, that tile."""
    x = np.arange(n) * 2 * np.pi / n
    bands = [np.sin((k + 1) * x[None, :] + k) * np.cos((k + 2) * x[:, None]) for k in range(3)]
    texels = np.ones((n, n, 4), np.float32)
    texels[..., :channels] = np.stack(bands, axis=-1)[..., :channels] * 0.4 + 0.5
    return np.rint(texels * 255) / np.float32(255)


def image(name, texels, space="sRGB"):
    """Packed, as PNG."""
    made = bpy.data.images.new(name, texels.shape[1], texels.shape[0], alpha=False)
    made.colorspace_settings.name = space
    made.pixels.foreach_set(texels.astype(np.float32).reshape(-1))
    made.pack()
    return made


def bumps(n):
    """A normal map of shallow bumps."""
    height = waves(n)[..., :2] - 0.5
    normal = np.concatenate([height * 0.8, np.ones((n, n, 1), np.float32)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    return np.concatenate([normal * 0.5 + 0.5, np.ones((n, n, 1), np.float32)], axis=-1)


def sampled(image, uv):
    """Texels, (N, 4), at UV, (N, 2): linear, repeated."""
    width, height = image.size
    texels = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(texels)
    texels = texels.reshape(height, width, 4)
    place = uv.astype(np.float64) * (width, height) - 0.5
    low = np.floor(place).astype(int)
    fx, fy = (place - low).T[..., None]
    at = lambda dx, dy: texels[(low[:, 1] + dy) % height, (low[:, 0] + dx) % width]
    return (at(0, 0) * (1 - fx) + at(1, 0) * fx) * (1 - fy) + (at(0, 1) * (1 - fx) + at(1, 1) * fx) * fy


def map_of(mesh, node):
    """The UV map that an image node reads."""
    links = node.inputs["Vector"].links
    named = links[0].from_node.uv_map if links else ""
    return mesh.uv_layers[named] if named else next(layer for layer in mesh.uv_layers if layer.active_render)


class Textures(addon.Case):
    def setUp(self):
        super().setUp()
        for each in (*bpy.data.meshes, *bpy.data.materials, *bpy.data.images, *bpy.data.node_groups):
            bpy.data.batch_remove([each])

    def ball(self, **arguments):
        bpy.ops.mesh.primitive_uv_sphere_add(segments=24, ring_count=12, **arguments)
        bpy.ops.object.shade_smooth()
        return bpy.context.object

    def material(self, *objects, name="paint"):
        material = bpy.data.materials.new(name)
        material.use_nodes = True
        for each in objects:
            each.data.materials.append(material)
        return material

    def node(self, tree, image, to=None, **settings):
        node = tree.nodes.new("ShaderNodeTexImage")
        node.image = image
        for key, value in settings.items():
            setattr(node, key, value)
        if to is not None:
            tree.links.new(node.outputs["Color"], to)
        return node

    def shader(self, material):
        return next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")

    def normal_map(self, material, image):
        """The image node, and the node that reads it."""
        tree = material.node_tree
        node = tree.nodes.new("ShaderNodeNormalMap")
        tree.links.new(node.outputs["Normal"], self.shader(material).inputs["Normal"])
        return self.node(tree, image, node.inputs["Color"]), node

    def points(self, mesh, node, count=20000):
        """What an image node shows at random points of the surface, the same ones each time."""
        random = np.random.default_rng(7)
        corners = get(mesh.vertices, "co", 3)[get(mesh.loops, "vertex_index", 1, np.int32)[loop_triangles(mesh)]]
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        face = random.choice(len(area), count, p=area / area.sum())
        weight = random.dirichlet((1, 1, 1), count)
        uv = uv_of(mesh, map_of(mesh, node))[loop_triangles(mesh)][face]
        return sampled(node.image, (uv * weight[..., None]).sum(axis=1))

    def assert_close(self, before, after, channels=3):
        difference = 255 * np.abs(before - after)[:, :channels]
        self.assertLess(difference.mean(), 2)
        self.assertLess(np.percentile(difference, 99), 12)

    def assert_same_picture(self, before, after):
        difference = np.abs(before - after)
        self.assertLess(difference.mean(), 0.25)
        self.assertLess(np.percentile(difference, 99), 5)
        self.assertGreater(before.std(), 20, "it shows something")

    def rendered(self, *objects):
        """By Cycles, with light from one side."""
        scene = bpy.context.scene
        scene.render.engine, scene.cycles.samples, scene.cycles.device = "CYCLES", 16, "CPU"
        scene.cycles.use_denoising, scene.cycles.max_bounces, scene.cycles.seed = False, 1, 3
        scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 96 * len(objects), 96, 100
        scene.view_settings.view_transform, scene.render.image_settings.color_mode = "Standard", "RGB"
        made = []
        for name, data in (("camera", bpy.data.cameras.new("camera")), ("sun", bpy.data.lights.new("sun", "SUN"))):
            made.append(bpy.data.objects.new(name, data))
            bpy.context.collection.objects.link(made[-1])
        camera, sun = made
        middle = np.mean([each.location for each in objects], axis=0)
        camera.data.type, camera.data.ortho_scale = "ORTHO", 2.4 * len(objects)
        camera.location, camera.rotation_euler = middle + (0, -9, 0), (np.pi / 2, 0, 0)
        sun.rotation_euler, sun.data.energy, sun.data.angle = (0.9, 0, 0.6), 3, 0
        scene.camera = camera
        with tempfile.TemporaryDirectory() as directory:
            scene.render.filepath = os.path.join(directory, "image.png")
            with printed():
                bpy.ops.render.render(write_still=True)
            picture = bpy.data.images.load(scene.render.filepath)
            texels = np.empty(len(picture.pixels), np.float32)
            picture.pixels.foreach_get(texels)
            bpy.data.images.remove(picture)
        for each in made:
            bpy.data.objects.remove(each)
        return 255 * texels.reshape(96, 96 * len(objects), 4)[..., :3]

    def test_images_are_drawn_for_the_new_map(self):
        ball = self.ball()
        mesh, material = ball.data, self.material(ball)
        tree, shader = material.node_tree, self.shader(material)
        color = self.node(tree, image("wood.png", waves(256)), shader.inputs["Base Color"])
        rough = self.node(tree, image("rough", waves(128, 1), "Non-Color"), shader.inputs["Roughness"])
        directions, normal_map = self.normal_map(material, image("bumps", bumps(256), "Non-Color"))
        nodes = (color, rough, directions)
        old_map, old_uv, old_images = mesh.uv_layers.active.name, uv_of(mesh), [node.image for node in nodes]
        before, look = [self.points(mesh, node) for node in nodes], self.rendered(ball)
        self.assertEqual(unwrap(), {"FINISHED"})
        new_map = mesh.uv_layers.active.name
        self.assertEqual(new_map, old_map + ".planish")
        self.assertTrue(mesh.uv_layers.active.active_render)
        np.testing.assert_array_equal(uv_of(mesh, mesh.uv_layers[old_map]), old_uv)
        self.assertLess(islands(mesh), 12)
        self.assertEqual([node.image.name for node in nodes], ["wood.planish", "rough.planish", "bumps.planish"])
        for node, old in zip(nodes, old_images):
            self.assertEqual(map_of(mesh, node).name, new_map)
            self.assertEqual(node.image.colorspace_settings.name, old.colorspace_settings.name)
            self.assertEqual(node.image.alpha_mode, old.alpha_mode)
            self.assertIsNotNone(node.image.packed_file)
            self.assertTrue(old.use_fake_user)
            np.testing.assert_array_equal(sampled(old, np.zeros((1, 2))), sampled(bpy.data.images[old.name], np.zeros((1, 2))))
        self.assert_close(before[0], self.points(mesh, color))
        self.assert_close(before[1], self.points(mesh, rough))
        self.assertEqual(normal_map.uv_map, new_map)
        self.assertGreater(255 * np.abs(before[2] - self.points(mesh, directions))[:, :2].mean(), 5, "in another frame")
        self.assert_same_picture(self.rendered(ball), look)
        self.assertEqual([each.name for each in bpy.data.materials if each.name.startswith(material.name)], [material.name])

    def test_what_cannot_be_moved_reads_the_old_map(self):
        ball = self.ball()
        mesh, material = ball.data, self.material(ball)
        tree, shader = material.node_tree, self.shader(material)
        links = tree.links

        def new(kind, where=tree, **settings):
            node = where.nodes.new(kind)
            for key, value in settings.items():
                setattr(node, key, value)
            return node

        def mixed(a, b):
            node = new("ShaderNodeMixRGB")
            node.inputs["Fac"].default_value = 0.5
            links.new(a, node.inputs["Color1"])
            links.new(b, node.inputs["Color2"])
            return node.outputs["Color"]

        coordinates = new("ShaderNodeTexCoord")
        # Moved: one that a mapping node repeats, and one in a group.
        mapping = new("ShaderNodeMapping")
        mapping.inputs["Scale"].default_value, mapping.inputs["Location"].default_value = (3, 2, 1), (0.3, 0.1, 0)
        mapping.inputs["Rotation"].default_value = (0, 0, 0.5)
        links.new(coordinates.outputs["UV"], mapping.inputs["Vector"])
        repeated = self.node(tree, image("repeated", waves(64)))
        links.new(mapping.outputs["Vector"], repeated.inputs["Vector"])
        group = bpy.data.node_groups.new("group", "ShaderNodeTree")
        group.outputs.new("NodeSocketColor", "Color")
        inner = self.node(group, image("inner", waves(128)))
        group.links.new(inner.outputs["Color"], group.nodes.new("NodeGroupOutput").inputs["Color"])
        grouped = new("ShaderNodeGroup", node_tree=group)
        # Kept: one that Blender generates, one at computed places, a pattern, and a normal map with something between.
        grid = bpy.data.images.new("grid", 64, 64)
        grid.generated_type = "COLOR_GRID"
        generated = self.node(tree, grid)
        bent = self.node(tree, image("bent", waves(64)))
        add = new("ShaderNodeVectorMath", operation="SINE")
        links.new(coordinates.outputs["UV"], add.inputs[0])
        links.new(add.outputs[0], bent.inputs["Vector"])
        checker = new("ShaderNodeTexChecker")
        links.new(coordinates.outputs["UV"], checker.inputs["Vector"])
        directions, normal_map = self.normal_map(material, image("bumps", bumps(128), "Non-Color"))
        gamma = new("ShaderNodeGamma")
        gamma.inputs["Gamma"].default_value = 1.3
        links.new(directions.outputs["Color"], gamma.inputs["Color"])
        links.new(gamma.outputs["Color"], normal_map.inputs["Color"])
        tiles = bpy.data.images.new("tiles", 64, 64, tiled=True)
        tiled = self.node(tree, tiles, shader.inputs["Roughness"])
        color = mixed(repeated.outputs["Color"], grouped.outputs["Color"])
        for node in (generated, bent, checker):
            color = mixed(color, node.outputs["Color"])
        links.new(color, shader.inputs["Base Color"])

        look = self.rendered(ball)
        with printed() as lines:
            unwrap()
        said = "\n".join(lines)
        self.assert_same_picture(look, self.rendered(ball))
        self.assertTrue(mesh.uv_layers.active.active_render)
        old, new_map = (layer.name for layer in mesh.uv_layers)
        self.assertRegex(said, "Info: Sphere: 3 images drawn for UV map UVMap.planish: .*repeated.planish")
        for name, why in (("grid", "is generated"), ("bent", "is read at places that other nodes compute"), ("tiles", "has tiles")):
            self.assertRegex(said, f"Warning: Sphere: paint: image {name} {why}; it reads UV map {old} as before")
        for node in (repeated, directions):
            self.assertEqual(map_of(mesh, node).name, new_map)
        for node in (generated, tiled):
            self.assertEqual(map_of(mesh, node).name, old)
        self.assertEqual(normal_map.uv_map, old)
        self.assertEqual(map_of(mesh, inner).name, new_map)

    def test_others_that_use_a_material_keep_it(self):
        ball, other = self.ball(), self.ball(location=(3, 0, 0))
        material = self.material(ball, other)
        color = self.node(material.node_tree, image("wood", waves(128)), self.shader(material).inputs["Base Color"])
        old = color.image
        own = self.material(ball, name="own")  # on every other polygon
        ball.data.polygons.foreach_set("material_index", np.arange(len(ball.data.polygons)) % 2)
        self.node(own.node_tree, image("metal", waves(64)), self.shader(own).inputs["Base Color"])
        look, other_uv = self.rendered(ball, other), uv_of(other.data)
        self.select(ball)
        with printed() as lines:
            unwrap()
        self.assertIn("Info: Sphere: material paint was copied as paint.001, since others use it too", "\n".join(lines))
        self.assertEqual([each.name for each in ball.data.materials], ["paint.001", "own"])
        self.assertEqual([each.name for each in other.data.materials], ["paint"])
        self.assertEqual((color.image, old.use_fake_user, len(other.data.uv_layers)), (old, False, 1))
        np.testing.assert_array_equal(uv_of(other.data), other_uv)
        self.assert_same_picture(look, self.rendered(ball, other))
        # Both in one atlas: one image for what they share.
        images = len(bpy.data.images)
        self.select(ball, other)
        ball.data.materials[0] = material
        ball.data.uv_layers.remove(ball.data.uv_layers[1])
        ball.data.materials[1] = material
        unwrap()
        self.assertEqual(len(bpy.data.images), images + 1)
        self.assertEqual([each.data.materials[0].name for each in (ball, other)], ["paint", "paint"])
        self.assert_same_picture(look[:, 96:], self.rendered(ball, other)[:, 96:])

    def test_undo_takes_textures_back(self):
        for mode in ("OBJECT", "EDIT"):
            ball = self.ball()
            material = self.material(ball)
            color = self.node(material.node_tree, image("wood", waves(64)), self.shader(material).inputs["Base Color"])
            name, old, node, look = ball.name, color.image.name, color.name, self.rendered(ball)
            bpy.ops.object.mode_set(mode=mode)
            bpy.ops.ed.undo_push(message="before")
            unwrap()
            bpy.ops.ed.undo_push(message="Unwrap with planish")  # calls of scripts push none
            self.assertEqual(bpy.context.mode, "OBJECT")
            self.assert_same_picture(look, self.rendered(bpy.data.objects[name]))
            bpy.ops.ed.undo()
            ball = bpy.data.objects[name]
            self.assertEqual(ball.mode, mode)
            bpy.ops.object.mode_set(mode="OBJECT")
            self.assertEqual(len(ball.data.uv_layers), 1)
            self.assertEqual(ball.data.materials[0].node_tree.nodes[node].image.name, old)
            self.assert_same_picture(look, self.rendered(ball))

    def test_textures_that_stay(self):
        ball = self.ball()
        mesh, material = ball.data, self.material(ball)
        color = self.node(material.node_tree, image("wood", waves(64)), self.shader(material).inputs["Base Color"])
        before, old = self.points(mesh, color), color.image
        unwrap(transfer_textures=False)
        self.assertEqual((len(mesh.uv_layers), color.image), (1, old))
        self.assertGreater(255 * np.abs(before - self.points(mesh, color)).mean(), 20)
        # An image that nobody can read: the look stays, and a map is added.
        with tempfile.TemporaryDirectory() as directory:
            path = os.path.join(directory, "cut.png")
            old.filepath_raw, old.file_format = path, "PNG"
            old.save()
            with open(path, "r+b") as file:
                file.truncate(200)
            color.image = bpy.data.images.load(path)
            with printed() as lines:
                unwrap()
        self.assertRegex("\n".join(lines), "Warning: Sphere: no texture was moved, and materials read the old UV map: .*0.png")
        self.assertEqual(map_of(mesh, color), mesh.uv_layers[0])
        self.assertEqual(len(mesh.uv_layers), 2)
        # No command, and no room.
        color.image = old
        mesh.uv_layers.active_index = 0
        PREFERENCES.engine, PREFERENCES.command = "PACKAGE", "/nowhere/planish"
        with self.assertRaisesRegex(RuntimeError, "moved by the command planish, and /nowhere/planish is not a program"):
            unwrap()
        while len(mesh.uv_layers) < 8:
            mesh.uv_layers.new(do_init=False)
        mesh.uv_layers.active_index = 0
        with self.assertRaisesRegex(RuntimeError, "Sphere has 8 UV maps"):
            unwrap()
        self.assertEqual([name for name in os.listdir(os.environ["TMPDIR"]) if name.startswith("planish-blender-")], [])


if __name__ == "__main__":
    addon.main()
