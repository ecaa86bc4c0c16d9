# Opens ours.4dgs and writes the splats that are visible in each of its FRAMES frames as fourdgs_N.ply.
import math
import struct
import sys

import fourdgs

frames = int(sys.argv[1])
scene = fourdgs.read("ours.4dgs", recover_truncated=False)
duration = scene.header.duration_sec
names = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity"]
names += ["scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]
C0 = 0.28209479177387814
for frame in range(frames):
    # Windows are half-open: the last frame is just before the end.
    time = min(duration * frame / (frames - 1), math.nextafter(duration, 0))
    state = scene.state_at(time)
    rows = state["indices"]
    with open(f"fourdgs_{frame}.ply", "wb") as out:
        header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(rows)}"]
        header += [f"property float {name}" for name in names] + ["end_header", ""]
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
