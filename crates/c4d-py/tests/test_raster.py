"""The rasteriser and its gradients."""

import numpy as np
import pytest

import catalyst4d as c4d
from catalyst4d import raster

CAMERA = c4d.Camera.look_at([0, 0, -4], [0, 0, 0], [0, 1, 0], 0.8, 24, 20)


def some_splats(dtype):
    random = np.random.default_rng(0)
    return {
        "means": random.uniform(-0.8, 0.8, (12, 3)).astype(dtype),
        "quats": random.standard_normal((12, 4)).astype(dtype),
        "log_scales": random.uniform(-2, -1, (12, 3)).astype(dtype),
        "opacity_logits": random.uniform(-1, 1, 12).astype(dtype),
        "sh": random.uniform(-0.5, 0.5, (12, 4, 3)).astype(dtype),
    }


def test_images_equal_those_of_scenes(scene):
    camera, = scene.cameras("front", size=(64, 48))
    image = scene.render(camera, 0.5, ["rgb", "alpha", "depth"], gpu="cpu")
    found = raster.rasterize(scene.at(0.5), camera, background=scene.background)
    for name in ("rgb", "alpha", "depth"):
        assert getattr(found, name).tobytes() == image[name].tobytes()


@pytest.mark.parametrize("name", ["means", "quats", "log_scales", "opacity_logits", "sh"])
def test_gradients_equal_finite_differences(name):
    splats = some_splats(np.float64)
    random = np.random.default_rng(1)
    weights = {
        "v_rgb": random.standard_normal((20, 24, 3)),
        "v_alpha": random.standard_normal((20, 24)),
        "v_depth": random.standard_normal((20, 24)),
    }

    def loss(values):
        images = raster.rasterize({**splats, name: values}, CAMERA, dtype=np.float64)
        planes = (images.rgb, images.alpha, images.depth)
        return sum((plane * weight).sum() for plane, weight in zip(planes, weights.values()))

    images = raster.rasterize(splats, CAMERA, exact_gradients=True, dtype=np.float64)
    gradient = images.backward(**weights)[name]
    assert gradient.shape == splats[name].shape
    direction = random.standard_normal(splats[name].shape)
    step = 1e-6
    ahead, behind = loss(splats[name] + step * direction), loss(splats[name] - step * direction)
    slope, expected = (gradient * direction).sum(), (ahead - behind) / (2 * step)
    assert abs(expected) > 1e-3
    assert abs(slope - expected) < 1e-4 * max(1, abs(expected))
    assert abs(1.01 * slope - expected) > 1e-4 * max(1, abs(expected)), "the comparison can fail"


def test_features_are_composited():
    splats = some_splats(np.float32)
    ones = np.ones((12, 2), np.float32)
    images = raster.rasterize(splats, CAMERA, features=ones)
    np.testing.assert_allclose(images.features[..., 0], images.alpha, atol=1e-6)
    grads = images.backward(v_features=np.ones((20, 24, 2), np.float32))
    assert grads["features"].shape == (12, 2) and grads["features"].max() > 0
    assert grads["sh"].max() == 0


def test_wrong_input_is_an_error():
    splats = some_splats(np.float32)
    with pytest.raises(ValueError, match="float32 or float64"):
        raster.rasterize(splats, CAMERA, dtype=np.int32)
    with pytest.raises(ValueError, match="expected"):
        raster.rasterize({**splats, "sh": splats["sh"][:, :3]}, CAMERA)
    with pytest.raises(ValueError, match="features has"):
        raster.rasterize(splats, CAMERA, features=np.ones(13, np.float32))
    images = raster.rasterize(splats, CAMERA)
    with pytest.raises(ValueError, match="v_rgb"):
        images.backward(v_rgb=np.ones((3, 3, 3), np.float32))
