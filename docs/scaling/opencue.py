"""Twenty parts of a render as frames of an OpenCue layer, then one that joins them."""

from outline import Outline, cuerun
from outline.modules.shell import Shell

PARTS = 20
RENDER = "c4d render RUN --cameras orbit --part #IFRAME#/20 -o PARTS/#IFRAME# -w --no-progress"
GATHER = "c4d gather PARTS/* -o clip.mp4"

job = Outline("c4d", shot="shot", show="show", user="user")
render = Shell("render", command=RENDER.split(), range=f"1-{PARTS}")
gather = Shell("gather", command=["sh", "-c", GATHER], range="1-1")
gather.depend_all(render)
job.add_layer(render)
job.add_layer(gather)
cuerun.launch(job, use_pycuerun=False)
