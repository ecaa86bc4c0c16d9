"""The 4DGS deformation network compared with PyTorch: one process, one thread each, equal outputs.

Needs the package and a CPU build of PyTorch in one environment:
    pip install catalyst4d torch && python crates/c4d-py/benches/compare_with_torch.py

Models have random weights in the three published configurations. *Cached*: the features of the
three spatial planes are known from an earlier time, for both. *Uncached*: they are computed, too;
for catalyst4d this is the first time after the scene was opened, which also stores them.
"""

import statistics
import tempfile
import time
from pathlib import Path

import catalyst4d as c4d
import numpy as np
import torch

GAUSSIANS, REPEATS = 100_000, 7
TIMES = [0.11 + 0.1 * k for k in range(REPEATS)]
# Pairs of coordinates of the planes; the last coordinate is time.
PLANES = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]
HEADS = {"pos": 3, "scales": 3, "rotations": 4, "opacity": 1, "shs": 48}
# Name: width, channels, spatial resolutions relative to 64, time resolution, number of heads.
CONFIGS = {
    "dnerf": (64, 32, [1, 2], 50, 3),
    "hypernerf": (128, 16, [1, 2, 4], 150, 3),
    "dynerf": (128, 16, [1, 2], 150, 5),
}


def random_model(width, channels, multires, frames, heads):
    """Tensors of ``deformation.pth``."""
    torch.manual_seed(17)
    uniform = lambda *shape, bound: (torch.rand(*shape) * 2 - 1) * bound  # noqa: E731
    tensors = {"deformation_net.grid.aabb": torch.tensor([[1.6] * 3, [-1.6] * 3])}
    for level, multiplier in enumerate(multires):
        for plane, (first, second) in enumerate(PLANES):
            columns = 64 * multiplier
            rows = frames if second == 3 else columns
            name = f"deformation_net.grid.grids.{level}.{plane}"
            tensors[name] = uniform(1, channels, rows, columns, bound=1.0)

    def linear(name, inputs, outputs):
        tensors[f"deformation_net.{name}.weight"] = uniform(
            outputs, inputs, bound=(6 / (inputs + outputs)) ** 0.5
        )
        tensors[f"deformation_net.{name}.bias"] = uniform(outputs, bound=0.1)

    linear("feature_out.0", channels * len(multires), width)
    for head, outputs in list(HEADS.items())[:heads]:
        linear(f"{head}_deform.1", width, width)
        linear(f"{head}_deform.3", width, outputs)
    return tensors


def write_model(folder, tensors, config):
    """A model folder as 4DGaussians writes it; returns the splats."""
    width, channels, multires, frames, heads = config
    random = np.random.default_rng(29)
    table = np.zeros((GAUSSIANS, 62), "<f4")
    table[:, :3] = random.uniform(-1.7, 1.7, (GAUSSIANS, 3))
    table[:, 55:58] = -4.0
    table[:, 58] = 1.0
    names = ["x", "y", "z", "nx", "ny", "nz", *(f"f_dc_{i}" for i in range(3))]
    names += [f"f_rest_{i}" for i in range(45)]
    names += ["opacity", *(f"scale_{i}" for i in range(3)), *(f"rot_{i}" for i in range(4))]
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {GAUSSIANS}"]
    head += [f"property float {name}" for name in names] + ["end_header", ""]
    saved = folder / "point_cloud" / "iteration_1"
    saved.mkdir(parents=True)
    (saved / "point_cloud.ply").write_bytes("\n".join(head).encode() + table.tobytes())
    torch.save(tensors, saved / "deformation.pth")
    torch.save(torch.ones(GAUSSIANS, dtype=torch.bool), saved / "deformation_table.pth")
    torch.save(torch.zeros(GAUSSIANS, 3), saved / "deformation_accum.pth")
    planes = {
        "grid_dimensions": 2,
        "input_coordinate_dim": 4,
        "output_coordinate_dim": channels,
        "resolution": [64, 64, 64, frames],
    }
    (folder / "cfg_args").write_text(
        f"Namespace(sh_degree=3, white_background=False, net_width={width}, defor_depth=0, "
        f"multires={multires}, kplanes_config={planes}, bounds=1.6, no_dx=False, no_ds=False, "
        f"no_dr=False, no_do={heads < 4}, no_dshs={heads < 5}, static_mlp=False, "
        f"empty_voxel=False, apply_rotation=False, grid_pe=0, no_grid=False)"
    )
    return {
        "means": torch.from_numpy(table[:, :3].copy()),
        "log_scales": torch.from_numpy(table[:, 55:58].copy()),
        "quats": torch.from_numpy(table[:, 58:62].copy()),
        "opacity_logits": torch.from_numpy(table[:, 54].copy()),
        "sh": torch.zeros(GAUSSIANS, 16, 3),
    }


