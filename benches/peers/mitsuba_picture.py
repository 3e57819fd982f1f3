"""Models in this project's renderer and in Mitsuba 3, by plug-in and by `.bsdf` file, as one picture.

    python benches/peers/mitsuba_picture.py PROGRAM OUT.png MODEL.elm...

PROGRAM is `elm-brdf`. Needs mitsuba 3.9.1, numpy and, for its LLVM variants, LLVM 15 or later
(`DRJIT_LIBLLVM_PATH`). A row for each model: the renderer, the plug-in, the file. Prints how far the pictures are apart.
"""

import importlib
import pathlib
import subprocess
import sys
import tempfile

import mitsuba as mi
import numpy as np

mi.set_variant('llvm_ad_rgb')

SIZE, SAMPLES = 240, 1024
SCENE = f"""
[image]
width = {SIZE}
height = {SIZE}
samples = {SAMPLES}
[camera]
position = [0, 1.2, 6]
target = [0, -0.1, 0]
fov = 25
[environment]
radiance = [0.2, 0.22, 0.26]
[[area]]
corner = [-2.7, 3.5, 0.3]
edge_u = [2.4, 0, 0]
edge_v = [0, 0, 2.4]
radiance = [9, 8.6, 8]
[material.subject]
model = 'NAME.elm'
[material.floor]
analytic = 'lambert'
albedo = 0.3
[[sphere]]
center = [0, 0, 0]
radius = 1
material = 'subject'
[[rectangle]]
corner = [-8, -1, 8]
edge_u = [16, 0, 0]
edge_v = [0, 0, -16]
material = 'floor'
"""


def ours(program, folder, name):
    (folder / f'{name}.toml').write_text(SCENE.replace('NAME', name))
    picture = folder / f'{name}.exr'
    subprocess.run([program, 'render', folder / f'{name}.toml', '-o', picture], check=True, stdout=subprocess.DEVNULL)
    found = mi.Bitmap(str(picture)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32)
    return np.array(found)


def theirs(bsdf):
    transform = mi.ScalarTransform4f
    down = transform().rotate([1, 0, 0], 90)
    up = transform().rotate([1, 0, 0], -90)
    scene = mi.load_dict({
        'type': 'scene',
        'integrator': {'type': 'path', 'max_depth': 2},
        'sensor': {
            'type': 'perspective', 'fov': 25, 'fov_axis': 'y',
            'to_world': transform().look_at([0, 1.2, 6], [0, -0.1, 0], [0, 1, 0]),
            'film': {'type': 'hdrfilm', 'width': SIZE, 'height': SIZE, 'rfilter': {'type': 'box'}},
            'sampler': {'type': 'independent', 'sample_count': SAMPLES},
        },
        'environment': {'type': 'constant', 'radiance': {'type': 'rgb', 'value': [0.2, 0.22, 0.26]}},
        'lamp': {
            'type': 'rectangle',
            'to_world': transform().translate([-1.5, 3.5, 1.5]) @ down @ transform().scale([1.2, 1.2, 1]),
            'emitter': {'type': 'area', 'radiance': {'type': 'rgb', 'value': [9, 8.6, 8]}},
        },
        'sphere': {'type': 'sphere', 'bsdf': bsdf},
        'floor': {
            'type': 'rectangle',
            'to_world': transform().translate([0, -1, 0]) @ up @ transform().scale([8, 8, 1]),
            'bsdf': {'type': 'diffuse', 'reflectance': {'type': 'rgb', 'value': 0.3}},
        },
    })
    return np.array(mi.render(scene, spp=SAMPLES))[..., :3]


def display(linear):
    linear = np.clip(linear, 0, 1)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)


def main(program, out, models):
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        sys.path.insert(0, str(folder))
        for index, model in enumerate(models):
            name = f'subject{index}'
            (folder / f'{name}.elm').write_bytes(pathlib.Path(model).read_bytes())
            for end, more in (('.py', ['--name', name]), ('.bsdf', [])):
                command = [program, 'export', folder / f'{name}.elm', '-o', folder / f'{name}{end}', *more]
                subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
            importlib.import_module(name)
            pictures = [ours(program, folder, name), theirs({'type': name}),
                        theirs({'type': 'measured', 'filename': str(folder / f'{name}.bsdf')})]
            pictures = [display(picture) for picture in pictures]
            apart = [np.abs(picture - pictures[0]).mean() for picture in pictures[1:]]
            print(f'{model}: mean difference of sRGB values {apart[0]:.4f} by plug-in, {apart[1]:.4f} by file')
            rows.append(np.concatenate(pictures, axis=1))
    picture = (255 * np.concatenate(rows) + 0.5).astype(np.uint8)
    mi.Bitmap(picture).write(str(out))


if __name__ == '__main__':
    main(sys.argv[1], sys.argv[2], sys.argv[3:])
