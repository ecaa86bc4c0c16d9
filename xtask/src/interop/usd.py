# Opens ours.usda and writes the splats of each time sample as usd_N.ply; fails if the layer does not load or validate.
import struct

from pxr import Usd, UsdValidation

stage = Usd.Stage.Open("ours.usda")
validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
errors = UsdValidation.ValidationContext(validators).Validate(stage)
assert not errors, [f"{error.GetName()}: {error.GetMessage()}" for error in errors]
print(f"{len(validators)} validators")
prims = [prim for prim in stage.Traverse() if prim.GetTypeName() == "ParticleField3DGaussianSplat"]
assert len(prims) == 1, [prim.GetTypeName() for prim in stage.Traverse()]
prim = prims[0]


def value(name, time):
    return prim.GetAttribute(name).Get(time)


degree = value("radiance:sphericalHarmonicsDegree", Usd.TimeCode.Default())
coefficients = (degree + 1) ** 2
start, end = int(stage.GetStartTimeCode()), int(stage.GetEndTimeCode())
for time in range(start, end + 1):
    positions = value("positions", time)
    harmonics = value("radiance:sphericalHarmonicsCoefficients", time)
    opacities = value("opacities", time)
    names = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity"]
    names += ["scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]
    with open(f"usd_{time - start}.ply", "wb") as out:
        header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(positions)}"]
        header += [f"property float {name}" for name in names] + ["end_header", ""]
        out.write("\n".join(header).encode())
        for i, position in enumerate(positions):
            logit = 9.0 if opacities[i] > 0.5 else 0.0
            row = [*position, *harmonics[i * coefficients], logit, -3, -3, -3, 1, 0, 0, 0]
            out.write(struct.pack("<14f", *row))
