"""Redraws images for a new UV map by the command `planish transfer`. Nothing here uses Blender."""

import json
import os
import signal
import subprocess
import tempfile
import threading
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .engines import Failed, Outcome

#: Values of glTF's samplers.
REPEAT, CLAMP, MIRROR = 10497, 33071, 33648
_NEAREST = 9728
#: The textures of a glTF material that filter as each role wants it.
_SLOTS = {
    "BLENDED": ("/pbrMetallicRoughness/baseColorTexture",),
    "COLOR": ("/pbrMetallicRoughness/baseColorTexture", "/emissiveTexture"),
    "DATA": ("/pbrMetallicRoughness/metallicRoughnessTexture", "/occlusionTexture"),
    "NORMAL": ("/normalTexture",),
}


@dataclass(frozen=True)
class Reading:
    """A way in which materials read an image."""

    path: str  # of its file, in the folder of the transfer
    role: str  # BLENDED: colours weighted with their alpha; COLOR; DATA; NORMAL: directions in tangent space
    wrap: int = REPEAT
    is_nearest: bool = False
    transform: tuple = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)  # u' = t[0] u + t[1] v + t[2], and v' likewise


@dataclass
class Geometry:
    """The corners of a sheet's triangles, in the space in which tangents are made."""

    positions: Any  # (F, 3, 3) float32
    normals: Any  # (F, 3, 3) float32
    uv: Any  # (F, 3, 2) float32: the old map


@dataclass
class Progress:
    number: int = 0
    count: int = 0
    name: str = ""

    def __str__(self):
        return f"image {self.number} of {self.count}: {self.name}" if self.count else "images"

    @property
    def fraction(self):
        return max(0, self.number - 1) / max(1, self.count)


class Transfer:
    """The images of one sheet. Owns a folder with their files."""

    def __init__(self):
        self.command = ""
        self._directory = tempfile.TemporaryDirectory(prefix="planish-blender-")
        self.geometry = None
        self.readings = {}  # Reading: mask of the triangles that read it so

    @property
    def folder(self):
        return self._directory.name

    def close(self):
        self._directory.cleanup()

    def start(self, sheet, outcome):
        """Draws the images, one or more, for the map of `outcome`. Raises Failed."""
        return _Call(self, sheet, outcome)

    def write_models(self, new_uv):
        """Writes from.gltf, with the images, and to.gltf. Returns the material and its slot for each reading."""
        places, parts = {}, []
        for mask, transform, readings in self._by_triangles():
            left = list(readings)
            while left:
                material = {"alphaMode": "BLEND" if left[0].role == "BLENDED" else "OPAQUE", "slots": {}}
                for reading in list(left):
                    if reading.role == "BLENDED" and material["alphaMode"] != "BLEND":
                        continue
                    free = [slot for slot in _SLOTS[reading.role] if slot not in material["slots"]]
                    if not free:
                        continue
                    material["slots"][free[0]] = reading
                    places[reading] = (len(parts), free[0])
                    left.remove(reading)
                parts.append((mask, transform, material))
        self._write("from.gltf", parts, lambda mask, transform: _transformed(self.geometry.uv[mask], transform), with_images=True)
        self._write("to.gltf", parts, lambda mask, _: new_uv[mask], with_images=False)
        return places

    def _by_triangles(self):
        """Readings of the same triangles with the same transform, together."""
        groups = {}
        for reading, mask in self.readings.items():
            if mask.any():
                groups.setdefault((mask.tobytes(), reading.transform), (mask, reading.transform, []))[2].append(reading)
        return groups.values()

    def _write(self, name, parts, uv_of, with_images):
        binary, views, accessors, primitives = [], [], [], []

        def add(values, kind, **bounds):
            data = np.ascontiguousarray(values, "<f4").tobytes()
            views.append({"buffer": 0, "byteOffset": sum(map(len, binary)), "byteLength": len(data)})
            binary.append(data)
            accessors.append({"bufferView": len(views) - 1, "componentType": 5126, "count": len(values), "type": kind, **bounds})
            return len(accessors) - 1

        model = {"asset": {"version": "2.0"}, "materials": [], "images": [], "textures": [], "samplers": []}
        for mask, transform, material in parts:
            positions = self.geometry.positions[mask].reshape(-1, 3)
            bounds = {"min": positions.min(axis=0).tolist(), "max": positions.max(axis=0).tolist()}
            attributes = {"POSITION": add(positions, "VEC3", **bounds)}
            uv = uv_of(mask, transform).astype(np.float64).reshape(-1, 2)
            attributes["TEXCOORD_0"] = add(np.stack([uv[:, 0], 1 - uv[:, 1]], axis=1), "VEC2")
            primitive = {"attributes": attributes}
            if with_images:
                if any(reading.role == "NORMAL" for reading in material["slots"].values()):
                    attributes["NORMAL"] = add(self.geometry.normals[mask].reshape(-1, 3), "VEC3")
                primitive["material"] = len(model["materials"])
                model["materials"].append(_material(material, model))
            primitives.append(primitive)
        model.update(
            accessors=accessors,
            bufferViews=views,
            buffers=[{"uri": name + ".bin", "byteLength": sum(map(len, binary))}],
            meshes=[{"primitives": primitives}],
            nodes=[{"mesh": 0}],
            scenes=[{"nodes": [0]}],
        )
        with open(os.path.join(self.folder, name + ".bin"), "wb") as file:
            file.writelines(binary)
        with open(os.path.join(self.folder, name), "w", encoding="ascii") as file:
            json.dump({key: value for key, value in model.items() if value != []}, file)


