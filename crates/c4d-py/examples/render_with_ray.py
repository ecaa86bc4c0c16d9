"""Renders a run on all machines of a Ray cluster, and joins the parts into one video.

    python render_with_ray.py RUN CLIP.mp4 --parts 20

The run and the folder of the video must be on a shared file system.
"""

import argparse
import tempfile
from pathlib import Path

import catalyst4d as c4d
import ray


@ray.remote(num_cpus=1)
def render_part(run: Path, part: int, parts: int, folder: Path, options: dict) -> str:
    """Renders one part; returns its folder."""
    c4d.set_num_threads(1)
    scene = c4d.Scene.open(run)
    return scene.render_to(folder / str(part), part=f"{part}/{parts}", overwrite=True, **options)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run", type=Path)
    parser.add_argument("clip", type=Path)
    parser.add_argument("--parts", type=int, default=20)
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--size", default="960x720")
    parser.add_argument("--workers", type=int, help="run only on this machine, with this many workers")
    arguments = parser.parse_args()
    # Without this, Ray connects to the cluster in RAY_ADDRESS at the first task.
    if arguments.workers:
        ray.init(num_cpus=arguments.workers, include_dashboard=False)
    options = {"frames": arguments.frames, "size": arguments.size, "cameras": "orbit", "gpu": "cpu"}
    run, clip = arguments.run.absolute(), arguments.clip.absolute()
    with tempfile.TemporaryDirectory(dir=clip.parent) as folder:
        parts = ray.get(
            [
                render_part.remote(run, part, arguments.parts, Path(folder), options)
                for part in range(1, arguments.parts + 1)
            ]
        )
        c4d.run("gather", *parts, "--output", clip)
    print(clip)


if __name__ == "__main__":
    main()