class Field:
    """The network in PyTorch operations."""

    def __init__(self, tensors, levels, heads):
        self.tensors = {k.removeprefix("deformation_net."): v for k, v in tensors.items()}
        self.levels, self.heads = levels, heads

    def sample(self, level, plane, coordinates):
        first, second = PLANES[plane]
        at = torch.stack([coordinates[:, first], coordinates[:, second]], 1)[None, None]
        grid = self.tensors[f"grid.grids.{level}.{plane}"]
        found = torch.nn.functional.grid_sample(
            grid, at, mode="bilinear", padding_mode="border", align_corners=True
        )
        return found[0, :, 0].T

    def spatial(self, means):
        """Normalised coordinates, and the product of the spatial planes for each level."""
        high, low = self.tensors["grid.aabb"]
        coordinates = (means - high) * (2 / (low - high)) - 1
        products = [
            self.sample(level, 0, coordinates)
            * self.sample(level, 1, coordinates)
            * self.sample(level, 3, coordinates)
            for level in range(self.levels)
        ]
        return coordinates, products

    def at(self, splats, t, spatial):
        coordinates, products = spatial
        at = torch.cat([coordinates, torch.full((len(coordinates), 1), t)], 1)
        features = []
        for level, product in enumerate(products):
            for plane in (2, 4, 5):
                product = product * self.sample(level, plane, at)
            features.append(product)
        linear = lambda x, name: torch.nn.functional.linear(  # noqa: E731
            x, self.tensors[f"{name}.weight"], self.tensors[f"{name}.bias"]
        )
        hidden = torch.relu(linear(torch.cat(features, 1), "feature_out.0"))
        out = dict(splats)
        for head, key in list(zip(HEADS, ("means", "log_scales", "quats", "opacity_logits", "sh")))[
            : self.heads
        ]:
            change = linear(torch.relu(linear(hidden, f"{head}_deform.1")), f"{head}_deform.3")
            out[key] = splats[key] + change.reshape(splats[key].shape)
        return out


def seconds(work):
    begun = time.perf_counter()
    result = work()
    return result, time.perf_counter() - begun


def spread(times):
    low, middle, high = min(times), statistics.median(times), max(times)
    return f"{1e3 * middle:.0f} ({1e3 * low:.0f}–{1e3 * high:.0f})", middle


def compare(name, config):
    tensors = random_model(*config)
    field = Field(tensors, len(config[2]), config[4])
    times = {"cached": ([], []), "uncached": ([], [])}
    with tempfile.TemporaryDirectory() as folder, torch.no_grad():
        splats = write_model(Path(folder), tensors, config)
        scene = c4d.Scene.open(folder)
        spatial = field.spatial(splats["means"])
        scene.at(0.5), field.at(splats, 0.5, spatial)
        for t in TIMES:
            fresh = c4d.Scene.open(folder)
            ours, own = seconds(lambda: fresh.at(t))
            theirs, other = seconds(lambda: field.at(splats, t, field.spatial(splats["means"])))
            times["uncached"][0].append(own), times["uncached"][1].append(other)
            _, own = seconds(lambda: scene.at(t))
            _, other = seconds(lambda: field.at(splats, t, spatial))
            times["cached"][0].append(own), times["cached"][1].append(other)
            for key in splats:
                difference = np.abs(np.asarray(ours[key]) - theirs[key].numpy()).max()
                assert difference < 2e-4, f"{name}, {key}: outputs differ by {difference}"
    for kind, (own, other) in times.items():
        (text, middle), (slow, theirs) = spread(own), spread(other)
        print(f"| {name} | {kind} | {text} | {slow} | {theirs / middle:.1f} |")


torch.set_num_threads(1)
c4d.set_num_threads(1)
print(f"PyTorch {torch.__version__}, {torch.backends.cpu.get_cpu_capability()}\n")
print("| configuration | spatial features | catalyst4d, ms | PyTorch, ms | ratio |")
print("|---|---|---|---|---|")
for name, config in CONFIGS.items():
    compare(name, config)