def _transformed(uv, transform):
    a, b, c, d, e, f = transform
    u, v = uv[..., 0].astype(np.float64), uv[..., 1].astype(np.float64)
    return np.stack([a * u + b * v + c, d * u + e * v + f], axis=-1)


def _material(material, model):
    """As JSON; its images, textures and samplers are added to the model."""
    result = {"alphaMode": material["alphaMode"]}
    for slot, reading in material["slots"].items():
        model["images"].append({"uri": reading.path})
        sampler = {"wrapS": reading.wrap, "wrapT": reading.wrap}
        if reading.is_nearest:
            sampler["magFilter"] = _NEAREST
        model["samplers"].append(sampler)
        model["textures"].append({"source": len(model["images"]) - 1, "sampler": len(model["samplers"]) - 1})
        *folders, key = slot.strip("/").split("/")
        holder = result
        for folder in folders:
            holder = holder.setdefault(folder, {})
        holder[key] = {"index": len(model["textures"]) - 1}
    return result


def _image_file(model, material, slot):
    info = model["materials"][material]
    for key in slot.strip("/").split("/"):
        info = info[key]
    return model["images"][model["textures"][info["index"]]["source"]]["uri"]


@dataclass
class Images:
    """What a transfer made: the file of each reading, or why there is none."""

    files: dict = field(default_factory=dict)
    warnings: list = field(default_factory=list)
    failure: str = ""


class _Call:
    """The command at work, with the interface of the calls of engines.py."""

    def __init__(self, transfer, sheet, outcome):
        self.sheet = sheet
        self.progress = Progress()
        self._outcome = outcome
        self._folder = transfer.folder
        self._last_line = ""
        self._cancelled = False
        self._places = transfer.write_models(outcome.uv)
        arguments = [transfer.command, "transfer", *map(self._path, ("from.gltf", "to.gltf")), "-o", self._path("out.gltf")]
        try:
            self._process = subprocess.Popen(
                [*arguments, "--json", "--progress=json"],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
            )
        except OSError as error:
            raise Failed(f"{transfer.command} cannot be started: {error.strerror}") from error
        self._answer = ""
        self._threads = [threading.Thread(target=read, daemon=True) for read in (self._read_events, self._read_answer)]
        for thread in self._threads:
            thread.start()

    def _path(self, name):
        return os.path.join(self._folder, name)

    def _read_events(self):
        for line in self._process.stderr:
            if not line.startswith("{"):
                self._last_line = line.strip() or self._last_line
                continue
            try:
                image = json.loads(line).get("image")
            except ValueError:
                continue  # the end of a truncated line
            if image:
                self.progress = Progress(image["number"], image["count"], image["name"])

    def _read_answer(self):
        self._answer = self._process.stdout.read()

    def done(self):
        return self._process.poll() is not None

    def wait(self, seconds):
        try:
            self._process.wait(seconds)
            return True
        except subprocess.TimeoutExpired:
            return False

    def cancel(self):
        self._cancelled = True
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)

    def result(self) -> Outcome:
        """The outcome of the unwrap, with its images: those of a transfer that failed are a failure in it."""
        self._process.wait()
        for thread in self._threads:
            thread.join()
        self._process.stdout.close()
        self._process.stderr.close()
        if self._cancelled and self._process.returncode != 0:
            raise Failed("the job was cancelled", "CANCELLED")
        try:
            report = json.loads(self._answer)
        except ValueError:
            report = {}
        images = self._outcome.images = Images()
        if self._process.returncode != 0:
            error = report.get("error") or {}
            message = error.get("message") or self._last_line or f"planish ended with {self._process.returncode} and said nothing"
            images.failure = message.replace(self._path("from.gltf") + ": ", "")
            return self._outcome
        with open(self._path("out.gltf"), encoding="utf-8") as file:
            model = json.load(file)
        images.files = {reading: self._path(_image_file(model, *place)) for reading, place in self._places.items()}
        images.warnings = [warning["message"].replace(self._path("from.gltf") + ": ", "") for warning in report.get("warnings", ())]
        return self._outcome
