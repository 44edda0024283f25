"""Renders a scene with Cycles, within Blender: `blender -b --factory-startup --python blender_side.py -- FOLDER`.

FOLDER has scene.json and an .npz file for each body (see renderers.py). Each line of standard input is a render, {"spp", "seed",
"out"}: its linear radiance goes to the EXR file "out", its wall and CPU time, in seconds, to standard output.
"""
import json
import sys
import time
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector


def add_material(albedo, emission):
    material = bpy.data.materials.new("material")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    out, surface = nodes.new("ShaderNodeOutputMaterial"), nodes.new("ShaderNodeBsdfDiffuse")
    surface.inputs["Color"].default_value = (*albedo, 1)
    if any(emission):
        lamp, both = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeAddShader")
        lamp.inputs["Color"].default_value = (*emission, 1)
        links.new(surface.outputs[0], both.inputs[0])
        links.new(lamp.outputs[0], both.inputs[1])
        surface = both
    links.new(surface.outputs[0], out.inputs["Surface"])
    return material


def add_body(name, file, materials):
    data = np.load(file)
    vertices, faces = data["vertices"].astype(np.float32), data["faces"].astype(np.int32)
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(vertices))
    mesh.vertices.foreach_set("co", vertices.ravel())
    mesh.loops.add(faces.size)
    mesh.loops.foreach_set("vertex_index", faces.ravel())
    mesh.polygons.add(len(faces))
    mesh.polygons.foreach_set("loop_start", np.arange(0, faces.size, 3, dtype=np.int32))
    mesh.polygons.foreach_set("loop_total", np.full(len(faces), 3, np.int32))
    for material in materials:
        mesh.materials.append(add_material(*material))
    mesh.polygons.foreach_set("material_index", data["material_of"].astype(np.int32))
    mesh.update(calc_edges=True)
    bpy.context.collection.objects.link(bpy.data.objects.new(name, mesh))


def add_camera(scene, about):
    camera = bpy.data.cameras.new("camera")
    camera.sensor_fit, camera.angle = "HORIZONTAL", np.radians(about["fov_deg"])
    camera.clip_start, camera.clip_end = 1e-3, 1e6
    thing = bpy.data.objects.new("camera", camera)
    right, up, forward = (Vector(a) for a in about["axes"])
    thing.matrix_world = Matrix.Translation(about["position"]) @ Matrix((right, up, -forward)).transposed().to_4x4()
    bpy.context.collection.objects.link(thing)
    scene.camera = thing


def add_sun(about):
    sun = bpy.data.lights.new("sun", "SUN")
    sun.energy, sun.angle = about["irradiance"], np.radians(about["diameter_deg"])
    thing = bpy.data.objects.new("sun", sun)
    thing.rotation_mode = "QUATERNION"
    thing.rotation_quaternion = Vector(about["direction"]).to_track_quat("Z", "Y")
    bpy.context.collection.objects.link(thing)


def set_up(folder):
    about = json.loads((folder / "scene.json").read_text())
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    for name, materials in about["bodies"].items():
        add_body(name, folder / f"{name}.npz", materials)
    add_camera(scene, about)
    if about["sun"]:
        add_sun(about["sun"])
    render, cycles = scene.render, scene.cycles
    render.engine, render.use_persistent_data = "CYCLES", True
    render.resolution_x = render.resolution_y = about["size"]
    render.resolution_percentage = 100
    render.threads_mode, render.threads = "FIXED", about["threads"]
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR", "32"
    cycles.device, cycles.use_adaptive_sampling, cycles.use_denoising = "CPU", False, False
    cycles.pixel_filter_type = "BOX"
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    for bounces in ("max_bounces", "diffuse_bounces"):
        setattr(cycles, bounces, about["depth"] - 1)
    return scene


def render(scene, spp, seed, out):
    scene.cycles.samples, scene.cycles.seed = spp, seed
    scene.update_tag()  # or the renderer keeps the old numbers
    bpy.context.view_layer.update()
    wall, cpu = time.perf_counter(), time.process_time()
    bpy.ops.render.render()
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    bpy.data.images["Render Result"].save_render(out)
    return {"wall_s": wall, "cpu_s": cpu}


def main():
    scene = set_up(Path(sys.argv[sys.argv.index("--") + 1]))
    for line in sys.stdin:
        print("DONE", json.dumps(render(scene, **json.loads(line))), flush=True)


main()
