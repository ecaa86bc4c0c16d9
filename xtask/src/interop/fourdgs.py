# Evaluates .4dgs files, or writes some. Times are shares of the clip.
#
# read FILE TIME…   writes the splats of FILE that are visible at each time as fourdgs_N.ply, if any
# lines FILE        writes splats that move along lines, fade in and out and have windows
# convert FRAMES FILE   turns a folder of PLYs into a clip, as `fourdgs convert` does
import math
import struct
import sys

import fourdgs
import numpy as np
from fourdgs.convert import convert_ply_sequence

C0 = 0.28209479177387814
NAMES = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity"]
NAMES += ["scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]


def read(file, times):
    scene = fourdgs.read(file, recover_truncated=False)
    for number, time in enumerate(times):
        # Windows are half-open: the end is the instant before the end.
        state = scene.state_at(float(time) * math.nextafter(scene.header.duration_sec, 0))
        rows = state["indices"]
        if len(rows) == 0:
            continue
        with open(f"fourdgs_{number}.ply", "wb") as out:
            header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(rows)}"]
            header += [f"property float {name}" for name in NAMES] + ["end_header", ""]
            out.write("\n".join(header).encode())
            for i, row in enumerate(rows):
                base = [(float(value) - 0.5) / C0 for value in scene.gaussians.colors[row][:3]]
                opacity = min(max(float(state["opacity"][i]), 1e-6), 1 - 1e-6)
                scale = [math.log(float(value)) for value in scene.gaussians.scales[row]]
                x, y, z, w = state["orientations"][i]
                logit = math.log(opacity / (1 - opacity))
                values = [*state["centers"][i], *base, logit, *scale, w, x, y, z]
                out.write(struct.pack("<14f", *values))
    print(scene.gaussians.count)


def lines(file):
    count, seconds = 5000, 2.0
    random = np.random.default_rng(1)
    turns = random.normal(size=(count, 4))
    starts = random.choice([0.0, 0.5, 1.0], count)
    lasts = random.random(count) < 0.3
    splats = fourdgs.GaussianSet(
        positions=random.normal(size=(count, 3)).astype(np.float32),
        scales=np.exp(random.normal(-4.0, 0.5, (count, 3))).astype(np.float32),
        rotations=(turns / np.linalg.norm(turns, axis=1, keepdims=True)).astype(np.float32),
        colors=random.random((count, 4)).astype(np.float32),
        motions=random.normal(0.0, 0.3, (count, 3)).astype(np.float32),
        mu_t=random.uniform(0.0, seconds, count).astype(np.float32),
        sigma_t=np.where(lasts, np.inf, random.uniform(0.05, 0.6, count)).astype(np.float32),
        win_lo=starts,
        win_hi=starts + 1.0,
        sh=random.integers(0, 256, (count, 45)).astype(np.uint8),
        sh_degree=3,
    )
    fourdgs.write(file, splats, seconds)


def convert(frames, file):
    splats, seconds = convert_ply_sequence(frames)
    fourdgs.write(file, splats, seconds)


command, *arguments = sys.argv[1:]
if command == "read":
    read(arguments[0], arguments[1:])
elif command == "lines":
    lines(*arguments)
else:
    convert(*arguments)
