"""Threads, memory, signals, the interpreter's lock, import time."""

import gc
import hashlib
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from conftest import SYNTH, program

import catalyst4d as c4d

PROPAGATE = """
import hashlib, sys
import catalyst4d as c4d
c4d.set_num_threads(int(sys.argv[1]))
run = c4d.propagate(sys.argv[2], sys.argv[3], sys.argv[4], no_refine=True)
camera, = run.cameras("front", size=(64, 48))
digest = hashlib.sha256(run.render(camera, 0.5, gpu="cpu")["rgb"].tobytes())
x = run.at(0.0)["means"][:300]
digest.update(c4d.uot.solve(points=(x, x + 0.01)).plan.tobytes())
digest.update(c4d.anchors.build(x, num_lines=5000).positions.tobytes())
digest.update(c4d.raster.rasterize(run.at(0.3), camera).rgb.tobytes())
print(digest.hexdigest())
"""


def python(code, *arguments, **options):
    words = [sys.executable, "-c", code, *map(str, arguments)]
    return subprocess.run(words, capture_output=True, text=True, check=True, **options).stdout


def test_any_number_of_threads_gives_the_same_bytes(tmp_path):
    found = set()
    for threads in (1, 2, 7):
        output = tmp_path / str(threads)
        digest = python(PROPAGATE, threads, SYNTH / "source", SYNTH / "edited.ply", output)
        found.add((digest, hashlib.sha256((output / "scene.c4d").read_bytes()).hexdigest()))
    assert len(found) == 1


def test_threads_are_set_once(scene):
    scene.at(0.0)
    with pytest.raises(c4d.UsageError, match="already runs with"):
        c4d.set_num_threads(1000)
    with pytest.raises(c4d.UsageError, match="expected 1 to 1024"):
        c4d.propagate(scene, SYNTH / "edited.ply", threads=0)


def test_import_is_fast():
    code = """
import time
wall, own = time.perf_counter(), time.process_time()
import catalyst4d
print(time.perf_counter() - wall, time.process_time() - own)
"""
    python(code)
    wall, own = zip(*(map(float, python(code).split()) for _ in range(3)))
    print(f"\nimport: {min(wall):.3f} s, {min(own):.3f} s of processor time")
    # processor time, which other programs on the machine do not affect
    assert min(own) < 0.3


def test_the_lock_is_released(scene, tmp_path):
    count, ended = 0, threading.Event()

    def work():
        nonlocal count
        while not ended.is_set():
            count += 1
            time.sleep(0.001)

    thread = threading.Thread(target=work)
    thread.start()
    begun = time.perf_counter()
    c4d.propagate(scene, SYNTH / "edited.ply", tmp_path / "run", no_refine=True)
    elapsed = time.perf_counter() - begun
    ended.set()
    thread.join()
    assert count > 50 * elapsed, f"{count} rounds of 1 ms in {elapsed:.1f} s"


def test_exceptions_of_callbacks_end_the_work(scene, tmp_path):
    class Enough(Exception):
        pass

    def progress(stage, done, total):
        raise Enough

    with pytest.raises(Enough):
        scene.render_to(tmp_path / "clip", frames=50, gpu="cpu", progress=progress)
    assert list(tmp_path.iterdir()) == [], "no partial output remains"


INTERRUPTED = """
import sys
import catalyst4d as c4d
print("ready", flush=True)
try:
    c4d.Scene.open(sys.argv[1]).render_to(sys.argv[2], frames=90, size=(1600, 1200), gpu="cpu")
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGINT for one process")
def test_control_c_ends_the_work(tmp_path):
    words = [sys.executable, "-c", INTERRUPTED, str(SYNTH / "source"), str(tmp_path / "clip")]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "ready\n"
        time.sleep(1.0)
        process.send_signal(signal.SIGINT)
        begun = time.perf_counter()
        assert process.stdout.readline() == "interrupted\n"
        assert time.perf_counter() - begun < 10
    assert process.returncode == 0
    assert list(tmp_path.iterdir()) == [], "no partial output remains"


def resident():
    """Memory of this process, bytes."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return 1024 * next(int(line.split()[1]) for line in lines if line.startswith("VmRSS"))


def growth(scene, count):
    """Growth of memory per propagation from arrays, bytes."""
    edited = c4d.Scene.open(SYNTH / "edited.ply").at(0.0)

    def once():
        run = c4d.propagate(scene, edited, no_refine=True)
        assert len(run.at(0.5)["means"]) == len(run.binding.kinds)

    for _ in range(max(3, count // 10)):
        once()
    gc.collect()
    before = resident()
    for _ in range(count):
        once()
    gc.collect()
    return (resident() - before) / count


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="Linux only")
def test_memory_does_not_grow(scene):
    frame = sum(array.nbytes for array in scene.at(0.0).values())
    per_run = growth(scene, 20)
    print(f"\n{per_run:.0f} bytes per propagation; a frame has {frame}")
    assert per_run < frame / 2


@pytest.mark.slow
def test_memory_does_not_grow_over_a_thousand_runs(scene):
    frame = sum(array.nbytes for array in scene.at(0.0).values())
    per_run = growth(scene, 1000)
    print(f"\n{per_run:.0f} bytes per propagation; a frame has {frame}")
    assert per_run < frame / 50


def test_versions_agree():
    assert program("--version").stdout.split()[1] == c4d.__version__
